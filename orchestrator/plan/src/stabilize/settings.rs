//! The file of settings of `airloop stabilize` and `airloop trials`: TOML with named variables and units.

use std::path::Path;

use toml::de::DeTable;

use crate::Error;
use crate::file::table::{Table, Value};
use crate::file::{Quantity, Source, Text, parameters};

/// Content of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The file.
    pub source: Source,
    /// Time between samples; default: that of the sampled components.
    pub sample_time: Option<Quantity>,
    /// Measured signals with the standard deviation of their noise, in the order of the controller's inputs.
    pub sensors: Vec<(Text, Quantity)>,
    /// Deviations of states and inputs that cost alike.
    pub deviation: Vec<(Text, Quantity)>,
    /// Standard deviation after one second: of drifts of states that the model does not describe, of disturbances of
    /// inputs.
    pub drift: Vec<(Text, Quantity)>,
    /// Standard deviation of initial states.
    pub initial: Vec<(Text, Quantity)>,
    /// Limits of inputs.
    pub limits: Vec<(Text, [Quantity; 2])>,
    /// Start values of parameters of the closed loop, `component.variable`.
    pub parameters: Vec<(Text, String)>,
    /// Settings for following a plan with several phases.
    pub phases: Option<PhaseSettings>,
    /// Trials.
    pub trials: Option<Trials>,
}

/// `[phases]`
#[derive(Debug, Clone, PartialEq)]
pub struct PhaseSettings {
    /// Outputs that pass through zero at the ends of all phases but the last.
    pub guards: Vec<Text>,
    /// Integer output that tells the phase, with its values; without it phases begin by time.
    pub mode: Option<(Text, Vec<i32>)>,
    /// Time by which the trajectory of a phase continues beyond its ends.
    pub overlap: Option<Quantity>,
    /// Time by which the regulator looks beyond the end of the plan.
    pub horizon: Option<Quantity>,
}

/// `[trials]`
#[derive(Debug, Clone, PartialEq)]
pub struct Trials {
    /// Length of a trial.
    pub duration: Quantity,
    /// Perturbations that differ from trial to trial.
    pub perturb: Vec<Perturb>,
    /// Criteria of a successful trial.
    pub criteria: Vec<Criterion>,
}

/// `[[trials.perturb]]`: one uniform number for all variables named.
#[derive(Debug, Clone, PartialEq)]
pub struct Perturb {
    /// Parameters and start values, `component.variable`.
    pub variables: Vec<Text>,
    /// Size of the perturbation.
    pub spread: Spread,
}

/// Width of a perturbation, to either side.
#[derive(Debug, Clone, PartialEq)]
pub enum Spread {
    /// Part of the value.
    Relative(f64),
    /// In the unit of the variable.
    Absolute(Quantity),
    /// One for each variable, in its unit.
    Each(Vec<Quantity>),
}

/// `[[trials.criterion]]`: a signal within limits in a span of time. Criteria of one name hold together.
#[derive(Debug, Clone, PartialEq)]
pub struct Criterion {
    /// Name.
    pub name: String,
    /// Signal.
    pub signal: Text,
    /// Least value.
    pub min: Option<Quantity>,
    /// Greatest value.
    pub max: Option<Quantity>,
    /// Begin of the span; default: that of the trial.
    pub from: Option<Quantity>,
    /// End of the span; default: that of the trial.
    pub to: Option<Quantity>,
}

/// Reads the file.
///
/// # Errors
/// [`Error::Io`], or [`Error::File`] with line, column, value and remedy.
pub fn read(file: &Path) -> Result<Settings, Error> {
    parse(Source::read(file)?)
}

/// Reads the text of a file.
///
/// # Errors
/// Same as [`read`].
pub fn parse(source: Source) -> Result<Settings, Error> {
    let document = DeTable::parse(&source.text).map_err(|error| {
        let end = source.text.len();
        source.error(&error.span().unwrap_or(end..end), error.message())
    })?;
    let root = Table::root(&source, document.get_ref());
    let quantities = |key: &'static str| -> Result<Vec<(Text, Quantity)>, Error> {
        let Some(value) = root.get(key) else { return Ok(Vec::new()) };
        let entries = value.table(&format!("[{key}]"))?.entries();
        entries.into_iter().map(|(name, value)| Ok((name, value.quantity()?))).collect()
    };
    let sample_time = root.maybe("sample_time", |value| value.quantity())?;
    let sensors = quantities("sensors")?;
    if sensors.is_empty() {
        return Err(root.error(
            "nothing is measured; add a table [sensors] with signals and the standard deviation of their noise, such as theta = \"0.1 deg\"",
        ));
    }
    let (deviation, drift, initial) =
        (quantities("deviation")?, quantities("drift")?, quantities("initial")?);
    let limits = root.maybe("limits", limits)?.unwrap_or_default();
    let phases = root.maybe("phases", phases)?;
    let parameters = root.maybe("parameters", |value| parameters(value, "[parameters]"))?.unwrap_or_default();
    let trials = root.maybe("trials", trials)?;
    root.finish()?;
    let source = source.clone();
    Ok(Settings {
        sample_time,
        sensors,
        deviation,
        drift,
        initial,
        limits,
        parameters,
        phases,
        trials,
        source,
    })
}

fn phases(value: Value) -> Result<PhaseSettings, Error> {
    let table = value.table("[phases]")?;
    let guards = table.need("guards")?.list()?.iter().map(Value::text).collect::<Result<_, _>>()?;
    let mode = table.maybe("mode", |value| value.text())?;
    let whole = |value: &Value| -> Result<i32, Error> {
        let number = value.number()?;
        match number.fract() == 0.0 && number.abs() < 1e9 {
            true => Ok(number as i32),
            false => Err(value.error("a mode is a whole number")),
        }
    };
    let modes =
        table.maybe("modes", |value| value.list()?.iter().map(whole).collect::<Result<Vec<_>, _>>())?;
    let mode = match (mode, modes) {
        (Some(mode), Some(modes)) => Some((mode, modes)),
        (None, None) => None,
        _ => {
            return Err(
                table.error("`mode` and `modes` belong together: an output and its value in every phase")
            );
        }
    };
    let overlap = table.maybe("overlap", |value| value.quantity())?;
    let horizon = table.maybe("horizon", |value| value.quantity())?;
    table.finish()?;
    Ok(PhaseSettings { guards, mode, overlap, horizon })
}

fn limits(value: Value) -> Result<Vec<(Text, [Quantity; 2])>, Error> {
    let of = |(name, value): (Text, Value)| {
        let table = value.table(&format!("the limit of `{}`", name.text))?;
        let pair = [table.need("min")?.quantity()?, table.need("max")?.quantity()?];
        table.finish()?;
        Ok((name, pair))
    };
    value.table("[limits]")?.entries().into_iter().map(of).collect()
}

fn trials(value: Value) -> Result<Trials, Error> {
    let table = value.table("[trials]")?;
    let duration = table.need("duration")?.quantity()?;
    let each = |key: &'static str| -> Result<Vec<Table>, Error> {
        let Some(list) = table.get(key) else { return Ok(Vec::new()) };
        let name = |number: usize| format!("[[trials.{key}]] number {}", number + 1);
        list.list()?.into_iter().enumerate().map(|(number, one)| one.table(&name(number))).collect()
    };
    let perturb = each("perturb")?.iter().map(perturb).collect::<Result<_, _>>()?;
    let criteria = each("criterion")?.iter().map(criterion).collect::<Result<Vec<_>, _>>()?;
    if criteria.is_empty() {
        return Err(table.error("no trial can succeed or fail; add [[trials.criterion]]"));
    }
    table.finish()?;
    Ok(Trials { duration, perturb, criteria })
}

fn perturb(table: &Table) -> Result<Perturb, Error> {
    if let Some(widths) = table.get("widths") {
        let widths = widths.table("`widths`")?.entries();
        let widths = widths.into_iter().map(|(name, value)| Ok((name, value.quantity()?)));
        let (variables, widths) = widths.collect::<Result<Vec<_>, Error>>()?.into_iter().unzip();
        table.finish()?;
        return Ok(Perturb { variables, spread: Spread::Each(widths) });
    }
    let variables = table.need("variables")?.list()?.iter().map(Value::text).collect::<Result<_, _>>()?;
    let relative = table.maybe("relative", |value| value.number())?;
    let absolute = table.maybe("absolute", |value| value.quantity())?;
    table.finish()?;
    let spread = match (relative, absolute) {
        (Some(part), None) => Spread::Relative(part),
        (None, Some(width)) => Spread::Absolute(width),
        _ => {
            return Err(table.error(
                "a perturbation has either `relative` or `absolute`, or `widths` in place of `variables`",
            ));
        }
    };
    Ok(Perturb { variables, spread })
}

fn criterion(table: &Table) -> Result<Criterion, Error> {
    let quantity = |key| table.maybe(key, |value: Value| value.quantity());
    let criterion = Criterion {
        name: table.need("name")?.text()?.text,
        signal: table.need("signal")?.text()?,
        min: quantity("min")?,
        max: quantity("max")?,
        from: quantity("from")?,
        to: quantity("to")?,
    };
    table.finish()?;
    if criterion.min.is_none() && criterion.max.is_none() {
        return Err(table.error("a criterion has `min`, `max` or both"));
    }
    Ok(criterion)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Settings, Error> {
        parse(Source { file: "s.toml".into(), text: text.into() })
    }

    #[test]
    fn everything_is_read() {
        let text = "sample_time = \"1 ms\"\n[sensors]\nx = \"0.2 mm\"\n[limits]\nu = { min = -1, max = \"2 N\" }\n\
                    [trials]\nduration = 4\n[[trials.perturb]]\nvariables = [\"a.b\", \"a.c\"]\nrelative = 0.1\n\
                    [[trials.criterion]]\nname = \"held\"\nsignal = \"x\"\nmax = \"150 mm\"\nfrom = \"3 s\"\n";
        let settings = parsed(text).unwrap();
        assert_eq!(settings.sensors[0].1.unit.as_deref(), Some("mm"));
        assert_eq!(settings.limits[0].1[1].value, 2.0);
        let trials = settings.trials.unwrap();
        assert_eq!(
            (trials.perturb[0].variables.len(), &trials.perturb[0].spread),
            (2, &Spread::Relative(0.1))
        );
        assert_eq!((trials.criteria[0].name.as_str(), trials.criteria[0].min.is_none()), ("held", true));
    }

    #[test]
    fn what_is_missing_or_unknown_is_named_with_its_place() {
        let cases = [
            ("", "line 1, column 1: nothing is measured"),
            ("[sensors]\nx = 1\n[drfit]\n", "line 3"),
            ("[sensors]\nx = true\n", "line 2, column 5"),
            ("[sensors]\nx = 1\n[trials]\nduration = 4\n", "no trial can succeed"),
            (
                "[sensors]\nx = 1\n[trials]\nduration = 4\n[[trials.perturb]]\nvariables = []\n",
                "either `relative`",
            ),
        ];
        for (text, expected) in cases {
            let message = parsed(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{text}: {message}");
        }
    }
}
