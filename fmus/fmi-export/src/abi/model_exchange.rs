//! Functions of Model Exchange across the C boundary.

use super::{call, input, null, output};
use crate::ctypes::{Bool, Component, EventInfo, Status};
use crate::model::Model;
use crate::state_machine::Function;

pub unsafe fn new_discrete_states<M: Model>(c: Component, info: *mut EventInfo) -> Status {
    call::<M>(c, Function::fmi2NewDiscreteStates, |i| match output(info, 1) {
        Some([info]) => i.new_discrete_states(info),
        _ => null(i, Function::fmi2NewDiscreteStates),
    })
}

pub unsafe fn completed_integrator_step<M: Model>(
    c: Component,
    enter_event_mode: *mut Bool,
    terminate_simulation: *mut Bool,
) -> Status {
    const F: Function = Function::fmi2CompletedIntegratorStep;
    call::<M>(c, F, |i| match (output(enter_event_mode, 1), output(terminate_simulation, 1)) {
        (Some([enter]), Some([terminate])) => {
            // Nothing depends on the history of accepted steps (completedIntegratorStepNotNeeded).
            *enter = 0;
            *terminate = 0;
            Status::OK
        }
        _ => null(i, F),
    })
}

pub unsafe fn set_time<M: Model>(c: Component, time: f64) -> Status {
    call::<M>(c, Function::fmi2SetTime, |i| i.set_time(time))
}

pub unsafe fn set_continuous_states<M: Model>(c: Component, x: *const f64, n: usize) -> Status {
    call::<M>(c, Function::fmi2SetContinuousStates, |i| match input(x, n) {
        Some(x) => i.set_continuous_states(x),
        None => null(i, Function::fmi2SetContinuousStates),
    })
}

/// Functions of Model Exchange that fill an array.
macro_rules! fill {
    ($($name:ident, $function:ident;)*) => {
        $(pub unsafe fn $name<M: Model>(c: Component, out: *mut f64, n: usize) -> Status {
            call::<M>(c, Function::$function, |i| match output(out, n) {
                Some(out) => i.$name(out),
                None => null(i, Function::$function),
            })
        })*
    };
}
fill! {
    get_derivatives, fmi2GetDerivatives;
    get_event_indicators, fmi2GetEventIndicators;
    get_continuous_states, fmi2GetContinuousStates;
    get_nominals, fmi2GetNominalsOfContinuousStates;
}
