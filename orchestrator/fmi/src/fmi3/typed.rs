//! Values in the C types of FMI 3.0: of a float the bits of an f64, of an integer those of an i64 or u64.

use std::ffi::c_void;

use super::Component;
use crate::description::layout::BaseType;

/// Bits of the element at `place`: of a float those of an f64, of an integer those of an i64 or u64.
pub(super) fn read(values: &[u64], base: BaseType, place: usize) -> u64 {
    let start: *const u64 = values.as_ptr();
    // SAFETY: `values` has at least as many eight-byte words as there are elements of any type, all of them
    // initialized, and every type is at most eight bytes long and aligned in it.
    unsafe {
        match base {
            BaseType::Float32 => f64::from(*start.cast::<f32>().add(place)).to_bits(),
            BaseType::Int8 => i64::from(*start.cast::<i8>().add(place)) as u64,
            BaseType::UInt8 => u64::from(*start.cast::<u8>().add(place)),
            BaseType::Int16 => i64::from(*start.cast::<i16>().add(place)) as u64,
            BaseType::UInt16 => u64::from(*start.cast::<u16>().add(place)),
            BaseType::Int32 => i64::from(*start.cast::<i32>().add(place)) as u64,
            BaseType::UInt32 => u64::from(*start.cast::<u32>().add(place)),
            BaseType::Boolean => u64::from(*start.cast::<u8>().add(place) != 0),
            BaseType::Float64 | BaseType::Int64 | BaseType::UInt64 | BaseType::String | BaseType::Binary => {
                *start.add(place)
            }
        }
    }
}

/// Writes what [`read`] reads.
pub(super) fn write(values: &mut [u64], base: BaseType, place: usize, bits: u64) {
    let start: *mut u64 = values.as_mut_ptr();
    // SAFETY: as in `read`.
    unsafe {
        match base {
            BaseType::Float32 => *start.cast::<f32>().add(place) = f64::from_bits(bits) as f32,
            BaseType::Int8 | BaseType::UInt8 | BaseType::Boolean => {
                *start.cast::<u8>().add(place) = bits as u8;
            }
            BaseType::Int16 | BaseType::UInt16 => *start.cast::<u16>().add(place) = bits as u16,
            BaseType::Int32 | BaseType::UInt32 => *start.cast::<u32>().add(place) = bits as u32,
            BaseType::Float64 | BaseType::Int64 | BaseType::UInt64 | BaseType::String | BaseType::Binary => {
                *start.add(place) = bits;
            }
        }
    }
}

/// An integer of any width as we carry it; `None` beyond 64 bits with a sign.
pub(super) fn as_integer(base: BaseType, bits: u64) -> Option<i64> {
    match base {
        BaseType::UInt64 => i64::try_from(bits).ok(),
        _ => Some(bits as i64),
    }
}

/// A C function that reads or sets values of one type, given as a pointer of the type `P`.
type Call<P> = unsafe extern "C" fn(*mut c_void, *const u32, usize, P, usize) -> u32;

macro_rules! by_type {
    ($($base:ident: $get:ident $get_name:literal, $set:ident $set_name:literal;)*) => {
        impl Component {
            /// Calls the getter of a type for the references in the scratch memory; `count` values go there.
            pub(super) fn call_get(&mut self, base: BaseType, count: usize) -> u32 {
                self.scratch.values.clear();
                self.scratch.values.resize(count, 0);
                let values = self.scratch.values.as_mut_ptr();
                let functions = self.functions.common;
                match base {
                    $(BaseType::$base => self.call(functions.$get, $get_name, values.cast(), count),)*
                    BaseType::Binary => self.get_binary(count),
                }
            }

            /// Calls the setter of a type for the references and `count` values in the scratch memory.
            pub(super) fn call_set(&self, base: BaseType, count: usize) -> u32 {
                let values = self.scratch.values.as_ptr();
                let functions = self.functions.common;
                match base {
                    $(BaseType::$base => self.call(functions.$set, $set_name, values.cast(), count),)*
                    BaseType::Binary => self.set_binary(count),
                }
            }
        }
    };
}

by_type! {
    Float32: get_float32 "fmi3GetFloat32", set_float32 "fmi3SetFloat32";
    Float64: get_float64 "fmi3GetFloat64", set_float64 "fmi3SetFloat64";
    Int8: get_int8 "fmi3GetInt8", set_int8 "fmi3SetInt8";
    UInt8: get_uint8 "fmi3GetUInt8", set_uint8 "fmi3SetUInt8";
    Int16: get_int16 "fmi3GetInt16", set_int16 "fmi3SetInt16";
    UInt16: get_uint16 "fmi3GetUInt16", set_uint16 "fmi3SetUInt16";
    Int32: get_int32 "fmi3GetInt32", set_int32 "fmi3SetInt32";
    UInt32: get_uint32 "fmi3GetUInt32", set_uint32 "fmi3SetUInt32";
    Int64: get_int64 "fmi3GetInt64", set_int64 "fmi3SetInt64";
    UInt64: get_uint64 "fmi3GetUInt64", set_uint64 "fmi3SetUInt64";
    Boolean: get_boolean "fmi3GetBoolean", set_boolean "fmi3SetBoolean";
    String: get_string "fmi3GetString", set_string "fmi3SetString";
}

impl Component {
    /// Calls a getter or setter for the references and `count` values in the scratch memory, to which `values` points.
    fn call<P>(&self, call: Option<Call<P>>, name: &str, values: P, count: usize) -> u32 {
        let references = &self.scratch.references;
        match call {
            // SAFETY: the instance is alive; the arrays have the lengths passed and are large enough for any type,
            // Booleans are 0 or 1, and strings live during the call.
            Some(call) => unsafe {
                call(self.instance, references.as_ptr(), references.len(), values, count)
            },
            None => self.lacks(name),
        }
    }
}
