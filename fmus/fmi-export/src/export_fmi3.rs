//! The exported C functions of FMI 3.0; a part of [`crate::export_fmu`].

/// All functions of `fmi3Functions.h` under their exact names, over the type `Exported` and the static `DEFINITION`.
#[doc(hidden)]
#[macro_export]
macro_rules! export_fmi3_functions {
    () => {
        #[unsafe(no_mangle)]
        pub extern "C" fn fmi3GetVersion() -> CString {
            abi::fmi3::version()
        }
        $crate::instantiate_fmi3! { Exported, DEFINITION;
            fmi3InstantiateModelExchange => Some($crate::Interface::ModelExchange), [], [];
            fmi3InstantiateCoSimulation => Some($crate::Interface::CoSimulation),
                [u8, u8, *const ValueReference, usize], [*const c_void];
            fmi3InstantiateScheduledExecution => None, [], [*const c_void, *const c_void, *const c_void];
        }
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fmi3FreeInstance(c: Component) {
            unsafe { abi::free_instance::<Exported>(c) }
        }
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fmi3CompletedIntegratorStep(
            c: Component,
            _no_set_fmu_state_prior_to_current_point: u8,
            enter_event_mode: *mut u8,
            terminate_simulation: *mut u8,
        ) -> Status {
            unsafe {
                abi::fmi3::completed_integrator_step::<Exported>(c, enter_event_mode, terminate_simulation)
            }
        }
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fmi3DoStep(
            c: Component,
            time: f64,
            step: f64,
            _no_set_fmu_state_prior_to_current_point: u8,
            event_handling_needed: *mut u8,
            terminate_simulation: *mut u8,
            early_return: *mut u8,
            last_successful_time: *mut f64,
        ) -> Status {
            unsafe {
                abi::fmi3::do_step::<Exported>(
                    c,
                    time,
                    step,
                    event_handling_needed,
                    terminate_simulation,
                    early_return,
                    last_successful_time,
                )
            }
        }

        $crate::forward_to_abi! { Exported;
            fmi3ExitInitializationMode => exit_initialization_mode();
            fmi3EnterEventMode => enter_event_mode();
            fmi3Terminate => terminate();
            fmi3Reset => reset();
            fmi3GetFMUState => get_fmu_state(state: *mut FmuState);
            fmi3SetFMUState => set_fmu_state(state: FmuState);
            fmi3FreeFMUState => free_fmu_state(state: *mut FmuState);
            fmi3SerializedFMUStateSize => serialized_fmu_state_size(state: FmuState, size: *mut usize);
            fmi3EnterContinuousTimeMode => enter_continuous_time_mode();
            fmi3SetTime => set_time(time: f64);
            fmi3SetContinuousStates => set_continuous_states(x: *const f64, n: usize);
            fmi3GetContinuousStateDerivatives => get_derivatives(dx: *mut f64, n: usize);
            fmi3GetEventIndicators => get_event_indicators(z: *mut f64, n: usize);
            fmi3GetContinuousStates => get_continuous_states(x: *mut f64, n: usize);
            fmi3GetNominalsOfContinuousStates => get_nominals(nominal: *mut f64, n: usize);
        }
        $crate::forward_to_fmi3! { Exported;
            fmi3SetDebugLogging => set_debug_logging(on: u8, n: usize, categories: *const CString);
            fmi3EnterInitializationMode => enter_initialization_mode(tolerance_defined: u8, tolerance: f64, start: f64, stop_defined: u8, stop: f64);
            fmi3GetFloat64 => get_float64(vr: *const ValueReference, n: usize, value: *mut f64, n_values: usize);
            fmi3GetInt32 => get_int32(vr: *const ValueReference, n: usize, value: *mut i32, n_values: usize);
            fmi3GetInt64 => get_int64(vr: *const ValueReference, n: usize, value: *mut i64, n_values: usize);
            fmi3GetBoolean => get_boolean(vr: *const ValueReference, n: usize, value: *mut u8, n_values: usize);
            fmi3GetString => get_string(vr: *const ValueReference, n: usize, value: *mut CString, n_values: usize);
            fmi3SetFloat64 => set_float64(vr: *const ValueReference, n: usize, value: *const f64, n_values: usize);
            fmi3SetInt32 => set_int32(vr: *const ValueReference, n: usize, value: *const i32, n_values: usize);
            fmi3SetInt64 => set_int64(vr: *const ValueReference, n: usize, value: *const i64, n_values: usize);
            fmi3SetBoolean => set_boolean(vr: *const ValueReference, n: usize, value: *const u8, n_values: usize);
            fmi3SetString => set_string(vr: *const ValueReference, n: usize, value: *const CString, n_values: usize);
            fmi3SerializeFMUState => serialize_fmu_state(state: FmuState, bytes: *mut u8, n: usize);
            fmi3DeserializeFMUState => deserialize_fmu_state(bytes: *const u8, n: usize, state: *mut FmuState);
            fmi3GetDirectionalDerivative => get_directional_derivative(unknowns: *const ValueReference, n_unknowns: usize, knowns: *const ValueReference, n_knowns: usize, seed: *const f64, n_seed: usize, out: *mut f64, n_out: usize);
            fmi3GetAdjointDerivative => get_adjoint_derivative(unknowns: *const ValueReference, n_unknowns: usize, knowns: *const ValueReference, n_knowns: usize, seed: *const f64, n_seed: usize, out: *mut f64, n_out: usize);
            fmi3UpdateDiscreteStates => update_discrete_states(needed: *mut u8, terminate: *mut u8, nominals_changed: *mut u8, values_changed: *mut u8, next_event_defined: *mut u8, next_event: *mut f64);
            fmi3GetNumberOfContinuousStates => number_of_continuous_states(n: *mut usize);
            fmi3GetNumberOfEventIndicators => number_of_event_indicators(n: *mut usize);
            fmi3GetOutputDerivatives => get_output_derivatives(vr: *const ValueReference, n: usize, order: *const i32, value: *mut f64, n_values: usize);
        }
        $crate::absent_types! { Exported;
            fmi3GetFloat32, fmi3GetInt8, fmi3GetUInt8, fmi3GetInt16, fmi3GetUInt16, fmi3GetUInt32, fmi3GetUInt64,
            fmi3SetFloat32, fmi3SetInt8, fmi3SetUInt8, fmi3SetInt16, fmi3SetUInt16, fmi3SetUInt32, fmi3SetUInt64,
        }
        $crate::unsupported! { Exported;
            fmi3GetBinary(_vr: *const ValueReference, _n: usize, _sizes: *mut usize, _values: *mut *const u8, _n_values: usize);
            fmi3SetBinary(_vr: *const ValueReference, _n: usize, _sizes: *const usize, _values: *const *const u8, _n_values: usize);
            fmi3GetClock(_vr: *const ValueReference, _n: usize, _values: *mut u8);
            fmi3SetClock(_vr: *const ValueReference, _n: usize, _values: *const u8);
            fmi3GetNumberOfVariableDependencies(_vr: ValueReference, _n: *mut usize);
            fmi3GetVariableDependencies(_vr: ValueReference, _dependent: *mut usize, _independent: *mut ValueReference, _element: *mut usize, _kinds: *mut i32, _n: usize);
            fmi3EnterConfigurationMode();
            fmi3ExitConfigurationMode();
            fmi3GetIntervalDecimal(_vr: *const ValueReference, _n: usize, _intervals: *mut f64, _qualifiers: *mut i32);
            fmi3GetIntervalFraction(_vr: *const ValueReference, _n: usize, _counters: *mut u64, _resolutions: *mut u64, _qualifiers: *mut i32);
            fmi3GetShiftDecimal(_vr: *const ValueReference, _n: usize, _shifts: *mut f64);
            fmi3GetShiftFraction(_vr: *const ValueReference, _n: usize, _counters: *mut u64, _resolutions: *mut u64);
            fmi3SetIntervalDecimal(_vr: *const ValueReference, _n: usize, _intervals: *const f64);
            fmi3SetIntervalFraction(_vr: *const ValueReference, _n: usize, _counters: *const u64, _resolutions: *const u64);
            fmi3SetShiftDecimal(_vr: *const ValueReference, _n: usize, _shifts: *const f64);
            fmi3SetShiftFraction(_vr: *const ValueReference, _n: usize, _counters: *const u64, _resolutions: *const u64);
            fmi3EvaluateDiscreteStates();
            fmi3EnterStepMode();
            fmi3ActivateModelPartition(_vr: ValueReference, _time: f64);
        }
    };
}

/// Functions that make an instance: arguments of the listed types, after `loggingOn` and at the end, are not used; a
/// part of [`crate::export_fmu`].
#[doc(hidden)]
#[macro_export]
macro_rules! instantiate_fmi3 {
    ($model:ident, $definition:ident; $($function:ident => $interface:expr, [$($inner:ty),*], [$($last:ty),*];)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $function(
                name: CString,
                token: CString,
                resource_path: CString,
                _visible: u8,
                logging_on: u8,
                $(_: $inner,)*
                environment: ComponentEnvironment,
                log_message: Option<LogMessage>,
                $(_: $last,)*
            ) -> Component {
                unsafe {
                    abi::fmi3::instantiate::<$model>(
                        &$definition,
                        $interface,
                        name,
                        token,
                        resource_path,
                        logging_on,
                        environment,
                        log_message,
                    )
                }
            }
        )*
    };
}

/// Exported functions of FMI 3.0 that hand all their arguments on; a part of [`crate::export_fmu`].
#[doc(hidden)]
#[macro_export]
macro_rules! forward_to_fmi3 {
    ($model:ident; $($function:ident => $target:ident($($argument:ident: $type:ty),*);)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $function(c: Component, $($argument: $type),*) -> Status {
                unsafe { abi::fmi3::$target::<$model>(c, $($argument),*) }
            }
        )*
    };
}

/// Get and set functions of types that no variable has; a part of [`crate::export_fmu`].
#[doc(hidden)]
#[macro_export]
macro_rules! absent_types {
    ($model:ident; $($function:ident,)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $function(
                c: Component,
                _vr: *const ValueReference,
                n: usize,
                _values: *mut c_void,
                _n_values: usize,
            ) -> Status {
                unsafe { abi::fmi3::of_absent_type::<$model>(c, stringify!($function), n) }
            }
        )*
    };
}

/// Functions that no FMU of this crate offers; a part of [`crate::export_fmu`].
#[doc(hidden)]
#[macro_export]
macro_rules! unsupported {
    ($model:ident; $($function:ident($($argument:ident: $type:ty),*);)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $function(c: Component, $($argument: $type),*) -> Status {
                unsafe { abi::fmi3::unsupported::<$model>(c, stringify!($function)) }
            }
        )*
    };
}
