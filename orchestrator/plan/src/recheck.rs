//! A plan checked along its roll-out, which comes from another interface and integrator: the limits of every phase
//! between the nodes of the plan, and when the events happen that end the phases.

use serde::{Deserialize, Serialize};

use super::balance::Recomputed;
use super::catalog::Kind;
use super::prepare::Setup;
use super::task::Signal;
use super::verify::Rollout;
use airloop_ocp::transcription::Trajectory;

/// Check of a plan by its roll-out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Recheck {
    /// The end of every phase but the last.
    pub phase_ends: Vec<PhaseEnd>,
    /// Every limit along the way, in the order of the problem.
    pub limits: Vec<Kept>,
    /// Forces of constraints recomputed from the energy, where the problem says how.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub forces: Option<Recomputed>,
}

/// End of a phase.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PhaseEnd {
    /// Phase.
    pub phase: String,
    /// Time in the plan \[s\].
    pub planned: f64,
    /// Next event of the roll-out \[s\], and by how much it is later than planned \[s\]; null without state events.
    pub event: Option<f64>,
    /// See `event`.
    pub late: Option<f64>,
}

/// Margin by which a limit is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Kept {
    /// Phase.
    pub phase: String,
    /// Limit.
    pub limit: String,
    /// Unit of the margin.
    pub unit: Option<String>,
    /// Smallest distance to the limit at the communication points within the phase, below 0 where it is violated.
    pub margin: f64,
    /// Time \[s\].
    pub time: f64,
}

/// Time around a change of phase \[s\] in which no limit is checked: plan and roll-out may be in different phases
/// there.
const UNCHECKED_TIME_AT_PHASE_CHANGE: f64 = 1e-5;

/// Checks a plan of one or several phases along its roll-out. Limits on signals that the roll-out does not show are
/// left out.
pub fn recheck(setup: &Setup, plan: &Trajectory, rollout: &Rollout) -> Recheck {
    let ends = &plan.phases[..plan.phases.len() - 1];
    let phase_ends = ends.iter().map(|phase| {
        let planned = phase.end();
        let near = |a: &&f64, b: &&f64| (**a - planned).abs().total_cmp(&(**b - planned).abs());
        let event = rollout.events.iter().min_by(near).copied();
        PhaseEnd { phase: phase.name.clone(), planned, event, late: event.map(|event| event - planned) }
    });
    let column = |signal: Signal| -> Option<&[f64]> {
        let signals = &setup.task.signals;
        let index = match signal {
            Signal::State(i) => signals.states[i],
            Signal::Output(i) => signals.outputs[i],
            Signal::Input(_) => return None,
        };
        let variable = &setup.catalog.variables()[index];
        let series = if variable.kind == Kind::State { &rollout.states } else { &rollout.outputs };
        let channel = series.channel(&variable.name).or_else(|| rollout.outputs.channel(&variable.path))?;
        Some(&channel.values)
    };
    let times = rollout.outputs.time();
    let mut limits = Vec::new();
    for (phase, planned) in setup.task.phases.iter().zip(&plan.phases) {
        for path in &phase.path {
            let terms = path.limit.terms.iter().map(|&(signal, factor)| Some((column(signal)?, factor)));
            let Some(terms) = terms.collect::<Option<Vec<_>>>() else { continue };
            let (begin, length) = (planned.begin(), planned.end() - planned.begin());
            let window = (begin + path.during.0 * length, begin + path.during.1 * length);
            let window = (
                window.0.max(begin + UNCHECKED_TIME_AT_PHASE_CHANGE),
                window.1.min(planned.end() - UNCHECKED_TIME_AT_PHASE_CHANGE),
            );
            let (low, high) = path.limit.limits;
            let rows = (0..times.len()).filter(|&row| (window.0..=window.1).contains(&times[row]));
            let margins = rows.map(|row| {
                let value: f64 = terms.iter().map(|(values, factor)| factor * values[row]).sum();
                ((value - low).min(high - value), times[row])
            });
            let least = margins.min_by(|a, b| a.0.total_cmp(&b.0));
            limits.extend(least.filter(|least| least.0.is_finite()).map(|(margin, time)| Kept {
                phase: phase.name.clone(),
                limit: path.limit.name.clone(),
                unit: path.limit.unit.clone(),
                margin,
                time,
            }));
        }
    }
    Recheck { phase_ends: phase_ends.collect(), limits, forces: None }
}
