//! A second instance of a static FMU, for Model Exchange: there its outputs may be read at any inputs without a step.

use super::unit::Unit;
use crate::master::initialize::enter_initialization;
use crate::master::{Error, Settings};
use crate::system::graph::Component;
use airloop_fmi::Model;

/// Event iterations before an FMU without states is given up; it has nothing to iterate on.
const MAX_ROUNDS: usize = 100;

/// Instantiates and initializes with the start values of the component and the present inputs of the unit.
pub(super) fn instantiate(component: &Component, unit: &Unit, settings: &Settings) -> Result<Model, Error> {
    let mut model = Model::instantiate(&component.fmu, &component.name, false)?;
    enter_initialization(&mut model, component, settings)?;
    model.set_real(&unit.input_references, &unit.u)?;
    model.exit_initialization_mode()?;
    for _ in 0..MAX_ROUNDS {
        if !model.new_discrete_states()?.new_discrete_states_needed {
            break;
        }
    }
    model.enter_continuous_time_mode()?;
    Ok(model)
}
