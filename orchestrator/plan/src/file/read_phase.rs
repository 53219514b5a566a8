//! The part of a problem file that states one phase.

use super::read::{parameters, texts_of_pairs};
use super::source::Place;
use super::statement::{Bound, Condition, Cost, Duration, Of, Phase, Range, Rate, Reset, Where};
use super::table::{Table, Text, Value};
use crate::Error;

/// Reads the keys of a phase from its table, or (not `listed`) from the root of a file with one phase, whose name,
/// intervals and parameters are those of the problem.
pub fn read(table: &Table, name: &str, listed: bool) -> Result<Phase, Error> {
    let own = |key| if listed { table.get(key) } else { None };
    let own_name = own("name").map(|value| value.text()).transpose()?;
    let mut bounds = table.maybe("bounds", bounds)?.unwrap_or_default();
    bounds.extend(table.maybe("constraint", constraints)?.unwrap_or_default());
    Ok(Phase {
        name: own_name.map_or_else(|| name.to_owned(), |text| text.text),
        place: table.place(),
        duration: duration(table.need("duration")?)?,
        intervals: own("intervals").map(|value| value.whole(1)).transpose()?,
        parameters: own("parameters")
            .map(|value| parameters(value, "`parameters` of a phase"))
            .transpose()?
            .unwrap_or_default(),
        reset: own("reset").map(reset).transpose()?,
        initial: table.maybe("initial", |value| conditions(value, "[initial]"))?.unwrap_or_default(),
        terminal: table.maybe("final", |value| conditions(value, "[final]"))?.unwrap_or_default(),
        bounds,
        rates: table.maybe("rates", rates)?.unwrap_or_default(),
        costs: table.maybe("cost", costs)?.unwrap_or_default(),
    })
}

fn duration(value: Value) -> Result<Duration, Error> {
    if !value.is_table() {
        return Ok(Duration::Fixed(value.quantity()?));
    }
    let table = value.table("`duration`")?;
    let duration = Duration::Free {
        min: table.need("min")?.quantity()?,
        max: table.need("max")?.quantity()?,
        guess: table.need("guess")?.quantity()?,
    };
    table.finish()?;
    Ok(duration)
}

fn reset(value: Value) -> Result<Reset, Error> {
    let table = value.table("`reset` of a phase")?;
    let states = texts_of_pairs(table.need("states")?, "`states` of a reset")?;
    let mut limits = table.maybe("bounds", bounds)?.unwrap_or_default();
    limits.extend(table.maybe("constraint", constraints)?.unwrap_or_default());
    let reset = Reset {
        parameters: table
            .maybe("parameters", |value| parameters(value, "`parameters` of a reset"))?
            .unwrap_or_default(),
        states,
        bounds: limits,
        place: value.place(),
    };
    table.finish()?;
    Ok(reset)
}

fn conditions(value: Value, name: &str) -> Result<Vec<Condition>, Error> {
    let one = |(variable, value): (Text, Value)| {
        let range = if value.is_table() {
            let table = value.table(&format!("the condition of `{}`", variable.text))?;
            let range = range(&table)?;
            table.finish()?;
            range
        } else if value.text().is_ok_and(|text| text.text == "free") {
            Range::default()
        } else {
            let value = value.quantity()?;
            Range { min: Some(value.clone()), max: Some(value) }
        };
        Ok(Condition { variable, range })
    };
    value.table(name)?.entries().into_iter().map(one).collect()
}

/// `min` and `max` of a table.
fn range(table: &Table) -> Result<Range, Error> {
    Ok(Range {
        min: table.maybe("min", |value| value.quantity())?,
        max: table.maybe("max", |value| value.quantity())?,
    })
}

fn bounds(value: Value) -> Result<Vec<Bound>, Error> {
    let one = |(variable, value): (Text, Value)| {
        let table = value.table(&format!("the bound of `{}`", variable.text))?;
        let bound = bound(&table, vec![(variable.clone(), 1.0)], variable.place)?;
        table.finish()?;
        Ok(bound)
    };
    value.table("[bounds]")?.entries().into_iter().map(one).collect()
}

fn bound(table: &Table, terms: Vec<(Text, f64)>, place: Place) -> Result<Bound, Error> {
    let places =
        [("nodes", Where::Nodes), ("midpoints", Where::Midpoints), ("everywhere", Where::Everywhere)];
    let bound = Bound {
        name: table.maybe("name", |value| value.text())?.map(|text| text.text),
        terms,
        range: range(table)?,
        at: table.maybe("at", |value| value.choice(&places))?,
        during: table.maybe("during", during)?.unwrap_or((0.0, 1.0)),
        margin: table.maybe("margin", margin)?.unwrap_or(0.0),
        place,
    };
    if bound.range.min.is_none() && bound.range.max.is_none() {
        return Err(table.error("a bound needs `min`, `max` or both"));
    }
    Ok(bound)
}

fn margin(value: Value) -> Result<f64, Error> {
    let margin = value.number()?;
    let good = margin >= 0.0 && margin.is_finite();
    if good {
        Ok(margin)
    } else {
        Err(value.error("`margin` is a number, 0 or more, in the unit of the variable"))
    }
}

fn during(value: Value) -> Result<(f64, f64), Error> {
    let ends = value.list()?.iter().map(Value::number).collect::<Result<Vec<f64>, Error>>()?;
    match ends[..] {
        [from, to] if (0.0..=1.0).contains(&from) && from <= to && to <= 1.0 => Ok((from, to)),
        _ => Err(value.error("`during` is [from, to] as parts of the phase, 0 <= from <= to <= 1")),
    }
}

fn constraints(value: Value) -> Result<Vec<Bound>, Error> {
    let one = |value: &Value| {
        let table = value.table("[[constraint]]")?;
        let terms = table.need("terms")?.table("`terms`")?.entries();
        let terms: Result<Vec<(Text, f64)>, Error> =
            terms.into_iter().map(|(variable, factor)| Ok((variable, factor.number()?))).collect();
        let terms = terms?;
        if terms.is_empty() {
            return Err(table.error("`terms` of a constraint names at least one variable with its factor"));
        }
        let bound = bound(&table, terms, value.place())?;
        table.finish()?;
        Ok(bound)
    };
    value.list()?.iter().map(one).collect()
}

fn rates(value: Value) -> Result<Vec<Rate>, Error> {
    let one = |(variable, value): (Text, Value)| {
        let range = if value.is_table() {
            let table = value.table(&format!("the rate of `{}`", variable.text))?;
            let range = range(&table)?;
            table.finish()?;
            range
        } else {
            let max = value.quantity()?;
            if max.value < 0.0 {
                return Err(value.error("one number limits the rate both ways and is not negative"));
            }
            Range { min: Some(super::Quantity { value: -max.value, ..max.clone() }), max: Some(max) }
        };
        Ok(Rate { variable, range })
    };
    value.table("[rates]")?.entries().into_iter().map(one).collect()
}

fn costs(value: Value) -> Result<Vec<Cost>, Error> {
    value.list()?.iter().map(cost).collect()
}

fn cost(value: &Value) -> Result<Cost, Error> {
    let table = value.table("[[cost]]")?;
    let integral = table.maybe("integral", |value| value.text())?;
    let terminal = table.maybe("final", |value| value.text())?;
    let duration = table.maybe("duration", |value| value.number())?;
    let weight = table.maybe("weight", |value| value.number())?;
    let reference = table.maybe("reference", |value| value.quantity())?;
    table.finish()?;
    let (of, weight) = match (integral, terminal, duration) {
        (Some(variable), None, None) => (Of::Integral(variable, reference), weight.unwrap_or(1.0)),
        (None, Some(variable), None) => (Of::Final(variable, reference), weight.unwrap_or(1.0)),
        (None, None, Some(own)) if weight.is_none() && reference.is_none() => (Of::Duration, own),
        _ => {
            let problem = "a cost is one of `integral = \"variable\"`, `final = \"variable\"` (each with `weight` and \
                           `reference`) or `duration = weight`";
            return Err(table.error(problem));
        }
    };
    if weight < 0.0 {
        return Err(table.error(format!("the weight {weight} is negative; the cost would fall without end")));
    }
    Ok(Cost { of, weight, place: value.place() })
}
