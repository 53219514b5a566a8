//! Arrays that C functions take: a pointer and a length.

#![allow(unsafe_code, reason = "pointers from callers with the signatures of C")]

/// The elements of an array; the pointer may be NULL where there are none.
///
/// # Safety
/// `values` points to `count` elements that nobody writes to during `'a`, or `count` is 0.
pub(crate) unsafe fn list<'a, T>(values: *const T, count: usize) -> &'a [T] {
    // SAFETY: as the caller promises; an empty array may be anywhere.
    if count == 0 { &[] } else { unsafe { std::slice::from_raw_parts(values, count) } }
}

/// Same as [`list`], to write to.
///
/// # Safety
/// `values` points to `count` elements that nobody else uses during `'a`, or `count` is 0.
pub(crate) unsafe fn list_mut<'a, T>(values: *mut T, count: usize) -> &'a mut [T] {
    // SAFETY: as the caller promises; an empty array may be anywhere.
    if count == 0 { &mut [] } else { unsafe { std::slice::from_raw_parts_mut(values, count) } }
}
