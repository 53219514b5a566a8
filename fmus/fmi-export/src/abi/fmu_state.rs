//! FMU state handles across the C boundary.

use super::{call, input, null, output};
use crate::ctypes::{Component, FmuState, Status};
use crate::fmu_state::{self, Snapshot};
use crate::model::Model;
use crate::state_machine::Function;
use std::ffi::c_char;

/// The snapshot behind an `fmi2FMUstate`.
fn snapshot<'a>(state: FmuState) -> Option<&'a mut Snapshot> {
    // SAFETY: a state that is not null came from `get_fmu_state` or `deserialize_fmu_state` of the same FMU and
    // was not freed (section 2.1.8).
    unsafe { state.cast::<Snapshot>().as_mut() }
}

pub unsafe fn get_fmu_state<M: Model>(c: Component, state: *mut FmuState) -> Status {
    call::<M>(c, Function::fmi2GetFMUstate, |i| {
        let Some([handle]) = output(state, 1) else { return null(i, Function::fmi2GetFMUstate) };
        match snapshot(*handle) {
            Some(snapshot) => snapshot.state.copy_from(&i.state),
            None => *handle = Box::into_raw(Box::new(Snapshot { state: i.state.clone() })).cast(),
        }
        Status::OK
    })
}

pub unsafe fn set_fmu_state<M: Model>(c: Component, state: FmuState) -> Status {
    call::<M>(c, Function::fmi2SetFMUstate, |i| match snapshot(state) {
        Some(snapshot) => {
            i.state.copy_from(&snapshot.state);
            i.columns.forget();
            Status::OK
        }
        None => i.error("fmi2SetFMUstate", "the FMU state is a null pointer"),
    })
}

pub unsafe fn free_fmu_state<M: Model>(c: Component, state: *mut FmuState) -> Status {
    call::<M>(c, Function::fmi2FreeFMUstate, |_| {
        if let Some([handle]) =
            output(state, usize::from(!state.is_null())).and_then(|s| <&mut [FmuState; 1]>::try_from(s).ok())
            && !handle.is_null()
        {
            // SAFETY: as in `snapshot`; the handle is set to null, so that it is not freed twice.
            drop(unsafe { Box::from_raw(handle.cast::<Snapshot>()) });
            *handle = std::ptr::null_mut();
        }
        Status::OK
    })
}

pub unsafe fn serialized_fmu_state_size<M: Model>(c: Component, state: FmuState, size: *mut usize) -> Status {
    const F: Function = Function::fmi2SerializedFMUstateSize;
    call::<M>(c, F, |i| match (snapshot(state), output(size, 1)) {
        (Some(snapshot), Some([size])) => {
            let mut bytes = Vec::new();
            fmu_state::serialize(&i.guid, &snapshot.state, &mut bytes);
            *size = bytes.len();
            Status::OK
        }
        _ => i.error(F.name(), "the FMU state or the address of the size is a null pointer"),
    })
}

pub unsafe fn serialize_fmu_state<M: Model>(
    c: Component,
    state: FmuState,
    bytes: *mut c_char,
    size: usize,
) -> Status {
    const F: Function = Function::fmi2SerializeFMUstate;
    call::<M>(c, F, |i| match (snapshot(state), output(bytes.cast::<u8>(), size)) {
        (Some(snapshot), Some(out)) => {
            let mut written = Vec::new();
            fmu_state::serialize(&i.guid, &snapshot.state, &mut written);
            if written.len() > out.len() {
                return i.error(
                    F.name(),
                    &format!("the state needs {} bytes, there is room for {}", written.len(), out.len()),
                );
            }
            out[..written.len()].copy_from_slice(&written);
            Status::OK
        }
        _ => i.error(F.name(), "the FMU state or the byte array is a null pointer"),
    })
}

pub unsafe fn deserialize_fmu_state<M: Model>(
    c: Component,
    bytes: *const c_char,
    size: usize,
    state: *mut FmuState,
) -> Status {
    const F: Function = Function::fmi2DeSerializeFMUstate;
    call::<M>(c, F, |i| match (input(bytes.cast::<u8>(), size), output(state, 1)) {
        (Some(bytes), Some([handle])) => match fmu_state::deserialize(i, bytes) {
            Ok(read) => {
                match snapshot(*handle) {
                    Some(old) => *old = read,
                    None => *handle = Box::into_raw(Box::new(read)).cast(),
                }
                Status::OK
            }
            Err(message) => i.error(F.name(), &message),
        },
        _ => i.error(F.name(), "the byte array or the address of the FMU state is a null pointer"),
    })
}
