//! Names of variables and constraints, and sentences about what is violated.

use std::fmt;

use super::part::{Label, Part};
use super::problem::{Quantity, Variable};
use super::program::{Position, Program};
use airloop_optim::Nlp;

/// The phase in front of a name, where there are several.
fn prefix(program: &Program<'_>, part: &Part) -> String {
    if program.parts.len() > 1 { format!("{}: ", part.name) } else { String::new() }
}

pub(super) fn variable(program: &Program<'_>, variable: usize) -> String {
    let begins = program.phase_times(program.last_point());
    let part = program.parts.iter().zip(&begins).rfind(|(part, _)| part.layout.first <= variable);
    let Some((part, begin)) = part else { return format!("variable {variable}") };
    let (layout, free) = (&part.layout, part.layout.free);
    let local = variable - layout.first;
    let (k, mut a) = ((local / layout.stride()).min(layout.intervals), 0);
    a += local - k * layout.stride();
    let mut s = part.fractions[k];
    if a >= layout.node_width() {
        s = 0.5 * (s + part.fractions[k + 1]);
        a = a - layout.node_width() + free + layout.states + layout.inputs - layout.middle;
    }
    let time = begin + s * part.duration_at(program.last_point());
    let name = if a < free { "duration" } else { part.names[a - free].as_str() };
    format!("{}{name} at t = {time:.4} s", prefix(program, part))
}

pub(super) fn constraint(program: &Program<'_>, constraint: usize) -> String {
    match program.position(constraint) {
        None => format!("constraint {constraint}"),
        Some(Position::Limit(part, limit, time)) => {
            let limit = &part.limits[limit];
            let what = expression(&limit.quantity, &part.names, part.layout.states, part.layout.inputs);
            format!("{}{}: {what} at t = {time:.4} s", prefix(program, part), limit.name)
        }
        Some(Position::Defect(part, row, time)) => {
            let states = part.layout.states;
            let kind = if row < states { "defect" } else { "midpoint" };
            let name = &part.names[row % states];
            format!("{}{kind} of {name} after t = {time:.4} s", prefix(program, part))
        }
        Some(Position::Linear(part, label, time)) => {
            let name = match label {
                Label::Rate(rate) => part.rates[rate].0.as_str(),
                Label::Duration => "one duration for the phase",
            };
            format!("{}{name} at t = {time:.4} s", prefix(program, part))
        }
        Some(Position::Joint(_, name, _, time)) => format!("{name} at t = {time:.4} s"),
    }
}

/// A quantity in words: `x`, `2 x - theta`.
fn expression(quantity: &Quantity, names: &[String], states: usize, inputs: usize) -> String {
    let mut text = String::new();
    for &(variable, factor) in &quantity.terms {
        let name = &names[match variable {
            Variable::State(i) => i,
            Variable::Input(i) => states + i,
            Variable::Output(i) => states + inputs + i,
        }];
        let sign = match (text.is_empty(), factor < 0.0) {
            (true, false) => "",
            (true, true) => "-",
            (false, false) => " + ",
            (false, true) => " - ",
        };
        text += sign;
        if factor.abs() != 1.0 {
            text += &format!("{} ", factor.abs());
        }
        text += name;
    }
    text
}

/// A violated limit. [`fmt::Display`] gives e.g. `stroke: |x| <= 0.15 m at t = 1.28 s violated by 3 mm`,
/// after the phase where there are several.
#[derive(Debug, Clone, PartialEq)]
pub struct Violation {
    /// Phase, where there are several; that of a link is the phase it leads to.
    pub phase: Option<String>,
    /// Name of the limit or of the equation.
    pub name: String,
    /// Bounded quantity, in words; empty for equations of the program itself.
    pub expression: String,
    /// Unit.
    pub unit: String,
    /// Lower bound.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
    /// Time, s.
    pub time: f64,
    /// Amount by which it is violated, in its unit.
    pub amount: f64,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Violation { phase, name, expression, unit, lower, upper, time, amount } = self;
        if let Some(phase) = phase {
            write!(f, "phase `{phase}`, ")?;
        }
        write!(f, "{name}")?;
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        if !expression.is_empty() {
            write!(f, ": ")?;
            if lower == upper {
                write!(f, "{expression} = {lower}{unit}")?;
            } else if -lower == *upper {
                write!(f, "|{expression}| <= {upper}{unit}")?;
            } else if !lower.is_finite() {
                write!(f, "{expression} <= {upper}{unit}")?;
            } else if !upper.is_finite() {
                write!(f, "{expression} >= {lower}{unit}")?;
            } else {
                write!(f, "{lower} <= {expression} <= {upper}{unit}")?;
            }
        }
        write!(f, " at t = {} s violated by {}", rounded(*time, 4), amount_in(*amount, &self.unit))
    }
}

/// A number with at most that many decimals, without zeros at its end.
fn rounded(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// An amount with three digits, with a prefix of the unit where that is one letter or rad.
fn amount_in(amount: f64, unit: &str) -> String {
    let prefixed = matches!(unit, "m" | "s" | "N" | "rad" | "V" | "A" | "W" | "J" | "Pa" | "Hz");
    let scales = [(1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")];
    let digits = |value: f64| {
        let decimals = (2 - value.abs().max(1e-300).log10().floor() as i32).clamp(0, 12);
        rounded(value, decimals as usize)
    };
    match scales.iter().find(|(scale, _)| amount >= *scale * 0.9995) {
        Some((scale, prefix)) if prefixed => format!("{} {prefix}{unit}", digits(amount / scale)),
        Some((1.0, _)) => format!("{} {unit}", digits(amount)).trim_end().to_owned(),
        _ => format!("{amount:.3e} {unit}").trim_end().to_owned(),
    }
}

impl Program<'_> {
    /// Limits, links and equations that are violated by more than `tolerance` at `x`, the worst first; amounts count in
    /// their own units.
    ///
    /// # Errors
    /// Fails where the dynamics have no value at `x`.
    pub fn violations(
        &mut self,
        x: &[f64],
        tolerance: f64,
    ) -> Result<Vec<Violation>, airloop_optim::EvaluationError> {
        let mut values = vec![0.0; self.constraints()];
        self.constraint_values(x, &mut values)?;
        let bounds = self.constraint_bounds();
        let mut found = Vec::new();
        for (constraint, &value) in values.iter().enumerate() {
            let amount = (bounds.lower[constraint] - value).max(value - bounds.upper[constraint]);
            if amount > tolerance {
                found.extend(self.violation(constraint, amount));
            }
        }
        for (variable, &value) in x.iter().enumerate() {
            let Bound { lower, upper } = self.bound(variable);
            let amount = (lower - value).max(value - upper);
            if amount > tolerance {
                found.extend(self.bound_violation(variable, usize::from(value > upper), amount));
            }
        }
        found.sort_by(|a, b| b.amount.total_cmp(&a.amount));
        Ok(found)
    }

    fn bound(&self, variable: usize) -> Bound {
        let bounds = &self.bounds.bounds;
        Bound { lower: bounds.lower[variable], upper: bounds.upper[variable] }
    }

    fn violation(&self, constraint: usize, amount: f64) -> Option<Violation> {
        let several = self.parts.len() > 1;
        let plain = |phase: &str, name: String, time: f64| Violation {
            phase: several.then(|| phase.to_owned()),
            name,
            expression: String::new(),
            unit: String::new(),
            lower: 0.0,
            upper: 0.0,
            time,
            amount,
        };
        Some(match self.position(constraint)? {
            Position::Limit(part, limit, time) => of_limit((part, several), limit, time, amount),
            Position::Defect(part, row, time) => {
                plain(&part.name, format!("defect of {}", part.names[row % part.layout.states]), time)
            }
            Position::Linear(part, Label::Rate(rate), time) => {
                let (name, unit) = part.rates[rate].clone();
                Violation { unit, ..plain(&part.name, name, time) }
            }
            Position::Linear(part, _, time) => plain(&part.name, "duration".to_owned(), time),
            Position::Joint(part, name, None, time) => plain(&part.name, name, time),
            Position::Joint(part, name, Some(limit), time) => Violation {
                expression: "reset".to_owned(),
                unit: limit.unit.clone(),
                lower: limit.lower,
                upper: limit.upper,
                ..plain(&part.name, name, time)
            },
        })
    }

    fn bound_violation(&self, variable: usize, side: usize, amount: f64) -> Option<Violation> {
        let begins = self.phase_times(self.last_point());
        let (part, begin) =
            self.parts.iter().zip(&begins).rfind(|(part, _)| part.layout.first <= variable)?;
        let local = variable - part.layout.first;
        let k = (local / part.layout.stride()).min(part.layout.intervals);
        let inside = local - k * part.layout.stride() >= part.layout.node_width();
        let next = part.fractions[(k + 1).min(part.layout.intervals)];
        let s = if inside { 0.5 * (part.fractions[k] + next) } else { part.fractions[k] };
        let time = begin + s * part.duration_at(self.last_point());
        let limit = self.bounds.origin[variable][side]?;
        Some(of_limit((part, self.parts.len() > 1), limit, time, amount))
    }
}

struct Bound {
    lower: f64,
    upper: f64,
}

fn of_limit((part, several): (&Part, bool), limit: usize, time: f64, amount: f64) -> Violation {
    let limit = &part.limits[limit];
    Violation {
        phase: several.then(|| part.name.clone()),
        name: limit.name.clone(),
        expression: expression(&limit.quantity, &part.names, part.layout.states, part.layout.inputs),
        unit: limit.unit.clone(),
        lower: limit.lower,
        upper: limit.upper,
        time,
        amount,
    }
}
