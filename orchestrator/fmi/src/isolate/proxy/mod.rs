//! Functions with the signatures of FMI that pass each call on to a worker.
//!
//! The component that they take is a [`Remote`](remote::Remote). Setters and steps of a running instance are handled as
//! the parent module says; all else is one turn of the worker.

use super::calls::*;
use super::channel::Channel;
use crate::functions::{CommonFunctions, GetInteger, ModelFunctions, SetInteger, SlaveFunctions};
use crate::library::Library;
use crate::open::{Fmu, InterfaceKind};
use common::*;
use model::*;
use slave::*;
use states::*;
use values::*;

pub(crate) use remote::{forget, instantiate, refused_setter};

/// Calls without arguments.
macro_rules! simple {
    ($($function:ident: $number:ident,)*) => {
        $(pub(super) unsafe extern "C" fn $function(component: Component) -> fmi2Status {
            // SAFETY: our importer passes a live component.
            unsafe { remote(component) }.simple($number)
        })*
    };
}

mod common;
mod model;
mod remote;
mod slave;
mod states;
mod values;

type Component = *mut std::ffi::c_void;

/// Bits of the optional functions of a library, of its interfaces, and of nothing else.
pub(super) fn offered(library: &Library) -> u64 {
    let common = &library.common;
    let slave = library.slave.as_ref().ok();
    let bits = [
        library.slave.is_ok(),
        library.model.is_ok(),
        common.set_debug_logging.is_some(),
        common.get_state.is_some(),
        common.set_state.is_some(),
        common.free_state.is_some(),
        common.serialized_state_size.is_some(),
        common.serialize_state.is_some(),
        common.deserialize_state.is_some(),
        common.directional_derivative.is_some(),
        slave.is_some_and(|slave| slave.set_real_input_derivatives.is_some()),
        slave.is_some_and(|slave| slave.get_real_output_derivatives.is_some()),
        slave.is_some_and(|slave| slave.get_real_status.is_some()),
        slave.is_some_and(|slave| slave.get_boolean_status.is_some()),
    ];
    bits.iter().enumerate().map(|(index, &there)| u64::from(there) << index).sum()
}

/// Tables of functions of one library: common ones, and those of each interface.
pub(crate) type Tables =
    (CommonFunctions, Result<SlaveFunctions, &'static str>, Result<ModelFunctions, &'static str>);

/// Loads the library of an interface in a worker; `None` if the worker is lost. The error is the message of the worker.
pub(crate) fn functions(channel: &Channel, fmu: &Fmu, kind: InterfaceKind) -> Option<Result<Tables, String>> {
    let mut calls = Calls::default();
    calls.begin(LOAD, 0);
    calls.block(fmu.shown.to_string_lossy().as_bytes());
    calls.block(fmu.folder().to_string_lossy().as_bytes());
    calls.number(u64::from(kind == InterfaceKind::CoSimulation));
    let answer = channel.call(&calls)?;
    let mut parts = Parts { bytes: &answer.payload };
    if answer.status != 0 {
        let message = parts.block().map(|bytes| String::from_utf8_lossy(bytes).into_owned());
        return Some(Err(message.unwrap_or_else(|| "the worker cannot load it".into())));
    }
    let bits = parts.number().unwrap_or_default();
    let has = |index: u32| bits >> index & 1 == 1;
    let common = CommonFunctions {
        free_instance,
        setup_experiment,
        enter_initialization_mode,
        exit_initialization_mode,
        terminate,
        reset,
        get_real,
        get_integer: GetInteger::Long(get_integer),
        get_boolean,
        get_string,
        set_real,
        set_integer: SetInteger::Long(set_integer),
        set_boolean,
        set_string,
        set_debug_logging: has(2).then_some(set_debug_logging),
        get_state: has(3).then_some(get_state),
        set_state: has(4).then_some(set_state),
        free_state: has(5).then_some(free_state),
        serialized_state_size: has(6).then_some(serialized_state_size),
        serialize_state: has(7).then_some(serialize_state),
        deserialize_state: has(8).then_some(deserialize_state),
        directional_derivative: has(9).then_some(directional_derivative),
    };
    let slave = SlaveFunctions {
        do_step,
        set_real_input_derivatives: has(10).then_some(set_real_input_derivatives),
        get_real_output_derivatives: has(11).then_some(get_real_output_derivatives),
        get_real_status: has(12).then_some(get_real_status),
        get_boolean_status: has(13).then_some(get_boolean_status),
    };
    let model = ModelFunctions {
        enter_event_mode,
        new_discrete_states,
        enter_continuous_time_mode,
        completed_integrator_step,
        set_time,
        set_continuous_states,
        get_continuous_states,
        get_derivatives,
        get_event_indicators,
        get_nominals,
    };
    let slave = has(0).then_some(slave).ok_or("fmi2DoStep");
    let model = has(1).then_some(model).ok_or("fmi2GetDerivatives");
    Some(Ok((common, slave, model)))
}
