//! A pure delay: tube, bus.

use fmi_export::{MemoryBlock, Outcome, Real, Refusal, Scalar, Table, Values};

/// `u(t - delay)`, linear between samples and 0 before the first unless it is filled.
pub struct Delay {
    delay: Real,
    /// Signals of the last samples, youngest first.
    line: MemoryBlock,
}

impl Delay {
    pub fn declare(t: &mut Table, longest: usize) -> Self {
        let delay = t.parameter("delay").unit("s").about("pure delay").min(0.0).nominal(0.001).real(0.0);
        Self { delay, line: t.memory(longest) }
    }

    /// Refuses what does not fit the memory.
    pub fn check<S: Scalar>(&self, q: &Values<S>, sample_time: S) -> Outcome {
        let samples = q[self.delay].value() / sample_time.value();
        if samples + 1.0 > self.line.len() as f64 {
            return Err(Refusal::Error(format!(
                "delay = {} s is {samples:.1} samples of {} s, but {} are kept; use a shorter delay or a longer sample_time",
                q[self.delay].value(),
                sample_time.value(),
                self.line.len() - 1
            )));
        }
        Ok(())
    }

    pub fn output<S: Scalar>(&self, q: &Values<S>, u: S, sample_time: S) -> S {
        let samples = q[self.delay] / sample_time;
        if samples.value() <= 0.0 {
            return u;
        }
        let whole = samples.value().floor();
        let part = samples - whole;
        let back = |i: usize| if i == 0 { u } else { q[self.line.at(i - 1)] };
        let i = whole as usize;
        let (near, far) = (back(i), back(i + 1));
        near + part * (far - near)
    }

    /// The signal had this value for long.
    pub fn fill<S: Scalar>(&self, q: &mut Values<S>, u: S) {
        (0..self.line.len()).for_each(|i| q[self.line.at(i)] = u);
    }

    pub fn push(&self, q: &mut Values<f64>, u: f64) {
        let used = ((q[self.delay] > 0.0) as usize) * self.line.len();
        for i in (1..used).rev() {
            q[self.line.at(i)] = q[self.line.at(i - 1)];
        }
        if used > 0 {
            q[self.line.at(0)] = u;
        }
    }

    pub fn switch_off(&self, q: &mut Values<f64>) {
        q[self.delay] = 0.0;
    }
}
