//! The call tables of FMI 2.0 that lead into an FMI 3.0 library.

use super::{life_cycle, sensitivities, states, values};
use crate::functions::{CommonFunctions, GetInteger, ModelFunctions, SetInteger, SlaveFunctions};
use crate::library::ThreeFunctions;

pub(crate) fn common(functions: &ThreeFunctions) -> CommonFunctions {
    let three = &functions.common;
    CommonFunctions {
        free_instance: life_cycle::free_instance,
        setup_experiment: life_cycle::setup_experiment,
        enter_initialization_mode: life_cycle::enter_initialization_mode,
        exit_initialization_mode: life_cycle::exit_initialization_mode,
        terminate: life_cycle::terminate,
        reset: life_cycle::reset,
        get_real: values::get_real,
        get_integer: GetInteger::Long(values::get_integer),
        get_boolean: values::get_boolean,
        get_string: values::get_string,
        set_real: values::set_real,
        set_integer: SetInteger::Long(values::set_integer),
        set_boolean: values::set_boolean,
        set_string: values::set_string,
        set_debug_logging: three.set_debug_logging.map(|_| life_cycle::set_debug_logging as _),
        get_state: three.get_state.map(|_| states::get_state as _),
        set_state: three.set_state.map(|_| states::set_state as _),
        free_state: three.free_state.map(|_| states::free_state as _),
        serialized_state_size: three.serialized_state_size.map(|_| states::serialized_state_size as _),
        serialize_state: three.serialize_state.map(|_| states::serialize_state as _),
        deserialize_state: three.deserialize_state.map(|_| states::deserialize_state as _),
        directional_derivative: three
            .directional_derivative
            .map(|_| sensitivities::directional_derivative as _),
    }
}

pub(crate) fn slave(functions: &ThreeFunctions) -> SlaveFunctions {
    let outputs = functions.common.output_derivatives;
    SlaveFunctions {
        do_step: life_cycle::do_step,
        // FMI 3.0 has none: an input is interpolated in intermediate updates.
        set_real_input_derivatives: None,
        get_real_output_derivatives: outputs.map(|_| sensitivities::get_output_derivatives as _),
        get_real_status: Some(life_cycle::get_real_status),
        get_boolean_status: Some(life_cycle::get_boolean_status),
    }
}

pub(crate) const MODEL: ModelFunctions = ModelFunctions {
    enter_event_mode: life_cycle::enter_event_mode,
    new_discrete_states: life_cycle::new_discrete_states,
    enter_continuous_time_mode: life_cycle::enter_continuous_time_mode,
    completed_integrator_step: life_cycle::completed_integrator_step,
    set_time: life_cycle::set_time,
    set_continuous_states: life_cycle::set_continuous_states,
    get_continuous_states: life_cycle::get_continuous_states,
    get_derivatives: life_cycle::get_derivatives,
    get_event_indicators: life_cycle::get_event_indicators,
    get_nominals: life_cycle::get_nominals,
};
