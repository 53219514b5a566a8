//! Saved states: passed on, and what is known of arrays is forgotten.

#![allow(unsafe_code, reason = "calls into the FMU's library")]

use std::ffi::{c_char, c_void};

use super::component;

macro_rules! state_calls {
    ($($name:ident($($argument:ident: $type:ty $(as $cast:ident)?),*) $symbol:literal;)*) => {
        $(pub(super) unsafe extern "C" fn $name(handle: *mut c_void $(, $argument: $type)*) -> u32 {
            // SAFETY: the call tables pass handles of live components only.
            let component = unsafe { component(handle) };
            component.forget();
            match component.functions.common.$name {
                // SAFETY: the instance is alive and belongs to this library; states were made by it; arrays have the
                // lengths passed.
                Some(call) => unsafe { call(component.instance $(, $argument$(.$cast())?)*) },
                None => component.lacks($symbol),
            }
        })*
    };
}

state_calls! {
    get_state(state: *mut *mut c_void) "fmi3GetFMUState";
    set_state(state: *mut c_void) "fmi3SetFMUState";
    free_state(state: *mut *mut c_void) "fmi3FreeFMUState";
    serialized_state_size(state: *mut c_void, size: *mut usize) "fmi3SerializedFMUStateSize";
    serialize_state(state: *mut c_void, bytes: *mut c_char as cast, size: usize) "fmi3SerializeFMUState";
    deserialize_state(bytes: *const c_char as cast, size: usize, state: *mut *mut c_void) "fmi3DeserializeFMUState";
}
