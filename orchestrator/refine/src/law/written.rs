//! Formulas and curves written as effects of one's own.

use std::sync::Arc;

use super::grammar::Axis;
use super::surface::Surface;
use crate::study::law::Variable;
use crate::study::ports;
use crate::vocabulary::Own;

/// Name of a variable in formulas.
pub(super) fn name(variable: Variable) -> &'static str {
    match variable {
        Variable::Position => "x",
        Variable::Velocity => "v",
        Variable::Time => "t",
        _ => "f",
    }
}

/// An effect of one's own from a formula that is taken off what passes a port; `units`: of `x`, `v` and `f`; `sign`: -1
/// where a larger value makes the velocity fall. None where its units do not fit.
pub fn effect(
    text: &str,
    parameters: &[(String, String, f64)],
    units: &[String; 3],
    sign: f64,
) -> Option<Arc<Own>> {
    let mut entries = String::new();
    for (name, unit, value) in parameters {
        entries += &format!("{name} = {{ unit = {unit:?}, start = {value:?} }}\n");
    }
    read(text, "law found in the records", units, sign, &format!("[parameters]\n{entries}"))
}

/// An effect of one's own from a formula that is taken off, with its tables of states and parameters as TOML.
pub(super) fn read(
    text: &str,
    words: &str,
    units: &[String; 3],
    sign: f64,
    tables: &str,
) -> Option<Arc<Own>> {
    let port = ports::kind(&units[2]);
    let formula = match (port.replaces(), sign < 0.0) {
        (false, _) => text.to_owned(),
        (true, false) => format!("f - ({text})"),
        (true, true) => format!("f + ({text})"),
    };
    let [x, v, f] = units;
    let own = Own::read(&format!(
        "kind = \"law\"\nport = {:?}\nformula = {formula:?}\nwords = {words:?}\n[variables]\nx = {x:?}\nv = {v:?}\nf = {f:?}\n{tables}",
        port.word()
    ));
    own.ok().map(Arc::new)
}

/// The free form itself as a formula: a curve, or curves between curves for two variables.
pub fn curve_text(surface: &Surface, heights: &[f64], axes: &[Axis]) -> Option<String> {
    let points = |knots: &[f64], heights: Vec<String>, name: &str| {
        let own = knots.iter().zip(heights).map(|(x, y)| format!("{x:.6e}, {y}"));
        format!("curve({name}, {})", own.collect::<Vec<_>>().join(", "))
    };
    let number = |height: &f64| format!("{height:.6e}");
    let text = match &surface.knots[..] {
        [knots] => points(knots, heights.iter().map(number).collect(), axes[0].name),
        [first, second] => {
            let rows = heights.chunks(second.len());
            let rows = rows.map(|row| points(second, row.iter().map(number).collect(), axes[1].name));
            points(first, rows.collect(), axes[0].name)
        }
        _ => return None,
    };
    Some(format!("a*{text}"))
}
