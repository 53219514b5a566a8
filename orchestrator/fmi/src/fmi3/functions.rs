//! The C functions of an FMI 3.0 library as a table of pointers, with the signatures of `fmi3FunctionTypes.h`.
//!
//! FMI 3.0 asks every library for all of them. Those that not every FMU is asked for are `Option` here, so that one
//! that lacks what nobody calls still runs.

#![allow(unsafe_code, reason = "asking a third-party library")]

use fmi::fmi3::binding::*;

type Instance = fmi3Instance;
type Status = fmi3Status;
type Simple = unsafe extern "C" fn(Instance) -> Status;
type Getter<T> = Option<unsafe extern "C" fn(Instance, *const u32, usize, *mut T, usize) -> Status>;
type Setter<T> = Option<unsafe extern "C" fn(Instance, *const u32, usize, *const T, usize) -> Status>;
type ReadStates = unsafe extern "C" fn(Instance, *mut f64, usize) -> Status;
type Count = unsafe extern "C" fn(Instance, *mut usize) -> Status;

macro_rules! table {
    (
        $(#[$doc:meta])* $table:ident {
            required { $($name:ident: $symbol:ident: $type:ty,)* }
            optional { $($option:ident: $option_symbol:ident: $option_type:ty,)* }
        }
    ) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(crate) struct $table {
            $(pub(super) $name: $type,)*
            $(pub(super) $option: $option_type,)*
        }

        impl $table {
            /// The table, or the name of the first required function that is missing.
            pub(crate) fn new(binding: &Fmi3Binding) -> Result<Self, &'static str> {
                Ok($table {
                    $($name: *binding.$symbol.as_ref().map_err(|_| stringify!($symbol))?,)*
                    $($option: binding.$option_symbol.as_ref().ok().copied(),)*
                })
            }
        }
    };
}

table! {
    /// Functions that both interfaces share, and those of one of them that an FMU of the other may lack.
    Functions {
        required {
            get_version: fmi3GetVersion: unsafe extern "C" fn() -> *const std::ffi::c_char,
            free_instance: fmi3FreeInstance: unsafe extern "C" fn(Instance),
            enter_initialization_mode: fmi3EnterInitializationMode:
                unsafe extern "C" fn(Instance, bool, f64, f64, bool, f64) -> Status,
            exit_initialization_mode: fmi3ExitInitializationMode: Simple,
            terminate: fmi3Terminate: Simple,
            reset: fmi3Reset: Simple,
        }
        optional {
            set_debug_logging: fmi3SetDebugLogging:
                Option<unsafe extern "C" fn(Instance, bool, usize, *const fmi3String) -> Status>,
            enter_configuration_mode: fmi3EnterConfigurationMode: Option<Simple>,
            exit_configuration_mode: fmi3ExitConfigurationMode: Option<Simple>,
            get_float32: fmi3GetFloat32: Getter<f32>,
            get_float64: fmi3GetFloat64: Getter<f64>,
            get_int8: fmi3GetInt8: Getter<i8>,
            get_uint8: fmi3GetUInt8: Getter<u8>,
            get_int16: fmi3GetInt16: Getter<i16>,
            get_uint16: fmi3GetUInt16: Getter<u16>,
            get_int32: fmi3GetInt32: Getter<i32>,
            get_uint32: fmi3GetUInt32: Getter<u32>,
            get_int64: fmi3GetInt64: Getter<i64>,
            get_uint64: fmi3GetUInt64: Getter<u64>,
            get_boolean: fmi3GetBoolean: Getter<bool>,
            get_string: fmi3GetString: Getter<fmi3String>,
            set_float32: fmi3SetFloat32: Setter<f32>,
            set_float64: fmi3SetFloat64: Setter<f64>,
            set_int8: fmi3SetInt8: Setter<i8>,
            set_uint8: fmi3SetUInt8: Setter<u8>,
            set_int16: fmi3SetInt16: Setter<i16>,
            set_uint16: fmi3SetUInt16: Setter<u16>,
            set_int32: fmi3SetInt32: Setter<i32>,
            set_uint32: fmi3SetUInt32: Setter<u32>,
            set_int64: fmi3SetInt64: Setter<i64>,
            set_uint64: fmi3SetUInt64: Setter<u64>,
            set_boolean: fmi3SetBoolean: Setter<bool>,
            set_string: fmi3SetString: Setter<fmi3String>,
            get_binary: fmi3GetBinary: Option<
                unsafe extern "C" fn(Instance, *const u32, usize, *mut usize, *mut fmi3Binary, usize) -> Status
            >,
            set_binary: fmi3SetBinary: Option<
                unsafe extern "C" fn(Instance, *const u32, usize, *const usize, *const fmi3Binary, usize) -> Status
            >,
            get_state: fmi3GetFMUState: Option<unsafe extern "C" fn(Instance, *mut fmi3FMUState) -> Status>,
            set_state: fmi3SetFMUState: Option<unsafe extern "C" fn(Instance, fmi3FMUState) -> Status>,
            free_state: fmi3FreeFMUState: Option<unsafe extern "C" fn(Instance, *mut fmi3FMUState) -> Status>,
            serialized_state_size: fmi3SerializedFMUStateSize:
                Option<unsafe extern "C" fn(Instance, fmi3FMUState, *mut usize) -> Status>,
            serialize_state: fmi3SerializeFMUState:
                Option<unsafe extern "C" fn(Instance, fmi3FMUState, *mut u8, usize) -> Status>,
            deserialize_state: fmi3DeserializeFMUState:
                Option<unsafe extern "C" fn(Instance, *const u8, usize, *mut fmi3FMUState) -> Status>,
            directional_derivative: fmi3GetDirectionalDerivative: Option<
                unsafe extern "C" fn(
                    Instance, *const u32, usize, *const u32, usize, *const f64, usize, *mut f64, usize
                ) -> Status
            >,
            output_derivatives: fmi3GetOutputDerivatives:
                Option<unsafe extern "C" fn(Instance, *const u32, usize, *const i32, *mut f64, usize) -> Status>,
        }
    }
}

impl Functions {
    /// Version that the library says it follows.
    pub(crate) fn version(&self) -> String {
        // SAFETY: the function takes nothing and returns a static C string.
        crate::library::text(unsafe { (self.get_version)() })
    }
}

table! {
    /// Functions of Co-Simulation.
    SlaveFunctions {
        required {
            instantiate: fmi3InstantiateCoSimulation: unsafe extern "C" fn(
                fmi3String, fmi3String, fmi3String, bool, bool, bool, bool, *const u32, usize,
                fmi3InstanceEnvironment, fmi3LogMessageCallback, fmi3IntermediateUpdateCallback
            ) -> Instance,
            do_step: fmi3DoStep: unsafe extern "C" fn(
                Instance, f64, f64, bool, *mut bool, *mut bool, *mut bool, *mut f64
            ) -> Status,
        }
        optional {}
    }
}

table! {
    /// Functions of Model Exchange.
    ModelFunctions {
        required {
            instantiate: fmi3InstantiateModelExchange: unsafe extern "C" fn(
                fmi3String, fmi3String, fmi3String, bool, bool, fmi3InstanceEnvironment, fmi3LogMessageCallback
            ) -> Instance,
            enter_event_mode: fmi3EnterEventMode: Simple,
            update_discrete_states: fmi3UpdateDiscreteStates: unsafe extern "C" fn(
                Instance, *mut bool, *mut bool, *mut bool, *mut bool, *mut bool, *mut f64
            ) -> Status,
            enter_continuous_time_mode: fmi3EnterContinuousTimeMode: Simple,
            completed_integrator_step: fmi3CompletedIntegratorStep:
                unsafe extern "C" fn(Instance, bool, *mut bool, *mut bool) -> Status,
            set_time: fmi3SetTime: unsafe extern "C" fn(Instance, f64) -> Status,
            set_continuous_states: fmi3SetContinuousStates:
                unsafe extern "C" fn(Instance, *const f64, usize) -> Status,
            get_continuous_states: fmi3GetContinuousStates: ReadStates,
            get_derivatives: fmi3GetContinuousStateDerivatives: ReadStates,
            get_event_indicators: fmi3GetEventIndicators: ReadStates,
            get_nominals: fmi3GetNominalsOfContinuousStates: ReadStates,
        }
        optional {
            count_states: fmi3GetNumberOfContinuousStates: Option<Count>,
            count_event_indicators: fmi3GetNumberOfEventIndicators: Option<Count>,
        }
    }
}
