//! Fits in rungs: first on the beginnings of the records, then on longer spans of them.
//!
//! A simulation over a whole record depends on parameters the less linearly the longer it is: where a pole turns over
//! once too often, the derivative is useless. A model that does not follow one second does not follow four either, and
//! is given up at a fraction of the cost.

use super::candidate::Candidate;
use super::fit::Free;
use super::goodness::Null;
use super::search::{Model, Promise, Search};
use super::{System, stop};

/// Shares of the records that are fitted before the whole.
const SHARES: [f64; 2] = [0.25, 0.5];
/// Draws of the null of a beginning, which only tells what is hopeless.
const DRAWS: usize = 60;
/// Times the limit of what counts as noise up to which a fit of a beginning goes on with more.
const MAX_LIMITS_OF_NOISE: f64 = 4.0;

/// The records from their beginning, each share with its own search, and the whole on top.
pub struct Ladder<'a, S: System + ?Sized> {
    whole: &'a Search<'a, S>,
    beginnings: Vec<Search<'a, dyn System + 'a>>,
    margin: f64,
}

/// A fit and the rung of the ladder it came to.
#[derive(Debug, Clone)]
pub struct Reached {
    /// The fit, over the records as far as `rung` goes.
    pub model: Model,
    /// Rung; that of the whole is [`Ladder::top`].
    pub rung: usize,
}

/// The systems of the rungs below the whole.
pub fn beginnings<S: System + ?Sized>(system: &S) -> Vec<Box<dyn System + '_>> {
    SHARES.iter().filter_map(|&share| system.beginning(share)).collect()
}

impl<'a, S: System + ?Sized> Ladder<'a, S> {
    /// Over the `systems` of [`beginnings`]; a power within `margin` of the largest of the null is noise.
    pub fn new(
        whole: &'a Search<'a, S>,
        systems: &'a [Box<dyn System + 'a>],
        declared: &Model,
        margin: f64,
    ) -> Ladder<'a, S> {
        let (p, locals) = (&declared.fit.parameters, &declared.fit.locals);
        let one = |system: &'a (dyn System + 'a)| {
            let (records, screened) = (whole.records.clone(), whole.screened.clone());
            let null = Null::simulate(system, &records, p, locals, DRAWS, 1);
            Search { system, candidates: whole.candidates, records, screened, null, rules: whole.rules }
        };
        Ladder { whole, beginnings: systems.iter().map(AsRef::as_ref).map(one).collect(), margin }
    }

    /// Candidates.
    pub fn candidates(&self) -> &'a [Candidate] {
        self.whole.candidates
    }

    /// Rung of the whole records.
    pub fn top(&self) -> usize {
        self.beginnings.len()
    }

    /// Largest normalized power that counts as noise on a rung.
    pub fn limit(&self, rung: usize) -> f64 {
        self.beginnings.get(rung).map_or(self.whole.null.quantile, |search| search.null.quantile)
            + self.margin
    }

    /// Whether a fit leaves only noise on the whole records.
    pub fn explains(&self, reached: &Reached) -> bool {
        reached.rung == self.top() && reached.model.worst() < self.limit(reached.rung)
    }

    /// A fit on one rung.
    pub fn fit(&self, rung: usize, added: &[usize], extra: &[Free], start: &Model, rounds: usize) -> Model {
        let (p, locals) = (&start.fit.parameters, &start.fit.locals);
        match self.beginnings.get(rung) {
            Some(search) => search.fit(added, extra, p, locals, rounds),
            None => self.whole.fit(added, extra, p, locals, rounds),
        }
    }

    /// Predicted sum of squares of every candidate that `base` lacks on a rung, best first.
    pub fn screen(&self, rung: usize, base: &Model) -> Vec<Promise> {
        self.beginnings.get(rung).map_or_else(|| self.whole.screen(base), |search| search.screen(base))
    }

    /// Fits what is promising beside `base`, best promise first, from the start that each promise was made around. Once
    /// a model explains the records, only candidates that promised about as much are still fitted.
    pub fn attempt(
        &self,
        base: &Reached,
        promises: &[(&Promise, &Model)],
        extra: &[Free],
        (count, rounds): (usize, usize),
    ) -> Vec<Reached> {
        let mut found: Vec<Reached> = Vec::new();
        let mut enough = f64::INFINITY;
        for (promise, start) in promises {
            let mut added = base.model.added.clone();
            added.push(promise.candidate);
            if found.iter().any(|other| other.model.added == added) {
                continue;
            }
            if found.len() >= count || promise.chi2 > enough || stop::asked() {
                break;
            }
            let mut start = (*start).clone();
            start.fit.parameters.clone_from(&promise.parameters);
            let reached = self.climb(base.rung, &added, extra, &start, rounds);
            if self.explains(&reached) {
                enough = enough.min(2.0 * promise.chi2);
            }
            found.push(reached);
        }
        found
    }

    /// A fit from rung to rung, up to the first where it is hopeless.
    pub fn climb(
        &self,
        from: usize,
        added: &[usize],
        extra: &[Free],
        start: &Model,
        rounds: usize,
    ) -> Reached {
        let mut model = self.fit(from, added, extra, start, rounds);
        let mut rung = from;
        while rung < self.top() && !stop::asked() && model.worst() < MAX_LIMITS_OF_NOISE * self.limit(rung) {
            rung += 1;
            model = self.fit(rung, added, extra, &model, rounds);
        }
        Reached { model, rung }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::candidate::Start;
    use crate::engine::search::Rules;
    use crate::engine::system::testing::Lines;

    /// Rung that a fit of the parameter `index` comes to, and whether it explains lines of the given slope and square.
    fn reached(slope: f64, square: f64, index: usize) -> (usize, bool) {
        let system = Lines::new(slope, square);
        let locals = vec![vec![0.0], vec![40.0]];
        let free = vec![Free { index, bounds: (-1e3, 1e3), step: 1e-3, prior: None }];
        let starts = vec![Start { values: Vec::new(), open: vec![0], idle: true }];
        let candidates =
            [Candidate { id: "a", channel: "c", signal: None, free, starts, place: 0, contains: None }];
        let null = Null::simulate(&system, &[0, 1], &[0.0, 0.0], &locals, 100, 1);
        let search = Search {
            system: &system,
            candidates: &candidates,
            records: vec![0, 1],
            screened: vec![0, 1],
            null,
            rules: Rules::default(),
        };
        let declared = search.fit(&[], &[], &[0.0, 0.0], &locals, 5);
        let systems = beginnings(&system);
        let ladder = Ladder::new(&search, &systems, &declared, 8.0);
        assert_eq!(ladder.top(), 2);
        let found = ladder.climb(0, &[0], &[], &declared, 10);
        (found.rung, ladder.explains(&found))
    }

    #[test]
    fn what_explains_the_records_climbs_to_the_whole() {
        assert_eq!(reached(60.0, 0.0, 0), (2, true));
    }

    #[test]
    fn what_does_not_follow_the_beginning_is_given_up_there() {
        // A straight line through a parabola of 2000 t^2: over a quarter they differ by up to 2000/16/8 = 16.
        assert_eq!(reached(0.0, 2000.0, 0), (0, false));
        // 100 t^2: by less than the noise of 1 over a quarter, by 3 over a half.
        assert_eq!(reached(0.0, 100.0, 0), (1, false));
    }
}
