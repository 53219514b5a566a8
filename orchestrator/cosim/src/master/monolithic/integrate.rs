//! Integration with error control, and the time of state events.
//!
//! A step ends where the caller says at the latest. An event lies between a point where no event indicator has left
//! its domain (above zero, or not) and a point where one has; the step is taken again with other lengths until both
//! are as close as rounding allows. So the state at the event is one of the integrator, not of an interpolation.

use super::dop853::Step;

/// Problem to integrate: the right-hand side and its event indicators.
pub(super) trait Problem {
    /// Reason why it cannot be evaluated.
    type Error;

    /// Right-hand side at `t` \[s\] and states `x`, `[n]`, into `dx`, `[n]`; the indicators asked for next belong
    /// to this point.
    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Self::Error>;

    /// Event indicators at the point evaluated last.
    fn indicators(&mut self, z: &mut [f64]) -> Result<(), Self::Error>;

    /// A step ended at the point evaluated last; whether an event is wanted.
    fn completed(&mut self) -> Result<bool, Self::Error>;

    /// Whether a shorter step may help.
    fn is_recoverable(error: &Self::Error) -> bool;
}

/// Reason why an integration stopped at the point given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reached {
    /// The end.
    End,
    /// The event indicator of this number left its domain.
    Indicator(usize),
    /// The problem asked for an event.
    Wanted,
}

/// Reason why an integration cannot go on; the point is the last that was good.
#[derive(Debug)]
pub(super) enum Failure<E> {
    /// The problem.
    Problem(E),
    /// The error of this state stays too large at the shortest step \[s\].
    Underflow { state: usize, step: f64 },
    /// More steps than allowed on the way to the end; this state limits them.
    TooManySteps { state: usize, steps: u64 },
}

/// Work done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Work {
    pub accepted: u64,
    pub rejected: u64,
    pub evaluations: u64,
}

/// Factors by which a step may change, and the margin below the step that would just do.
const SHRINK: f64 = 0.2;
const GROW: f64 = 10.0;
const SAFETY: f64 = 0.9;
/// The error falls with this power of the step.
const ORDER: f64 = 8.0;
/// Steps on the way to one end, beyond which the problem counts as stiff.
const MOST_STEPS: u64 = 200_000;
/// Width to which an event is found, as a fraction of the step \[1\], and at most \[s\].
const EVENT_FRACTION: f64 = 1e-12;
const EVENT_WIDTH: f64 = 1e-12;

/// Memory and settings.
#[derive(Debug)]
pub(super) struct Integrator {
    relative: f64,
    /// Absolute tolerance of each state.
    pub absolute: Vec<f64>,
    step: Step,
    /// Right-hand side at the end of the step tried.
    end_rates: Vec<f64>,
    /// Indicators at the start and at the end of the step tried.
    start_indicators: Vec<f64>,
    indicators: Vec<f64>,
    /// Step the error control proposes \[s\]; 0 before the first.
    proposal: f64,
    /// The state that erred most in the step before.
    limiting: usize,
    pub work: Work,
}

impl Integrator {
    pub fn new(states: usize, indicators: usize, relative: f64) -> Integrator {
        Integrator {
            relative,
            absolute: vec![relative; states],
            step: Step::new(states),
            end_rates: vec![0.0; states],
            start_indicators: vec![0.0; indicators],
            indicators: vec![0.0; indicators],
            proposal: 0.0,
            limiting: 0,
            work: Work::default(),
        }
    }

    /// Forgets the step that the error control proposes.
    pub fn forget(&mut self) {
        self.proposal = 0.0;
    }

    /// Evaluates the start of what follows; to be called at the beginning and after every event.
    pub fn restart<P: Problem>(&mut self, problem: &mut P, t: f64, x: &[f64]) -> Result<(), P::Error> {
        self.work.evaluations += 1;
        problem.derivatives(t, x, &mut self.step.k[0])?;
        problem.indicators(&mut self.start_indicators)
    }

    /// From `t` and `x` to `end` or to the first event; both are moved on with every good step.
    pub fn advance<P: Problem>(
        &mut self,
        problem: &mut P,
        t: &mut f64,
        x: &mut [f64],
        end: f64,
    ) -> Result<Reached, Failure<P::Error>> {
        if self.proposal == 0.0 {
            self.proposal = self.first_step(x, end - *t);
        }
        let (mut rejected, mut tries) = (false, 0);
        while *t < end {
            tries += 1;
            if tries > MOST_STEPS {
                return Err(Failure::TooManySteps { state: self.limiting, steps: MOST_STEPS });
            }
            let rest = end - *t;
            let last = self.proposal >= rest * (1.0 - 1e-9);
            // Two equal steps rather than a long and a tiny one.
            let h = if last { rest } else { self.proposal.min(0.5 * rest) };
            let shortest = 16.0 * f64::EPSILON * t.abs().max(end.abs());
            if h < shortest && !last {
                return Err(Failure::Underflow { state: self.limiting, step: h });
            }
            let error = match self.attempt(problem, *t, h, x) {
                Ok(error) => error,
                Err(problem) if P::is_recoverable(&problem) && h > 8.0 * shortest => f64::INFINITY,
                Err(problem) => return Err(Failure::Problem(problem)),
            };
            if error.is_nan() || error > 1.0 {
                let factor = if error.is_finite() { SAFETY * error.powf(-1.0 / ORDER) } else { 0.0 };
                self.proposal = h * factor.max(SHRINK);
                self.work.rejected += 1;
                rejected = true;
                if self.proposal < shortest {
                    return Err(Failure::Underflow { state: self.limiting, step: h });
                }
                continue;
            }
            let longest = if rejected { 1.0 } else { GROW };
            let factor = (SAFETY * error.powf(-1.0 / ORDER)).clamp(SHRINK, longest);
            let shortened = h < self.proposal;
            self.proposal = if shortened { self.proposal.max(h * factor) } else { h * factor };
            rejected = false;

            let crossed = self.first_crossing();
            let mut reached = *t + h;
            if last {
                reached = end;
            }
            let mut event = None;
            if crossed.is_some() {
                let (length, indicator) = self.locate(problem, *t, h, x).map_err(Failure::Problem)?;
                if length < h {
                    reached = *t + length;
                }
                event = Some(Reached::Indicator(indicator));
            }
            self.work.accepted += 1;
            *t = reached;
            x.copy_from_slice(&self.step.end);
            std::mem::swap(&mut self.step.k[0], &mut self.end_rates);
            std::mem::swap(&mut self.start_indicators, &mut self.indicators);
            let wanted = problem.completed().map_err(Failure::Problem)?;
            if let Some(event) = event {
                return Ok(event);
            }
            if wanted {
                return Ok(Reached::Wanted);
            }
        }
        Ok(Reached::End)
    }

    /// Takes a step of `h` \[s\], evaluates its end and gives its error in units of the tolerance.
    fn attempt<P: Problem>(&mut self, problem: &mut P, t: f64, h: f64, x: &[f64]) -> Result<f64, P::Error> {
        self.trial(problem, t, h, x)?;
        let (relative, absolute, end) = (self.relative, &self.absolute, &self.step.end);
        let scale = |i: usize| absolute[i] + relative * x[i].abs().max(end[i].abs());
        let (error, state) = self.step.error(h, scale);
        self.limiting = state;
        if let Some(state) = (0..x.len()).find(|&i| !(end[i].is_finite() && self.end_rates[i].is_finite())) {
            self.limiting = state;
            return Ok(f64::INFINITY);
        }
        if self.indicators.iter().any(|z| z.is_nan()) {
            return Ok(f64::INFINITY);
        }
        Ok(error)
    }

    fn trial<P: Problem>(&mut self, problem: &mut P, t: f64, h: f64, x: &[f64]) -> Result<(), P::Error> {
        self.work.evaluations += if x.is_empty() { 1 } else { super::dop853::STAGES as u64 };
        self.step.take(|t, x, dx| problem.derivatives(t, x, dx), t, h, x)?;
        problem.derivatives(t + h, &self.step.end, &mut self.end_rates)?;
        problem.indicators(&mut self.indicators)
    }

    /// The first indicator that is in another domain than at the start of the step.
    fn first_crossing(&self) -> Option<usize> {
        self.start_indicators
            .iter()
            .zip(&self.indicators)
            .position(|(start, end)| (*start > 0.0) != (*end > 0.0))
    }

    /// Length of the step to just behind the first event, and its indicator; the step ends there.
    fn locate<P: Problem>(
        &mut self,
        problem: &mut P,
        t: f64,
        h: f64,
        x: &[f64],
    ) -> Result<(f64, usize), P::Error> {
        let shortest = 4.0 * f64::EPSILON * (t + h).abs();
        let width = (EVENT_FRACTION * h).min(EVENT_WIDTH).max(shortest);
        let (mut before, mut behind) = (0.0, h);
        let mut z_before = self.start_indicators.clone();
        let mut z_behind = self.indicators.clone();
        let mut taken = h;
        let mut tries = 0u32;
        while behind - before > width {
            tries += 1;
            let middle = 0.5 * (before + behind);
            // A secant through the indicators that changed converges fast, a bisection in between always does.
            let length = if tries.is_multiple_of(2) {
                middle
            } else {
                let root = |(a, b): (&f64, &f64)| {
                    ((*a > 0.0) != (*b > 0.0)).then(|| before + (behind - before) * a / (a - b))
                };
                let roots = z_before.iter().zip(&z_behind).filter_map(root).filter(|root| root.is_finite());
                let first = roots.fold(f64::INFINITY, f64::min);
                let side = if tries % 4 == 1 { 0.4 } else { -0.4 };
                if first.is_finite() { first + side * width } else { middle }
            };
            let length = length.clamp(before + 0.1 * width, behind - 0.1 * width);
            if !(length > before && length < behind) {
                break;
            }
            self.trial(problem, t, length, x)?;
            taken = length;
            if self.first_crossing().is_some() {
                behind = length;
                z_behind.clone_from(&self.indicators);
            } else {
                before = length;
                z_before.clone_from(&self.indicators);
            }
        }
        if taken != behind {
            self.trial(problem, t, behind, x)?;
        }
        Ok((behind, self.first_crossing().unwrap_or(0)))
    }

    /// A first step from the size of the states and their rates; the error control corrects it.
    fn first_step(&self, x: &[f64], span: f64) -> f64 {
        let norm = |values: &[f64]| -> f64 {
            let scaled = values.iter().zip(x).zip(&self.absolute);
            scaled.map(|((value, x), a)| (value / (a + self.relative * x.abs())).powi(2)).sum::<f64>().sqrt()
        };
        let (size, rate) = (norm(x), norm(&self.step.k[0]));
        let guess = if size > 1e-5 && rate > 1e-5 { 0.01 * size / rate } else { 1e-3 * span };
        if guess.is_finite() { guess.clamp(1e-6 * span, span) } else { 1e-3 * span }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x' = v, v' = -g, with the height as indicator.
    struct Fall {
        height: f64,
        evaluations: u64,
    }

    impl Problem for Fall {
        type Error = ();

        fn derivatives(&mut self, _: f64, x: &[f64], dx: &mut [f64]) -> Result<(), ()> {
            self.height = x[0];
            self.evaluations += 1;
            (dx[0], dx[1]) = (x[1], -9.81);
            Ok(())
        }

        fn indicators(&mut self, z: &mut [f64]) -> Result<(), ()> {
            z[0] = self.height;
            Ok(())
        }

        fn completed(&mut self) -> Result<bool, ()> {
            Ok(false)
        }

        fn is_recoverable((): &()) -> bool {
            true
        }
    }

    #[test]
    fn bounces_are_found_at_their_closed_form_times() {
        let mut problem = Fall { height: 0.0, evaluations: 0 };
        let mut integrator = Integrator::new(2, 1, 1e-10);
        let (mut t, mut x) = (0.0, vec![1.0, 0.0]);
        let mut expected = (2.0f64 / 9.81).sqrt();
        let mut speed = 9.81 * expected;
        for _ in 0..12 {
            integrator.restart(&mut problem, t, &x).unwrap();
            let reached = integrator.advance(&mut problem, &mut t, &mut x, 3.0).unwrap();
            assert_eq!(reached, Reached::Indicator(0));
            assert!((t - expected).abs() < 1e-10, "{t} {expected}");
            assert!(x[0] <= 0.0 && x[0] > -1e-8);
            speed *= 0.7;
            expected += 2.0 * speed / 9.81;
            x = vec![f64::MIN_POSITIVE, -0.7 * x[1]];
        }
        assert_eq!(problem.evaluations, integrator.work.evaluations);
    }

    #[test]
    fn an_end_is_met_exactly_and_the_error_keeps_to_the_tolerance() {
        struct Oscillator;
        impl Problem for Oscillator {
            type Error = ();
            fn derivatives(&mut self, _: f64, x: &[f64], dx: &mut [f64]) -> Result<(), ()> {
                (dx[0], dx[1]) = (x[1], -x[0]);
                Ok(())
            }
            fn indicators(&mut self, _: &mut [f64]) -> Result<(), ()> {
                Ok(())
            }
            fn completed(&mut self) -> Result<bool, ()> {
                Ok(false)
            }
            fn is_recoverable((): &()) -> bool {
                true
            }
        }
        let mut integrator = Integrator::new(2, 0, 1e-10);
        let (mut t, mut x) = (0.0, vec![1.0, 0.0]);
        integrator.restart(&mut Oscillator, t, &x).unwrap();
        assert_eq!(integrator.advance(&mut Oscillator, &mut t, &mut x, 10.0).unwrap(), Reached::End);
        assert_eq!(t, 10.0);
        assert!((x[0] - 10f64.cos()).abs() < 1e-8 && (x[1] + 10f64.sin()).abs() < 1e-8, "{x:?}");
        assert!(integrator.work.accepted < 60, "{:?}", integrator.work);
    }

    #[test]
    fn a_solution_that_ends_is_an_underflow_of_the_step() {
        struct Blowup;
        impl Problem for Blowup {
            type Error = ();
            fn derivatives(&mut self, _: f64, x: &[f64], dx: &mut [f64]) -> Result<(), ()> {
                dx[0] = x[0] * x[0];
                Ok(())
            }
            fn indicators(&mut self, _: &mut [f64]) -> Result<(), ()> {
                Ok(())
            }
            fn completed(&mut self) -> Result<bool, ()> {
                Ok(false)
            }
            fn is_recoverable((): &()) -> bool {
                true
            }
        }
        // x = 1 / (1 - t) has no value at t = 1.
        let mut integrator = Integrator::new(1, 0, 1e-8);
        let (mut t, mut x) = (0.0, vec![1.0]);
        integrator.restart(&mut Blowup, t, &x).unwrap();
        let failure = integrator.advance(&mut Blowup, &mut t, &mut x, 2.0).unwrap_err();
        assert!(matches!(failure, Failure::Underflow { state: 0, .. }), "{failure:?}");
        assert!((t - 1.0).abs() < 1e-6, "{t}");
    }
}
