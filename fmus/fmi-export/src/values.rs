//! The numbers of one instance, indexed by the handles that the variable table gives out.

use crate::dual::Dual;
use crate::scalar::Scalar;
use std::ops::{Index, IndexMut};

/// Handle of a Real variable; its number is the value reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Real(pub(crate) u32);

/// Handle of an Integer or Enumeration variable; its number is the value reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Integer(pub(crate) u32);

/// Handle of a Boolean variable; its number is the value reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Boolean(pub(crate) u32);

/// Handle of a String variable; its number is the value reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Text(pub(crate) u32);

/// Handle of a number that the importer does not see: held samples, factorized parameters, delay lines.
///
/// Part of the FMU state like every variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Memory(pub(crate) u32);

/// A run of consecutive [`Memory`] numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryBlock {
    pub(crate) first: u32,
    pub(crate) len: u32,
}

impl MemoryBlock {
    /// Handle of element `i` (0-based).
    ///
    /// # Panics
    /// If `i` is not below the length: an error of the model's author.
    #[inline]
    pub fn at(self, i: usize) -> Memory {
        assert!(i < self.len as usize, "memory block of {} has no element {i}", self.len);
        Memory(self.first + i as u32)
    }

    /// Number of elements.
    pub fn len(self) -> usize {
        self.len as usize
    }

    /// True for a block without elements.
    pub fn is_empty(self) -> bool {
        self.len == 0
    }
}

impl Real {
    /// The value reference under which importers know the variable.
    pub fn value_reference(self) -> u32 {
        self.0
    }
}

/// FMI interface for which an instance was created.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// `fmi2ModelExchange`
    ModelExchange,
    /// `fmi2CoSimulation`
    CoSimulation,
}

/// All numbers of one instance. `v[handle]` reads and writes.
#[derive(Clone, Debug)]
pub struct Values<S> {
    /// Time \[s\].
    pub time: S,
    /// Interface of the instance.
    pub interface: Interface,
    /// True while the sampled update of the present time has not been taken yet: the equations show what the
    /// sample would give (direct feed-through); false: sampled outputs show the held value.
    pub at_sample: bool,
    pub(crate) real: Vec<S>,
    pub(crate) memory: Vec<S>,
    pub(crate) integer: Vec<i32>,
    pub(crate) boolean: Vec<bool>,
    pub(crate) text: Vec<String>,
}

impl<S: Scalar> Values<S> {
    /// Copies `source` with all derivatives zero; keeps the buffers.
    pub(crate) fn copy_from_f64(&mut self, source: &Values<f64>) {
        self.time = S::from(source.time);
        self.interface = source.interface;
        self.at_sample = source.at_sample;
        for (to, from) in self.real.iter_mut().zip(&source.real) {
            *to = S::from(*from);
        }
        for (to, from) in self.memory.iter_mut().zip(&source.memory) {
            *to = S::from(*from);
        }
        self.integer.copy_from_slice(&source.integer);
        self.boolean.copy_from_slice(&source.boolean);
        for (to, from) in self.text.iter_mut().zip(&source.text) {
            to.clone_from(from);
        }
    }
}

impl Values<f64> {
    /// Takes the values that the equations gave with derivatives: they are the same to the last bit.
    pub(crate) fn take_values_of<const L: usize>(&mut self, duals: &Values<Dual<L>>) {
        for (to, from) in self.real.iter_mut().zip(&duals.real) {
            *to = from.re;
        }
        for (to, from) in self.memory.iter_mut().zip(&duals.memory) {
            *to = from.re;
        }
        self.integer.copy_from_slice(&duals.integer);
        self.boolean.copy_from_slice(&duals.boolean);
        for (to, from) in self.text.iter_mut().zip(&duals.text) {
            to.clone_from(from);
        }
    }

    /// The same numbers in another scalar type.
    pub(crate) fn convert<S: Scalar>(&self) -> Values<S> {
        Values {
            time: S::from(self.time),
            interface: self.interface,
            at_sample: self.at_sample,
            real: self.real.iter().map(|x| S::from(*x)).collect(),
            memory: self.memory.iter().map(|x| S::from(*x)).collect(),
            integer: self.integer.clone(),
            boolean: self.boolean.clone(),
            text: self.text.clone(),
        }
    }

    /// Overwrites `self` with `other` of the same model without allocating (but for longer strings).
    pub(crate) fn copy_from(&mut self, other: &Values<f64>) {
        self.copy_from_f64(other);
    }
}

macro_rules! index {
    ($handle:ty, $field:ident, $($generic:ident, $value:ty)?) => {
        impl<S> Index<$handle> for Values<S> {
            type Output = index!(@out $($value)?);
            #[inline]
            fn index(&self, handle: $handle) -> &Self::Output {
                &self.$field[handle.0 as usize]
            }
        }
        impl<S> IndexMut<$handle> for Values<S> {
            #[inline]
            fn index_mut(&mut self, handle: $handle) -> &mut Self::Output {
                &mut self.$field[handle.0 as usize]
            }
        }
    };
    (@out $value:ty) => { $value };
}
index!(Real, real, S, S);
index!(Memory, memory, S, S);
index!(Integer, integer, S, i32);
index!(Boolean, boolean, S, bool);
index!(Text, text, S, String);
