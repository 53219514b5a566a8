//! The whole identification: fit, validation, flags, alternatives, verdict.

use std::collections::BTreeMap;

use serde::Serialize;

use super::fit::{Fit, Origin, errors_of, memory, refine, rms, search};
use super::law::{C2, Law, names};
use super::predict::Predict;
use super::track::{Sweep, Track};
use super::{Error, Mass, Settings, verdict};
use crate::fit::nrmse;

/// A parameter with its 95 % interval.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: &'static str,
    /// 95 % interval; null if the parameter is given, or the data do not determine it.
    pub ci95: Option<[f64; 2]>,
    /// `estimated`, `at-bound` or `fixed`.
    pub origin: &'static str,
}

/// Quality of the prediction of forces (or positions) on some records.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quality {
    /// Root mean square error, in N (m where positions are predicted).
    pub rms: f64,
    /// NRMSE fit \[%\] (eq. 9), the mean over the records; null if the signal is constant.
    pub fit: Option<f64>,
    /// The same by record.
    pub records: Vec<RecordQuality>,
}

/// Quality of the prediction of one record.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordQuality {
    /// Record.
    pub name: String,
    /// Errors counted.
    pub samples: usize,
    /// Root mean square error, in N or m.
    pub rms: f64,
    /// NRMSE fit \[%\] (eq. 9).
    pub fit: Option<f64>,
    /// Noise of the velocity sensor that the smoother found \[m/s\].
    pub velocity_noise: Option<f64>,
    /// Mean spread of the smoothed velocity \[m/s\].
    pub velocity_uncertainty: f64,
}

/// Something the user should know.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Flag {
    /// Short name.
    pub id: &'static str,
    /// Sentence.
    pub message: String,
}

/// A law that was compared with the one wanted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alternative {
    /// Law.
    pub law: Law,
    /// In words.
    pub what: &'static str,
    /// Whether it improves validation data clearly ([`RULE`]).
    pub offered: bool,
    /// Root mean square error on the estimation records.
    pub estimation_rms: f64,
    /// Root mean square error on the validation records.
    pub validation_rms: f64,
    /// `n ln(rss/rss_alternative)` on validation records, n counted without what errors remember.
    pub evidence: f64,
    /// Its parameters; empty where a first search already showed no gain.
    pub parameters: BTreeMap<&'static str, Parameter>,
}

/// A first search has to reach this part of the rms error on validation records for a law to be fitted to the end.
const MAX_RELATIVE_ERROR_OF_FIRST_SEARCH: f64 = 0.99;

/// Rule by which an alternative is offered.
pub const RULE: &str = "offered if, on the validation records, the rms error falls by at least 3 %, \
n ln(rss/rss_alternative) is at least 10 + k ln n (n: samples over the memory of the errors, k: added parameters), \
and no record gets worse by more than 1 %";

/// Result of an identification of friction.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Law.
    pub law: Law,
    /// `force` or `motion`: what is predicted.
    pub predicted: &'static str,
    /// Parameters by name; `mass` only where it is known or fitted.
    pub parameters: BTreeMap<&'static str, Parameter>,
    /// On the records that the law was fitted to.
    pub estimation: Quality,
    /// On other records.
    pub validation: Option<Quality>,
    /// Things to know.
    pub flags: Vec<Flag>,
    /// Rule by which an alternative is offered.
    pub rule: &'static str,
    /// Laws that were compared with it, the best on validation records first.
    pub alternatives: Vec<Alternative>,
    /// The result in words.
    pub verdict: Vec<String>,
    /// Samples after which an error no longer resembles itself; intervals are widened by its root.
    pub error_memory: f64,
    /// The fit itself.
    #[serde(skip)]
    pub fit: Fit,
    /// Tracks of the estimation records.
    #[serde(skip)]
    pub estimation_tracks: Vec<Track>,
    /// Tracks of the validation records.
    #[serde(skip)]
    pub validation_tracks: Vec<Track>,
}

/// Identifies friction from `estimation` and judges it on `validation`.
///
/// # Errors
/// [`Error`]: a record that cannot be used, a setting that does not go with them, a fit without result.
pub fn identify(estimation: &[Sweep], validation: &[Sweep], settings: &Settings) -> Result<Report, Error> {
    if estimation.is_empty() {
        return Err(Error::NoRecord);
    }
    let records = || estimation.iter().chain(validation);
    if settings.mass == Mass::None && settings.predict != Predict::Force {
        return Err(Error::NoMass);
    }
    if settings.law == Law::Pressure && records().any(|record| record.pressure.is_none()) {
        return Err(Error::Missing { law: settings.law.id(), what: "pressure" });
    }
    let tracks = |records: &[Sweep]| -> Result<Vec<Track>, Error> {
        records.iter().map(|record| record.track(settings.area, settings.smooth)).collect()
    };
    let (tracks, others) = (tracks(estimation)?, tracks(validation)?);
    if let Some(corner) = settings.low_pass
        && let Some(track) = tracks.iter().chain(&others).find(|track| settings.filter(track).is_none())
    {
        let rate = (track.len() - 1) as f64 / (track.time[track.len() - 1] - track.time[0]);
        return Err(Error::LowPass { record: track.name.clone(), corner, nyquist: 0.5 * rate });
    }
    let found = refine(settings.law, &tracks, settings, &search(settings.law, &tracks, settings, None)?)?;
    let validation_errors = errors_of(settings.law, &found.parameters, &others, settings);
    let alternatives = if settings.alternatives && !others.is_empty() {
        alternatives(&found, &tracks, &others, &validation_errors, settings, estimation)?
    } else {
        Vec::new()
    };
    let estimated = quality(&tracks, &found.errors, settings);
    let validated = (!others.is_empty()).then(|| quality(&others, &validation_errors, settings));
    let parameters = parameters(&found, settings);
    let flags = verdict::flags(&found, &tracks, settings);
    let verdict =
        verdict::sentences(&found, &parameters, &estimated, validated.as_ref(), &alternatives, settings);
    Ok(Report {
        law: settings.law,
        predicted: if settings.predict == Predict::Force { "force" } else { "motion" },
        parameters,
        estimation: estimated,
        validation: validated,
        flags,
        rule: RULE,
        alternatives,
        verdict,
        error_memory: found.memory,
        fit: found,
        estimation_tracks: tracks,
        validation_tracks: others,
    })
}

/// Parameters by name; an unknown mass is left out.
fn parameters(fit: &Fit, settings: &Settings) -> BTreeMap<&'static str, Parameter> {
    names(fit.law)
        .into_iter()
        .filter(|(_, name, _)| *name != "mass" || settings.mass != Mass::None)
        .filter(|(index, ..)| fit.law != Law::Presliding || *index != C2)
        .map(|(index, name, unit)| {
            let value = fit.parameters[index];
            let half = fit.deviation[index].map(|deviation| 1.96 * deviation);
            // At a bound the data ask for less: the interval begins there.
            let ci95 = half.map(|half| match fit.origin[index] {
                Origin::AtBound => [value, value + half],
                _ => [value - half, value + half],
            });
            let origin = match fit.origin[index] {
                Origin::Estimated => "estimated",
                Origin::AtBound => "at-bound",
                Origin::Fixed => "fixed",
            };
            (name, Parameter { value, unit, ci95, origin })
        })
        .collect()
}

fn quality(tracks: &[Track], errors: &[Vec<f64>], settings: &Settings) -> Quality {
    let records: Vec<RecordQuality> = tracks
        .iter()
        .zip(errors)
        .map(|(track, errors)| {
            let fit = match settings.predict {
                Predict::Force => {
                    let mut measured = track.force.clone();
                    if let Some(filter) = settings.filter(track) {
                        filter.both_ways(&mut measured);
                    }
                    let predicted: Vec<f64> = measured.iter().zip(errors).map(|(m, e)| m - e).collect();
                    nrmse(&measured, &predicted).ok()
                }
                // Windows overlap in their end points; the scatter of the whole record is the measure all the same.
                Predict::Motion { .. } => {
                    let measured = track.measured_position.as_ref().unwrap_or(&track.motion.position);
                    let measured: Vec<f64> = measured.iter().skip(1).take(errors.len()).copied().collect();
                    let predicted: Vec<f64> = measured.iter().zip(errors).map(|(m, e)| m - e).collect();
                    nrmse(&measured, &predicted).ok()
                }
            };
            let spread = &track.motion.velocity_deviation;
            RecordQuality {
                name: track.name.clone(),
                samples: errors.len(),
                rms: rms(std::slice::from_ref(errors)),
                fit: fit.and_then(|fit| fit.nrmse_percent).filter(|fit| fit.is_finite()),
                velocity_noise: track.motion.sensor_deviation[1],
                velocity_uncertainty: spread.iter().sum::<f64>() / spread.len().max(1) as f64,
            }
        })
        .collect();
    let fits: Option<Vec<f64>> = records.iter().map(|record| record.fit).collect();
    let fit = fits.filter(|fits| !fits.is_empty()).map(|fits| fits.iter().sum::<f64>() / fits.len() as f64);
    Quality { rms: rms(errors), fit, records }
}

/// Laws compared with the one wanted, judged on the validation records.
fn alternatives(
    base: &Fit,
    tracks: &[Track],
    others: &[Track],
    validation_errors: &[Vec<f64>],
    settings: &Settings,
    records: &[Sweep],
) -> Result<Vec<Alternative>, Error> {
    let mut tried = Vec::new();
    let unordered = tracks.iter().chain(others).any(|track| track.unordered);
    let before = rms(validation_errors);
    let n: usize = validation_errors.iter().map(Vec::len).sum();
    let samples = n as f64 / memory(validation_errors);
    for law in Law::EXTENSIONS {
        let applies = match law {
            _ if law == settings.law || settings.law != Law::CoulombViscous => false,
            Law::Pressure => records.iter().all(|record| record.pressure.is_some()),
            Law::PositionCoulomb | Law::Spring => records.iter().all(|record| record.position.is_some()),
            Law::Presliding => settings.predict == Predict::Force && !unordered,
            _ => true,
        };
        if !applies {
            continue;
        }
        let settings = Settings { law, ..settings.clone() };
        let rough = search(law, tracks, &settings, Some(&base.parameters))?;
        let mut errors = errors_of(law, &rough.parameters, others, &settings);
        let promising = rms(&errors) <= MAX_RELATIVE_ERROR_OF_FIRST_SEARCH * before;
        let (estimation_rms, found) = if promising {
            let found = refine(law, tracks, &settings, &rough)?;
            errors = errors_of(law, &found.parameters, others, &settings);
            (rms(&found.errors), parameters(&found, &settings))
        } else {
            (rms(&errors_of(law, &rough.parameters, tracks, &settings)), BTreeMap::new())
        };
        let after = rms(&errors);
        let evidence = 2.0 * samples * (before / after).ln();
        let added = law.extra().len() as f64;
        let worse = errors.iter().zip(validation_errors).any(|(after, before)| {
            rms(std::slice::from_ref(after)) > 1.01 * rms(std::slice::from_ref(before))
        });
        tried.push(Alternative {
            law,
            what: law.words(),
            offered: after <= 0.97 * before && evidence >= 10.0 + added * samples.ln() && !worse,
            estimation_rms,
            validation_rms: after,
            evidence,
            parameters: found,
        });
    }
    tried.sort_by(|a, b| a.validation_rms.total_cmp(&b.validation_rms));
    Ok(tried)
}
