//! A case folder: `case.toml` (declared model, sensors, files with their role) and the records it names.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::Error;
use super::rig::corrections;
use super::rig::cylinder::Stated;
use super::study::clipping::clipping;
use super::study::declaration::read;
use super::{cleaned, grid, regime, spikes};
use airloop_series::{TimeSeries, csv};

/// Contents of `case.toml`: the declared model, its sensors and the list of records.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Declaration {
    /// Name of the case.
    pub id: String,
    /// Part of the rig that the records show.
    pub kind: Kind,
    /// Sample rate \[Hz\].
    pub sample_rate_hz: f64,
    /// Declared parameters.
    pub model: Declared,
    /// Standard deviations of declared parameters by path (`cart_pole.m_c`), relative to their values; poles: absolute.
    #[serde(default)]
    pub tolerance: BTreeMap<String, f64>,
    /// Sensors by the name of their column.
    pub sensors: BTreeMap<String, Sensor>,
    /// Records.
    pub files: Vec<File>,
}

/// Which part of the rig the records are about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Actuator, friction, cart and pole in series.
    Cartpole,
    /// The actuator alone, rod fixed.
    Actuator,
    /// Piston and cart alone, moved by a drive.
    Friction,
}

/// Declared parameters, SI units.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Declared {
    /// Sampled actuator model.
    pub actuator: Option<Actuator>,
    /// Cylinder from first principles, for where a moving piston contradicts `actuator`; dimensions that are left out
    /// are fitted from those of the FMU `pneumatic-cylinder` on.
    pub cylinder: Stated,
    /// Friction between piston and cylinder.
    pub piston_friction: Option<Friction>,
    /// Friction between cart and guide.
    pub cart_friction: Option<Friction>,
    /// Masses and lengths.
    pub cart_pole: Option<CartPole>,
}

/// `y(k) + A1 y(k-1) = B0 u(k) + B1 u(k-1)`, eq. 6.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case, reason = "names of the paper")]
pub struct Actuator {
    /// Sample time \[s\].
    pub sample_time: f64,
    /// Shape \[2, 2\].
    pub A1: [[f64; 2]; 2],
    /// Shape \[2\].
    pub B0: [f64; 2],
    /// Shape \[2\].
    pub B1: [f64; 2],
}

impl Actuator {
    /// The actuator with an output larger by `gain`, relatively, and with moved poles: their mean by `decay`, half
    /// their distance (along the real axis, or along the imaginary one for a complex pair) by `turn`.
    ///
    /// With F = -A1, its mean pole a and G = F - a I, which has the poles +-q: F' = (a + decay) I + (1 + turn/q) G, and
    /// B' = (1 + gain) (I - F') (I - F)^-1 B, so that the static gain changes by `gain` alone.
    pub fn moved(&self, gain: f64, decay: f64, turn: f64) -> Actuator {
        let mut moved = self.clone();
        if (decay, turn) != (0.0, 0.0) {
            let f = -nalgebra::Matrix2::from_fn(|i, j| self.A1[i][j]);
            let unit = nalgebra::Matrix2::identity();
            let mean = f.trace() / 2.0;
            let spread = f - unit * mean;
            // Poles that coincide have no direction to move apart in.
            let q = spread.determinant().abs().sqrt().max(MIN_DISTANCE_OF_POLES);
            let new = unit * (mean + decay) + spread * (1.0 + turn / q);
            moved.A1 = std::array::from_fn(|i| std::array::from_fn(|j| -new[(i, j)]));
            // An integrator has no static gain that could stay.
            let same_gain = (unit - f).try_inverse().map_or(unit, |inverse| (unit - new) * inverse);
            for b in [&mut moved.B0, &mut moved.B1] {
                let own = same_gain * nalgebra::Vector2::from(*b);
                *b = own.into();
            }
        }
        for b in moved.B0.iter_mut().chain(&mut moved.B1) {
            *b *= 1.0 + gain;
        }
        moved
    }

    /// Mean of the poles and half their distance.
    pub fn poles(&self) -> [f64; 2] {
        let f = -nalgebra::Matrix2::from_fn(|i, j| self.A1[i][j]);
        let mean = f.trace() / 2.0;
        [mean, (f - nalgebra::Matrix2::identity() * mean).determinant().abs().sqrt()]
    }
}

/// Half the distance of two poles below which they count as one.
const MIN_DISTANCE_OF_POLES: f64 = 1e-4;

/// `c1 tanh(c2 (v - c3)) + c4 v + c5`, eq. 2; N, s/m, m/s, N s/m, N.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "names of the equation")]
pub struct Friction {
    pub c1: f64,
    pub c2: f64,
    pub c3: f64,
    pub c4: f64,
    pub c5: f64,
}

/// Cart and pole, eq. 4; kg, m, m/s2, N m s/rad.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "names of the paper")]
pub struct CartPole {
    pub m_c: f64,
    pub m_p: f64,
    pub l: f64,
    pub g: f64,
    pub b_p: f64,
    /// Pivot to the free end of the rod \[m\].
    pub tip_distance: f64,
    /// Stroke of the cylinder \[m\].
    #[serde(default)]
    pub stroke: f64,
}

/// A measured signal.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Unit of the column.
    pub unit: String,
    /// Description in words.
    #[serde(default)]
    pub what: String,
    /// Rms of the measurement noise, quantization included, in `unit`.
    pub noise_rms: f64,
}

/// One record of the case.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct File {
    /// File name inside the case folder.
    pub name: String,
    /// Use of the record: estimation or validation.
    pub role: Role,
    /// `coupled`, `rod_fixed`, `sweep_piston` or `sweep_cart`.
    pub experiment: Experiment,
    /// Records of one group repeat one command.
    #[serde(default)]
    pub group: String,
}

/// Use of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Parameters are fitted on it.
    Estimation,
    /// Only the error is reported on it.
    Validation,
}

/// How a record was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "words of case.toml")]
pub enum Experiment {
    Coupled,
    RodFixed,
    SweepPiston,
    SweepCart,
}

/// A case with its records.
#[derive(Debug, Clone)]
pub struct Case {
    /// Contents of `case.toml`.
    pub declaration: Declaration,
    /// One series per file, in the same order.
    pub records: Vec<TimeSeries>,
    /// Changes made to the records while reading, one sentence each.
    pub notes: Vec<String>,
}

impl Case {
    /// Reads a case folder.
    ///
    /// # Errors
    /// A file that cannot be read, a signal without declared sensor, a time axis with gaps or of another rate (one that
    /// jitters or drifts is put on the grid), no estimation or no validation record: each names file, place and remedy.
    pub fn read(folder: &Path) -> Result<Case, Error> {
        let path = folder.join("case.toml");
        let refused = |problem: String| Error::Case { path: path.clone(), problem };
        if !folder.exists() {
            let problem = "there is no such file or folder; give the folder of a case, or a study.toml";
            return Err(Error::Case { path: folder.into(), problem: problem.into() });
        }
        if folder.is_file() {
            let problem = "a single file cannot be searched: give the folder that holds case.toml (declared model, sensors, files) and its records, or a study.toml for another system";
            return Err(Error::Case { path: folder.into(), problem: problem.into() });
        }
        let text = airloop_series::file::read_to_string(&path).map_err(|error| refused(error.to_string()))?;
        let declaration: Declaration = read(&text).map_err(refused)?;
        if !(declaration.sample_rate_hz > 0.0 && declaration.sample_rate_hz.is_finite()) {
            return Err(refused("sample_rate_hz must be positive".into()));
        }
        declaration.model.check().map_err(refused)?;
        if let Err(problem) = declaration.model.cylinder.cylinder().check() {
            return Err(refused(format!(
                "[model.cylinder]: {problem}; SI units, and what is left out is fitted from the values of the FMU pneumatic-cylinder on"
            )));
        }
        for role in [Role::Estimation, Role::Validation] {
            if !declaration.files.iter().any(|file| file.role == role) {
                let name = if role == Role::Estimation { "estimation" } else { "validation" };
                return Err(refused(format!(
                    "no file has the role `{name}`: an effect is only reported when it was fitted on estimation records and lowers the error on validation records that the fit has not seen; give at least one file each role"
                )));
            }
        }
        for (name, sensor) in &declaration.sensors {
            let exact = name == "u" && sensor.noise_rms == 0.0;
            if !(exact || sensor.noise_rms > 0.0 && sensor.noise_rms.is_finite()) {
                return Err(refused(format!(
                    "sensors.{name}.noise_rms is {}: it must be positive (only the command `u` may be exact); give the rms of sensor noise and rounding together",
                    sensor.noise_rms
                )));
            }
        }
        check_tolerances(&declaration.tolerance).map_err(refused)?;
        // The command is sent, not measured: an outstanding sample of it is intended.
        let measured = declaration.sensors.iter().filter(|(_, sensor)| sensor.noise_rms > 0.0);
        let measured: Vec<&str> = measured.map(|(name, _)| name.as_str()).collect();
        let integrates = |name: &&str| spikes::is_state(&declaration.sensors[*name].unit);
        let states: Vec<&str> = measured.iter().copied().filter(integrates).collect();
        let (mut records, mut notes) = (Vec::new(), Vec::new());
        for file in &declaration.files {
            let path = folder.join(&file.name);
            let series = read_record(&path, &declaration, &mut notes)?;
            let series = cleaned::without(series, &file.name, &measured, &states, &mut notes);
            records.push(series.map_err(|problem| Error::Case { path, problem })?);
        }
        notes.extend(check_regimes(&declaration, &records).map_err(refused)?);
        check_limits(&declaration, &records, &measured).map_err(refused)?;
        Ok(Case { declaration, records, notes })
    }
}

/// Records are of one regime, and show more than noise.
fn check_regimes(declaration: &Declaration, records: &[TimeSeries]) -> Result<Vec<String>, String> {
    let step = 1.0 / declaration.sample_rate_hz;
    let files = || declaration.files.iter().zip(records);
    let of = |name: &str, role: Role| {
        let own = files().filter(|(file, _)| file.role == role);
        own.filter_map(|(file, record)| {
            Some(regime::Values { name: &file.name, step, values: &record.channel(name)?.values })
        })
        .collect()
    };
    let mut signals = Vec::new();
    for (name, sensor) in &declaration.sensors {
        let [estimation, validation] = [Role::Estimation, Role::Validation].map(|role| of(name, role));
        let driven = sensor.noise_rms == 0.0;
        signals.push(regime::Signal { name, driven, noise: sensor.noise_rms, estimation, validation });
    }
    regime::check(&signals)
}

/// No sensor stands at a limit again and again, over all records: what the limit hides would be taken for an effect.
fn check_limits(declaration: &Declaration, records: &[TimeSeries], measured: &[&str]) -> Result<(), String> {
    for name in measured {
        let values =
            |record: &TimeSeries| record.channel(name).map_or_else(Vec::new, |own| own.values.clone());
        let Some(found) = clipping(&records.iter().flat_map(values).collect::<Vec<f64>>()) else { continue };
        let there =
            |record: &TimeSeries| values(record).into_iter().filter(|value| *value == found.at).count();
        let files = declaration.files.iter().zip(records);
        let Some((most, file)) = files.map(|(file, record)| (there(record), &file.name)).max() else {
            continue;
        };
        return Err(format!(
            "column `{name}` stands at {} again and again, in {:.1} % of the samples of all records (in {file} in {most}), as if the sensor were saturated or the machine at its limit there; what happens beyond it would be taken for an effect. Record again with a wider range or a smaller command, or cut these spans out of the files",
            found.at,
            100.0 * found.share
        ));
    }
    Ok(())
}

/// Every tolerance belongs to a declared parameter and is a standard deviation.
fn check_tolerances(tolerances: &BTreeMap<String, f64>) -> Result<(), String> {
    for (path, value) in tolerances {
        if !corrections::TABLE.iter().any(|kind| kind.path == path) {
            let known: Vec<&str> = corrections::TABLE.iter().map(|kind| kind.path).collect();
            return Err(format!(
                "[tolerance] \"{path}\" is none of the declared parameters that may be off: {}",
                known.join(", ")
            ));
        }
        if !(*value > 0.0 && value.is_finite()) {
            return Err(format!(
                "[tolerance] \"{path}\" is {value}: give one standard deviation relative to the value (for poles: absolute), larger than 0"
            ));
        }
    }
    Ok(())
}

fn read_record(path: &Path, declaration: &Declaration, notes: &mut Vec<String>) -> Result<TimeSeries, Error> {
    let series = csv::read(path)?;
    let refused = |problem: String| Error::Case { path: path.into(), problem };
    for name in declaration.sensors.keys() {
        if series.channel(name).is_none() {
            return Err(refused(format!(
                "there is no column `{name}`, which case.toml declares as a sensor"
            )));
        }
    }
    for channel in series.channels() {
        if !declaration.sensors.contains_key(&channel.name) {
            return Err(refused(format!(
                "column `{0}` has no [sensors.{0}] in case.toml; declare its unit and noise or remove it",
                channel.name
            )));
        }
    }
    let exact = declaration.sensors.iter().filter(|(_, sensor)| sensor.noise_rms == 0.0);
    let held: Vec<String> = exact.map(|(name, _)| name.clone()).collect();
    let step = 1.0 / declaration.sample_rate_hz;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    grid::on_grid(series, step, &name, &held, notes).map_err(refused)
}
