//! Lists in the order of a number. The compiler makes a sort of the standard library anew for every list, some
//! thousand lines each; here the numbers are sorted by one function for all, and the elements follow.

/// Puts `list` in the order of a value, the least first; elements with the same value stay in their order. Values that
/// are no numbers come last.
pub fn ascending<T>(list: &mut [T], value: impl Fn(&T) -> f64) {
    let order = order(list.iter().map(value).collect());
    for k in 0..list.len() {
        // Where the element is that belongs here: swaps may have moved it.
        let mut from = order[k];
        while from < k {
            from = order[from];
        }
        list.swap(k, from);
    }
}

/// The same with the largest first.
pub fn descending<T>(list: &mut [T], value: impl Fn(&T) -> f64) {
    ascending(list, |own| -value(own));
}

/// Index of the element that comes first, second ...
fn order(values: Vec<f64>) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use airloop_series::random::Random;

    #[test]
    fn the_order_is_that_of_a_stable_sort() {
        let mut random = Random::new(3);
        for n in 0..40 {
            // Few values, so that many are the same.
            let list: Vec<(f64, usize)> = (0..n).map(|k| ((3.0 * random.normal()).round(), k)).collect();
            let [mut own, mut sorted] = [list.clone(), list.clone()];
            ascending(&mut own, |own| own.0);
            sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
            assert_eq!(own, sorted);
            descending(&mut own, |own| own.1 as f64);
            assert!(own.iter().rev().map(|own| own.1).eq(0..n));
        }
    }
}
