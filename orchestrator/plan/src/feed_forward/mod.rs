//! Commands that make a sampled linear actuator deliver a planned output: its inversion under bounds, by least squares.
//!
//! [`Actuator`] is the model; [`invert`] finds the command, [`direct`] answers what happens without a model, with the
//! planned output as the command. The caller provides plan and model.

mod actuator;
#[cfg(test)]
mod tests;

pub use actuator::Actuator;
use airloop_ident::fit;
use airloop_optim::{Bounds, Quadratic, QuadraticStatus, solve_quadratic};

/// Reason why there is no command.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Matrices that do not belong together.
    #[error(
        "the actuator has {states} states, but its {matrix} has {found} entries; give one row per state and command"
    )]
    Shape {
        /// Number of states.
        states: usize,
        /// Name of the matrix.
        matrix: &'static str,
        /// Its entries.
        found: usize,
    },
    /// A model without a steady state, or whose output does not answer its command in the end.
    #[error("the actuator has no steady state for a constant output: {reason}")]
    NoSteadyState {
        /// Missing part.
        reason: &'static str,
    },
    /// A setting outside its range.
    #[error("{name} = {value} must be {allowed}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Allowed values.
        allowed: &'static str,
    },
    /// No planned output, or a value in it that is not a number.
    #[error("the planned output {0}")]
    Target(String),
    /// The steady command of the first planned value is out of reach.
    #[error(
        "the planned output starts at {start}, which takes a command of {command}, outside {lower} .. {upper}; plan a \
         start within reach"
    )]
    Reach {
        /// First planned output.
        start: f64,
        /// Its steady command.
        command: f64,
        /// Smallest command.
        lower: f64,
        /// Largest command.
        upper: f64,
    },
    /// The quadratic program was not solved.
    #[error(
        "the commands were not found: the quadratic program ended as {0:?}; try another weight of the changes"
    )]
    Unsolved(QuadraticStatus),
    /// The quadratic program is malformed.
    #[error(transparent)]
    Optim(#[from] airloop_optim::Error),
    /// Plan and output cannot be compared.
    #[error(transparent)]
    Fit(#[from] fit::Error),
}

/// Requirements on the commands; outputs and commands have one unit.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Smallest command.
    pub lower: f64,
    /// Largest command.
    pub upper: f64,
    /// Divides errors and changes before they are squared, > 0; usually the largest command.
    pub scale: f64,
    /// Weight of the changes of the command against the error of the output, >= 0.
    pub smoothness: f64,
}

/// A command with what it brings about.
#[derive(Clone, Debug)]
pub struct Command {
    /// u(k), `[n]`.
    pub u: Vec<f64>,
    /// y(k) of the model, `[n]`.
    pub y: Vec<f64>,
    /// Fit of y to the plan (eq. 9).
    pub fit: fit::Fit,
    /// Delay of y against the plan \[samples\] at which the correlation of their changes is largest; < 0: early.
    pub late: i64,
}

/// The command whose output is next to the plan: minimizes
/// `sum_k ((y(k) - plan(k)) / scale)² + smoothness sum_k ((u(k) - u(k-1)) / scale)²` under `lower <= u(k) <= upper`,
/// from the steady state of the first planned value with `u(-1)` its steady command.
///
/// | name | shape | unit |
/// |------|-------|------|
/// | `plan` | \[n\] | that of the output |
///
/// # Errors
/// See [`Error`].
pub fn invert(actuator: &Actuator, plan: &[f64], settings: Settings) -> Result<Command, Error> {
    let (state, before) = start(actuator, plan, settings)?;
    let problem = quadratic(actuator, plan, settings, &state, before);
    let solution = solve_quadratic(&problem)?;
    if solution.status != QuadraticStatus::Solved {
        return Err(Error::Unsolved(solution.status));
    }
    let stride = actuator.states() + 1;
    let within = |u: f64| (u * settings.scale).clamp(settings.lower, settings.upper);
    let u = solution.x.chunks(stride).map(|stage| within(stage[stride - 1])).collect();
    judge(actuator, plan, state, u)
}

/// The planned output itself as the command, cut to the bounds, from the same start as [`invert`].
///
/// # Errors
/// See [`Error`].
pub fn direct(actuator: &Actuator, plan: &[f64], settings: Settings) -> Result<Command, Error> {
    let (state, _) = start(actuator, plan, settings)?;
    let u = plan.iter().map(|y| y.clamp(settings.lower, settings.upper)).collect();
    judge(actuator, plan, state, u)
}

/// Steady state and command of the first planned value, with everything checked.
fn start(actuator: &Actuator, plan: &[f64], settings: Settings) -> Result<(Vec<f64>, f64), Error> {
    let positive = |name, value: f64| {
        let good = value > 0.0 && value.is_finite();
        if good { Ok(()) } else { Err(Error::Setting { name, value, allowed: "positive and finite" }) }
    };
    positive("scale", settings.scale)?;
    positive("upper - lower", settings.upper - settings.lower)?;
    if !(settings.smoothness >= 0.0 && settings.smoothness.is_finite()) {
        let (name, value) = ("smoothness", settings.smoothness);
        return Err(Error::Setting { name, value, allowed: "0 or more, and finite" });
    }
    let Some(&first) = plan.first() else { return Err(Error::Target("has no samples".into())) };
    if let Some(k) = plan.iter().position(|y| !y.is_finite()) {
        return Err(Error::Target(format!("is {} at sample {k}", plan[k])));
    }
    let command = first / actuator.gain()?;
    let (lower, upper) = (settings.lower, settings.upper);
    if !(lower..=upper).contains(&command) {
        return Err(Error::Reach { start: first, command, lower, upper });
    }
    Ok((actuator.steady_state(command)?, command))
}

/// The quadratic program in stages of states and command, all divided by `scale`.
fn quadratic(actuator: &Actuator, plan: &[f64], settings: Settings, state: &[f64], before: f64) -> Quadratic {
    let (n, stride) = (actuator.states(), actuator.states() + 1);
    let count = plan.len() * stride;
    let (s, weight) = (settings.scale, 2.0 * settings.smoothness);
    let mut hessian = Vec::with_capacity(plan.len() * (stride * (stride + 1) / 2 + 3));
    let mut gradient = vec![0.0; count];
    let mut rows = Vec::with_capacity(plan.len() * n * (n + 2));
    let mut bounds = Bounds::free(count);
    let output = |i: usize| if i < n { actuator.c()[i] } else { actuator.d() };
    for (k, planned) in plan.iter().enumerate() {
        let at = |i: usize| k * stride + i;
        for i in 0..stride {
            hessian.extend((0..=i).map(|j| (at(i), at(j), 2.0 * output(i) * output(j))));
            gradient[at(i)] -= 2.0 * output(i) * planned / s;
        }
        hessian.push((at(n), at(n), weight));
        if k == 0 {
            gradient[at(n)] -= weight * before / s;
            for (i, x) in state.iter().enumerate() {
                (bounds.lower[i], bounds.upper[i]) = (x / s, x / s);
            }
        } else {
            let last = at(n) - stride;
            hessian.extend([(last, last, weight), (at(n), last, -weight)]);
            for i in 0..n {
                let row = (k - 1) * n + i;
                rows.push((row, at(i), -1.0));
                rows.extend((0..n).map(|j| (row, at(j) - stride, actuator.a()[i * n + j])));
                rows.push((row, last, actuator.b()[i]));
            }
        }
        (bounds.lower[at(n)], bounds.upper[at(n)]) = (settings.lower / s, settings.upper / s);
    }
    let row_bounds = Bounds::zero((plan.len() - 1) * n);
    Quadratic { hessian, gradient, rows, row_bounds, bounds }
}

fn judge(actuator: &Actuator, plan: &[f64], state: Vec<f64>, u: Vec<f64>) -> Result<Command, Error> {
    let y = actuator.simulate(state, &u);
    let fit = fit::nrmse(plan, &y)?;
    Ok(Command { late: late(plan, &y), u, y, fit })
}

/// Shift of `y` against `plan` with the largest correlation of the changes, at most a quarter of the length; the
/// smallest shift among equals.
fn late(plan: &[f64], y: &[f64]) -> i64 {
    let changes = |s: &[f64]| s.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>();
    let (plan, y) = (changes(plan), changes(y));
    let most = (plan.len() / 4) as i64;
    let correlation = |shift: i64| -> f64 {
        let (from, to) = (shift.max(0) as usize, (-shift).max(0) as usize);
        y.iter().skip(from).zip(plan.iter().skip(to)).map(|(a, b)| a * b).sum()
    };
    let mut best = (0, correlation(0));
    for shift in (1..=most).flat_map(|shift| [shift, -shift]) {
        let found = correlation(shift);
        if found > best.1 {
            best = (shift, found);
        }
    }
    best.0
}
