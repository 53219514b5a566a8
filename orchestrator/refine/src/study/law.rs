//! The laws of the candidate effects, as forces and as changes of a command: the equations of a block at an attachment.

use super::command::Command;

/// Signals that a law may depend on.
#[derive(Debug, Clone, Copy, Default)]
pub struct Point {
    /// Velocity at the attachment.
    pub velocity: f64,
    /// Position at the attachment.
    pub position: f64,
    /// Pressure force \[N\].
    pub pressure_force: f64,
    /// Chamber pressure \[Pa\].
    pub pressure: f64,
    /// Time since the beginning of the record \[s\].
    pub time: f64,
    /// The value that passes the attachment.
    pub value: f64,
}

impl Point {
    /// Variables of formulas: position, velocity, value, time.
    pub fn variables(&self) -> [f64; 4] {
        [self.position, self.velocity, self.value, self.time]
    }

    /// A point on the way to another, this part of it.
    pub fn toward(self, other: Point, part: f64) -> Point {
        let between = |a: f64, b: f64| a + part * (b - a);
        Point {
            velocity: between(self.velocity, other.velocity),
            position: between(self.position, other.position),
            pressure_force: between(self.pressure_force, other.pressure_force),
            pressure: between(self.pressure, other.pressure),
            time: between(self.time, other.time),
            value: between(self.value, other.value),
        }
    }

    /// The point between two.
    pub fn mean(self, other: Point) -> Point {
        self.toward(other, 0.5)
    }

    /// Value of a variable.
    pub fn of(&self, variable: Variable) -> f64 {
        match variable {
            Variable::Velocity => self.velocity,
            Variable::Position => self.position,
            Variable::PressureForce => self.pressure_force,
            Variable::Value => self.value,
            Variable::Time => self.time,
        }
    }
}

/// A variable that a free form is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variable {
    /// Velocity at the attachment.
    Velocity,
    /// Position at the attachment.
    Position,
    /// Pressure force.
    PressureForce,
    /// The value that passes.
    Value,
    /// Time since the beginning of the record.
    Time,
}

/// Ratio of pressures below which the flow of air is choked.
const CRITICAL_RATIO: f64 = 0.528;

/// Knots of a free form.
pub const KNOTS: usize = 8;

/// Piecewise linear through `heights`, `[KNOTS]`, over `range`; over a velocity that changes its sign it may jump at
/// zero.
pub fn shape(variable: Variable, heights: &[f64], range: (f64, f64), at: f64) -> f64 {
    let line = |heights: &[f64], low: f64, high: f64| {
        let last = heights.len() - 1;
        let place = ((at - low) / (high - low) * last as f64).clamp(0.0, last as f64);
        let below = (place as usize).min(last - 1);
        heights[below] + (place - below as f64) * (heights[below + 1] - heights[below])
    };
    let (low, high) = range;
    if variable == Variable::Velocity && low < 0.0 && high > 0.0 {
        let half = heights.len() / 2;
        if at < 0.0 { line(&heights[..half], low, 0.0) } else { line(&heights[half..], 0.0, high) }
    } else {
        line(heights, low, high)
    }
}

/// A law; its parameters stand in the order of [`Law::parameters`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Law {
    /// `coef v`
    Viscous,
    /// `force s(v)`
    Coulomb,
    /// `force exp(-(v/vs)^2) s(v)`
    Stribeck,
    /// Coulomb level times `z/disp - s(v)`, `z' = v - |v| z/disp`
    Presliding,
    /// `coef |F| s(v)`, F the pressure force
    Pressure,
    /// `value`
    Offset,
    /// v > 0: `force s(v) + coef v`
    Asymmetry,
    /// `slope x s(v)`
    PositionCoulomb,
    /// `(sine sin(2 pi x / period) + cosine cos(2 pi x / period)) s(v)`
    PeriodicCoulomb,
    /// `coef |value| s(v)`: friction of a gear or guide under load, with a sign change of its own
    Load,
    /// `coef |v| v`
    Drag,
    /// `stiffness x + force`
    Spring,
    /// x > pos: `max(0, stiffness (x - pos) + damping v)`
    EndStop,
    /// x < pos: `min(0, stiffness (x - pos) + damping v)`
    LowerStop,
    /// `sine sin(2 pi x / period) + cosine cos(2 pi x / period)`
    Cogging,
    /// `-coef p`
    Area,
    /// `-gain` times the value that passes
    Gain,
    /// value less itself clipped: dead band
    DeadBand,
    /// value clipped
    Saturation,
    /// value clipped between two values
    Limits,
    /// value rounded to a multiple of a step
    Quantization,
    /// gain that changes with position
    PositionGain,
    /// gain that falls with time
    Droop,
    /// `stiffness (x - rest)^3`
    CubicSpring,
    /// `coef x`
    Leakage,
    /// `coef sqrt(max(x, 0))`
    Outlet,
    /// `coef max(0, x - level)`
    Overflow,
    /// `coef max(0, x - level)`, and `caught max(0, x - level)` of it added at another port, which [`Law::Caught`]
    /// does
    CaughtOverflow,
    /// `-caught max(0, x - level)` with the parameters of [`Law::CaughtOverflow`]; x is the position at another
    /// attachment: its index
    Caught(usize),
    /// `coef x sqrt(1 - (max(0, outside/x - b)/(1 - b))^2)` with the critical ratio of pressures b of a gas
    Choked,
    /// `slope t`
    Drift,
    /// `-value`
    Bias,
    /// Change with a memory of a signal inside of the system
    Memory(Command),
    /// Free form over a variable: heights at knots over its range; see [`shape`]
    Shape(Variable),
    /// An effect of one's own: index into [`super::model::Study::own`].
    Own(usize),
    /// Heights of a free form: index into [`super::model::Study::surfaces`].
    Surface(usize),
}

impl Law {
    /// Number of parameters; that of an effect of one's own is known to the study alone.
    pub fn parameters(self) -> usize {
        match self {
            Law::Stribeck | Law::Asymmetry | Law::Spring | Law::Droop => 2,
            Law::CubicSpring | Law::Overflow | Law::Limits | Law::Choked => 2,
            Law::EndStop | Law::LowerStop | Law::Cogging | Law::PeriodicCoulomb => 3,
            Law::CaughtOverflow | Law::Caught(_) => 3,
            Law::Shape(_) => KNOTS,
            Law::Memory(kind) => kind.parameters(),
            _ => 1,
        }
    }

    /// Variables that the law depends on; a bias is part of any free form over velocity or position.
    pub fn variables(self) -> Vec<Variable> {
        use Variable::{Position, PressureForce, Time, Value, Velocity};
        match self {
            Law::Viscous | Law::Coulomb | Law::Stribeck | Law::Presliding => vec![Velocity],
            Law::Asymmetry | Law::Drag => vec![Velocity],
            Law::Pressure => vec![Velocity, PressureForce],
            Law::Offset => vec![Velocity, Position],
            Law::PositionCoulomb | Law::PeriodicCoulomb => vec![Velocity, Position],
            Law::Load => vec![Velocity, Value],
            Law::Spring | Law::EndStop | Law::LowerStop | Law::Cogging => vec![Position],
            Law::CubicSpring | Law::Leakage | Law::Outlet | Law::Overflow | Law::Choked => vec![Position],
            Law::CaughtOverflow | Law::Caught(_) => vec![Position],
            Law::Drift => vec![Time],
            Law::Bias => vec![Value, Position],
            Law::Area => vec![PressureForce],
            Law::Gain | Law::DeadBand | Law::Saturation | Law::Limits => vec![Value],
            Law::Quantization | Law::Memory(_) => vec![Value],
            Law::PositionGain => vec![Value, Position],
            Law::Droop => vec![Value, Time],
            Law::Shape(variable) => vec![variable],
            Law::Own(_) | Law::Surface(_) => vec![Velocity, Position, Value, Time],
        }
    }

    /// Whether the law changes a command instead of taking a force from it.
    pub fn changes_command(self) -> bool {
        matches!(
            self,
            Law::Gain
                | Law::DeadBand
                | Law::Saturation
                | Law::Limits
                | Law::Quantization
                | Law::PositionGain
                | Law::Droop
                | Law::Memory(_)
        )
    }

    /// Whether the force has a factor that changes its sign with the velocity.
    pub fn changes_sign_with_velocity(self) -> bool {
        matches!(
            self,
            Law::Coulomb
                | Law::Stribeck
                | Law::Presliding
                | Law::Pressure
                | Law::Asymmetry
                | Law::PositionCoulomb
                | Law::PeriodicCoulomb
                | Law::Load
        )
    }

    /// Place in the order in which laws act at one attachment: changes of a command first, as the amended system has
    /// them.
    pub fn rank(self) -> usize {
        match self {
            Law::Memory(kind) => kind.rank(),
            Law::Quantization => 6,
            Law::DeadBand => 7,
            Law::Saturation | Law::Limits => 8,
            Law::Gain => 9,
            Law::PositionGain => 10,
            Law::Droop => 11,
            // It takes its part of what comes in before others take theirs.
            Law::Load => 12,
            _ => 13,
        }
    }

    /// Level that the law adds to the factor `s` that changes sign with the velocity, on which presliding acts as well.
    pub fn level(self, p: &[f64], at: &Point) -> f64 {
        match self {
            Law::Coulomb => p[0],
            Law::Stribeck => p[0] * (-(at.velocity / p[1]).powi(2)).exp(),
            Law::Pressure => p[0] * at.pressure_force.abs(),
            Law::PositionCoulomb => p[0] * at.position,
            Law::PeriodicCoulomb => repeated(p, at.position),
            Law::Load => p[0] * at.value.abs(),
            Law::Asymmetry if at.velocity > 0.0 => p[0],
            _ => 0.0,
        }
    }

    /// Value subtracted from the one that passes the attachment. `s` is the factor that changes sign with the velocity,
    /// where there is one, `z` the state of presliding, `level` the Coulomb level it acts on.
    pub fn force(self, p: &[f64], at: &Point, s: f64, z: f64, level: f64) -> f64 {
        let (v, x) = (at.velocity, at.position);
        match self {
            Law::Viscous => p[0] * v,
            Law::Coulomb | Law::Stribeck | Law::Pressure => self.level(p, at) * s,
            Law::PositionCoulomb | Law::PeriodicCoulomb | Law::Load => self.level(p, at) * s,
            Law::Presliding => level * (z / p[0] - s),
            Law::Offset => p[0],
            Law::Asymmetry => {
                if v > 0.0 {
                    p[0] * s + p[1] * v
                } else {
                    0.0
                }
            }
            Law::Drag => p[0] * v.abs() * v,
            Law::Spring => p[0] * x + p[1],
            Law::EndStop => {
                if x > p[2] {
                    (p[0] * (x - p[2]) + p[1] * v).max(0.0)
                } else {
                    0.0
                }
            }
            Law::LowerStop => {
                if x < p[2] {
                    (p[0] * (x - p[2]) + p[1] * v).min(0.0)
                } else {
                    0.0
                }
            }
            Law::Choked => {
                let above = (p[1] / x - CRITICAL_RATIO).max(0.0) / (1.0 - CRITICAL_RATIO);
                p[0] * x * (1.0 - above * above).max(0.0).sqrt()
            }
            Law::Cogging => repeated(p, x),
            Law::Area => -p[0] * at.pressure,
            Law::CubicSpring => p[0] * (x - p[1]).powi(3),
            Law::Leakage => p[0] * x,
            Law::Outlet => p[0] * x.max(0.0).sqrt(),
            Law::Overflow | Law::CaughtOverflow => p[0] * (x - p[1]).max(0.0),
            Law::Caught(_) => -p[2] * (x - p[1]).max(0.0),
            Law::Drift => p[0] * at.time,
            Law::Bias => -p[0],
            Law::Gain | Law::DeadBand | Law::Saturation | Law::Limits => 0.0,
            Law::Quantization | Law::PositionGain | Law::Droop => 0.0,
            // Computed by the study, which has their formulas and memories.
            Law::Memory(_) | Law::Shape(_) | Law::Own(_) | Law::Surface(_) => 0.0,
        }
    }

    /// The command that leaves the attachment for the one that enters.
    pub fn command(self, p: &[f64], at: &Point, value: f64) -> f64 {
        match self {
            Law::Gain => (1.0 + p[0]) * value,
            Law::DeadBand => value - value.clamp(-p[0].abs(), p[0].abs()),
            Law::Saturation => value.clamp(-p[0].abs(), p[0].abs()),
            Law::Limits => value.min(p[1]).max(p[0]),
            Law::Quantization => rounded(value, p[0]),
            Law::PositionGain => (1.0 + p[0] * at.position) * value,
            Law::Droop => (1.0 - p[0] * (1.0 - (-at.time / p[1]).exp())) * value,
            _ => value,
        }
    }
}

/// `sine sin(2 pi x / period) + cosine cos(2 pi x / period)` with p = \[sine, cosine, period\].
fn repeated(p: &[f64], x: f64) -> f64 {
    let phase = std::f64::consts::TAU * x / p[2];
    p[0] * phase.sin() + p[1] * phase.cos()
}

/// The multiple of `step` that is nearest to a value, the upper one of two; the value itself where the step is none.
pub fn rounded(value: f64, step: f64) -> f64 {
    if step > 0.0 { step * (value / step + 0.5).floor() } else { value }
}

/// State of presliding after `step` \[s\] at velocity `v`: the exact solution of `z' = v - |v| z/disp`.
pub fn preslide(z: f64, v: f64, disp: f64, step: f64) -> f64 {
    let end = disp * v.signum();
    if v == 0.0 { z } else { end + (z - end) * (-v.abs() * step / disp).exp() }
}

/// State of presliding after `step` \[s\] while the velocity goes from `from` to `to` in a line: exact, as the state
/// follows the path, `dz/ds = sgn(v) - z/disp`.
pub fn preslide_along(z: f64, [from, to]: [f64; 2], disp: f64, step: f64) -> f64 {
    if from * to >= 0.0 {
        return preslide(z, 0.5 * (from + to), disp, step);
    }
    // It stops and turns.
    let first = step * from / (from - to);
    preslide(preslide(z, 0.5 * from, disp, first), 0.5 * to, disp, step - first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presliding_is_a_spring_first_and_coulomb_friction_in_the_end() {
        // z follows the path at first (dz = dx) and saturates at disp.
        assert!((preslide(0.0, 0.1, 1e-3, 1e-6) - 1e-7).abs() < 1e-10);
        assert!((preslide(0.0, -0.1, 1e-3, 1.0) + 1e-3).abs() < 1e-12);
        assert_eq!(preslide(5e-4, 0.0, 1e-3, 1.0), 5e-4);
    }

    #[test]
    fn presliding_follows_the_path_where_the_motion_turns() {
        let (from, to, disp, step) = (0.3, -0.2, 1e-3, 5e-3);
        let count = 100_000;
        let h = step / f64::from(count);
        let fine = (0..count).fold(2e-4, |z, k| {
            preslide(z, from + (to - from) * (f64::from(k) + 0.5) / f64::from(count), disp, h)
        });
        assert!((preslide_along(2e-4, [from, to], disp, step) - fine).abs() < 1e-9 * disp);
    }

    #[test]
    fn presliding_acts_on_the_level_that_other_friction_adds() {
        let at = Point { velocity: -0.1, position: 0.2, pressure_force: -30.0, ..Point::default() };
        assert_eq!(Law::Coulomb.level(&[2.0], &at), 2.0);
        assert_eq!(Law::Pressure.level(&[0.1], &at), 3.0);
        assert!((Law::Stribeck.level(&[2.0, 0.1], &at) - 2.0 / std::f64::consts::E).abs() < 1e-12);
        assert_eq!((Law::Asymmetry.level(&[1.0, 5.0], &at), Law::Viscous.level(&[9.0], &at)), (0.0, 0.0));
    }

    #[test]
    fn an_end_stop_only_pushes() {
        let at = |x: f64, v: f64| Point { position: x, velocity: v, ..Point::default() };
        let force = |x, v| Law::EndStop.force(&[100.0, 10.0, 0.2], &at(x, v), 0.0, 0.0, 0.0);
        assert_eq!((force(0.1, 1.0), force(0.3, -5.0)), (0.0, 0.0));
        assert!((force(0.3, 0.5) - 15.0).abs() < 1e-12);
        let force = |x, v| Law::LowerStop.force(&[100.0, 10.0, -0.2], &at(x, v), 0.0, 0.0, 0.0);
        assert_eq!((force(-0.1, -1.0), force(-0.3, 5.0)), (0.0, 0.0));
        assert!((force(-0.3, -0.5) + 15.0).abs() < 1e-12);
    }

    #[test]
    fn a_part_of_what_runs_over_comes_in_at_the_next_level() {
        let at = |x: f64| Point { position: x, ..Point::default() };
        let flow = |law: Law, x: f64| law.force(&[2.0, 0.5, 1.2], &at(x), 0.0, 0.0, 0.0);
        assert_eq!((flow(Law::CaughtOverflow, 0.4), flow(Law::Caught(0), 0.4)), (0.0, 0.0));
        assert!((flow(Law::CaughtOverflow, 0.75) - 0.5).abs() < 1e-15);
        assert!((flow(Law::Caught(0), 0.75) + 0.3).abs() < 1e-15);
    }

    #[test]
    fn a_free_form_goes_through_its_heights_and_may_jump_where_a_velocity_changes_its_sign() {
        let heights = [3.0, 2.0, 1.0, 0.5, -0.5, -1.0, -2.0, -3.0];
        let velocity = |v| shape(Variable::Velocity, &heights, (-0.3, 0.6), v);
        assert_eq!((velocity(-0.3), velocity(0.0), velocity(0.6)), (3.0, -0.5, -3.0));
        assert!((velocity(-0.05) - 0.75).abs() < 1e-12);
        let place = |x| shape(Variable::Position, &heights, (0.0, 7.0), x);
        assert_eq!((place(-1.0), place(2.5), place(9.0)), (3.0, 0.75, -3.0));
    }

    #[test]
    fn a_command_loses_what_lies_in_the_dead_band() {
        let at = Point::default();
        assert_eq!(Law::DeadBand.command(&[0.5], &at, 2.0), 1.5);
        assert_eq!(Law::DeadBand.command(&[0.5], &at, -0.3), 0.0);
        assert_eq!(Law::Saturation.command(&[0.5], &at, -2.0), -0.5);
        let rounded = [1.2, 1.3, -1.2, -1.3].map(|u| Law::Quantization.command(&[0.5], &at, u));
        assert_eq!(rounded, [1.0, 1.5, -1.0, -1.5]);
        assert_eq!(Law::Quantization.command(&[0.0], &at, 0.3), 0.3);
    }
}
