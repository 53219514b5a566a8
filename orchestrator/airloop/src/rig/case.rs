//! `case.toml`: what an experimenter knows of a set of records.

use std::fmt::Write;

use super::Recording;
use super::sensor::{Sensor, sensor_of};

/// The text of `case.toml`: kind of experiment, source of the records, sensors, files with role, experiment and group.
pub fn text(
    id: &str,
    kind: &str,
    source: &str,
    seed: u64,
    sample_time: f64,
    sensors: &[Sensor],
    recordings: &[Recording],
) -> String {
    let mut text = String::new();
    // Writing into a String cannot fail.
    let _ = writeln!(
        text,
        "id = {id:?}\nkind = {kind:?}\nsample_rate_hz = {}\n\n[virtual_rig]\nsource = {source:?}\nseed = {seed}",
        (1.0 / sample_time).round()
    );
    let mut named: Vec<&str> = Vec::new();
    for channel in recordings.iter().flat_map(|recording| recording.signals.channels()) {
        if named.contains(&channel.name.as_str()) {
            continue;
        }
        named.push(&channel.name);
        let sensor = sensor_of(&channel.name, sensors);
        let unit = channel.unit.as_deref().unwrap_or("");
        let _ =
            write!(text, "\n[sensors.{}]\nunit = {unit:?}\nnoise_rms = {:?}\n", channel.name, sensor.noise);
        if sensor.step > 0.0 {
            let _ = writeln!(text, "step = {:?}", sensor.step);
        }
    }
    for recording in recordings {
        let role = if recording.estimation { "estimation" } else { "validation" };
        let _ = write!(
            text,
            "\n[[files]]\nname = {:?}\nrole = {role:?}\nexperiment = {:?}\ngroup = {:?}\n",
            recording.name, recording.experiment, recording.group
        );
    }
    text
}
