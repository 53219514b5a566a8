//! Records of force and motion, and the tracks that a fit works on.

use super::Error;
use super::smoother::{Measured, Motion};

/// One record of force and motion in SI units; shape \[n\] each.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sweep {
    /// Name in messages, usually the file it was read from.
    pub name: String,
    /// Times \[s\], increasing.
    pub time: Vec<f64>,
    /// Force \[N\] that moves the part against its friction.
    pub force: Vec<f64>,
    /// Position \[m\], if measured.
    pub position: Option<Vec<f64>>,
    /// Velocity \[m/s\], if measured.
    pub velocity: Option<Vec<f64>>,
    /// Acceleration \[m/s2\], if measured.
    pub acceleration: Option<Vec<f64>>,
    /// Pressure \[Pa\], if measured.
    pub pressure: Option<Vec<f64>>,
}

/// A record with its smoothed motion; shape \[n\] each.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// Name of the record.
    pub name: String,
    /// Times \[s\].
    pub time: Vec<f64>,
    /// Force less that of the pressure on its area \[N\].
    pub force: Vec<f64>,
    /// Position as measured, else integrated \[m\].
    pub measured_position: Option<Vec<f64>>,
    /// Pressure \[Pa\]; zero where it is not measured.
    pub pressure: Vec<f64>,
    /// Smoothed motion.
    pub motion: Motion,
    /// Whether the velocity is as measured, since its samples do not follow one another smoothly.
    pub unordered: bool,
}

/// Fewest samples of a record.
pub const MIN_SAMPLES: usize = 20;
/// Sensor noise above this part of the velocity's own scatter: the samples do not form a smooth trajectory.
const MAX_NOISE_OF_SMOOTH_VELOCITY: f64 = 0.3;

impl Sweep {
    /// Refuses records that cannot be used.
    ///
    /// # Errors
    /// [`Error::Short`], [`Error::NoMotion`], [`Error::Still`].
    pub fn check(&self) -> Result<(), Error> {
        let name = || self.name.clone();
        let n = self.time.len();
        if n < MIN_SAMPLES {
            return Err(Error::Short { record: name(), samples: n });
        }
        let moved =
            self.velocity.as_ref().or(self.position.as_ref()).ok_or(Error::NoMotion { record: name() })?;
        let (low, high) =
            moved.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (v.min(l), v.max(h)));
        let size = low.abs().max(high.abs());
        if high - low <= 1e-12 * size {
            let what = if self.velocity.is_some() { "velocity" } else { "position" };
            return Err(Error::Still { record: name(), what, value: low });
        }
        Ok(())
    }

    /// The record with its motion smoothed; `area` \[m2\] times the pressure is taken off the force.
    ///
    /// # Errors
    /// Same as [`Sweep::check`].
    pub fn track(&self, area: f64, smooth: bool) -> Result<Track, Error> {
        self.check()?;
        let n = self.time.len();
        let measured = Measured {
            time: &self.time,
            position: self.position.as_deref(),
            velocity: self.velocity.as_deref(),
            acceleration: self.acceleration.as_deref(),
        };
        let mut motion = measured.smooth();
        let mut unordered = false;
        if let Some(velocity) = &self.velocity {
            let mean = velocity.iter().sum::<f64>() / n as f64;
            let scatter = (velocity.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64).sqrt();
            unordered = motion.sensor_deviation[1]
                .is_some_and(|noise| noise > MAX_NOISE_OF_SMOOTH_VELOCITY * scatter);
            if unordered || !smooth {
                motion.velocity.clone_from(velocity);
                motion.velocity_deviation = vec![0.0; n];
                motion.acceleration = self.acceleration.clone().unwrap_or_else(|| vec![0.0; n]);
                motion.position = self.position.clone().unwrap_or_else(|| vec![0.0; n]);
            }
        }
        let pressure = self.pressure.clone().unwrap_or_else(|| vec![0.0; n]);
        let force = self.force.iter().zip(&pressure).map(|(force, p)| force - area * p).collect();
        Ok(Track {
            name: self.name.clone(),
            time: self.time.clone(),
            force,
            measured_position: self.position.clone(),
            pressure,
            motion,
            unordered,
        })
    }
}

impl Track {
    /// Number of samples n.
    pub fn len(&self) -> usize {
        self.time.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }

    /// Every `step`-th sample.
    pub fn thinned(&self, step: usize) -> Track {
        let thin = |values: &[f64]| values.iter().step_by(step).copied().collect::<Vec<f64>>();
        Track {
            name: self.name.clone(),
            time: thin(&self.time),
            force: thin(&self.force),
            measured_position: self.measured_position.as_deref().map(thin),
            pressure: thin(&self.pressure),
            motion: Motion {
                position: thin(&self.motion.position),
                velocity: thin(&self.motion.velocity),
                acceleration: thin(&self.motion.acceleration),
                velocity_deviation: thin(&self.motion.velocity_deviation),
                sensor_deviation: self.motion.sensor_deviation,
            },
            unordered: self.unordered,
        }
    }
}
