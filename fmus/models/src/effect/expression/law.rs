//! The formulas of one effect, read.

use airloop_expression::{Expression, Function};
use fmi_export::Scalar;

use super::{PARAMETERS, PORT, STATES};

/// Formula of an effect and of the rates of its states.
#[derive(Debug)]
pub struct Law {
    pub formula: Expression,
    pub rates: Vec<Expression>,
    names: Vec<String>,
}

/// Names with spaces between them.
fn names<'t>(text: &'t str, what: &str, most: usize) -> Result<Vec<&'t str>, String> {
    let found: Vec<&str> = text.split_whitespace().collect();
    if found.len() > most {
        return Err(format!("`{what}` names {} of them; {most} are allowed", found.len()));
    }
    Ok(found)
}

impl Law {
    /// Reads formula, names of states, names of parameters, rates.
    ///
    /// # Errors
    /// Too many names, a name twice, or a formula that cannot be read: which, where and why.
    pub fn read(texts: &[&str; 3 + STATES]) -> Result<Law, String> {
        let [formula, states, parameters, rates @ ..] = *texts;
        let states = names(states, "states", STATES)?;
        let parameters = names(parameters, "parameters", PARAMETERS)?;
        let all: Vec<&str> = PORT.iter().chain(&states).chain(&parameters).copied().collect();
        if let Some(twice) = all.iter().enumerate().find(|(i, name)| all[..*i].contains(name)) {
            return Err(format!(
                "the name `{}` is given twice; names of the port are {}",
                twice.1,
                PORT.join(", ")
            ));
        }
        let read = |text: &str, what: &str| {
            Expression::parse(text, &all).map_err(|error| format!("`{what}` = `{text}`, {error}"))
        };
        let rates: Result<Vec<_>, _> =
            (0..states.len()).map(|i| read(rates[i], &format!("rate[{}]", i + 1))).collect();
        let names = all.iter().map(|name| (*name).to_owned()).collect();
        Ok(Law { formula: read(formula, "formula")?, rates: rates?, names })
    }

    /// A sentence on a formula that has no value, with the values of the names that it uses.
    pub fn without_value(&self, text: &str, values: &[f64]) -> String {
        let own = self.names.iter().zip(values).map(|(name, value)| format!("{name} = {value}"));
        format!("`{text}` has no value at {}", own.collect::<Vec<_>>().join(", "))
    }
}

/// A function of any scalar.
pub fn call<S: Scalar>(function: Function, x: S) -> S {
    match function {
        Function::Sin => x.sin(),
        Function::Cos => x.cos(),
        Function::Tanh => x.tanh(),
        Function::Exp => x.exp(),
        Function::Ln => x.ln(),
        Function::Sqrt => x.sqrt(),
        Function::Abs => x.abs(),
        Function::Sign | Function::Floor => S::from(function.of(x.value())),
        Function::Power(n) => x.powi(n),
    }
}
