//! Setting and reading values, with the signatures of FMI 2.0.

use std::ffi::{CStr, CString, c_void};

use super::binary;
use super::typed::as_integer;
use super::{DISCARD, ERROR, OK, Text, component};
use crate::arrays::list;
use crate::description::layout::BaseType;

pub(super) unsafe extern "C" fn get_real(
    handle: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut f64,
) -> u32 {
    // SAFETY: the call tables pass handles of live components and arrays of the length passed.
    let (component, references) = unsafe { (component(handle), list(references, count)) };
    component.get(references, |component, index, base, bits| {
        if !base.is_float() {
            return component.say(ERROR, "a variable that is no float is read as one".to_owned());
        }
        // SAFETY: `index` is below `count`, the length of the array.
        unsafe { values.add(index).write(f64::from_bits(bits)) };
        OK
    })
}

pub(super) unsafe extern "C" fn set_real(
    handle: *mut c_void,
    references: *const u32,
    count: usize,
    values: *const f64,
) -> u32 {
    // SAFETY: the call tables pass handles of live components and arrays of the length passed.
    let (component, references, values) =
        unsafe { (component(handle), list(references, count), list(values, count)) };
    component.set(references, |component, index, base| match base.is_float() {
        true => Ok(values[index].to_bits()),
        false => Err(component.say(ERROR, "a variable that is no float is set as one".to_owned())),
    })
}

pub(super) unsafe extern "C" fn get_integer(
    handle: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut i64,
) -> u32 {
    // SAFETY: the call tables pass handles of live components and arrays of the length passed.
    let (component, references) = unsafe { (component(handle), list(references, count)) };
    component.get(references, |component, index, base, bits| {
        let Some(value) = as_integer(base, bits).filter(|_| base.range().is_some()) else {
            let value = if base == BaseType::UInt64 { bits.to_string() } else { (bits as i64).to_string() };
            let reference = references[index];
            return component.say(
                DISCARD,
                format!("#i{reference}# is {value}: integers are carried with 64 bits and a sign"),
            );
        };
        // SAFETY: `index` is below `count`, the length of the array.
        unsafe { values.add(index).write(value) };
        OK
    })
}

pub(super) unsafe extern "C" fn set_integer(
    handle: *mut c_void,
    references: *const u32,
    count: usize,
    values: *const i64,
) -> u32 {
    // SAFETY: the call tables pass handles of live components and arrays of the length passed.
    let (component, references, values) =
        unsafe { (component(handle), list(references, count), list(values, count)) };
    component.set(references, |component, index, base| match base.range() {
        Some((min, max)) if (min..=max).contains(&i128::from(values[index])) => Ok(values[index] as u64),
        Some((min, max)) => {
            Err(component.say(DISCARD, format!("#i{}# takes {base:?}, {min} to {max}", references[index])))
        }
        None => Err(component.say(ERROR, "a variable that is no integer is set as one".to_owned())),
    })
}

pub(super) unsafe extern "C" fn get_boolean(
    handle: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut i32,
) -> u32 {
    // SAFETY: the call tables pass handles of live components and arrays of the length passed.
    let (component, references) = unsafe { (component(handle), list(references, count)) };
    component.get(references, |_, index, _, bits| {
        // SAFETY: `index` is below `count`, the length of the array.
        unsafe { values.add(index).write((bits != 0).into()) };
        OK
    })
}

pub(super) unsafe extern "C" fn set_boolean(
    handle: *mut c_void,
    references: *const u32,
    count: usize,
    values: *const i32,
) -> u32 {
    // SAFETY: the call tables pass handles of live components and arrays of the length passed.
    let (component, references, values) =
        unsafe { (component(handle), list(references, count), list(values, count)) };
    component.set(references, |component, index, base| match base {
        BaseType::Boolean => Ok((values[index] != 0).into()),
        _ => Err(component.say(ERROR, "a variable that is no Boolean is set as one".to_owned())),
    })
}

pub(super) unsafe extern "C" fn get_string(
    handle: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut Text,
) -> u32 {
    // SAFETY: the call tables pass handles of live components and arrays of the length passed.
    let (component, references) = unsafe { (component(handle), list(references, count)) };
    // A string lives until the next call only: it is kept here, until the next strings are read.
    let mut texts = Vec::with_capacity(count);
    let status = component.get(references, |component, _, base, bits| {
        if !base.is_text() {
            return component.say(ERROR, "a variable that is no string is read as one".to_owned());
        }
        let pointer: Text = std::ptr::with_exposed_provenance(bits as usize);
        texts.push(match pointer.is_null() {
            true => CString::default(),
            // SAFETY: not null; the FMU's string is valid until the next call on the instance.
            false => unsafe { CStr::from_ptr(pointer) }.to_owned(),
        });
        OK
    });
    component.texts = texts;
    for (index, text) in component.texts.iter().enumerate() {
        // SAFETY: there are at most `count` texts, the length of the array.
        unsafe { values.add(index).write(text.as_ptr()) };
    }
    status
}

pub(super) unsafe extern "C" fn set_string(
    handle: *mut c_void,
    references: *const u32,
    count: usize,
    values: *const Text,
) -> u32 {
    // SAFETY: the call tables pass handles of live components and arrays of the length passed.
    let (component, references, values) =
        unsafe { (component(handle), list(references, count), list(values, count)) };
    let status = component.set(references, |component, index, base| match base {
        BaseType::String => Ok(values[index].expose_provenance() as u64),
        // SAFETY: the strings of the caller live during the call.
        BaseType::Binary if !binary::is_hexadecimal(unsafe { CStr::from_ptr(values[index]) }) => {
            let what = "takes bytes as pairs of hexadecimal digits, such as 00ff";
            Err(component.say(DISCARD, format!("#s{}# {what}", references[index])))
        }
        BaseType::Binary => Ok(values[index].expose_provenance() as u64),
        _ => Err(component.say(ERROR, "a variable that is no string is set as one".to_owned())),
    });
    // What is known of an array of strings are pointers, which end with this call.
    component.forget();
    status
}
