//! Whether a system can be where a plan with phases begins.
//!
//! The parameters of a phase may switch off checks that the system makes by itself, such as that no foot is in the
//! ground. So the system without them is put where the first phase begins, before anything is searched for.

use std::sync::atomic::AtomicBool;

use super::Error;
use super::prepare::Setup;
use airloop_cosim::master::simulate::{self, Watch};
use airloop_cosim::master::{self, Algorithm, Settings};

/// Length of the run that shows it \[s\].
const RUN_LENGTH: f64 = 1e-6;

/// Initializes the system at the initial states, where the problem has several phases and fixes all of these states.
///
/// # Errors
/// Fails if an FMU refuses them; the message names the phase.
pub fn check(setup: &Setup) -> Result<(), Error> {
    let [phase, _, ..] = &setup.task.phases[..] else { return Ok(()) };
    if phase.initial.iter().any(|(lower, upper)| lower != upper) {
        return Ok(());
    }
    let place = format!("phase `{}`, initial states", phase.name);
    let mut graph = setup.graph.clone();
    for (&state, (value, _)) in setup.task.signals.states.iter().zip(&phase.initial) {
        graph.set_start(&setup.catalog.variables()[state].path, &value.to_string(), &place)?;
    }
    let settings = Settings {
        stop_time: RUN_LENGTH,
        step_size: RUN_LENGTH,
        algorithm: Algorithm::Monolithic,
        ..Settings::default()
    };
    let watch = Watch { stop: &AtomicBool::new(false), progress: &mut |_, _| {} };
    match simulate::run(&graph, &settings, None, watch) {
        Err(error @ master::Error::Fmu(_)) => {
            Err(Error::Place { place, problem: format!("the system cannot be there: {error}") })
        }
        // Other reasons why it does not run have nothing to do with the states.
        _ => Ok(()),
    }
}
