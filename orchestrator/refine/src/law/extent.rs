//! How far a study reaches before a search adds to it, so that what was of no use can be taken away again as a whole:
//! a candidate whose attachment is gone would be simulated nowhere. Steps of integration that a law needs go with it.

use crate::study::model::Study;

/// Lengths of the lists that a search for laws adds to, and the steps of integration per sample.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Extent {
    entries: usize,
    candidates: usize,
    surfaces: usize,
    own: usize,
    taps: usize,
    substeps: usize,
}

impl Extent {
    pub(crate) fn of(study: &Study) -> Extent {
        Extent {
            entries: study.entries.len(),
            candidates: study.candidates.len(),
            surfaces: study.surfaces.len(),
            own: study.own.len(),
            taps: study.taps.len(),
            substeps: study.substeps,
        }
    }

    /// Takes away what was added since.
    pub(crate) fn restore(self, study: &mut Study) {
        study.entries.truncate(self.entries);
        study.candidates.truncate(self.candidates);
        study.surfaces.truncate(self.surfaces);
        study.own.truncate(self.own);
        study.taps.truncate(self.taps);
        study.substeps = self.substeps;
        study.forget_instances();
    }
}
