//! Limits of physical sense on fitted effects of the rig: an effect beyond them is refused, however well it fits.

use super::parameters::*;
use crate::engine::candidate::Candidate;
use crate::engine::fit::Fit;

/// Motion range of the estimation records.
#[derive(Debug, Clone, Default)]
pub struct Reach {
    /// Positions \[m\], sorted.
    pub positions: Vec<f64>,
    /// Fastest speed of the cart \[m/s\].
    pub speed: f64,
}

/// Shares of samples between which an end stop is touched.
const CONTACT: (f64, f64) = (0.001, 0.35);
/// Largest gain error of a sensor.
const MAX_SENSOR_GAIN: f64 = 0.5;

/// Why a fitted candidate makes no sense, if it does not.
pub fn objection(candidate: &Candidate, fit: &Fit, reach: &Reach) -> Option<String> {
    let p = &fit.parameters;
    let (low, high) =
        (reach.positions.first().copied().unwrap_or(0.0), reach.positions.last().copied().unwrap_or(0.0));
    let travel = high - low;
    match candidate.id {
        "cart.cogging" if travel > 0.0 && p[COG_PERIOD] > 0.5 * travel => {
            return Some("its period does not fit into the travel twice".into());
        }
        "cart.endstop" if travel > 0.0 => {
            let beyond = reach.positions.partition_point(|&x| x <= p[STOP_POS]);
            let touched = 1.0 - beyond as f64 / reach.positions.len() as f64;
            if p[STOP_STIFFNESS] == 0.0 || !(CONTACT.0..=CONTACT.1).contains(&touched) {
                return Some(format!("it would be touched in {:.1} % of the samples", 100.0 * touched));
            }
        }
        "cart.spring" if travel > 0.0 && p[SPRING] > 0.0 => {
            let rest = p[SPRING_FORCE] / p[SPRING];
            if rest < low - travel || rest > high + travel {
                return Some("its rest lies outside of the travel".into());
            }
        }
        "pf.stribeck" | "cf.stribeck" => {
            let vs = p[if candidate.id == "pf.stribeck" { PF_STRIBECK_VS } else { CF_STRIBECK_VS }];
            if reach.speed > 0.0 && vs > 0.5 * reach.speed {
                return Some("its Stribeck speed is that of fast motion, where it is no peak".into());
            }
        }
        "sensor.gain" if candidate.free.iter().any(|free| p[free.index].abs() > MAX_SENSOR_GAIN) => {
            return Some("no sensor is that wrong".into());
        }
        _ => {}
    }
    let own = |index: usize| candidate.free.iter().any(|free| free.index == index);
    // The damping of an end stop may be none.
    let may_be_at_bound = |index: usize| index == STOP_DAMPING;
    let stuck = fit
        .free
        .iter()
        .zip(&fit.at_bound)
        .find(|(free, at)| **at && own(free.index) && !may_be_at_bound(free.index));
    stuck.map(|(free, _)| format!("{} ends at a bound", TABLE[free.index].name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::catalog::free;

    /// Whether a model of one candidate with these values makes no sense on records from 0 to 0.1 m.
    fn refused(id: &'static str, values: &[(usize, f64)]) -> bool {
        let mut parameters = neutral();
        values.iter().for_each(|&(index, value)| parameters[index] = value);
        let own: Vec<_> = values.iter().map(|&(index, _)| free(index)).collect();
        let at_bound =
            values.iter().map(|&(i, v)| v <= TABLE[i].bounds.0 || v >= TABLE[i].bounds.1).collect();
        let covariance = nalgebra::DMatrix::zeros(own.len(), own.len());
        let fit = Fit { parameters, free: own.clone(), locals: Vec::new(), chi2: 0.0, covariance, at_bound };
        let starts = Vec::new();
        let candidate =
            Candidate { id, channel: "c", signal: None, free: own, starts, place: 0, contains: None };
        let positions = (0..1000).map(|k| 1e-4 * f64::from(k)).collect();
        objection(&candidate, &fit, &Reach { positions, speed: 0.5 }).is_some()
    }

    #[test]
    fn an_end_stop_is_touched_in_some_samples_but_not_in_most() {
        let stop = |position: f64| [(STOP_STIFFNESS, 200.0), (STOP_DAMPING, 0.0), (STOP_POS, position)];
        assert!(!refused("cart.endstop", &stop(0.09)));
        assert!(refused("cart.endstop", &stop(0.02)) && refused("cart.endstop", &stop(0.2)));
    }

    #[test]
    fn a_parameter_at_a_bound_imitates() {
        assert!(!refused("cart.cogging", &[(COG_SIN, 1.0), (COG_PERIOD, 0.03)]));
        assert!(refused("cart.cogging", &[(COG_SIN, 1.0), (COG_PERIOD, 0.08)]));
        assert!(refused("pf.presliding", &[(PF_PRESLIDING, 0.05)]));
        assert!(refused("sensor.gain", &[(SENSOR_GAIN_X, 0.6)]));
    }
}
