//! Folders of measured data without a study: `dataset.toml` names columns, units, parameters and segments, and the
//! units show which rig it is.
//!
//! | columns | declared model |
//! |---|---|
//! | one angle, no force | pendulum with viscous damping on a fixed joint; inertia, damping and offset of the angle are
//! free |
//! | a force and a position | mass with viscous friction; both are free |
//! | a force, a pressure and a position | piston force less Coulomb and viscous friction and a bias, all three free |

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use serde::Deserialize;

use super::declaration::{Declaration, File};
use crate::Error;
use airloop_series::csv;
use airloop_series::units::lookup;

/// Roles of the records that are fitted.
const ESTIMATION: [&str; 2] = ["train", "estimation"];

/// Samples over which a way is measured.
const SAMPLES_OF_A_WAY: usize = 11;

/// Name of the file.
pub const NAME: &str = "dataset.toml";

#[derive(Debug, Deserialize)]
struct Dataset {
    #[serde(default)]
    name: String,
    units: BTreeMap<String, Entry>,
    #[serde(default)]
    parameters: BTreeMap<String, Value>,
    segment: Vec<Span>,
}

#[derive(Debug, Deserialize)]
struct Entry {
    unit: String,
}

#[derive(Debug, Deserialize)]
struct Value {
    value: f64,
}

#[derive(Debug, Deserialize)]
struct Span {
    file: String,
    role: String,
    from_s: Option<f64>,
    to_s: Option<f64>,
}

impl Dataset {
    /// Columns of the dimension of `unit`, without the time.
    fn columns(&self, unit: &str) -> Vec<&String> {
        let wanted = lookup(unit).map(|unit| unit.exponents);
        let same = |entry: &Entry| lookup(&entry.unit).map(|unit| unit.exponents) == wanted;
        self.units
            .iter()
            .filter(|(name, entry)| *name != "time" && same(entry))
            .map(|(name, _)| name)
            .collect()
    }

    fn parameter(&self, words: &[&str]) -> Option<f64> {
        let named = |word: &str| self.parameters.iter().find(|(name, _)| name.contains(word));
        words.iter().find_map(|word| named(word)).map(|(_, value)| value.value)
    }

    /// The column to use where there are several: the one whose name holds one of the words, else the first.
    fn one<'a>(columns: &[&'a String], not: &[&str]) -> Option<&'a String> {
        let plain = columns.iter().find(|name| !not.iter().any(|word| name.contains(word)));
        plain.or(columns.first()).copied()
    }

    fn unit(&self, column: &str) -> &str {
        self.units.get(column).map_or("1", |entry| &entry.unit)
    }

    /// Factor of a column to SI units.
    fn factor(&self, column: &str) -> f64 {
        lookup(self.unit(column)).map_or(1.0, |unit| unit.factor)
    }

    fn signal(&self, column: &str) -> String {
        format!("column = {column:?}, unit = {:?}", self.unit(column))
    }

    fn derivative(&self, column: &str) -> String {
        format!("derivative_of = {column:?}, unit = {:?}", self.unit(column))
    }

    /// Work \[J\] of a force along a position in the estimation records, without that of a pressure on `area` \[m2\]:
    /// friction takes it up, so that it is negative where both are counted in opposite directions.
    fn work(
        &self,
        folder: &Path,
        force: &str,
        position: &str,
        pressure: Option<(&str, f64)>,
    ) -> Result<f64, Error> {
        let mut sum = 0.0;
        for span in self.segment.iter().filter(|span| ESTIMATION.contains(&span.role.as_str())) {
            let series = csv::read(&folder.join(&span.file))?;
            let of = |name: &str| {
                let factor = self.factor(name);
                series.channel(name).map(|own| own.values.iter().map(|v| factor * v).collect::<Vec<f64>>())
            };
            let (Some(forces), Some(path)) = (of(force), of(position)) else { continue };
            let pressures = pressure.and_then(|(name, area)| Some((of(name)?, area)));
            for (k, pair) in path.windows(SAMPLES_OF_A_WAY).enumerate() {
                let middle = k + SAMPLES_OF_A_WAY / 2;
                let other = pressures.as_ref().map_or(0.0, |(values, area)| area * values[middle]);
                sum += (forces[middle] - other) * (pair[SAMPLES_OF_A_WAY - 1] - pair[0])
                    / (SAMPLES_OF_A_WAY - 1) as f64;
            }
        }
        Ok(sum)
    }
}

/// Reads the folder as the study that its columns suggest.
///
/// # Errors
/// A `dataset.toml` that cannot be read, or columns that suggest no rig.
pub fn read(folder: &Path) -> Result<File, Error> {
    let path = folder.join(NAME);
    let refused = |problem: String| Error::Case { path: path.clone(), problem };
    let text = airloop_series::file::read_to_string(&path).map_err(|error| refused(error.to_string()))?;
    let set: Dataset = super::declaration::read(&text).map_err(refused)?;
    let (angles, forces, positions, pressures) =
        (set.columns("rad"), set.columns("N"), set.columns("m"), set.columns("Pa"));
    let others = ["reference", "set", "target", "desired", "command"];
    let angle = Dataset::one(&angles, &others);
    let position = Dataset::one(&positions, &others);
    let force = Dataset::one(&forces, &[]);
    let (body, note) = match (angle, force, position, pressures.first()) {
        (_, Some(force), Some(position), Some(pressure)) => seal(&set, folder, [force, position, pressure])?,
        (_, Some(force), Some(position), None) => axis(&set, folder, force, position)?,
        (Some(angle), None, None, None) => pendulum(&set, folder, angle)?,
        _ => {
            let problem = "its columns suggest no rig that is known: one angle (a pendulum), a force and a position (a linear axis), or force, pressure and position (a piston); write a study.toml that names the system";
            return Err(refused(problem.into()));
        }
    };
    let mut study = format!("name = {:?}\n{body}", set.name);
    for span in &set.segment {
        let _ = write!(study, "[[segment]]\nfile = {:?}\nrole = {:?}\n", span.file, span.role);
        let times = [("from_s", span.from_s), ("to_s", span.to_s)];
        for (name, value) in times.into_iter().filter_map(|(name, value)| Some((name, value?))) {
            let _ = writeln!(study, "{name} = {value:?}");
        }
        if force.is_none() {
            study.push_str("initial = \"fit\"\n");
        }
    }
    let declaration: Declaration =
        toml::from_str(&study).map_err(|error| refused(error.message().to_owned()))?;
    Ok(File {
        path,
        text: String::new(),
        folder: folder.to_owned(),
        declaration,
        notes: vec![note],
        effects: Vec::new(),
        redrawn: None,
    })
}

fn pendulum(set: &Dataset, folder: &Path, angle: &str) -> Result<(String, String), Error> {
    let g = set.parameter(&["gravity"]).unwrap_or(9.81);
    let m = set.parameter(&["mass"]).unwrap_or(1.0);
    let l = set.parameter(&["com_distance", "distance", "length"]).unwrap_or(1.0);
    let b = set.parameter(&["viscous", "damping"]).unwrap_or(0.0).max(0.0);
    // Where the inertia is not given, that of the motion.
    let inertia = match set.parameter(&["inertia_com"]) {
        Some(own) => own + m * l * l,
        None => m * g * l / angular_frequency(set, folder, angle)?.powi(2),
    };
    let (column, rate) = (set.signal(angle), set.derivative(angle));
    let body = format!(
        r#"system = "airloop:pendulum"
[parameters]
m = {m:?}
l = {l:?}
g = {g:?}
[outputs]
theta = {{ {column}, offset = "fit" }}
[states]
theta = {{ {column} }}
omega = {{ {rate}, savitzky_golay_points = 9 }}
[[free]]
parameter = "I"
start = {inertia:?}
[[free]]
parameter = "b"
start = {b:?}
min = 0.0
[[attachment]]
input = "tau_ext"
channels = ["pole"]
velocity = "omega"
position = "theta"
viscous = "b"
"#
    );
    let note = "Declared model by its columns: pendulum on a fixed joint with viscous damping; inertia, damping and an offset of the angle are fitted, initial states of every segment too.";
    Ok((body, note.into()))
}

/// Angular frequency \[rad/s\] of a free swing, from its zero crossings; large amplitudes make it up to a tenth too
/// low.
fn angular_frequency(set: &Dataset, folder: &Path, angle: &str) -> Result<f64, Error> {
    let name = set.segment.iter().find(|span| ESTIMATION.contains(&span.role.as_str()));
    let Some(span) = name.or(set.segment.first()) else { return Ok(1.0) };
    let series = csv::read(&folder.join(&span.file))?;
    let Some(channel) = series.channel(angle) else { return Ok(1.0) };
    let mean = channel.values.iter().sum::<f64>() / channel.values.len() as f64;
    let signs: Vec<(f64, bool)> =
        series.time().iter().zip(&channel.values).map(|(t, value)| (*t, *value > mean)).collect();
    let crossings: Vec<f64> = signs.windows(2).filter(|w| w[0].1 != w[1].1).map(|w| w[1].0).collect();
    Ok(match (crossings.first(), crossings.last()) {
        (Some(first), Some(last)) if last > first => {
            std::f64::consts::PI * (crossings.len() - 1) as f64 / (last - first)
        }
        _ => 1.0,
    })
}

fn axis(set: &Dataset, folder: &Path, force: &str, position: &str) -> Result<(String, String), Error> {
    let m = set.parameter(&["mass"]).unwrap_or(1.0);
    let b = set.parameter(&["viscous", "damping"]).unwrap_or(0.0).max(0.0);
    let opposed = set.work(folder, force, position, None)? < 0.0;
    let (scale, turned) = match opposed {
        true => {
            (", scale = -1.0", " Force and position are counted in opposite directions: the force is turned.")
        }
        false => ("", ""),
    };
    let (drive, column, rate) = (set.signal(force), set.signal(position), set.derivative(position));
    let body = format!(
        r#"system = "airloop:rigid-mass"
[inputs]
F = {{ {drive}{scale}, hold = true }}
[outputs]
x = {{ {column} }}
[states]
x = {{ {column} }}
v = {{ {rate}, low_pass_hz = 40.0 }}
[[free]]
parameter = "m"
start = {m:?}
[[free]]
parameter = "b"
start = {b:?}
min = 0.0
[[attachment]]
input = "F_ext"
channels = ["cart_friction", "cart"]
velocity = "v"
position = "x"
viscous = "b"
[error]
windows_s = 1.0
force = {{ attachment = "F_ext", velocity = "v", low_pass_hz = 40.0, trim_s = 0.2, whole_file = true }}
"#
    );
    let note = "Declared model by its columns: mass with viscous friction, both fitted; simulated in windows of 1 s from the measured position and its derivative (zero-phase low-pass of order 4 at 40 Hz), and as force residual with all signals through that low-pass.";
    Ok((body, format!("{note}{turned}")))
}

fn seal(
    set: &Dataset,
    folder: &Path,
    [force, position, pressure]: [&String; 3],
) -> Result<(String, String), Error> {
    let bore = set.parameter(&["bore_diameter", "diameter", "bore"]);
    let area = set.parameter(&["piston_area", "area"]);
    let area = area.or(bore.map(|d| std::f64::consts::FRAC_PI_4 * d * d)).unwrap_or(5e-4);
    // Friction takes up work on the way in and out, which shows in what direction the position counts.
    let inwards = set.work(folder, force, position, Some((pressure, area)))? >= 0.0;
    let scale = if inwards { -1.0 } else { 1.0 };
    let place = scale * set.factor(position);
    let (measured, p, rate) = (set.signal(force), set.signal(pressure), set.derivative(position));
    let body = format!(
        r#"system = "airloop:piston-with-friction"
step_s = 0.01
[parameters]
"piston.S1" = {area:?}
"friction.c2" = 1000.0
"friction.c3" = 0.0
[inputs]
p1 = {{ {p} }}
v = {{ {rate}, savitzky_golay_points = 21, scale = {scale:?} }}
[signals]
x = {{ column = {position:?}, scale = {place:?} }}
[outputs]
F_out = {{ {measured} }}
[[free]]
parameter = "friction.c1"
start = 1.0
min = 0.0
[[free]]
parameter = "friction.c4"
start = 0.0
min = 0.0
[[free]]
parameter = "friction.c5"
start = 0.0
[[attachment]]
input = "friction.F_in"
channels = ["piston_friction", "actuator"]
velocity = "v"
position = "x"
pressure_force = "piston.F"
pressure = "p1"
coulomb = "friction.c1"
viscous = "friction.c4"
bias = "friction.c5"
"#
    );
    let note = "Declared model by its columns: piston force S1 p less friction c1 tanh(1000 v) + c4 v + c5 with c1, c4, c5 fitted (c1 and c4 not negative); signals on a grid of 10 ms, velocity by a Savitzky-Golay derivative of the position (21 points, order 2), positive in the direction of the pressure force.";
    let counted = if inwards { "against" } else { "in" };
    Ok((body, format!("{note} The position grows {counted} that direction, by the sign of the friction.")))
}
