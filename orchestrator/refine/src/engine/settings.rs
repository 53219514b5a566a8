//! Every number that decides an answer, in one table: name, meaning, default, range, and the command that shows its effect.

/// Settings of the search on machines that no model fits to the sensor noise.
#[derive(Debug, Clone, Copy)]
pub struct Rough {
    /// See `min_gain` of [`TABLE`].
    pub min_gain: f64,
    /// See `min_held_out_share` of [`TABLE`].
    pub min_held_out_share: f64,
    /// See `min_share_alone` of [`TABLE`].
    pub min_share_alone: f64,
    /// See `min_share_of_correction` of [`TABLE`].
    pub min_share_of_correction: f64,
    /// See `max_tolerances` of [`TABLE`].
    pub max_tolerances: f64,
    /// See `tie` of [`TABLE`].
    pub tie: f64,
    /// See `tie_share` of [`TABLE`].
    pub tie_share: f64,
}

impl Default for Rough {
    fn default() -> Rough {
        Rough {
            min_gain: 20.0,
            min_held_out_share: 0.2,
            min_share_alone: 0.2,
            min_share_of_correction: 0.5,
            max_tolerances: 3.0,
            tie: 12.0,
            tie_share: 0.03,
        }
    }
}
