//! The macro that turns a model into the exported C functions of an FMU library.

/// Exports model `$model` as an FMU: all functions of `fmi2Functions.h` and of `fmi3Functions.h` under their exact
/// names, so that one library serves an archive of each version.
///
/// Goes into a crate of type `cdylib`, once:
///
/// ```
/// # use fmi_export::{Identity, Model, Outcome, Real, Scalar, Table, Values};
/// # struct Double { u: Real, y: Real }
/// # impl Model for Double {
/// #     const IDENTITY: Identity = Identity {
/// #         model_identifier: "double", model_name: "double", description: "y = 2 u", version: "1",
/// #         author: "me", generation_tool: "fmi-export", stop_time: 1.0, step_size: 0.1,
/// #     };
/// #     fn declare(t: &mut Table) -> Self {
/// #         Double { u: t.input("u").real(0.0), y: t.output("y").computed() }
/// #     }
/// #     fn equations<S: Scalar>(&self, v: &mut Values<S>) -> Outcome {
/// #         v[self.y] = v[self.u] * 2.0;
/// #         Ok(())
/// #     }
/// # }
/// fmi_export::export_fmu!(Double);
/// # fn main() {}
/// ```
#[macro_export]
macro_rules! export_fmu {
    ($model:ty) => {
        mod fmi2_functions {
            #![allow(
                unsafe_code,
                non_snake_case,
                missing_docs,
                clippy::missing_safety_doc,
                clippy::too_many_arguments,
                clippy::undocumented_unsafe_blocks
            )]
            use super::*;
            use $crate::abi;
            use $crate::ctypes::{
                Bool, CString, CallbackFunctions, Component, ComponentEnvironment, EventInfo, FmuState,
                LogMessage, Status, ValueReference,
            };
            use ::std::ffi::{c_char, c_int, c_void};

            type Exported = $model;
            static DEFINITION: ::std::sync::OnceLock<$crate::Definition<Exported>> =
                ::std::sync::OnceLock::new();

            #[unsafe(no_mangle)]
            pub extern "C" fn fmi2GetTypesPlatform() -> CString {
                abi::types_platform()
            }
            #[unsafe(no_mangle)]
            pub extern "C" fn fmi2GetVersion() -> CString {
                abi::version()
            }
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmi2Instantiate(
                name: CString,
                kind: c_int,
                guid: CString,
                resource_location: CString,
                functions: *const CallbackFunctions,
                _visible: Bool,
                logging_on: Bool,
            ) -> Component {
                unsafe {
                    abi::instantiate::<Exported>(
                        &DEFINITION,
                        name,
                        kind,
                        guid,
                        resource_location,
                        functions,
                        logging_on,
                    )
                }
            }
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmi2FreeInstance(c: Component) {
                unsafe { abi::free_instance::<Exported>(c) }
            }
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmi2DoStep(
                c: Component,
                time: f64,
                step: f64,
                _no_set_fmu_state_prior_to_current_point: Bool,
            ) -> Status {
                unsafe { abi::do_step::<Exported>(c, time, step) }
            }

            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmi2CompletedIntegratorStep(
                c: Component,
                _no_set_fmu_state_prior_to_current_point: Bool,
                enter_event_mode: *mut Bool,
                terminate_simulation: *mut Bool,
            ) -> Status {
                unsafe {
                    abi::completed_integrator_step::<Exported>(c, enter_event_mode, terminate_simulation)
                }
            }

            $crate::forward_to_abi! { Exported;
                fmi2SetDebugLogging => set_debug_logging(on: Bool, n: usize, categories: *const CString);
                fmi2SetupExperiment => setup_experiment(tolerance_defined: Bool, tolerance: f64, start: f64, stop_defined: Bool, stop: f64);
                fmi2EnterInitializationMode => enter_initialization_mode();
                fmi2ExitInitializationMode => exit_initialization_mode();
                fmi2Terminate => terminate();
                fmi2Reset => reset();
                fmi2GetReal => get_real(vr: *const ValueReference, n: usize, value: *mut f64);
                fmi2GetInteger => get_integer(vr: *const ValueReference, n: usize, value: *mut c_int);
                fmi2GetBoolean => get_boolean(vr: *const ValueReference, n: usize, value: *mut Bool);
                fmi2GetString => get_string(vr: *const ValueReference, n: usize, value: *mut CString);
                fmi2SetReal => set_real(vr: *const ValueReference, n: usize, value: *const f64);
                fmi2SetInteger => set_integer(vr: *const ValueReference, n: usize, value: *const c_int);
                fmi2SetBoolean => set_boolean(vr: *const ValueReference, n: usize, value: *const Bool);
                fmi2SetString => set_string(vr: *const ValueReference, n: usize, value: *const CString);
                fmi2GetFMUstate => get_fmu_state(state: *mut FmuState);
                fmi2SetFMUstate => set_fmu_state(state: FmuState);
                fmi2FreeFMUstate => free_fmu_state(state: *mut FmuState);
                fmi2SerializedFMUstateSize => serialized_fmu_state_size(state: FmuState, size: *mut usize);
                fmi2SerializeFMUstate => serialize_fmu_state(state: FmuState, bytes: *mut c_char, size: usize);
                fmi2DeSerializeFMUstate => deserialize_fmu_state(bytes: *const c_char, size: usize, state: *mut FmuState);
                fmi2GetDirectionalDerivative => get_directional_derivative(unknown: *const ValueReference, n_unknown: usize, known: *const ValueReference, n_known: usize, seed: *const f64, value: *mut f64);
                fmi2EnterEventMode => enter_event_mode();
                fmi2NewDiscreteStates => new_discrete_states(info: *mut EventInfo);
                fmi2EnterContinuousTimeMode => enter_continuous_time_mode();
                fmi2SetTime => set_time(time: f64);
                fmi2SetContinuousStates => set_continuous_states(x: *const f64, n: usize);
                fmi2GetDerivatives => get_derivatives(dx: *mut f64, n: usize);
                fmi2GetEventIndicators => get_event_indicators(z: *mut f64, n: usize);
                fmi2GetContinuousStates => get_continuous_states(x: *mut f64, n: usize);
                fmi2GetNominalsOfContinuousStates => get_nominals(nominal: *mut f64, n: usize);
                fmi2SetRealInputDerivatives => set_real_input_derivatives(vr: *const ValueReference, n: usize, order: *const c_int, value: *const f64);
                fmi2GetRealOutputDerivatives => get_real_output_derivatives(vr: *const ValueReference, n: usize, order: *const c_int, value: *mut f64);
                fmi2CancelStep => cancel_step();
                fmi2GetStatus => get_status(kind: c_int, value: *mut Status);
                fmi2GetRealStatus => get_real_status(kind: c_int, value: *mut f64);
                fmi2GetIntegerStatus => get_integer_status(kind: c_int, value: *mut c_int);
                fmi2GetBooleanStatus => get_boolean_status(kind: c_int, value: *mut Bool);
                fmi2GetStringStatus => get_string_status(kind: c_int, value: *mut CString);
            }
            $crate::export_fmi3_functions! {}
        }
    };
}

/// Exported functions that hand all their arguments on; a part of [`export_fmu`].
#[doc(hidden)]
#[macro_export]
macro_rules! forward_to_abi {
    ($model:ident; $($function:ident => $target:ident($($argument:ident: $type:ty),*);)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $function(c: Component, $($argument: $type),*) -> Status {
                unsafe { abi::$target::<$model>(c, $($argument),*) }
            }
        )*
    };
}
