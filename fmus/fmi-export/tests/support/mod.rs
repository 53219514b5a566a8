//! A thin importer for the tests: calls the exported C functions of the model that the test file exports.

/// Exports `$model` and gives a type `Fmu` that calls it.
macro_rules! importer {
    ($model:ty) => {
        fmi_export::export_fmu!($model);

        use fmi_export::ctypes::{CallbackFunctions, Component, EventInfo, FmuState, Status};
        use std::ffi::{CStr, CString, c_void};
        use std::sync::Mutex;

        /// Log messages of the FMU: status, category, message.
        pub(crate) type Log = Mutex<Vec<(Status, String, String)>>;

        /// The callback is variadic in C; without arguments after the message the fixed form is the same call.
        unsafe extern "C" fn collect(
            environment: *mut c_void,
            _instance: *const i8,
            status: Status,
            category: *const i8,
            message: *const i8,
        ) {
            let text = |p: *const i8| unsafe { CStr::from_ptr(p) }.to_str().unwrap().to_owned();
            let log = unsafe { &*environment.cast::<Log>() };
            log.lock().unwrap().push((status, text(category), text(message)));
        }

        pub(crate) struct Fmu {
            pub(crate) c: Component,
            pub(crate) log: Box<Log>,
        }

        #[allow(dead_code)]
        impl Fmu {
            pub(crate) fn guid() -> String {
                fmi_export::Definition::<$model>::new().guid
            }

            pub(crate) fn table() -> fmi_export::Table {
                fmi_export::Table::of::<$model>().1
            }

            pub(crate) fn vr(name: &str) -> u32 {
                use fmi_export::Kind;
                match Self::table().by_name(name).unwrap_or_else(|| panic!("no variable {name}")).kind {
                    Kind::Real { handle, .. } => handle.value_reference(),
                    ref other => panic!("{name} is not a Real: {other:?}"),
                }
            }

            /// 0: Model Exchange, 1: Co-Simulation.
            pub(crate) fn instantiate_with(kind: i32, guid: &str, logging: bool) -> Self {
                let log: Box<Log> = Box::default();
                let callbacks = CallbackFunctions {
                    logger: Some(unsafe {
                        std::mem::transmute::<*const c_void, fmi_export::ctypes::CallbackLogger>(
                            collect as *const c_void,
                        )
                    }),
                    allocate_memory: None,
                    free_memory: None,
                    step_finished: None,
                    component_environment: (&raw const *log).cast_mut().cast(),
                };
                let (name, guid) = (CString::new("test").unwrap(), CString::new(guid).unwrap());
                let c = unsafe {
                    fmi2_functions::fmi2Instantiate(
                        name.as_ptr(),
                        kind,
                        guid.as_ptr(),
                        std::ptr::null(),
                        &callbacks,
                        0,
                        i32::from(logging),
                    )
                };
                Self { c, log }
            }

            pub(crate) fn new(kind: i32) -> Self {
                let fmu = Self::instantiate_with(kind, &Self::guid(), false);
                assert!(!fmu.c.is_null(), "{:?}", fmu.log);
                fmu
            }

            /// Initialized instance that starts at 0 s.
            pub(crate) fn started(kind: i32) -> Self {
                let fmu = Self::new(kind);
                fmu.start();
                fmu
            }

            pub(crate) fn start(&self) {
                unsafe {
                    assert_eq!(fmi2_functions::fmi2SetupExperiment(self.c, 0, 0.0, 0.0, 0, 0.0), Status::OK);
                    assert_eq!(fmi2_functions::fmi2EnterInitializationMode(self.c), Status::OK);
                    assert_eq!(fmi2_functions::fmi2ExitInitializationMode(self.c), Status::OK);
                }
            }

            pub(crate) fn get(&self, name: &str) -> f64 {
                let (vr, mut value) = (Self::vr(name), f64::NAN);
                assert_eq!(unsafe { fmi2_functions::fmi2GetReal(self.c, &vr, 1, &mut value) }, Status::OK);
                value
            }

            pub(crate) fn try_set(&self, name: &str, value: f64) -> Status {
                unsafe { fmi2_functions::fmi2SetReal(self.c, &Self::vr(name), 1, &value) }
            }

            pub(crate) fn set(&self, name: &str, value: f64) {
                assert_eq!(self.try_set(name, value), Status::OK, "{:?}", self.log);
            }

            pub(crate) fn step(&self, t: f64, h: f64) -> Status {
                unsafe { fmi2_functions::fmi2DoStep(self.c, t, h, 1) }
            }

            pub(crate) fn ramp(&self, name: &str, order: i32, rate: f64) {
                let status = unsafe {
                    fmi2_functions::fmi2SetRealInputDerivatives(self.c, &Self::vr(name), 1, &order, &rate)
                };
                assert_eq!(status, Status::OK, "{:?}", self.log);
            }

            pub(crate) fn new_discrete_states(&self) -> EventInfo {
                let mut info = EventInfo::default();
                let status = unsafe { fmi2_functions::fmi2NewDiscreteStates(self.c, &mut info) };
                assert_eq!(status, Status::OK, "{:?}", self.log);
                info
            }

            pub(crate) fn save(&self) -> FmuState {
                let mut state = std::ptr::null_mut();
                assert_eq!(unsafe { fmi2_functions::fmi2GetFMUstate(self.c, &mut state) }, Status::OK);
                state
            }

            pub(crate) fn last_message(&self) -> String {
                self.log.lock().unwrap().last().map_or_else(String::new, |m| m.2.clone())
            }
        }

        impl Drop for Fmu {
            fn drop(&mut self) {
                unsafe { fmi2_functions::fmi2FreeInstance(self.c) }
            }
        }
    };
}
