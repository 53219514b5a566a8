//! Meshes: where the knots of a phase lie.

use super::error::Error;

/// Knots as fractions of the duration of a phase, from 0 to 1, increasing.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    fractions: Vec<f64>,
}

impl Mesh {
    /// `intervals` intervals of the same length; one where 0 is asked for.
    pub fn uniform(intervals: usize) -> Mesh {
        let count = intervals.max(1);
        Mesh { fractions: (0..=count).map(|k| k as f64 / count as f64).collect() }
    }

    /// From fractions, `[N + 1]`.
    ///
    /// # Errors
    /// [`Error::Mesh`] unless they increase strictly from 0 to 1.
    pub fn new(fractions: Vec<f64>) -> Result<Mesh, Error> {
        if fractions.len() < 2 || fractions[0] != 0.0 || fractions[fractions.len() - 1] != 1.0 {
            return Err(Error::Mesh { knot: 0, value: fractions.first().copied().unwrap_or(f64::NAN) });
        }
        match (1..fractions.len())
            .find(|&k| fractions[k].partial_cmp(&fractions[k - 1]) != Some(std::cmp::Ordering::Greater))
        {
            Some(knot) => Err(Error::Mesh { knot, value: fractions[knot] }),
            None => Ok(Mesh { fractions }),
        }
    }

    /// Number of intervals N.
    pub fn intervals(&self) -> usize {
        self.fractions.len() - 1
    }

    /// Fractions of the knots, `[N + 1]`.
    pub fn fractions(&self) -> &[f64] {
        &self.fractions
    }

    /// Another mesh with every interval cut into the given number of equal parts, `[N]`; 0 counts as 1.
    pub fn split(&self, parts: &[usize]) -> Mesh {
        let mut fractions = vec![0.0];
        for (pair, &parts) in self.fractions.windows(2).zip(parts) {
            let parts = parts.max(1);
            fractions.extend((1..parts).map(|j| pair[0] + (pair[1] - pair[0]) * j as f64 / parts as f64));
            fractions.push(pair[1]);
        }
        Mesh { fractions }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_cut_into_equal_parts() {
        let mesh = Mesh::new(vec![0.0, 0.5, 1.0]).unwrap().split(&[1, 2]);
        assert_eq!(mesh.fractions(), [0.0, 0.5, 0.75, 1.0]);
        assert_eq!(mesh.intervals(), 3);
    }

    #[test]
    fn knots_that_do_not_increase_are_refused_with_their_place() {
        let error = Mesh::new(vec![0.0, 0.5, 0.5, 1.0]).unwrap_err();
        assert!(matches!(error, Error::Mesh { knot: 2, .. }), "{error}");
        assert!(Mesh::new(vec![0.1, 1.0]).is_err() && Mesh::new(vec![0.0, f64::NAN, 1.0]).is_err());
    }
}
