//! Sensors: white noise, then rounding to the step of the converter.

use super::{Error, Recording};
use airloop_series::TimeSeries;
use airloop_series::random::Random;

/// A sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    /// Signal.
    pub signal: String,
    /// Standard deviation of its noise, in the unit of the signal.
    pub noise: f64,
    /// Step of its values; 0 for none.
    pub step: f64,
}

/// Sensors of the usual signals: noise and steps of the records in `data/rig`.
pub fn usual(signal: &str) -> Sensor {
    let (noise, step) = match signal {
        "u" => (0.0, 1e-3),
        "F_hat" | "F_p" => (0.3, 0.01),
        "x" => (1e-4, 1e-5),
        "v" => (1e-3, 1e-4),
        "theta" => (0.0, std::f64::consts::TAU / 4096.0),
        _ => (0.0, 0.0),
    };
    Sensor { signal: signal.into(), noise, step }
}

/// Rounds to a multiple of `step`, once where the step is one over a whole number.
pub fn quantize(value: f64, step: f64) -> f64 {
    if step <= 0.0 {
        return value;
    }
    let inverse = (1.0 / step).round();
    let whole = (inverse * step - 1.0).abs() < 1e-12;
    let rounded = if whole { (value * inverse).round() / inverse } else { (value / step).round() * step };
    rounded + 0.0 // no negative zero
}

/// Measured signals of a recording. Each signal of each file has a noise of its own that depends on `seed` and
/// the names alone. Without a sensor of its own a signal has [`usual`].
///
/// # Errors
/// [`Error::Sensor`] for a sensor without signal.
pub fn measure(recording: &Recording, sensors: &[Sensor], seed: u64) -> Result<TimeSeries, Error> {
    let signals = &recording.signals;
    let mut measured = TimeSeries::new(signals.time().to_vec())?;
    for channel in signals.channels() {
        let sensor = sensor_of(&channel.name, sensors);
        let mut random = Random::stream(seed, &format!("{}/{}", recording.name, channel.name));
        let one = |value: &f64| quantize(value + sensor.noise * random.normal(), sensor.step);
        measured.push(
            channel.name.clone(),
            channel.unit.clone(),
            channel.values.iter().map(one).collect(),
        )?;
    }
    Ok(measured)
}

/// The sensor of a signal.
pub fn sensor_of(signal: &str, sensors: &[Sensor]) -> Sensor {
    sensors.iter().find(|sensor| sensor.signal == signal).cloned().unwrap_or_else(|| usual(signal))
}

/// Refuses sensors for signals that no recording has.
///
/// # Errors
/// [`Error::Sensor`].
pub fn check(recordings: &[Recording], sensors: &[Sensor]) -> Result<(), Error> {
    let known = |name: &str| recordings.iter().any(|recording| recording.signals.channel(name).is_some());
    let Some(lost) = sensors.iter().find(|sensor| !known(&sensor.signal)) else { return Ok(()) };
    let mut there: Vec<&str> = recordings
        .iter()
        .flat_map(|recording| recording.signals.channels().iter().map(|channel| channel.name.as_str()))
        .collect();
    there.sort_unstable();
    there.dedup();
    Err(Error::Sensor { name: lost.signal.clone(), there: there.join(", ") })
}
