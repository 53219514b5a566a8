//! Columns of a file as signals of the system: in its units, filtered, differentiated, over a span of samples.

use std::ops::Range;

use super::declaration::Signal;
use super::read::Layout;
use super::signal;
use super::time_grid::Grid;
use airloop_series::TimeSeries;
use airloop_series::names::without_unit;
use airloop_series::units::{Compatibility, compatible, lookup};

/// Factor and offset from the unit of a column to that of the signal `wanted`.
fn conversion(
    source: &TimeSeries,
    name: &str,
    signal: &Signal,
    wanted: Option<&str>,
) -> Result<(f64, f64), String> {
    let own = source.channel(name).and_then(|channel| channel.unit.as_deref());
    let (Some(unit), Some(wanted)) = (signal.unit.as_deref().or(own), wanted) else {
        return Ok((1.0, 0.0));
    };
    let known =
        |unit: &str| lookup(unit).ok_or_else(|| format!("unit `{unit}` of column `{name}` is not known"));
    let mut column = known(unit)?;
    let (before, behind) = match (&signal.derivative_of, &signal.integral_of) {
        (Some(_), _) => ("the derivative of ", "/s"),
        (_, Some(_)) => ("the integral of ", " s"),
        _ => ("", ""),
    };
    if !before.is_empty() {
        // An offset does not show in a derivative, and time is in seconds.
        column.exponents.s += if signal.derivative_of.is_some() { -1 } else { 1 };
        column.offset = 0.0;
    }
    match compatible(&column, &known(wanted)?) {
        Compatibility::Equal => Ok((1.0, 0.0)),
        Compatibility::Convertible { factor, offset } => Ok((factor, offset)),
        Compatibility::Incompatible => Err(format!(
            "{before}column `{name}` is in {unit}{behind}, the signal of the system in {wanted}; name another column or correct the unit"
        )),
    }
}

pub(super) fn no_column(source: &TimeSeries, name: &str) -> String {
    let known: Vec<&str> = source.channels().iter().map(|c| c.name.as_str()).collect();
    let hint = without_unit(name, known.iter().copied());
    format!("there is no column `{name}`{hint}; the file has: {}", known.join(", "))
}

/// Values of a column as they stand in a series, in the unit `wanted`.
fn in_unit(
    source: &TimeSeries,
    name: &str,
    signal: &Signal,
    wanted: Option<&str>,
) -> Result<Vec<f64>, String> {
    let channel = source.channel(name).ok_or_else(|| no_column(source, name))?;
    let (first, others) = channel.values.split_first().unwrap_or((&0.0, &[]));
    if signal.derivative_of.is_some() && others.iter().all(|value| value == first) {
        return Err(format!("column `{name}` never changes, so its derivative says nothing"));
    }
    let (factor, offset) = conversion(source, name, signal, wanted)?;
    let mut values = channel.values.clone();
    if (factor, offset) != (1.0, 0.0) {
        values.iter_mut().for_each(|value| *value = factor * *value + offset);
    }
    Ok(values)
}

/// The way in which the system uses a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Use {
    /// It acts on it over whole steps.
    Input,
    /// It is compared, or known, at the samples.
    Measured,
}

/// Values of a signal on the grid of its file, in the unit `wanted`.
fn values(grid: &Grid, signal: &Signal, wanted: Option<&str>, used: Use) -> Result<Vec<f64>, String> {
    let Some(name) = signal.source() else {
        return Err("a signal needs one of `column`, `derivative_of` and `integral_of`".into());
    };
    let source = match (signal.hold, used) {
        (true, Use::Input) => &grid.means,
        (true, Use::Measured) => &grid.held,
        (false, _) => &grid.series,
    };
    let mut values = processed(in_unit(source, name, signal, wanted)?, signal, grid.step);
    if let Some(offset) = signal.offset {
        values.iter_mut().for_each(|value| *value += offset);
    }
    Ok(values)
}

/// Values of a signal, `[n]`, from those of its column, `[n]`: a linear filter, derivative and scale.
pub fn processed(values: Vec<f64>, signal: &Signal, step: f64) -> Vec<f64> {
    let mut values = signal::low_pass(&values, signal.low_pass_hz, step);
    if signal.derivative_of.is_some() {
        values = match signal.savitzky_golay_points {
            Some(points) => signal::savitzky_golay(&values, points, step),
            None => signal::central(&values, step),
        };
    }
    if signal.integral_of.is_some() {
        values = signal::integral(&values, step);
    }
    if let Some(scale) = signal.scale {
        values.iter_mut().for_each(|value| *value *= scale);
    }
    values
}

/// Signals of a span.
pub(super) struct Signals {
    /// Of the system inputs, `[inputs][n]`; none where there is no column.
    pub(super) inputs: Vec<Option<Vec<f64>>>,
    /// Of the states, `[nx][n]`.
    pub(super) states: Vec<Option<Vec<f64>>>,
    /// Further ones, `[extra][n]`.
    pub(super) extra: Vec<Vec<f64>>,
    /// Of the outputs, `[outputs][n]`.
    pub(super) outputs: Vec<Vec<f64>>,
}

/// Values of a signal in a span; with a corner, those that are not filtered are.
fn cut(
    grid: &Grid,
    (signal, used): (&Signal, Use),
    unit: Option<&str>,
    range: &Range<usize>,
    corner: Option<f64>,
) -> Result<Vec<f64>, String> {
    let mut signal = signal.clone();
    signal.low_pass_hz = signal.low_pass_hz.or(corner);
    Ok(values(grid, &signal, unit, used)?[range.clone()].to_vec())
}

/// Values of the signals that there are.
fn optional(
    grid: &Grid,
    (signals, units, used): (&[Option<Signal>], &[Option<String>], Use),
    range: &Range<usize>,
    corner: Option<f64>,
) -> Result<Vec<Option<Vec<f64>>>, String> {
    let one = |(signal, unit): (&Option<Signal>, &Option<String>)| {
        let values = signal.as_ref().map(|own| cut(grid, (own, used), unit.as_deref(), range, corner));
        values.transpose()
    };
    signals.iter().zip(units).map(one).collect()
}

/// System inputs in a span.
pub(super) fn inputs(
    grid: &Grid,
    layout: &Layout,
    range: Range<usize>,
    corner: Option<f64>,
) -> Result<Vec<Option<Vec<f64>>>, String> {
    optional(grid, (&layout.inputs, &layout.units[0], Use::Input), &range, corner)
}

/// Inputs, states and outputs of a span; with a corner, columns are filtered as well.
pub(super) fn one(
    grid: &Grid,
    layout: &Layout,
    range: Range<usize>,
    corner: Option<f64>,
) -> Result<Signals, String> {
    let states = optional(grid, (&layout.states, &layout.units[1], Use::Measured), &range, corner)?;
    let extra = layout.extra.iter().map(|signal| cut(grid, (signal, Use::Measured), None, &range, corner));
    let extra = extra.collect::<Result<_, _>>()?;
    let outputs = layout.outputs.iter().zip(&layout.units[2]);
    let outputs =
        outputs.map(|(signal, unit)| cut(grid, (signal, Use::Measured), unit.as_deref(), &range, corner));
    let outputs = outputs.collect::<Result<_, _>>()?;
    Ok(Signals { inputs: inputs(grid, layout, range, corner)?, states, extra, outputs })
}

/// Factors of all signals.
pub(super) fn factors(grid: &Grid, layout: &Layout) -> Result<[Vec<f64>; 4], String> {
    let none = vec![None; layout.extra.len()];
    let [inputs, states, outputs] = &layout.units;
    let units = [inputs, states, &none, outputs];
    let mut found = [const { Vec::new() }; 4];
    for ((list, signals), units) in found.iter_mut().zip(layout.signals()).zip(units) {
        for (signal, unit) in signals.into_iter().zip(units) {
            let column = signal.and_then(|signal| Some((signal, signal.source()?)));
            list.push(match column {
                Some((signal, name)) => conversion(&grid.raw, name, signal, unit.as_deref())?.0,
                None => 1.0,
            });
        }
    }
    Ok(found)
}
