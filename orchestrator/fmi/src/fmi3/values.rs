//! Values: from scalars of ours to variables of the FMU, with its C types and whole arrays.

#![allow(unsafe_code, reason = "calls into the FMU's library")]

use std::ffi::{CStr, CString, c_void};

use super::{Component, DISCARD, ERROR, OK, Text, WARNING, component};
use crate::description::layout::{BaseType, Layout, Slot};

/// Memory of a call, kept so that a step allocates nothing.
#[derive(Default)]
pub(super) struct Scratch {
    /// Value references of the FMU.
    references: Vec<u32>,
    /// Values in the C type of the FMU; eight bytes are enough for any of them.
    values: Vec<u64>,
    /// Place of each value in `values`, counted in elements.
    places: Vec<usize>,
    /// Seeds or sensitivities of whole arrays.
    seeds: Vec<f64>,
    sensitivities: Vec<f64>,
    knowns: Vec<u32>,
    /// Arrays of a call, with the place of their first element.
    offsets: Vec<(usize, usize)>,
}

/// Values of an array, as [`read`] gives them.
#[derive(Clone, Default)]
pub(super) struct Known {
    bits: Vec<u64>,
    /// Whether the FMU has these values.
    is_valid: bool,
}

/// Bits of the element at `place`: of a float those of an f64, of an integer those of an i64 or u64.
fn read(values: &[u64], base: BaseType, place: usize) -> u64 {
    let start: *const u64 = values.as_ptr();
    // SAFETY: `values` has at least as many eight-byte words as there are elements of any type, all of them initialized,
    // and every type is at most eight bytes long and aligned in it.
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
            BaseType::Float64 | BaseType::Int64 | BaseType::UInt64 | BaseType::String => *start.add(place),
        }
    }
}

/// Writes what [`read`] reads.
fn write(values: &mut [u64], base: BaseType, place: usize, bits: u64) {
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
            BaseType::Float64 | BaseType::Int64 | BaseType::UInt64 | BaseType::String => {
                *start.add(place) = bits;
            }
        }
    }
}

/// An integer of any width as we carry it.
fn as_integer(base: BaseType, bits: u64) -> Option<i32> {
    match base {
        BaseType::UInt64 => i32::try_from(bits).ok(),
        _ => i32::try_from(bits as i64).ok(),
    }
}

impl Component {
    /// Forgets what is known of arrays.
    pub(super) fn forget(&mut self) {
        self.known.iter_mut().for_each(|known| known.is_valid = false);
    }

    fn slot(&self, reference: u32) -> Result<Slot, u32> {
        self.layout
            .find(reference)
            .ok_or_else(|| self.say(ERROR, format!("the value reference {reference} is that of no variable")))
    }

    /// Calls the getter of a type for the references and values in the scratch memory.
    fn call_get(&mut self, base: BaseType, count: usize) -> u32 {
        let functions = self.functions.common;
        self.scratch.values.clear();
        self.scratch.values.resize(count, 0);
        let (instance, references) = (self.instance, &self.scratch.references);
        let values = self.scratch.values.as_mut_ptr();
        macro_rules! get {
            ($function:ident, $symbol:literal) => {
                match functions.$function {
                    // SAFETY: the instance is alive; the arrays have the lengths passed.
                    Some(call) => unsafe {
                        call(instance, references.as_ptr(), references.len(), values.cast(), count)
                    },
                    None => self.lacks($symbol),
                }
            };
        }
        match base {
            BaseType::Float32 => get!(get_float32, "fmi3GetFloat32"),
            BaseType::Float64 => get!(get_float64, "fmi3GetFloat64"),
            BaseType::Int8 => get!(get_int8, "fmi3GetInt8"),
            BaseType::UInt8 => get!(get_uint8, "fmi3GetUInt8"),
            BaseType::Int16 => get!(get_int16, "fmi3GetInt16"),
            BaseType::UInt16 => get!(get_uint16, "fmi3GetUInt16"),
            BaseType::Int32 => get!(get_int32, "fmi3GetInt32"),
            BaseType::UInt32 => get!(get_uint32, "fmi3GetUInt32"),
            BaseType::Int64 => get!(get_int64, "fmi3GetInt64"),
            BaseType::UInt64 => get!(get_uint64, "fmi3GetUInt64"),
            BaseType::Boolean => get!(get_boolean, "fmi3GetBoolean"),
            BaseType::String => get!(get_string, "fmi3GetString"),
        }
    }

    /// Calls the setter of a type, as [`Self::call_get`].
    fn call_set(&self, base: BaseType, count: usize) -> u32 {
        let functions = &self.functions.common;
        let (instance, references) = (self.instance, &self.scratch.references);
        let values = self.scratch.values.as_ptr();
        macro_rules! set {
            ($function:ident, $symbol:literal) => {
                match functions.$function {
                    // SAFETY: the instance is alive; the arrays have the lengths passed, Booleans are 0 or 1, and
                    // strings live during the call.
                    Some(call) => unsafe {
                        call(instance, references.as_ptr(), references.len(), values.cast(), count)
                    },
                    None => self.lacks($symbol),
                }
            };
        }
        match base {
            BaseType::Float32 => set!(set_float32, "fmi3SetFloat32"),
            BaseType::Float64 => set!(set_float64, "fmi3SetFloat64"),
            BaseType::Int8 => set!(set_int8, "fmi3SetInt8"),
            BaseType::UInt8 => set!(set_uint8, "fmi3SetUInt8"),
            BaseType::Int16 => set!(set_int16, "fmi3SetInt16"),
            BaseType::UInt16 => set!(set_uint16, "fmi3SetUInt16"),
            BaseType::Int32 => set!(set_int32, "fmi3SetInt32"),
            BaseType::UInt32 => set!(set_uint32, "fmi3SetUInt32"),
            BaseType::Int64 => set!(set_int64, "fmi3SetInt64"),
            BaseType::UInt64 => set!(set_uint64, "fmi3SetUInt64"),
            BaseType::Boolean => set!(set_boolean, "fmi3SetBoolean"),
            BaseType::String => set!(set_string, "fmi3SetString"),
        }
    }

    /// Reads scalars of any numeric type and passes their index, type and bits on, until one is refused.
    fn get(&mut self, references: &[u32], mut take: impl FnMut(&Self, usize, BaseType, u64) -> u32) -> u32 {
        let mut worst = OK;
        let mut done = 0;
        while done < references.len() {
            let base = match self.slot(references[done]) {
                Ok(slot) => self.layout.wholes[slot.whole].base,
                Err(status) => return status,
            };
            // One call for all that follow of the same type; an array is read once for its elements.
            self.scratch.references.clear();
            self.scratch.places.clear();
            let (mut count, mut last) = (0, None);
            for &reference in &references[done..] {
                let Some(slot) = self.layout.find(reference) else { break };
                let whole = &self.layout.wholes[slot.whole];
                if whole.base != base {
                    break;
                }
                if last != Some(slot.whole) {
                    last = Some(slot.whole);
                    self.scratch.references.push(whole.reference);
                    count += whole.elements;
                }
                self.scratch.places.push(count - whole.elements + slot.element);
            }
            let status = self.call_get(base, count);
            if status > WARNING {
                return status;
            }
            worst = worst.max(status);
            for (index, &place) in self.scratch.places.iter().enumerate() {
                let status = take(self, done + index, base, read(&self.scratch.values, base, place));
                if status > WARNING {
                    return status;
                }
            }
            done += self.scratch.places.len();
        }
        worst
    }

    /// Sets all elements of one variable, given as bits.
    pub(super) fn set_whole(&mut self, whole: usize, base: BaseType, bits: &[u64]) -> u32 {
        self.scratch.references.clear();
        self.scratch.references.push(self.layout.wholes[whole].reference);
        self.scratch.values.clear();
        self.scratch.values.resize(bits.len(), 0);
        for (place, &bits) in bits.iter().enumerate() {
            write(&mut self.scratch.values, base, place, bits);
        }
        self.call_set(base, bits.len())
    }

    /// Sets scalars of any numeric type, whose bits `value` gives, or a status where the type cannot hold it.
    fn set(&mut self, references: &[u32], value: impl Fn(&Self, usize, BaseType) -> Result<u64, u32>) -> u32 {
        let mut worst = OK;
        let mut done = 0;
        while done < references.len() {
            let slot = match self.slot(references[done]) {
                Ok(slot) => slot,
                Err(status) => return status,
            };
            let whole = &self.layout.wholes[slot.whole];
            let (status, count) = if whole.structural {
                (self.set_structural(slot.whole, |component| value(component, done, component.base(slot))), 1)
            } else if whole.elements > 1 {
                self.set_elements(slot, done, references, &value)
            } else {
                self.set_scalars(done, references, &value)
            };
            if status > WARNING {
                return status;
            }
            worst = worst.max(status);
            done += count;
        }
        worst
    }

    fn base(&self, slot: Slot) -> BaseType {
        self.layout.wholes[slot.whole].base
    }

    /// Sets all scalars of one type from `first` on; yields how many.
    fn set_scalars(
        &mut self,
        first: usize,
        references: &[u32],
        value: &impl Fn(&Self, usize, BaseType) -> Result<u64, u32>,
    ) -> (u32, usize) {
        self.scratch.references.clear();
        self.scratch.places.clear();
        let mut base = None;
        for &reference in &references[first..] {
            let Some(slot) = self.layout.find(reference) else { break };
            let whole = &self.layout.wholes[slot.whole];
            if whole.structural || whole.elements != 1 || base.is_some_and(|base| base != whole.base) {
                break;
            }
            base = Some(whole.base);
            self.scratch.references.push(whole.reference);
        }
        let (base, count) = (base.unwrap_or(BaseType::Float64), self.scratch.references.len());
        self.scratch.values.clear();
        self.scratch.values.resize(count, 0);
        for place in 0..count {
            match value(self, first + place, base) {
                Ok(bits) => write(&mut self.scratch.values, base, place, bits),
                Err(status) => return (status, 0),
            }
        }
        (self.call_set(base, count), count)
    }

    /// Sets the elements of one array that follow each other from `first` on; yields how many. FMI 3.0 sets arrays as a
    /// whole: the other elements keep their values.
    fn set_elements(
        &mut self,
        slot: Slot,
        first: usize,
        references: &[u32],
        value: &impl Fn(&Self, usize, BaseType) -> Result<u64, u32>,
    ) -> (u32, usize) {
        let whole = &self.layout.wholes[slot.whole];
        let (base, elements, reference) = (whole.base, whole.elements, whole.reference);
        let of_this = |reference: &&u32| self.layout.find(**reference).is_some_and(|s| s.whole == slot.whole);
        // Each element once, so that as many references as elements are all of them.
        let count = references[first..].iter().take_while(of_this).take(elements).count();
        let is_held = whole.is_held;
        let Known { mut bits, is_valid } = std::mem::take(&mut self.known[slot.whole]);
        if !(is_valid && is_held) {
            bits.clear();
            bits.resize(elements, 0);
            // Where all elements are set, those that were there do not matter.
            if count < elements {
                self.scratch.references.clear();
                self.scratch.references.push(reference);
                let status = self.call_get(base, elements);
                if status > WARNING {
                    return (status, 0);
                }
                for (place, bits) in bits.iter_mut().enumerate() {
                    *bits = read(&self.scratch.values, base, place);
                }
            }
        }
        for (index, &reference) in references.iter().enumerate().skip(first).take(count) {
            let element = self.layout.find(reference).map_or(0, |slot| slot.element);
            match value(self, index, base) {
                Ok(value) => bits[element] = value,
                Err(status) => return (status, 0),
            }
        }
        let status = self.set_whole(slot.whole, base, &bits);
        self.known[slot.whole] = Known { bits, is_valid: status <= WARNING };
        (status, count)
    }

    /// Sets a structural parameter, in configuration mode.
    fn set_structural(&mut self, whole: usize, value: impl FnOnce(&Self) -> Result<u64, u32>) -> u32 {
        let bits = match value(self) {
            Ok(bits) => bits,
            Err(status) => return status,
        };
        let declared = &self.layout.wholes[whole];
        let (base, reference, sizes_arrays) = (declared.base, declared.reference, declared.sizes_arrays);
        if sizes_arrays || !self.is_configurable {
            // The value that it has may be set any number of times.
            self.scratch.references.clear();
            self.scratch.references.push(reference);
            let status = self.call_get(base, 1);
            if status <= WARNING && read(&self.scratch.values, base, 0) == bits {
                return status;
            }
            let why = if sizes_arrays {
                "it is the length of an array, so the variables are others with another value: give the value in the \
                 parameter set of the system, before the FMU is opened"
            } else {
                "it can be set before initialization only"
            };
            return self.say(DISCARD, format!("structural parameter: {why}"));
        }
        self.configure(|component| component.set_whole(whole, base, &[bits]))
    }
}

/// Slices of a call; NULL is allowed where there is nothing.
///
/// # Safety
/// `start` points to `count` values of the caller, or `count` is 0.
unsafe fn slice<'a, T>(start: *const T, count: usize) -> &'a [T] {
    // SAFETY: promised by the caller.
    if count == 0 { &[] } else { unsafe { std::slice::from_raw_parts(start, count) } }
}

pub(super) unsafe extern "C" fn get_real(
    handle: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut f64,
) -> u32 {
    // SAFETY: the call tables pass handles of live components and arrays of the length passed.
    let (component, references) = unsafe { (component(handle), slice(references, count)) };
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
        unsafe { (component(handle), slice(references, count), slice(values, count)) };
    component.set(references, |component, index, base| match base.is_float() {
        true => Ok(values[index].to_bits()),
        false => Err(component.say(ERROR, "a variable that is no float is set as one".to_owned())),
    })
}

pub(super) unsafe extern "C" fn get_integer(
    handle: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut i32,
) -> u32 {
    // SAFETY: the call tables pass handles of live components and arrays of the length passed.
    let (component, references) = unsafe { (component(handle), slice(references, count)) };
    component.get(references, |component, index, base, bits| {
        let Some(value) = as_integer(base, bits).filter(|_| base.range().is_some()) else {
            let value = if base == BaseType::UInt64 { bits.to_string() } else { (bits as i64).to_string() };
            let reference = references[index];
            return component
                .say(DISCARD, format!("#i{reference}# is {value}: integers are carried with 32 bits"));
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
    values: *const i32,
) -> u32 {
    // SAFETY: the call tables pass handles of live components and arrays of the length passed.
    let (component, references, values) =
        unsafe { (component(handle), slice(references, count), slice(values, count)) };
    component.set(references, |component, index, base| match base.range() {
        Some((min, max)) if (min..=max).contains(&i128::from(values[index])) => {
            Ok(i64::from(values[index]) as u64)
        }
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
    let (component, references) = unsafe { (component(handle), slice(references, count)) };
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
        unsafe { (component(handle), slice(references, count), slice(values, count)) };
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
    let (component, references) = unsafe { (component(handle), slice(references, count)) };
    // A string lives until the next call only: it is kept here, until the next strings are read.
    let mut texts = Vec::with_capacity(count);
    let status = component.get(references, |component, _, base, bits| {
        if base != BaseType::String {
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
        unsafe { (component(handle), slice(references, count), slice(values, count)) };
    let status = component.set(references, |component, index, base| match base {
        BaseType::String => Ok(values[index].expose_provenance() as u64),
        _ => Err(component.say(ERROR, "a variable that is no string is set as one".to_owned())),
    });
    // What is known of an array of strings are pointers, which end with this call.
    component.forget();
    status
}

pub(super) unsafe extern "C" fn directional_derivative(
    handle: *mut c_void,
    unknowns: *const u32,
    unknown_count: usize,
    knowns: *const u32,
    known_count: usize,
    seed: *const f64,
    out: *mut f64,
) -> u32 {
    // SAFETY: the call tables pass handles of live components and arrays of the lengths passed.
    let (component, unknowns, knowns, seed) = unsafe {
        let (unknowns, knowns) = (slice(unknowns, unknown_count), slice(knowns, known_count));
        (component(handle), unknowns, knowns, slice(seed, known_count))
    };
    let Some(call) = component.functions.common.directional_derivative else {
        return component.lacks("fmi3GetDirectionalDerivative");
    };
    let Component { scratch, layout, .. } = component;
    let Scratch { references, places, seeds, sensitivities, knowns: known_wholes, offsets, .. } = scratch;
    // Arrays are differentiated as a whole, each once: elements that are not asked for have no seed, or are left out.
    places.clear();
    let Some(seed_count) = gather(layout, knowns, known_wholes, offsets, places) else { return ERROR };
    seeds.clear();
    seeds.resize(seed_count, 0.0);
    places.iter().zip(seed).for_each(|(&place, &seed)| seeds[place] = seed);
    places.clear();
    let Some(sensitivity_count) = gather(layout, unknowns, references, offsets, places) else { return ERROR };
    sensitivities.clear();
    sensitivities.resize(sensitivity_count, 0.0);
    // SAFETY: the instance is alive; all arrays have the lengths passed.
    let status = unsafe {
        call(
            component.instance,
            references.as_ptr(),
            references.len(),
            known_wholes.as_ptr(),
            known_wholes.len(),
            seeds.as_ptr(),
            seeds.len(),
            sensitivities.as_mut_ptr(),
            sensitivities.len(),
        )
    };
    if status <= WARNING {
        for (index, &place) in places.iter().enumerate() {
            // SAFETY: there are as many places as unknowns, the length of the array.
            unsafe { out.add(index).write(sensitivities[place]) };
        }
    }
    status
}

/// The variables of the FMU behind scalars, each once, and the place of each scalar in their values one after another;
/// yields the number of these values, or `None` where a reference is unknown.
fn gather(
    layout: &Layout,
    scalars: &[u32],
    wholes: &mut Vec<u32>,
    offsets: &mut Vec<(usize, usize)>,
    places: &mut Vec<usize>,
) -> Option<usize> {
    wholes.clear();
    offsets.clear();
    let mut count = 0;
    for &scalar in scalars {
        let slot = layout.find(scalar)?;
        let whole = &layout.wholes[slot.whole];
        // Scalars stand once in a call; only arrays are looked for.
        let known = offsets.iter().rev().find(|(index, _)| *index == slot.whole);
        let offset = known.map_or(count, |&(_, offset)| offset);
        if known.is_none() {
            wholes.push(whole.reference);
            if whole.elements > 1 {
                offsets.push((slot.whole, count));
            }
            count += whole.elements;
        }
        places.push(offset + slot.element);
    }
    Some(count)
}

/// Derivatives of outputs, one variable at a time, since an order belongs to a whole array.
pub(super) unsafe extern "C" fn get_output_derivatives(
    handle: *mut c_void,
    references: *const u32,
    count: usize,
    orders: *const i32,
    values: *mut f64,
) -> u32 {
    // SAFETY: the call tables pass handles of live components and arrays of the lengths passed.
    let (component, references, orders) =
        unsafe { (component(handle), slice(references, count), slice(orders, count)) };
    let Some(call) = component.functions.common.output_derivatives else {
        return component.lacks("fmi3GetOutputDerivatives");
    };
    let mut worst = OK;
    for (index, (&reference, &order)) in references.iter().zip(orders).enumerate() {
        let slot = match component.slot(reference) {
            Ok(slot) => slot,
            Err(status) => return status,
        };
        let whole = &component.layout.wholes[slot.whole];
        let sensitivities = &mut component.scratch.sensitivities;
        sensitivities.clear();
        sensitivities.resize(whole.elements, 0.0);
        // SAFETY: the instance is alive; the pointers are to locals and to an array of the length passed.
        let status = unsafe {
            call(
                component.instance,
                &raw const whole.reference,
                1,
                &raw const order,
                sensitivities.as_mut_ptr(),
                sensitivities.len(),
            )
        };
        if status > WARNING {
            return status;
        }
        worst = worst.max(status);
        // SAFETY: `index` is below `count`, the length of the array.
        unsafe { values.add(index).write(sensitivities[slot.element]) };
    }
    worst
}
