//! Functions of Co-Simulation across the C boundary.

use super::{call, input, null, output};
use crate::co_simulation::StepStatus;
use crate::ctypes::{Bool, CString as CText, Component, Status, ValueReference};
use crate::model::Model;
use crate::state_machine::Function;
use std::ffi::c_int;

pub unsafe fn set_real_input_derivatives<M: Model>(
    c: Component,
    references: *const ValueReference,
    n: usize,
    orders: *const c_int,
    values: *const f64,
) -> Status {
    const F: Function = Function::fmi2SetRealInputDerivatives;
    call::<M>(c, F, |i| match (input(references, n), input(orders, n), input(values, n)) {
        (Some(references), Some(orders), Some(values)) => {
            i.set_real_input_derivatives(references, orders, values)
        }
        _ => null(i, F),
    })
}

pub unsafe fn get_real_output_derivatives<M: Model>(
    c: Component,
    references: *const ValueReference,
    n: usize,
    orders: *const c_int,
    values: *mut f64,
) -> Status {
    const F: Function = Function::fmi2GetRealOutputDerivatives;
    call::<M>(c, F, |i| match (input(references, n), input(orders, n), output(values, n)) {
        (Some(references), Some(orders), Some(values)) => {
            i.get_real_output_derivatives(references, orders, values)
        }
        _ => null(i, F),
    })
}

pub unsafe fn do_step<M: Model>(c: Component, t: f64, h: f64) -> Status {
    call::<M>(c, Function::fmi2DoStep, |i| i.do_step(t, h))
}

pub unsafe fn cancel_step<M: Model>(c: Component) -> Status {
    // The table allows it in no state, because steps are synchronous.
    call::<M>(c, Function::fmi2CancelStep, |i| i.error("fmi2CancelStep", "no step is in progress"))
}

/// A status function: `answer` gives the value for the kinds that it knows.
fn status<M: Model, T>(
    c: Component,
    function: Function,
    kind: c_int,
    value: *mut T,
    answer: impl FnOnce(StepStatus) -> Option<T>,
) -> Status {
    call::<M>(c, function, |i| {
        let Some([value]) = output(value, 1) else { return null(i, function) };
        match i.step_status(kind).and_then(answer) {
            Some(found) => {
                *value = found;
                Status::OK
            }
            None => i.discard(function.name(), &format!("status kind {kind} has no value of this type")),
        }
    })
}

pub unsafe fn get_status<M: Model>(c: Component, kind: c_int, value: *mut Status) -> Status {
    status::<M, _>(c, Function::fmi2GetStatus, kind, value, |s| match s {
        StepStatus::DoStep(status) => Some(status),
        _ => None,
    })
}

pub unsafe fn get_real_status<M: Model>(c: Component, kind: c_int, value: *mut f64) -> Status {
    status::<M, _>(c, Function::fmi2GetRealStatus, kind, value, |s| match s {
        StepStatus::LastSuccessfulTime(t) => Some(t),
        _ => None,
    })
}

pub unsafe fn get_integer_status<M: Model>(c: Component, kind: c_int, value: *mut c_int) -> Status {
    status::<M, _>(c, Function::fmi2GetIntegerStatus, kind, value, |_| None)
}

pub unsafe fn get_boolean_status<M: Model>(c: Component, kind: c_int, value: *mut Bool) -> Status {
    status::<M, _>(c, Function::fmi2GetBooleanStatus, kind, value, |s| match s {
        StepStatus::Terminated(terminated) => Some(Bool::from(terminated)),
        _ => None,
    })
}

pub unsafe fn get_string_status<M: Model>(c: Component, kind: c_int, value: *mut CText) -> Status {
    status::<M, _>(c, Function::fmi2GetStringStatus, kind, value, |s| match s {
        StepStatus::Pending => Some(c"no step is pending".as_ptr()),
        _ => None,
    })
}
