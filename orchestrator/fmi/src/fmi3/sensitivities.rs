//! Directional derivatives, and derivatives of outputs with respect to time.

use std::ffi::c_void;

use super::scalars::Scratch;
use super::{Component, ERROR, OK, WARNING, component};
use crate::arrays::list;
use crate::description::layout::Layout;

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
        let (unknowns, knowns) = (list(unknowns, unknown_count), list(knowns, known_count));
        (component(handle), unknowns, knowns, list(seed, known_count))
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
        unsafe { (component(handle), list(references, count), list(orders, count)) };
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
