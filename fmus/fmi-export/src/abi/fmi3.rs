//! The functions of FMI 3.0 across the C boundary: argument lists of 3.0 over the instances, call rules and equations
//! of 2.0.
//!
//! All variables are scalars, so that as many values as value references belong to a call. A Boolean of FMI 3.0 is a
//! byte, which is read and written as a number.

use super::{call, input, instance, make, output};
use crate::co_simulation::StepStatus;
use crate::ctypes::{
    CString as CText, Component, ComponentEnvironment, EventInfo, FmuState, LogMessage, Status,
    ValueReference, status_kind,
};
use crate::definition::Definition;
use crate::fmi3::references::{Meaning, meaning};
use crate::instance::Instance;
use crate::logger::{Callback, Category};
use crate::model::Model;
use crate::state_machine::Function;
use crate::values::Interface;
use std::ffi::{CString, c_char};
use std::sync::OnceLock;

pub fn version() -> CText {
    c"3.0".as_ptr()
}

pub unsafe fn instantiate<M: Model>(
    definition: &'static OnceLock<Definition<M>>,
    interface: Option<Interface>,
    name: CText,
    token: CText,
    resource_path: CText,
    logging_on: u8,
    environment: ComponentEnvironment,
    log_message: Option<LogMessage>,
) -> Component {
    let callback = log_message.map_or(Callback::Nobody, Callback::Three);
    let interface = interface.ok_or_else(|| "the FMU has no Scheduled Execution".to_owned());
    make(definition, (callback, environment), interface, (name, token, resource_path), logging_on != 0)
}

/// A function that the FMU does not offer.
pub unsafe fn unsupported<M: Model>(c: Component, function: &str) -> Status {
    match instance::<M>(c) {
        Some(i) => refuse(i, function, "the FMU does not offer this"),
        None => Status::Error,
    }
}

/// Get or set functions of a type that no variable has: fine as long as nothing is asked for.
pub unsafe fn of_absent_type<M: Model>(c: Component, function: &str, n: usize) -> Status {
    match instance::<M>(c) {
        Some(_) if n == 0 => Status::OK,
        Some(i) => refuse(i, function, "the FMU has no variable of this type"),
        None => Status::Error,
    }
}

fn refuse<M: Model>(i: &Instance<M>, function: &str, why: &str) -> Status {
    i.logger.log(Category::Error, &format!("{function}: {why}"));
    Status::Error
}

/// Number behind a value reference that must be of one kind.
fn number<M: Model>(
    i: &Instance<M>,
    function: &str,
    reference: u32,
    wanted: &[Meaning],
) -> Result<u32, Status> {
    match meaning(reference) {
        Some((found, number)) if wanted.contains(&found) => Ok(number),
        _ => Err(refuse(i, function, &format!("{reference} is the value reference of no such variable"))),
    }
}

/// References and values of a call, of which there must be as many.
fn pair<'a, M: Model, T>(
    i: &Instance<M>,
    function: &str,
    references: *const ValueReference,
    n: usize,
    values: *const T,
    n_values: usize,
) -> Result<(&'a [u32], &'a [T]), Status> {
    match (input(references, n), input(values, n_values)) {
        (Some(references), Some(values)) if n == n_values => Ok((references, values)),
        (Some(_), Some(_)) => {
            Err(refuse(i, function, &format!("{n_values} values for {n} variables, which are all scalars")))
        }
        _ => Err(refuse(i, function, "an array argument is a null pointer")),
    }
}

/// Same as [`pair`] for values to write.
fn pair_mut<'a, M: Model, T>(
    i: &Instance<M>,
    function: &str,
    references: *const ValueReference,
    n: usize,
    values: *mut T,
    n_values: usize,
) -> Result<(&'a [u32], &'a mut [T]), Status> {
    let (references, _) = pair(i, function, references, n, values.cast_const(), n_values)?;
    match output(values, n_values) {
        Some(values) => Ok((references, values)),
        None => Err(refuse(i, function, "an array argument is a null pointer")),
    }
}

/// The status of a body that may end early with one.
fn settled(result: Result<Status, Status>) -> Status {
    result.unwrap_or_else(|status| status)
}

pub unsafe fn get_float64<M: Model>(
    c: Component,
    references: *const ValueReference,
    n: usize,
    values: *mut f64,
    n_values: usize,
) -> Status {
    const F: &str = "fmi3GetFloat64";
    call::<M>(c, Function::fmi2GetReal, |i| {
        settled((|| {
            let (references, values) = pair_mut(i, F, references, n, values, n_values)?;
            let is_real = |reference: &u32| matches!(meaning(*reference), Some((Meaning::Real, _)));
            if references.iter().all(is_real) {
                return Ok(i.get_real(references, values));
            }
            let mut worst = Status::OK;
            for (&reference, value) in references.iter().zip(values) {
                let status = match meaning(reference) {
                    Some((Meaning::Real, _)) => i.get_real(&[reference], std::slice::from_mut(value)),
                    Some((Meaning::Time, 0)) => {
                        *value = i.state.values.time;
                        Status::OK
                    }
                    Some((Meaning::Indicator, number)) => {
                        let mut indicators = vec![0.0; i.definition.table.number_of_event_indicators()];
                        let status = i.get_event_indicators(&mut indicators);
                        match indicators.get(number as usize) {
                            Some(indicator) => *value = *indicator,
                            None => return Err(refuse(i, F, "there is no such event indicator")),
                        }
                        status
                    }
                    _ => return Err(number(i, F, reference, &[]).map_or_else(|s| s, |_| Status::Error)),
                };
                if status > Status::Warning {
                    return Ok(status);
                }
                worst = worst.max(status);
            }
            Ok(worst)
        })())
    })
}

pub unsafe fn set_float64<M: Model>(
    c: Component,
    references: *const ValueReference,
    n: usize,
    values: *const f64,
    n_values: usize,
) -> Status {
    const F: &str = "fmi3SetFloat64";
    call::<M>(c, Function::fmi2SetReal, |i| {
        settled((|| {
            let (references, values) = pair(i, F, references, n, values, n_values)?;
            for &reference in references {
                number(i, F, reference, &[Meaning::Real])?;
            }
            Ok(i.set_real(references, values))
        })())
    })
}

/// Get and set functions whose type of FMI 2.0 differs from that of 3.0.
macro_rules! converted {
    ($($get:ident, $get_name:literal, $set:ident, $set_name:literal, $type:ty, $meaning:ident,
       $get_two:ident, $get_rule:ident, $set_two:ident, $set_rule:ident, $from:expr, $to:expr;)*) => {
        $(pub unsafe fn $get<M: Model>(
            c: Component,
            references: *const ValueReference,
            n: usize,
            values: *mut $type,
            n_values: usize,
        ) -> Status {
            call::<M>(c, Function::$get_rule, |i| settled((|| {
                let (references, values) = pair_mut(i, $get_name, references, n, values, n_values)?;
                for (&reference, value) in references.iter().zip(values) {
                    let mut found = [0];
                    let status = i.$get_two(&[number(i, $get_name, reference, &[Meaning::$meaning])?], &mut found);
                    if status > Status::Warning {
                        return Ok(status);
                    }
                    *value = $from(found[0]);
                }
                Ok(Status::OK)
            })()))
        }

        pub unsafe fn $set<M: Model>(
            c: Component,
            references: *const ValueReference,
            n: usize,
            values: *const $type,
            n_values: usize,
        ) -> Status {
            call::<M>(c, Function::$set_rule, |i| settled((|| {
                let (references, values) = pair(i, $set_name, references, n, values, n_values)?;
                let numbers = references.iter().map(|&r| number(i, $set_name, r, &[Meaning::$meaning]));
                let numbers = numbers.collect::<Result<Vec<u32>, Status>>()?;
                let values: Vec<i32> = values.iter().map(|&value| $to(value)).collect();
                Ok(i.$set_two(&numbers, &values))
            })()))
        })*
    };
}
converted! {
    get_int32, "fmi3GetInt32", set_int32, "fmi3SetInt32", i32, Integer,
        get_integer, fmi2GetInteger, set_integer, fmi2SetInteger, |v| v, |v| v;
    // Items of enumerations count from 1; what is no Int32 is none of them.
    get_int64, "fmi3GetInt64", set_int64, "fmi3SetInt64", i64, Enumeration,
        get_integer, fmi2GetInteger, set_integer, fmi2SetInteger, i64::from,
        |v: i64| i32::try_from(v).unwrap_or(i32::MIN);
    get_boolean, "fmi3GetBoolean", set_boolean, "fmi3SetBoolean", u8, Boolean,
        get_boolean, fmi2GetBoolean, set_boolean, fmi2SetBoolean, |v| u8::from(v != 0), |v: u8| i32::from(v != 0);
}

pub unsafe fn get_string<M: Model>(
    c: Component,
    references: *const ValueReference,
    n: usize,
    values: *mut CText,
    n_values: usize,
) -> Status {
    const F: &str = "fmi3GetString";
    call::<M>(c, Function::fmi2GetString, |i| {
        settled((|| {
            let (references, values) = pair_mut(i, F, references, n, values, n_values)?;
            let numbers = references.iter().map(|&r| number(i, F, r, &[Meaning::Text]));
            let numbers = numbers.collect::<Result<Vec<u32>, Status>>()?;
            Ok(i.get_string(&numbers, |at, text: &CString| values[at] = text.as_ptr()))
        })())
    })
}

pub unsafe fn set_string<M: Model>(
    c: Component,
    references: *const ValueReference,
    n: usize,
    values: *const CText,
    n_values: usize,
) -> Status {
    const F: &str = "fmi3SetString";
    call::<M>(c, Function::fmi2SetString, |i| {
        settled((|| {
            let (references, values) = pair(i, F, references, n, values, n_values)?;
            let numbers = references.iter().map(|&r| number(i, F, r, &[Meaning::Text]));
            let numbers = numbers.collect::<Result<Vec<u32>, Status>>()?;
            let texts: Vec<Option<&str>> = values.iter().map(|value| super::text(*value)).collect();
            Ok(i.set_string(&numbers, &texts))
        })())
    })
}

pub unsafe fn enter_initialization_mode<M: Model>(
    c: Component,
    tolerance_defined: u8,
    tolerance: f64,
    start: f64,
    stop_defined: u8,
    stop: f64,
) -> Status {
    // SAFETY: the arguments are those of the importer.
    let set_up = unsafe {
        super::setup_experiment::<M>(
            c,
            (tolerance_defined != 0).into(),
            tolerance,
            start,
            (stop_defined != 0).into(),
            stop,
        )
    };
    if set_up > Status::Warning {
        return set_up;
    }
    // SAFETY: as above.
    unsafe { super::enter_initialization_mode::<M>(c) }
}

/// A step. A model that ends the simulation says so with `terminateSimulation`, not with a status.
pub unsafe fn do_step<M: Model>(
    c: Component,
    t: f64,
    h: f64,
    event_handling_needed: *mut u8,
    terminate_simulation: *mut u8,
    early_return: *mut u8,
    last_successful_time: *mut f64,
) -> Status {
    call::<M>(c, Function::fmi2DoStep, |i| {
        let flags = (output(event_handling_needed, 1), output(terminate_simulation, 1));
        let (Some([event]), Some([terminate])) = flags else {
            return refuse(i, "fmi3DoStep", "an argument is a null pointer");
        };
        let (Some([early]), Some([last])) = (output(early_return, 1), output(last_successful_time, 1)) else {
            return refuse(i, "fmi3DoStep", "an argument is a null pointer");
        };
        (*event, *terminate, *early) = (0, 0, 0);
        let status = i.do_step(t, h);
        *last = match i.step_status(status_kind::LAST_SUCCESSFUL_TIME) {
            Some(StepStatus::LastSuccessfulTime(time)) => time,
            _ => t,
        };
        let ended = matches!(i.step_status(status_kind::TERMINATED), Some(StepStatus::Terminated(true)));
        if status == Status::Discard && ended {
            *terminate = 1;
            return Status::OK;
        }
        status
    })
}

pub unsafe fn update_discrete_states<M: Model>(
    c: Component,
    needed: *mut u8,
    terminate: *mut u8,
    nominals_changed: *mut u8,
    values_changed: *mut u8,
    next_event_defined: *mut u8,
    next_event: *mut f64,
) -> Status {
    call::<M>(c, Function::fmi2NewDiscreteStates, |i| {
        let mut info = EventInfo::default();
        let status = i.new_discrete_states(&mut info);
        let flags = [
            (needed, info.new_discrete_states_needed),
            (terminate, info.terminate_simulation),
            (nominals_changed, info.nominals_of_continuous_states_changed),
            (values_changed, info.values_of_continuous_states_changed),
            (next_event_defined, info.next_event_time_defined),
        ];
        for (pointer, value) in flags {
            let Some([flag]) = output(pointer, 1) else {
                return refuse(i, "fmi3UpdateDiscreteStates", "an argument is a null pointer");
            };
            *flag = u8::from(value != 0);
        }
        match output(next_event, 1) {
            Some([time]) => *time = info.next_event_time,
            _ => return refuse(i, "fmi3UpdateDiscreteStates", "an argument is a null pointer"),
        }
        status
    })
}

pub unsafe fn completed_integrator_step<M: Model>(
    c: Component,
    enter_event_mode: *mut u8,
    terminate_simulation: *mut u8,
) -> Status {
    call::<M>(c, Function::fmi2CompletedIntegratorStep, |i| {
        match (output(enter_event_mode, 1), output(terminate_simulation, 1)) {
            (Some([enter]), Some([terminate])) => {
                // Nothing depends on the history of accepted steps (needsCompletedIntegratorStep).
                (*enter, *terminate) = (0, 0);
                Status::OK
            }
            _ => refuse(i, "fmi3CompletedIntegratorStep", "an argument is a null pointer"),
        }
    })
}

pub unsafe fn number_of_continuous_states<M: Model>(c: Component, n: *mut usize) -> Status {
    count::<M>(c, "fmi3GetNumberOfContinuousStates", n, |i| i.definition.table.states().len())
}

pub unsafe fn number_of_event_indicators<M: Model>(c: Component, n: *mut usize) -> Status {
    count::<M>(c, "fmi3GetNumberOfEventIndicators", n, |i| i.definition.table.number_of_event_indicators())
}

fn count<M: Model>(
    c: Component,
    function: &str,
    n: *mut usize,
    of: impl FnOnce(&Instance<M>) -> usize,
) -> Status {
    let Some(i) = instance::<M>(c) else { return Status::Error };
    match output(n, 1) {
        Some([n]) => {
            *n = of(i);
            Status::OK
        }
        _ => refuse(i, function, "an argument is a null pointer"),
    }
}

pub unsafe fn set_debug_logging<M: Model>(
    c: Component,
    on: u8,
    n: usize,
    categories: *const CText,
) -> Status {
    // SAFETY: the arguments are those of the importer.
    unsafe { super::set_debug_logging::<M>(c, (on != 0).into(), n, categories) }
}

pub unsafe fn serialize_fmu_state<M: Model>(
    c: Component,
    state: FmuState,
    bytes: *mut u8,
    n: usize,
) -> Status {
    // SAFETY: the arguments are those of the importer.
    unsafe { super::serialize_fmu_state::<M>(c, state, bytes.cast::<c_char>(), n) }
}

pub unsafe fn deserialize_fmu_state<M: Model>(
    c: Component,
    bytes: *const u8,
    n: usize,
    state: *mut FmuState,
) -> Status {
    // SAFETY: the arguments are those of the importer.
    unsafe { super::deserialize_fmu_state::<M>(c, bytes.cast::<c_char>(), n, state) }
}

pub unsafe fn get_output_derivatives<M: Model>(
    c: Component,
    references: *const ValueReference,
    n: usize,
    orders: *const i32,
    values: *mut f64,
    n_values: usize,
) -> Status {
    if n != n_values {
        return match instance::<M>(c) {
            Some(i) => refuse(i, "fmi3GetOutputDerivatives", "there must be one value for each variable"),
            None => Status::Error,
        };
    }
    // SAFETY: the arguments are those of the importer.
    unsafe { super::get_real_output_derivatives::<M>(c, references, n, orders, values) }
}

/// An array of value references of the importer.
type References = (*const ValueReference, usize);

/// `sensitivity = J seed`, or for the adjoint `sensitivity = J^T seed`, one column after the other.
fn derivative<M: Model>(
    c: Component,
    function: &str,
    ((unknowns, n_unknowns), (knowns, n_knowns)): (References, References),
    (seed, n_seed): (*const f64, usize),
    (out, n_out): (*mut f64, usize),
    is_adjoint: bool,
) -> Status {
    call::<M>(c, Function::fmi2GetDirectionalDerivative, |i| {
        settled((|| {
            let (seeded, answered) = if is_adjoint { (n_unknowns, n_knowns) } else { (n_knowns, n_unknowns) };
            let arrays = (input(unknowns, n_unknowns), input(knowns, n_knowns), input(seed, n_seed));
            let ((Some(unknowns), Some(knowns), Some(seed)), Some(out)) = (arrays, output(out, n_out)) else {
                return Err(refuse(i, function, "an array argument is a null pointer"));
            };
            if seed.len() != seeded || out.len() != answered {
                let text =
                    format!("{n_seed} seeds and {n_out} sensitivities where {seeded} and {answered} belong");
                return Err(refuse(i, function, &text));
            }
            for &reference in unknowns.iter().chain(knowns) {
                number(i, function, reference, &[Meaning::Real])?;
            }
            if !is_adjoint {
                return Ok(i.directional_derivative(unknowns, knowns, seed, out));
            }
            let mut column = vec![0.0; unknowns.len()];
            for (known, sensitivity) in knowns.iter().zip(out) {
                let status = i.directional_derivative(unknowns, &[*known], &[1.0], &mut column);
                if status > Status::Warning {
                    return Ok(status);
                }
                *sensitivity = column.iter().zip(seed).map(|(entry, seed)| entry * seed).sum();
            }
            Ok(Status::OK)
        })())
    })
}

macro_rules! derivatives {
    ($($name:ident, $function:literal, $is_adjoint:literal;)*) => {
        $(pub unsafe fn $name<M: Model>(
            c: Component,
            unknowns: *const ValueReference,
            n_unknowns: usize,
            knowns: *const ValueReference,
            n_knowns: usize,
            seed: *const f64,
            n_seed: usize,
            out: *mut f64,
            n_out: usize,
        ) -> Status {
            let variables = ((unknowns, n_unknowns), (knowns, n_knowns));
            derivative::<M>(c, $function, variables, (seed, n_seed), (out, n_out), $is_adjoint)
        })*
    };
}
derivatives! {
    get_directional_derivative, "fmi3GetDirectionalDerivative", false;
    get_adjoint_derivative, "fmi3GetAdjointDerivative", true;
}
