//! Numbers of a `study.toml`: finite, and in the range in which they mean something.

use toml::Spanned;

use super::declaration::{File, Initial, Signal, Value};
use crate::Error;

/// Points of a Savitzky-Golay derivative that are taken at most.
const MAX_POINTS: usize = 9999;

/// A number with its name and what it may be.
type Number<'a> = (&'a str, Option<f64>, fn(f64) -> bool, &'a str);

fn any(_: f64) -> bool {
    true
}

fn positive(value: f64) -> bool {
    value > 0.0
}

fn not_negative(value: f64) -> bool {
    value >= 0.0
}

fn not_zero(value: f64) -> bool {
    value != 0.0
}

/// Refuses numbers that no study can mean.
///
/// # Errors
/// Line, column, name, value and what is allowed.
pub fn check(file: &File) -> Result<(), Error> {
    let declaration = &file.declaration;
    for (name, value) in &declaration.parameters {
        if let Value::Number(number) = value.get_ref() {
            numbers(file, value, &[(name, Some(*number), any, "")])?;
        }
    }
    for table in [&declaration.inputs, &declaration.states, &declaration.signals] {
        for signal in table.values() {
            check_signal(file, signal)?;
        }
    }
    for output in declaration.outputs.values() {
        numbers(file, output, &[("noise", output.get_ref().noise, positive, "above zero")])?;
    }
    for segment in &declaration.segment {
        let own = segment.get_ref();
        numbers(file, segment, &[("from_s", own.from_s, any, ""), ("to_s", own.to_s, any, "")])?;
        if let Some(Initial::Given(values)) = &own.initial {
            for (name, value) in values {
                numbers(file, segment, &[(name, Some(*value), any, "")])?;
            }
        }
    }
    for free in &declaration.free {
        let own = free.get_ref();
        numbers(
            file,
            free,
            &[("min", own.min, any, ""), ("max", own.max, any, ""), ("start", own.start, any, "")],
        )?;
        if let (Some(min), Some(max)) = (own.min, own.max)
            && min >= max
        {
            return Err(file.refuse(free, format!("min = {min} is not below max = {max}")));
        }
    }
    for attachment in &declaration.attachment {
        let own = attachment.get_ref();
        numbers(file, attachment, &[("vt", own.vt, positive, "above zero"), ("v0", own.v0, any, "")])?;
    }
    let rule = &declaration.error;
    let mut all: Vec<Number> = vec![("error.windows_s", rule.windows_s, positive, "above zero")];
    if let Some(force) = &rule.force {
        all.push(("error.force.low_pass_hz", Some(force.low_pass_hz), positive, "above zero"));
        all.push(("error.force.trim_s", Some(force.trim_s), not_negative, "zero or above"));
    }
    problem(&all).map_or(Ok(()), |problem| Err(file.refuse_all(problem)))
}

fn check_signal(file: &File, spanned: &Spanned<Signal>) -> Result<(), Error> {
    let signal = spanned.get_ref();
    numbers(
        file,
        spanned,
        &[
            ("scale", signal.scale, not_zero, "other than zero"),
            ("low_pass_hz", signal.low_pass_hz, positive, "above zero"),
        ],
    )?;
    match signal.savitzky_golay_points {
        Some(points) if points > MAX_POINTS => Err(file.refuse(
            spanned,
            format!("savitzky_golay_points = {points}: more than {MAX_POINTS} points smooth any motion away"),
        )),
        _ => Ok(()),
    }
}

fn numbers<T>(file: &File, at: &Spanned<T>, all: &[Number]) -> Result<(), Error> {
    problem(all).map_or(Ok(()), |problem| Err(file.refuse(at, problem)))
}

fn problem(all: &[Number]) -> Option<String> {
    all.iter().find_map(|&(name, value, allowed, words)| {
        let value = value.filter(|value| !(value.is_finite() && allowed(*value)))?;
        let comma = if words.is_empty() { "" } else { ", " };
        Some(format!("{name} = {value} where a finite number{comma}{words} is needed"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_without_a_meaning_are_refused_with_their_place() {
        let text = "system = \"x.fmu\"\n[parameters]\nm = 1.0\n[states]\nx = { column = \"x\", scale = 2.0, low_pass_hz = 5.0 }\n\
                    [outputs]\ny = { column = \"y\", noise = 0.1 }\n[[segment]]\nfile = \"a.csv\"\nrole = \"estimation\"\nfrom_s = 0.5\n\
                    [[free]]\nparameter = \"b\"\nmin = 0.0\nmax = 3.0\n[error]\nwindows_s = 1.5\n";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("study.toml");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            check(&File::read(&path).unwrap())
        };
        assert!(read(text).is_ok());
        for (from, to, parts) in [
            ("m = 1.0", "m = nan", ["line 3", "m = NaN"]),
            ("scale = 2.0", "scale = 0.0", ["line 5", "scale = 0 where a finite number, other than zero"]),
            ("low_pass_hz = 5.0", "low_pass_hz = inf", ["line 5", "low_pass_hz = inf"]),
            ("noise = 0.1", "noise = -0.1", ["line 7", "noise = -0.1"]),
            ("from_s = 0.5", "from_s = nan", ["line 8", "from_s = NaN"]),
            ("max = 3.0", "max = -3.0", ["line 12", "min = 0 is not below max = -3"]),
            ("windows_s = 1.5", "windows_s = 0.0", ["study.toml", "error.windows_s = 0"]),
        ] {
            let message = read(&text.replace(from, to)).unwrap_err().to_string();
            assert!(parts.iter().all(|part| message.contains(part)), "{parts:?}: {message}");
        }
    }
}
