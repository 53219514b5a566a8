//! Values of an instance: get and set by value reference, and directional derivatives.

#![allow(unsafe_code, reason = "calls into the FMU's library")]

use std::ffi::{CStr, CString, c_char};

use super::status::Base;
use super::{Error, Instance};

impl Instance {
    /// Reads reals.
    ///
    /// # Errors
    /// Different lengths, or the FMU refuses.
    #[inline(always)]
    pub fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), Error> {
        let function = "fmi2GetReal";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        // SAFETY: the component is alive; both arrays have the length passed.
        let status = unsafe {
            (self.functions.get_real)(
                self.component,
                references.as_ptr(),
                references.len(),
                values.as_mut_ptr(),
            )
        };
        self.check_reals(function, status, references, None)
    }

    /// Sets reals.
    ///
    /// # Errors
    /// Different lengths, or the FMU refuses.
    #[inline(always)]
    pub fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), Error> {
        let function = "fmi2SetReal";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        // SAFETY: the component is alive; both arrays have the length passed.
        let status = unsafe {
            (self.functions.set_real)(self.component, references.as_ptr(), references.len(), values.as_ptr())
        };
        self.check_reals(function, status, references, Some(values))
    }

    /// Reads integers and enumerations.
    ///
    /// # Errors
    /// Different lengths, or the FMU refuses.
    pub fn get_integer(&mut self, references: &[u32], values: &mut [i64]) -> Result<(), Error> {
        let function = "fmi2GetInteger";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        // SAFETY: the component is alive; both arrays have the length passed.
        let status =
            unsafe { self.functions.get_integer.call(self.component, references, values, &mut self.scratch) };
        self.check_values(function, status, Base::Integer, references, |_| None)
    }

    /// Sets integers and enumerations.
    ///
    /// # Errors
    /// Different lengths, or the FMU refuses.
    pub fn set_integer(&mut self, references: &[u32], values: &[i64]) -> Result<(), Error> {
        let function = "fmi2SetInteger";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        // SAFETY: the component is alive; both arrays have the length passed.
        let status =
            unsafe { self.functions.set_integer.call(self.component, references, values, &mut self.scratch) };
        self.check_values(function, status, Base::Integer, references, |index| {
            Some(values[index].to_string())
        })
    }

    /// Reads truth values.
    ///
    /// # Errors
    /// Different lengths, or the FMU refuses.
    pub fn get_boolean(&mut self, references: &[u32], values: &mut [bool]) -> Result<(), Error> {
        let function = "fmi2GetBoolean";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        self.scratch.clear();
        self.scratch.resize(values.len(), 0);
        // SAFETY: the component is alive; both arrays have the length passed.
        let status = unsafe {
            (self.functions.get_boolean)(
                self.component,
                references.as_ptr(),
                references.len(),
                self.scratch.as_mut_ptr(),
            )
        };
        self.check_values(function, status, Base::Boolean, references, |_| None)?;
        values.iter_mut().zip(&self.scratch).for_each(|(value, &raw)| *value = raw != 0);
        Ok(())
    }

    /// Sets truth values.
    ///
    /// # Errors
    /// Different lengths, or the FMU refuses.
    pub fn set_boolean(&mut self, references: &[u32], values: &[bool]) -> Result<(), Error> {
        let function = "fmi2SetBoolean";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        self.scratch.clear();
        self.scratch.extend(values.iter().map(|&value| i32::from(value)));
        // SAFETY: the component is alive; both arrays have the length passed.
        let status = unsafe {
            (self.functions.set_boolean)(
                self.component,
                references.as_ptr(),
                references.len(),
                self.scratch.as_ptr(),
            )
        };
        self.check_values(function, status, Base::Boolean, references, |index| {
            Some(values[index].to_string())
        })
    }

    /// Reads texts; bytes that are not UTF-8 are replaced.
    ///
    /// # Errors
    /// The FMU refuses.
    pub fn get_string(&mut self, references: &[u32]) -> Result<Vec<String>, Error> {
        let function = "fmi2GetString";
        self.alive(function)?;
        let mut pointers = vec![std::ptr::null(); references.len()];
        // SAFETY: the component is alive; both arrays have the length passed.
        let status = unsafe {
            (self.functions.get_string)(
                self.component,
                references.as_ptr(),
                references.len(),
                pointers.as_mut_ptr(),
            )
        };
        self.check_values(function, status, Base::String, references, |_| None)?;
        let text = |pointer: *const c_char| {
            if pointer.is_null() {
                return String::new();
            }
            // SAFETY: not null; the string is valid until the next call on the instance (FMI 2.0.5 section 2.1.7).
            unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
        };
        Ok(pointers.into_iter().map(text).collect())
    }

    /// Sets texts.
    ///
    /// # Errors
    /// Different lengths, a NUL character in a text, or the FMU refuses.
    pub fn set_string(&mut self, references: &[u32], values: &[&str]) -> Result<(), Error> {
        let function = "fmi2SetString";
        self.alive(function)?;
        self.same_length(function, values.len(), references.len())?;
        let strings = self.c_strings(values)?;
        let pointers: Vec<_> = strings.iter().map(|string| string.as_ptr()).collect();
        // SAFETY: the component is alive; both arrays have the length passed and the strings live during the call.
        let status = unsafe {
            (self.functions.set_string)(
                self.component,
                references.as_ptr(),
                references.len(),
                pointers.as_ptr(),
            )
        };
        self.check_values(function, status, Base::String, references, |i| Some(format!("\"{}\"", values[i])))
    }

    /// `out = J seed`, where `J[i][j]` is the derivative of `unknown[i]` by `known[j]`.
    ///
    /// | name | shape | meaning |
    /// |---|---|---|
    /// | `unknown` | \[m\] | value references of outputs or derivatives |
    /// | `known` | \[n\] | value references of inputs or states |
    /// | `seed` | \[n\] | change of the knowns |
    /// | `out` | \[m\] | change of the unknowns |
    ///
    /// # Errors
    /// Wrong lengths, the function is missing, or the FMU refuses.
    pub fn directional_derivative(
        &mut self,
        unknown: &[u32],
        known: &[u32],
        seed: &[f64],
        out: &mut [f64],
    ) -> Result<(), Error> {
        let function = "fmi2GetDirectionalDerivative";
        self.alive(function)?;
        self.same_length(function, seed.len(), known.len())?;
        self.same_length(function, out.len(), unknown.len())?;
        let call = self.functions.directional_derivative.ok_or_else(|| self.missing(function))?;
        // SAFETY: the component is alive; each pair of arrays has the length passed.
        let status = unsafe {
            call(
                self.component,
                unknown.as_ptr(),
                unknown.len(),
                known.as_ptr(),
                known.len(),
                seed.as_ptr(),
                out.as_mut_ptr(),
            )
        };
        self.check_reals(function, status, unknown, None)
    }

    pub(super) fn c_strings(&self, texts: &[&str]) -> Result<Vec<CString>, Error> {
        let convert = |text: &&str| {
            CString::new(*text).map_err(|_| Error::NulCharacter {
                component: self.name.clone(),
                what: format!("the text {text:?}"),
            })
        };
        texts.iter().map(convert).collect()
    }
}
