//! Every number that decides an answer, in one table: name, meaning, default, range, and the command that shows its
//! effect.

use super::select::{MARGIN, MAX_DIFFERENCE_OF_CRITERION, MIN_EXCESS_OF_NULL, MIN_FALL_OF_SQUARES};

/// Ratio of the errors with the other and with the stated sign of a column up to which the sign is wrong.
pub const MAX_RATIO_OF_OTHER_SIGN: f64 = 0.5;
/// Factor between what is measured and what the declared model gives from which on it is no effect: units that are
/// mistaken for one another differ by 57 (degrees), 60, 100 or 1000.
pub const MIN_FACTOR_OF_OTHER_UNIT: f64 = 30.0;
/// Error with that factor, over the spread of the records, up to which the signal is the one of the model.
pub const MAX_ERROR_OF_OTHER_UNIT: f64 = 0.5;
/// Distance from the model at the first sample, over the spread of the output, from which on a record begins elsewhere.
pub const MIN_DISTANCE_OF_OTHER_BEGINNING: f64 = 0.3;

/// Settings of the search where no model reaches the sensor noise; meanings and ranges in [`ForwardSelection::table`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForwardSelection {
    /// Fall of the weighted sum of squares that an effect must bring.
    pub min_gain: f64,
    /// Share of the error on held-out folds that an effect must take away beyond the corrections.
    pub min_held_out_share: f64,
    /// Share of the error that an effect must take away without corrections.
    pub min_share_alone: f64,
    /// Share of the error that an effect must take away alone to count although corrections could do the same.
    pub min_share_of_correction: f64,
    /// Standard deviations of a declared parameter up to which a change of it is a correction.
    pub max_tolerances: f64,
    /// Difference of the weighted sum of squares within which two effects count as equal.
    pub tie: f64,
    /// Difference of the error, as a share, within which two effects count as equal.
    pub tie_share: f64,
    /// Difference of what two models predict, over what they leave, up to which they count as equal.
    pub tie_of_predictions: f64,
    /// Difference of the errors of two sets of effects, over what they leave, within which they count as equal.
    pub tie_share_of_rest: f64,
    /// Share of what an effect of a set takes away that another has to take away to count as its equal.
    pub min_share_of_rival: f64,
    /// Share of what a free form takes away that effects must take away to have the right form.
    pub min_form_share: f64,
    /// Share of what the other effects leave that an effect must take away which is small beside them.
    pub min_share_of_rest: f64,
    /// Share of the error on validation records below which an answer is withdrawn.
    pub min_validated_share: f64,
}

impl Default for ForwardSelection {
    fn default() -> ForwardSelection {
        ForwardSelection {
            min_gain: 20.0,
            min_held_out_share: 0.25,
            min_share_alone: 0.2,
            min_share_of_correction: 0.5,
            max_tolerances: 3.0,
            tie: 12.0,
            tie_share: 0.03,
            tie_of_predictions: 0.2,
            tie_share_of_rest: 0.2,
            min_share_of_rival: 0.5,
            min_form_share: 0.9,
            min_share_of_rest: 0.75,
            min_validated_share: 0.05,
        }
    }
}

/// A row of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Name, as in `--set NAME=VALUE`.
    pub name: &'static str,
    /// Value used.
    pub value: f64,
    /// Value without `--set`.
    pub default: f64,
    /// Allowed values; equal where the value is fixed.
    pub range: (f64, f64),
    /// Meaning, with unit.
    pub meaning: &'static str,
}

/// Command that shows what moving a setting does: false findings against missed ones on cases of one's own.
pub const STUDY: &str = "make study-refine-messy SET='--set NAME=VALUE'";

impl ForwardSelection {
    /// Every setting with its value here.
    pub fn table(&self) -> Vec<Row> {
        let usual = ForwardSelection::default();
        let row = |name, of: fn(&ForwardSelection) -> f64, range, meaning| {
            let (value, default) = (of(self), of(&usual));
            Row { name, value, default, range, meaning }
        };
        let fixed =
            |name, value, meaning| Row { name, value, default: value, range: (value, value), meaning };
        vec![
            row(
                "min_gain",
                |s| s.min_gain,
                (0.0, 1e6),
                "fall of the weighted sum of squares that an effect must bring: the largest that 40 tries with 3 parameters reach by chance with 1 %",
            ),
            row(
                "min_held_out_share",
                |s| s.min_held_out_share,
                (0.0, 1.0),
                "share of the declared model's error on held-out folds, or of the spread of the records where that is less, that an effect must take away beyond the corrections",
            ),
            row(
                "min_share_alone",
                |s| s.min_share_alone,
                (0.0, 1.0),
                "share of the error that an effect must take away without any correction, a quarter of it where it takes min_share_of_rest of what they leave: one that needs them imitates",
            ),
            row(
                "min_share_of_correction",
                |s| s.min_share_of_correction,
                (0.0, 1.0),
                "share of the error that an effect must take away alone to count although corrections of declared parameters within their tolerances could do the same",
            ),
            row(
                "max_tolerances",
                |s| s.max_tolerances,
                (1.0, 10.0),
                "standard deviations of a declared parameter up to which a change of it is a correction",
            ),
            row(
                "tie",
                |s| s.tie,
                (0.0, 1e3),
                "difference of the weighted sum of squares within which two effects count as equal",
            ),
            row(
                "tie_share",
                |s| s.tie_share,
                (0.0, 1.0),
                "difference of the error on held-out folds, as a share of the declared model's or of the spread of the records where that is less, within which two effects count as equal",
            ),
            row(
                "tie_of_predictions",
                |s| s.tie_of_predictions,
                (0.0, 1.0),
                "difference of what two models predict, as a share of the residual that they leave, within which the effects that they differ by count as equal whatever their sums of squares",
            ),
            row(
                "tie_share_of_rest",
                |s| s.tie_share_of_rest,
                (0.0, 1.0),
                "difference of the errors of two sets of effects on held-out folds, as a share of what they leave, within which the effects that they differ by count as equal; of effects that only a set brought",
            ),
            row(
                "min_share_of_rival",
                |s| s.min_share_of_rival,
                (0.0, 1.0),
                "share of what such an effect takes away beside the rest of its set that another has to take away to count as its equal",
            ),
            row(
                "min_form_share",
                |s| s.min_form_share,
                (0.0, 1.0),
                "share of what a free form over one variable takes away on held-out folds that effects must take away to have the right form; the same of a law at their port over variables that none of them depends on, on validation records",
            ),
            row(
                "min_share_of_rest",
                |s| s.min_share_of_rest,
                (0.0, 1.0),
                "share of what the other effects, or the corrections alone, leave that effects must take away which are too small beside these to take their share of the whole error, or take little without corrections; each of such a set must take away half of what the rest of it leaves",
            ),
            row(
                "min_validated_share",
                |s| s.min_validated_share,
                (0.0, 1.0),
                "share of the error on validation records below which an answer is withdrawn; so is one of several effects that takes away no more, neither alone nor beside the others, and not min_share_of_rest of what these leave",
            ),
            fixed(
                "noise_margin",
                MARGIN,
                "standard deviations above the largest power of the simulated noise up to which a residual is noise",
            ),
            fixed(
                "suspicious_margin",
                MIN_EXCESS_OF_NULL,
                "the same, from which on an explanation is compared with corrected parameters",
            ),
            fixed(
                "noticeable_gain",
                MIN_FALL_OF_SQUARES,
                "fall of the sum of squares in units of the noise below which an effect is not looked at",
            ),
            fixed(
                "noise_tie",
                MAX_DIFFERENCE_OF_CRITERION,
                "difference of the Bayesian information criterion within which two explanations to the noise count as equal",
            ),
            fixed(
                "other_sign",
                MAX_RATIO_OF_OTHER_SIGN,
                "ratio of the errors of the declared model with the other and with the stated sign of a column up to which it is refused",
            ),
            fixed(
                "other_unit",
                MIN_FACTOR_OF_OTHER_UNIT,
                "factor between a column and the declared model from which on it is refused as one of another unit",
            ),
            fixed(
                "other_unit_error",
                MAX_ERROR_OF_OTHER_UNIT,
                "error with that factor, over the spread of the records, up to which it is",
            ),
            fixed(
                "other_beginning",
                MIN_DISTANCE_OF_OTHER_BEGINNING,
                "distance of records without [states] from the declared model at their first sample, over the spread of the output, from which on they are refused",
            ),
            fixed(
                "window",
                crate::rig::windowed::WINDOW,
                "length of a windowed prediction of the coupled rig [s]",
            ),
        ]
    }

    /// The settings with one changed.
    ///
    /// # Errors
    /// A name that is none of those that can be changed, or a value out of its range: a sentence that says which are.
    pub fn with(mut self, name: &str, value: f64) -> Result<ForwardSelection, String> {
        let place = match name {
            "min_gain" => &mut self.min_gain,
            "min_held_out_share" => &mut self.min_held_out_share,
            "min_share_alone" => &mut self.min_share_alone,
            "min_share_of_correction" => &mut self.min_share_of_correction,
            "max_tolerances" => &mut self.max_tolerances,
            "tie" => &mut self.tie,
            "tie_share" => &mut self.tie_share,
            "tie_of_predictions" => &mut self.tie_of_predictions,
            "tie_share_of_rest" => &mut self.tie_share_of_rest,
            "min_share_of_rival" => &mut self.min_share_of_rival,
            "min_form_share" => &mut self.min_form_share,
            "min_share_of_rest" => &mut self.min_share_of_rest,
            "min_validated_share" => &mut self.min_validated_share,
            _ => {
                let rows = ForwardSelection::default().table();
                let free: Vec<&str> = rows.iter().filter(|r| r.range.0 < r.range.1).map(|r| r.name).collect();
                return Err(format!(
                    "`{name}` is none of the settings that can be changed: {}",
                    free.join(", ")
                ));
            }
        };
        *place = value;
        let row = self.table().into_iter().find(|row| row.name == name);
        match row {
            Some(row) if !(row.range.0..=row.range.1).contains(&value) => {
                Err(format!("`{name}` is {value}; it must be between {} and {}", row.range.0, row.range.1))
            }
            _ => Ok(self),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_that_the_table_gives_a_range_can_be_changed_within_it() {
        for row in ForwardSelection::default().table() {
            assert_eq!(row.value.to_bits(), row.default.to_bits());
            let changed = ForwardSelection::default().with(row.name, row.range.1);
            if row.range.0 < row.range.1 {
                let found = changed.unwrap().table();
                let other: Vec<&Row> = found.iter().filter(|own| own.value != own.default).collect();
                assert!(other.len() == 1 && other[0].name == row.name, "{}", row.name);
                assert!(ForwardSelection::default().with(row.name, row.range.1 + 1.0).is_err());
            } else {
                assert!(changed.is_err());
            }
        }
    }
}
