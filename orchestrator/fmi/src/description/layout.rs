//! Where the variables of an FMI 3.0 description lie in the FMU: what is one scalar here may be an element of an array
//! there, and has a C type of its own.

use std::sync::Arc;

/// C type of a variable of FMI 3.0, by which it is set and read. Enumerations are `Int64`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum BaseType {
    Float32,
    Float64,
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    Boolean,
    String,
    /// Carried as a text of hexadecimal digits.
    Binary,
}

impl BaseType {
    /// The type of an element of `ModelVariables`; `None` for Clock, and what is no variable.
    pub(crate) fn of(element: &str) -> Option<BaseType> {
        Some(match element {
            "Float32" => BaseType::Float32,
            "Float64" => BaseType::Float64,
            "Int8" => BaseType::Int8,
            "UInt8" => BaseType::UInt8,
            "Int16" => BaseType::Int16,
            "UInt16" => BaseType::UInt16,
            "Int32" => BaseType::Int32,
            "UInt32" => BaseType::UInt32,
            "Int64" | "Enumeration" => BaseType::Int64,
            "UInt64" => BaseType::UInt64,
            "Boolean" => BaseType::Boolean,
            "String" => BaseType::String,
            "Binary" => BaseType::Binary,
            _ => return None,
        })
    }

    /// Whether it is carried as a Real.
    pub(crate) fn is_float(self) -> bool {
        matches!(self, BaseType::Float32 | BaseType::Float64)
    }

    /// Whether it is carried as a text.
    pub(crate) fn is_text(self) -> bool {
        matches!(self, BaseType::String | BaseType::Binary)
    }

    /// Name of the kind of variable that it is carried as, given the name of its element.
    pub(crate) fn carried_as(self, element: &str) -> &'static str {
        match self {
            BaseType::Float32 | BaseType::Float64 => "Real",
            BaseType::Boolean => "Boolean",
            BaseType::String | BaseType::Binary => "String",
            _ if element == "Enumeration" => "Enumeration",
            _ => "Integer",
        }
    }

    /// Smallest and largest integer of the type; `None` for other types.
    pub(crate) fn range(self) -> Option<(i128, i128)> {
        let signed = |bits: u32| Some((-(1_i128 << (bits - 1)), (1_i128 << (bits - 1)) - 1));
        let unsigned = |bits: u32| Some((0, (1_i128 << bits) - 1));
        match self {
            BaseType::Int8 => signed(8),
            BaseType::UInt8 => unsigned(8),
            BaseType::Int16 => signed(16),
            BaseType::UInt16 => unsigned(16),
            BaseType::Int32 => signed(32),
            BaseType::UInt32 => unsigned(32),
            BaseType::Int64 => signed(64),
            BaseType::UInt64 => unsigned(64),
            BaseType::Float32
            | BaseType::Float64
            | BaseType::Boolean
            | BaseType::String
            | BaseType::Binary => None,
        }
    }
}

/// A variable as the FMU knows it: a scalar or a whole array.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Whole {
    /// Its value reference in the FMU.
    pub(crate) reference: u32,
    /// C type.
    pub(crate) base: BaseType,
    /// Number of elements; 1 for a scalar.
    pub(crate) elements: usize,
    /// It is set in configuration mode.
    pub(crate) structural: bool,
    /// It is the length of a dimension of an array.
    pub(crate) sizes_arrays: bool,
    /// An input or a parameter: it changes only by being set.
    pub(crate) is_held: bool,
}

/// One scalar of ours: an element of a variable of the FMU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Slot {
    /// Index among [`Layout::wholes`].
    pub(crate) whole: usize,
    /// Index of the element, row by row, from 0.
    pub(crate) element: usize,
}

/// A structural parameter with a value other than the start value of the file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Resize {
    /// Index among [`Layout::wholes`].
    pub(crate) whole: usize,
    /// Value to set.
    pub(crate) value: i64,
}

/// All variables as the FMU knows them, and the place of each value reference of ours.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Layout {
    /// The variables of the FMU in file order.
    pub(crate) wholes: Arc<Vec<Whole>>,
    /// Place of each value reference; `None` where there is no variable.
    pub(crate) slots: Arc<Vec<Option<Slot>>>,
    /// Structural parameters to be set before anything else.
    pub(crate) resizes: Vec<Resize>,
}

impl Layout {
    /// The variable of the FMU and the element behind a value reference of ours.
    #[inline]
    pub(crate) fn find(&self, reference: u32) -> Option<Slot> {
        self.slots.get(reference as usize).copied().flatten()
    }
}
