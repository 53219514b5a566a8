//! Calls of FMI as bytes: what is asked of a worker, in the order of the arguments.

/// C names of the functions by number; 0 stands for none.
pub(super) const NAMES: [&str; 39] = [
    "no function",
    "the loading of its library",
    "fmi2Instantiate",
    "fmi2FreeInstance",
    "fmi2SetupExperiment",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2Terminate",
    "fmi2Reset",
    "fmi2GetReal",
    "fmi2GetInteger",
    "fmi2GetBoolean",
    "fmi2GetString",
    "fmi2SetReal",
    "fmi2SetInteger",
    "fmi2SetBoolean",
    "fmi2SetString",
    "fmi2SetDebugLogging",
    "fmi2GetFMUstate",
    "fmi2SetFMUstate",
    "fmi2FreeFMUstate",
    "fmi2SerializedFMUstateSize",
    "fmi2SerializeFMUstate",
    "fmi2DeSerializeFMUstate",
    "fmi2GetDirectionalDerivative",
    "fmi2DoStep",
    "fmi2SetRealInputDerivatives",
    "fmi2GetRealOutputDerivatives",
    "fmi2GetRealStatus",
    "fmi2GetBooleanStatus",
    "fmi2EnterEventMode",
    "fmi2NewDiscreteStates",
    "fmi2EnterContinuousTimeMode",
    "fmi2CompletedIntegratorStep",
    "fmi2SetTime",
    "fmi2SetContinuousStates",
    "fmi2GetContinuousStates",
    "fmi2GetDerivatives",
    "fmi2GetEventIndicators",
];
/// `fmi2GetNominalsOfContinuousStates`, the last function.
pub(super) const NOMINALS: u32 = 39;
/// C name of the function of a number.
pub(super) fn name(function: u32) -> &'static str {
    if function == NOMINALS {
        return "fmi2GetNominalsOfContinuousStates";
    }
    NAMES.get(function as usize).copied().unwrap_or("an unknown function")
}

macro_rules! numbers {
    ($($name:ident = $number:literal,)*) => { $(pub(super) const $name: u32 = $number;)* };
}

numbers! {
    LOAD = 1, INSTANTIATE = 2, FREE_INSTANCE = 3, SETUP_EXPERIMENT = 4, ENTER_INITIALIZATION = 5,
    EXIT_INITIALIZATION = 6, TERMINATE = 7, RESET = 8, GET_REAL = 9, GET_INTEGER = 10, GET_BOOLEAN = 11,
    GET_STRING = 12, SET_REAL = 13, SET_INTEGER = 14, SET_BOOLEAN = 15, SET_STRING = 16, SET_DEBUG_LOGGING = 17,
    GET_STATE = 18, SET_STATE = 19, FREE_STATE = 20, STATE_SIZE = 21, SERIALIZE = 22, DESERIALIZE = 23,
    DIRECTIONAL_DERIVATIVE = 24, DO_STEP = 25, SET_INPUT_DERIVATIVES = 26, GET_OUTPUT_DERIVATIVES = 27,
    GET_REAL_STATUS = 28, GET_BOOLEAN_STATUS = 29, ENTER_EVENT_MODE = 30, NEW_DISCRETE_STATES = 31,
    ENTER_CONTINUOUS_TIME = 32, COMPLETED_STEP = 33, SET_TIME = 34, SET_STATES = 35, GET_STATES = 36,
    GET_DERIVATIVES = 37, GET_INDICATORS = 38,
}

/// Status of an answer that has not enough room: the worker states the size that it needs.
pub(super) const MORE_ROOM: u32 = 0x0100;
/// Status of a call that the library does not have, or that cannot be read.
pub(super) const REFUSED: u32 = 0x0101;
/// Status of every call once the worker is gone.
pub(crate) const LOST: u32 = 0x0102;

/// A call that is being written. All parts begin at multiples of 8 bytes.
#[derive(Debug, Default)]
pub(super) struct Calls {
    pub(super) bytes: Vec<u8>,
}

impl Calls {
    /// Begins a call of `function` of an instance (its number in the worker).
    pub(super) fn begin(&mut self, function: u32, instance: u64) {
        self.number(function.into());
        self.number(instance);
    }

    pub(super) fn number(&mut self, value: u64) {
        self.bytes.extend_from_slice(&value.to_le_bytes());
    }

    pub(super) fn real(&mut self, value: f64) {
        self.number(value.to_bits());
    }

    /// Bytes with their number.
    pub(super) fn block(&mut self, bytes: &[u8]) {
        self.number(bytes.len() as u64);
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(8), 0);
    }
}

/// Calls or answers that are being read from memory that the other side may have damaged.
pub(super) struct Parts<'a> {
    pub(super) bytes: &'a [u8],
}

impl<'a> Parts<'a> {
    pub(super) fn number(&mut self) -> Option<u64> {
        let (number, rest) = self.bytes.split_first_chunk::<8>()?;
        self.bytes = rest;
        Some(u64::from_le_bytes(*number))
    }

    pub(super) fn real(&mut self) -> Option<f64> {
        self.number().map(f64::from_bits)
    }

    pub(super) fn block(&mut self) -> Option<&'a [u8]> {
        let length = usize::try_from(self.number()?).ok()?;
        let (block, rest) = self.bytes.split_at_checked(length)?;
        let padding = length.checked_next_multiple_of(8)? - length;
        self.bytes = rest.get(padding..)?;
        Some(block)
    }
}

/// Numbers as the bytes that they are.
pub(super) fn bytes_of<T: Plain>(values: &[T]) -> &[u8] {
    // SAFETY: plain numbers without padding, as many bytes as they have.
    unsafe { std::slice::from_raw_parts(values.as_ptr().cast(), std::mem::size_of_val(values)) }
}

/// Numbers as bytes that may be changed.
pub(super) fn bytes_of_mut<T: Plain>(values: &mut [T]) -> &mut [u8] {
    // SAFETY: as above; every pattern of bytes is a number.
    unsafe { std::slice::from_raw_parts_mut(values.as_mut_ptr().cast(), std::mem::size_of_val(values)) }
}

/// Bytes as numbers, copied.
pub(super) fn values_of<T: Plain + Default + Clone>(bytes: &[u8]) -> Vec<T> {
    let mut values = vec![T::default(); bytes.len() / size_of::<T>()];
    let length = values.len() * size_of::<T>();
    bytes_of_mut(&mut values).copy_from_slice(&bytes[..length]);
    values
}

/// Numbers of which every pattern of bytes is one.
pub(super) trait Plain: Copy {}
impl Plain for f64 {}
impl Plain for u32 {}
impl Plain for i32 {}
impl Plain for i64 {}
impl Plain for u64 {}
