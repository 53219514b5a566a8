//! From scalars of ours to variables of the FMU, arrays as a whole.

use std::ffi::CString;

use super::typed::{read, write};
use super::{Component, DISCARD, ERROR, OK, WARNING};
use crate::description::layout::{BaseType, Slot};

/// Memory of a call, kept so that a step allocates nothing.
#[derive(Default)]
pub(super) struct Scratch {
    /// Value references of the FMU.
    pub(super) references: Vec<u32>,
    /// Values in the C type of the FMU; eight bytes are enough for any of them.
    pub(super) values: Vec<u64>,
    /// Place of each value in `values`, counted in elements.
    pub(super) places: Vec<usize>,
    /// Binaries that were read, as texts.
    pub(super) texts: Vec<CString>,
    /// Seeds or sensitivities of whole arrays.
    pub(super) seeds: Vec<f64>,
    pub(super) sensitivities: Vec<f64>,
    pub(super) knowns: Vec<u32>,
    /// Arrays of a call, with the place of their first element.
    pub(super) offsets: Vec<(usize, usize)>,
}

/// Values of an array, as [`read`] gives them.
#[derive(Clone, Default)]
pub(super) struct Known {
    bits: Vec<u64>,
    /// Whether the FMU has these values.
    is_valid: bool,
}

impl Component {
    /// Forgets what is known of arrays.
    pub(super) fn forget(&mut self) {
        self.known.iter_mut().for_each(|known| known.is_valid = false);
    }

    pub(super) fn slot(&self, reference: u32) -> Result<Slot, u32> {
        self.layout
            .find(reference)
            .ok_or_else(|| self.say(ERROR, format!("the value reference {reference} is that of no variable")))
    }

    /// Reads scalars of any numeric type and passes their index, type and bits on, until one is refused.
    pub(super) fn get(
        &mut self,
        references: &[u32],
        mut take: impl FnMut(&Self, usize, BaseType, u64) -> u32,
    ) -> u32 {
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
    pub(super) fn set(
        &mut self,
        references: &[u32],
        value: impl Fn(&Self, usize, BaseType) -> Result<u64, u32>,
    ) -> u32 {
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
