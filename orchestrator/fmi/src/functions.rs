//! The C functions of an FMU as a table of pointers, checked once when the library is loaded.
//!
//! Crate `fmi` looks each symbol up; this table keeps the pointers without the per-call `Result`. Functions behind a
//! capability flag may be missing in careless FMUs and are `Option`.

#![allow(unsafe_code, reason = "calls into third-party libraries")]

use fmi::fmi2::binding::*;

type Component = fmi2Component;
type Status = fmi2Status;
type Reference = fmi2ValueReference;

/// Pointers to the C functions of a loaded library, with the signatures of `fmi2FunctionTypes.h`.
macro_rules! function_table {
    (
        $(#[$doc:meta])* $table:ident {
            required { $($name:ident: $symbol:ident($($argument:ty),*) $(-> $result:ty)?,)* }
            optional { $($option:ident: $option_symbol:ident($($option_argument:ty),*) $(-> $option_result:ty)?,)* }
            $(widened { $($wide:ident: $wide_symbol:ident $wide_type:ty,)* })?
        }
    ) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(super) struct $table {
            $(pub(super) $name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
            $(pub(super) $option: Option<unsafe extern "C" fn($($option_argument),*) $(-> $option_result)?>,)*
            $($(pub(super) $wide: $wide_type,)*)?
        }

        impl $table {
            /// The table, or the name of the first required function that is missing.
            pub(super) fn new(binding: &Fmi2Binding) -> Result<Self, &'static str> {
                Ok($table {
                    $($name: *binding.$symbol.as_ref().map_err(|_| stringify!($symbol))?,)*
                    $($option: binding.$option_symbol.as_ref().ok().copied(),)*
                    $($($wide: <$wide_type>::Short(
                        *binding.$wide_symbol.as_ref().map_err(|_| stringify!($wide_symbol))?
                    ),)*)?
                })
            }
        }
    };
}

function_table! {
    /// Functions that exist before an instance does.
    FirstFunctions {
        required {
            get_types_platform: fmi2GetTypesPlatform() -> *const std::ffi::c_char,
            get_version: fmi2GetVersion() -> *const std::ffi::c_char,
            instantiate: fmi2Instantiate(
                fmi2String, fmi2Type, fmi2String, fmi2String, *const fmi2CallbackFunctions, fmi2Boolean, fmi2Boolean
            ) -> Component,
        }
        optional {}
    }
}

function_table! {
    /// Functions that both interfaces share.
    CommonFunctions {
        required {
            free_instance: fmi2FreeInstance(Component),
            setup_experiment: fmi2SetupExperiment(
                Component, fmi2Boolean, fmi2Real, fmi2Real, fmi2Boolean, fmi2Real
            ) -> Status,
            enter_initialization_mode: fmi2EnterInitializationMode(Component) -> Status,
            exit_initialization_mode: fmi2ExitInitializationMode(Component) -> Status,
            terminate: fmi2Terminate(Component) -> Status,
            reset: fmi2Reset(Component) -> Status,
            get_real: fmi2GetReal(Component, *const Reference, usize, *mut fmi2Real) -> Status,
            get_boolean: fmi2GetBoolean(Component, *const Reference, usize, *mut fmi2Boolean) -> Status,
            get_string: fmi2GetString(Component, *const Reference, usize, *mut fmi2String) -> Status,
            set_real: fmi2SetReal(Component, *const Reference, usize, *const fmi2Real) -> Status,
            set_boolean: fmi2SetBoolean(Component, *const Reference, usize, *const fmi2Boolean) -> Status,
            set_string: fmi2SetString(Component, *const Reference, usize, *const fmi2String) -> Status,
        }
        optional {
            set_debug_logging: fmi2SetDebugLogging(Component, fmi2Boolean, usize, *const fmi2String) -> Status,
            get_state: fmi2GetFMUstate(Component, *mut fmi2FMUstate) -> Status,
            set_state: fmi2SetFMUstate(Component, fmi2FMUstate) -> Status,
            free_state: fmi2FreeFMUstate(Component, *mut fmi2FMUstate) -> Status,
            serialized_state_size: fmi2SerializedFMUstateSize(Component, fmi2FMUstate, *mut usize) -> Status,
            serialize_state: fmi2SerializeFMUstate(Component, fmi2FMUstate, *mut fmi2Byte, usize) -> Status,
            deserialize_state: fmi2DeSerializeFMUstate(
                Component, *const fmi2Byte, usize, *mut fmi2FMUstate
            ) -> Status,
            directional_derivative: fmi2GetDirectionalDerivative(
                Component, *const Reference, usize, *const Reference, usize, *const fmi2Real, *mut fmi2Real
            ) -> Status,
        }
        widened {
            get_integer: fmi2GetInteger GetInteger,
            set_integer: fmi2SetInteger SetInteger,
        }
    }
}

type Get<T> = unsafe extern "C" fn(Component, *const Reference, usize, *mut T) -> Status;
type Set<T> = unsafe extern "C" fn(Component, *const Reference, usize, *const T) -> Status;

/// Reading integers, by the width that the functions of a library have.
#[derive(Clone, Copy)]
pub(super) enum GetInteger {
    /// FMI 2.0.
    Short(Get<i32>),
    /// FMI 3.0 and workers.
    Long(Get<i64>),
}

impl GetInteger {
    /// Reads into `values`; `scratch` is memory for the call.
    ///
    /// # Safety
    /// The component is alive, and `values` is as long as `references`.
    pub(super) unsafe fn call(
        self,
        component: Component,
        references: &[Reference],
        values: &mut [i64],
        scratch: &mut Vec<i32>,
    ) -> Status {
        match self {
            // SAFETY: promised by the caller.
            GetInteger::Long(get) => unsafe {
                get(component, references.as_ptr(), references.len(), values.as_mut_ptr())
            },
            GetInteger::Short(get) => {
                scratch.clear();
                scratch.resize(values.len(), 0);
                // SAFETY: promised by the caller; the scratch memory has the same length.
                let status =
                    unsafe { get(component, references.as_ptr(), references.len(), scratch.as_mut_ptr()) };
                values.iter_mut().zip(scratch.iter()).for_each(|(value, &short)| *value = short.into());
                status
            }
        }
    }
}

/// Setting integers, by the width that the functions of a library have.
#[derive(Clone, Copy)]
pub(super) enum SetInteger {
    /// FMI 2.0.
    Short(Set<i32>),
    /// FMI 3.0 and workers.
    Long(Set<i64>),
}

impl SetInteger {
    /// Sets `values`; a value beyond 32 bits is discarded where the library takes no more, none is set then. `scratch`
    /// is memory for the call.
    ///
    /// # Safety
    /// The component is alive, and `values` is as long as `references`.
    pub(super) unsafe fn call(
        self,
        component: Component,
        references: &[Reference],
        values: &[i64],
        scratch: &mut Vec<i32>,
    ) -> Status {
        match self {
            // SAFETY: promised by the caller.
            SetInteger::Long(set) => unsafe {
                set(component, references.as_ptr(), references.len(), values.as_ptr())
            },
            SetInteger::Short(set) => {
                scratch.clear();
                for &value in values {
                    let Ok(short) = i32::try_from(value) else { return fmi2Status_fmi2Discard };
                    scratch.push(short);
                }
                // SAFETY: promised by the caller; the scratch memory has the same length.
                unsafe { set(component, references.as_ptr(), references.len(), scratch.as_ptr()) }
            }
        }
    }
}

function_table! {
    /// Functions of Co-Simulation.
    SlaveFunctions {
        required {
            do_step: fmi2DoStep(Component, fmi2Real, fmi2Real, fmi2Boolean) -> Status,
        }
        optional {
            set_real_input_derivatives: fmi2SetRealInputDerivatives(
                Component, *const Reference, usize, *const fmi2Integer, *const fmi2Real
            ) -> Status,
            get_real_output_derivatives: fmi2GetRealOutputDerivatives(
                Component, *const Reference, usize, *const fmi2Integer, *mut fmi2Real
            ) -> Status,
            get_real_status: fmi2GetRealStatus(Component, fmi2StatusKind, *mut fmi2Real) -> Status,
            get_boolean_status: fmi2GetBooleanStatus(Component, fmi2StatusKind, *mut fmi2Boolean) -> Status,
        }
    }
}

function_table! {
    /// Functions of Model Exchange.
    ModelFunctions {
        required {
            enter_event_mode: fmi2EnterEventMode(Component) -> Status,
            new_discrete_states: fmi2NewDiscreteStates(Component, *mut fmi2EventInfo) -> Status,
            enter_continuous_time_mode: fmi2EnterContinuousTimeMode(Component) -> Status,
            completed_integrator_step: fmi2CompletedIntegratorStep(
                Component, fmi2Boolean, *mut fmi2Boolean, *mut fmi2Boolean
            ) -> Status,
            set_time: fmi2SetTime(Component, fmi2Real) -> Status,
            set_continuous_states: fmi2SetContinuousStates(Component, *const fmi2Real, usize) -> Status,
            get_continuous_states: fmi2GetContinuousStates(Component, *mut fmi2Real, usize) -> Status,
            get_derivatives: fmi2GetDerivatives(Component, *mut fmi2Real, usize) -> Status,
            get_event_indicators: fmi2GetEventIndicators(Component, *mut fmi2Real, usize) -> Status,
            get_nominals: fmi2GetNominalsOfContinuousStates(Component, *mut fmi2Real, usize) -> Status,
        }
        optional {}
    }
}
