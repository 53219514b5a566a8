//! Call rules: which function may be called in which state, as one table.
//!
//! FMI 2.0.4, tables of section 3.2.3 (Model Exchange) and 4.2.4 (Co-Simulation).

use crate::values::Interface;

/// State of an instance in the calling sequence.
#[repr(u8)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Mode {
    Instantiated = 0,
    InitializationMode = 1,
    /// Model Exchange.
    EventMode = 2,
    /// Model Exchange.
    ContinuousTimeMode = 3,
    /// Co-Simulation: at a communication point.
    StepComplete = 4,
    /// Co-Simulation: the last step returned `fmi2Discard`.
    StepFailed = 5,
    Terminated = 6,
    Error = 7,
    Fatal = 8,
}

impl Mode {
    /// Every state, in the order of their numbers.
    pub const ALL: [Mode; 9] = [
        Mode::Instantiated,
        Mode::InitializationMode,
        Mode::EventMode,
        Mode::ContinuousTimeMode,
        Mode::StepComplete,
        Mode::StepFailed,
        Mode::Terminated,
        Mode::Error,
        Mode::Fatal,
    ];

    /// Name as in the standard.
    pub fn name(self) -> &'static str {
        match self {
            Mode::Instantiated => "instantiated",
            Mode::InitializationMode => "Initialization Mode",
            Mode::EventMode => "Event Mode",
            Mode::ContinuousTimeMode => "Continuous-Time Mode",
            Mode::StepComplete => "step complete",
            Mode::StepFailed => "step failed",
            Mode::Terminated => "terminated",
            Mode::Error => "error",
            Mode::Fatal => "fatal",
        }
    }

    const fn bit(self) -> u16 {
        1 << self as u8
    }
}

const INST: u16 = Mode::Instantiated.bit();
const INIT: u16 = Mode::InitializationMode.bit();
const EVENT: u16 = Mode::EventMode.bit();
const CONT: u16 = Mode::ContinuousTimeMode.bit();
const DONE: u16 = Mode::StepComplete.bit();
const FAILED: u16 = Mode::StepFailed.bit();
const TERM: u16 = Mode::Terminated.bit();
const ERROR: u16 = Mode::Error.bit();

/// All states in which the instance still exists and may be used at all.
const LIVE: u16 = INST | INIT | EVENT | CONT | DONE | FAILED | TERM | ERROR;
/// Values can be read; after an error for debugging only.
const READ: u16 = INIT | EVENT | CONT | DONE | FAILED | TERM | ERROR;

macro_rules! call_rules {
    ($( $function:ident: $me:expr, $cs:expr; )*) => {
        /// A function of the C interface that belongs to an instance.
        #[allow(non_camel_case_types, missing_docs)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Function { $($function),* }

        impl Function {
            /// Every function of the table.
            pub const ALL: &'static [Function] = &[$(Function::$function),*];

            /// Exact C name.
            pub fn name(self) -> &'static str {
                match self { $(Function::$function => stringify!($function)),* }
            }

            const fn rule(self) -> (u16, u16) {
                match self { $(Function::$function => ($me, $cs)),* }
            }
        }
    };
}

// States in which a function may be called: in Model Exchange, in Co-Simulation.
call_rules! {
    fmi2SetDebugLogging:              LIVE, LIVE;
    fmi2FreeInstance:                 LIVE, LIVE;
    fmi2SetupExperiment:              INST, INST;
    fmi2EnterInitializationMode:      INST, INST;
    fmi2ExitInitializationMode:       INIT, INIT;
    fmi2Terminate:                    EVENT | CONT, DONE | FAILED;
    fmi2Reset:                        LIVE, LIVE;
    fmi2GetReal:                      READ, READ;
    fmi2GetInteger:                   READ, READ;
    fmi2GetBoolean:                   READ, READ;
    fmi2GetString:                    READ, READ;
    fmi2SetReal:                      INST | INIT | EVENT | CONT, INST | INIT | DONE;
    fmi2SetInteger:                   INST | INIT | EVENT, INST | INIT | DONE;
    fmi2SetBoolean:                   INST | INIT | EVENT, INST | INIT | DONE;
    fmi2SetString:                    INST | INIT | EVENT, INST | INIT | DONE;
    fmi2GetFMUstate:                  LIVE, LIVE;
    fmi2SetFMUstate:                  LIVE, LIVE;
    fmi2FreeFMUstate:                 LIVE, LIVE;
    fmi2SerializedFMUstateSize:       LIVE, LIVE;
    fmi2SerializeFMUstate:            LIVE, LIVE;
    fmi2DeSerializeFMUstate:          LIVE, LIVE;
    fmi2GetDirectionalDerivative:     READ, READ;

    fmi2EnterEventMode:               EVENT | CONT, 0;
    fmi2NewDiscreteStates:            EVENT, 0;
    fmi2EnterContinuousTimeMode:      EVENT, 0;
    fmi2CompletedIntegratorStep:      CONT, 0;
    fmi2SetTime:                      EVENT | CONT, 0;
    fmi2SetContinuousStates:          CONT, 0;
    fmi2GetDerivatives:               EVENT | CONT | TERM | ERROR, 0;
    fmi2GetEventIndicators:           INIT | EVENT | CONT | TERM | ERROR, 0;
    fmi2GetContinuousStates:          INIT | EVENT | CONT | TERM | ERROR, 0;
    fmi2GetNominalsOfContinuousStates: INST | EVENT | CONT | TERM | ERROR, 0;

    fmi2SetRealInputDerivatives:      0, INST | INIT | DONE;
    fmi2GetRealOutputDerivatives:     0, DONE | FAILED | TERM | ERROR;
    fmi2DoStep:                       0, DONE;
    fmi2CancelStep:                   0, 0; // no step is ever in progress: steps are synchronous
    fmi2GetStatus:                    0, DONE | FAILED | TERM;
    fmi2GetRealStatus:                0, DONE | FAILED | TERM;
    fmi2GetIntegerStatus:             0, DONE | FAILED | TERM;
    fmi2GetBooleanStatus:             0, DONE | FAILED | TERM;
    fmi2GetStringStatus:              0, DONE | FAILED | TERM;
}

/// True where the table allows the call.
#[inline]
pub fn is_allowed(function: Function, interface: Interface, mode: Mode) -> bool {
    let (model_exchange, co_simulation) = function.rule();
    let states = match interface {
        Interface::ModelExchange => model_exchange,
        Interface::CoSimulation => co_simulation,
    };
    states & mode.bit() != 0
}

/// The states in which `function` may be called, for messages.
pub fn allowed_states(function: Function, interface: Interface) -> String {
    let names: Vec<&str> =
        Mode::ALL.iter().filter(|m| is_allowed(function, interface, **m)).map(|m| m.name()).collect();
    if names.is_empty() { "no state of this interface".into() } else { names.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Interface::{CoSimulation, ModelExchange};

    /// Call sequences of the standard, as letters: what may be called next in a state.
    fn names(interface: Interface, mode: Mode) -> Vec<&'static str> {
        Function::ALL.iter().filter(|f| is_allowed(**f, interface, mode)).map(|f| f.name()).collect()
    }

    #[test]
    fn the_table_names_every_function_of_an_instance_once() {
        let mut all: Vec<_> = Function::ALL.iter().map(|f| f.name()).collect();
        all.sort_unstable();
        all.dedup();
        // 44 functions in fmi2Functions.h, less fmi2GetTypesPlatform, fmi2GetVersion, fmi2Instantiate.
        assert_eq!(all.len(), 41);
    }

    #[test]
    fn only_the_own_interface_can_step() {
        for mode in Mode::ALL {
            let me = names(ModelExchange, mode);
            let cs = names(CoSimulation, mode);
            assert!(!me.contains(&"fmi2DoStep") && !cs.contains(&"fmi2GetDerivatives"), "{mode:?}");
        }
        assert!(names(CoSimulation, Mode::StepComplete).contains(&"fmi2DoStep"));
        assert!(names(ModelExchange, Mode::ContinuousTimeMode).contains(&"fmi2GetDerivatives"));
    }

    #[test]
    fn a_fatal_instance_takes_no_call_and_an_error_only_what_helps_to_recover() {
        for interface in [ModelExchange, CoSimulation] {
            assert!(names(interface, Mode::Fatal).is_empty());
            let after_error = names(interface, Mode::Error);
            for helps in ["fmi2Reset", "fmi2FreeInstance", "fmi2SetFMUstate", "fmi2GetReal"] {
                assert!(after_error.contains(&helps));
            }
            for steps in ["fmi2DoStep", "fmi2SetReal", "fmi2SetTime", "fmi2Terminate"] {
                assert!(!after_error.contains(&steps));
            }
        }
    }
}
