//! Units of an effect: those of its formula, its rates and its states.

use airloop_expression::Dimension;
use airloop_series::compound_unit;

use super::own::{Law, Own};

/// Dimension of a unit that is coherent with SI.
///
/// # Errors
/// A unit that is not known, or whose factor to SI is not one.
pub fn coherent(text: &str) -> Result<Dimension, String> {
    let unit = compound_unit::parse(text).ok_or_else(|| {
        format!("unit `{text}` is not known; write products of SI units such as N.s/m, kg.m2, 1")
    })?;
    if (unit.factor - 1.0).abs() > 1e-12 || unit.offset != 0.0 {
        return Err(format!("{text} is {} times the SI unit; formulas are in SI units", unit.factor));
    }
    Ok(dimension(&unit))
}

/// Dimension of a unit; angles are numbers.
pub fn dimension(unit: &airloop_series::units::Unit) -> Dimension {
    let e = unit.exponents;
    Dimension([e.kg, e.m, e.s, e.A, e.K, e.mol, e.cd].map(f64::from))
}

/// Checks the unit that an FMU declares against `unit`, which is `stated` or that of the port and then gives way.
///
/// # Errors
/// A unit that is not known or not coherent with SI, or another one than the stated one.
pub fn same(unit: &mut String, declared: Option<String>, stated: bool) -> Result<(), String> {
    let Some(declared) = declared else { return coherent(unit).map(drop) };
    let dimension = coherent(&declared)?;
    if stated && !coherent(unit)?.same(&dimension) {
        return Err(format!("the FMU has it in {declared}, the file in {unit}"));
    }
    if !stated {
        *unit = declared;
    }
    Ok(())
}

/// Product of two with the second to a power.
fn times(a: &Dimension, b: &Dimension, power: f64) -> Dimension {
    let mut found = *a;
    found.0.iter_mut().zip(&b.0).for_each(|(a, b)| *a += power * b);
    found
}

/// Checks that the formula has the unit of its port, and every rate that of its state per second. `known`: units of the
/// variables and of the parameters; `given`: those of states, where they are given.
///
/// Units of states that are not given are tried: that of every variable, of the rate that the formula would need, and
/// of every parameter.
///
/// # Errors
/// The state in question, if it is one, and what does not fit.
pub fn check(
    own: &Own,
    [variables, parameters]: [&[Dimension]; 2],
    given: &[Option<Dimension>],
) -> Result<(), (Option<usize>, String)> {
    let second = Dimension::new(0.0, 0.0, 1.0);
    let mut trials: Vec<Dimension> = Vec::new();
    let plain = variables.iter().chain(parameters).chain([&Dimension::NUMBER]);
    for one in plain {
        for trial in [*one, times(one, &second, 1.0)] {
            if !trials.iter().any(|own| own.same(&trial)) {
                trials.push(trial);
            }
        }
    }
    let choices: Vec<Vec<Dimension>> =
        given.iter().map(|own| own.map_or_else(|| trials.clone(), |unit| vec![unit])).collect();
    let count: usize = choices.iter().map(Vec::len).product();
    let mut problem = None;
    for index in 0..count.max(1) {
        let mut rest = index;
        let states: Vec<Dimension> = choices
            .iter()
            .map(|own| {
                let unit = own[rest % own.len()];
                rest /= own.len();
                unit
            })
            .collect();
        let all = [variables, &states, parameters].concat();
        match fits(own, &all, &variables[2], &states) {
            Ok(()) => return Ok(()),
            // A fault of the formula with rates that fit says more than one of a rate.
            Err(error) if problem.is_none() || error.0.is_none() => problem = Some(error),
            Err(_) => {}
        }
    }
    let (state, text) = problem.unwrap_or_default();
    let open = given.iter().position(Option::is_none);
    Err(match (state, open) {
        (Some(_), Some(open)) => {
            let name = &own.states[open].0;
            (
                Some(open),
                format!(
                    "the unit of state `{name}` cannot be told: with {}, {text}; correct the formulas, or write [states.{name}] with rate and unit",
                    trials[0]
                ),
            )
        }
        (state, _) => (state, text),
    })
}

fn fits(
    own: &Own,
    all: &[Dimension],
    port: &Dimension,
    states: &[Dimension],
) -> Result<(), (Option<usize>, String)> {
    let Law::Formula { expression, rates } = &own.law else { return Ok(()) };
    let second = Dimension::new(0.0, 0.0, 1.0);
    for (i, ((name, text), rate)) in own.states.iter().zip(rates).enumerate() {
        let wanted = times(&states[i], &second, -1.0);
        let found = rate.dimension(all).map_err(|e| (Some(i), format!("rate of {name} = `{text}`, {e}")))?;
        if let Some(found) = found.filter(|found| !found.same(&wanted)) {
            let problem =
                format!("the rate `{text}` has the unit {found}, the state {name} per second {wanted}");
            return Err((Some(i), problem));
        }
    }
    let found = expression.dimension(all).map_err(|e| (None, format!("formula = `{}`, {e}", own.formula)))?;
    match found.filter(|found| !found.same(port)) {
        Some(found) => {
            Err((None, format!("the formula `{}` has the unit {found}, the port {port}", own.formula)))
        }
        None => Ok(()),
    }
}
