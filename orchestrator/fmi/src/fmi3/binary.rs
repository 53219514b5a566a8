//! Variables of type Binary, which are carried as texts of hexadecimal digits, as their start values in the
//! description.

use std::ffi::{CStr, CString};

use super::{Component, WARNING};
use crate::trace;

/// Whether a text is a whole number of bytes in hexadecimal digits.
pub(super) fn is_hexadecimal(text: &CStr) -> bool {
    let digits = text.to_bytes();
    digits.len().is_multiple_of(2) && digits.iter().all(u8::is_ascii_hexdigit)
}

fn digit(digit: u8) -> u8 {
    char::from(digit).to_digit(16).unwrap_or(0) as u8
}

impl Component {
    /// Reads the binaries of the references in the scratch memory; pointers to their texts go there.
    pub(super) fn get_binary(&mut self, count: usize) -> u32 {
        let Some(get) = self.functions.common.get_binary else { return self.lacks("fmi3GetBinary") };
        let (mut sizes, mut values) = (vec![0_usize; count], vec![std::ptr::null(); count]);
        let references = &self.scratch.references;
        trace::enter("fmi3GetBinary");
        // SAFETY: the instance is alive and the arrays have the lengths passed.
        let status = unsafe {
            get(
                self.instance,
                references.as_ptr(),
                references.len(),
                sizes.as_mut_ptr(),
                values.as_mut_ptr(),
                count,
            )
        };
        if status > WARNING {
            return status;
        }
        let text = |(&size, &value): (&usize, &*const u8)| {
            let bytes = match value.is_null() || size == 0 {
                true => &[],
                // SAFETY: not null; the FMU owns so many bytes until the next call on the instance.
                false => unsafe { std::slice::from_raw_parts(value, size) },
            };
            let digits: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
            CString::new(digits).unwrap_or_default()
        };
        self.scratch.texts = sizes.iter().zip(&values).map(text).collect();
        for (value, text) in self.scratch.values.iter_mut().zip(&self.scratch.texts) {
            *value = text.as_ptr().expose_provenance() as u64;
        }
        status
    }

    /// Sets the binaries of the references in the scratch memory, where the pointers to their texts lie.
    pub(super) fn set_binary(&self, count: usize) -> u32 {
        let Some(set) = self.functions.common.set_binary else { return self.lacks("fmi3SetBinary") };
        let bytes = |&pointer: &u64| -> Vec<u8> {
            let text: *const std::ffi::c_char = std::ptr::with_exposed_provenance(pointer as usize);
            // SAFETY: a text of the caller of the setter or of the scratch memory, which live during the call.
            let digits = unsafe { CStr::from_ptr(text) }.to_bytes();
            digits.chunks(2).map(|pair| pair.iter().fold(0, |byte, &half| byte << 4 | digit(half))).collect()
        };
        let values: Vec<Vec<u8>> = self.scratch.values.iter().take(count).map(bytes).collect();
        let sizes: Vec<usize> = values.iter().map(Vec::len).collect();
        let pointers: Vec<*const u8> = values.iter().map(|bytes| bytes.as_ptr()).collect();
        let references = &self.scratch.references;
        trace::enter("fmi3SetBinary");
        // SAFETY: the instance is alive, the arrays have the lengths passed, and the bytes live during the call.
        unsafe {
            set(
                self.instance,
                references.as_ptr(),
                references.len(),
                sizes.as_ptr(),
                pointers.as_ptr(),
                count,
            )
        }
    }
}
