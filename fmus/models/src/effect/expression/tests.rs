use fmi_export::{Dual, Interface, Model, Refusal, Table, Values};

use super::*;

const BRISTLES: [(&str, &str); 4] = [
    ("formula", "k*z + c*v*abs(f)"),
    ("states", "z"),
    ("rate[1]", "v - abs(v)*z/d"),
    ("parameters", "k d c"),
];

/// The model with texts and numbers by name, prepared.
fn with(texts: &[(&str, &str)], numbers: &[(&str, f64)]) -> Result<(ExpressionEffect, Values<f64>), Refusal> {
    let (model, table) = Table::of::<ExpressionEffect>();
    let mut q = table.start_values(Interface::ModelExchange);
    for (name, value) in numbers {
        let handle = table.by_name(name).and_then(|v| v.real()).unwrap_or_else(|| panic!("no {name}"));
        q[handle] = *value;
    }
    for (name, value) in texts {
        let handle = match *name {
            "formula" => model.formula,
            "states" => model.states,
            "parameters" => model.parameters,
            _ => model.rate[0],
        };
        (*value).clone_into(&mut q[handle]);
    }
    model.prepare(&mut q)?;
    Ok((model, q))
}

#[test]
fn nothing_is_taken_off_at_the_start_values() {
    let (model, mut q) = with(&[], &[("f_in", 3.0), ("x", 1.0), ("v", -2.0)]).expect("start values");
    model.equations(&mut q).expect("zero");
    assert_eq!((q[model.f], q[model.f_out]), (0.0, 3.0));
}

#[test]
fn a_formula_with_a_state_is_evaluated() {
    let numbers = [("p[1]", 2e4), ("p[2]", 1e-3), ("p[3]", 0.3), ("v", -0.2), ("z[1]", 4e-4), ("f_in", -5.0)];
    let (model, q) = with(&BRISTLES, &numbers).expect("a formula");
    let mut own = q.clone();
    model.equations(&mut own).expect("a value");
    assert!((own[model.f] - (8.0 - 0.3 * 0.2 * 5.0)).abs() < 1e-12);
    assert!((own[model.der_z[0]] - (-0.2 - 0.2 * 0.4)).abs() < 1e-15);
    assert_eq!(own[model.der_z[1]], 0.0);
}

#[test]
fn derivatives_are_exact() {
    let law = Law::read(&["k*z + c*v*abs(f)", "z", "k d c", "v - abs(v)*z/d", "0", "0"]).expect("a law");
    let value = |v: f64| Dual { re: v, eps: [0.0] };
    let mut at = [0.0, -0.2, -5.0, 0.0, 4e-4, 2e4, 1e-3, 0.3].map(value);
    at[1].eps = [1.0];
    // d/dv: c |f|; of the rate: 1 - sign(v) z/d.
    assert!((law.formula.evaluate(&at, &law::call).eps[0] - 1.5).abs() < 1e-12);
    assert!((law.rates[0].evaluate(&at, &law::call).eps[0] - 1.4).abs() < 1e-12);
}

#[test]
fn what_cannot_be_read_is_told_with_its_place() {
    for (texts, words) in [
        ([("formula", "k*y"), ("parameters", "k")], "`formula` = `k*y`, column 3: there is no `y`"),
        ([("formula", "k"), ("parameters", "k k")], "`k` is given twice"),
        ([("formula", "k"), ("parameters", "x")], "`x` is given twice"),
        ([("states", "a b c d"), ("parameters", "k")], "4 of them; 3 are allowed"),
        ([("states", "z"), ("rate[1]", "v -")], "`rate[1]` = `v -`"),
    ] {
        let Err(Refusal::Error(message)) = with(&texts, &[]) else { panic!("{texts:?} was read") };
        assert!(message.contains(words), "{message}");
    }
}

#[test]
fn a_formula_without_value_is_discarded_with_the_values_of_its_names() {
    let (model, mut q) = with(&[("formula", "1/x")], &[("v", 2.0)]).expect("a formula");
    let Err(Refusal::Discard(message)) = model.equations(&mut q) else { panic!("1/0 has a value") };
    assert!(message.contains("`1/x` has no value at x = 0, v = 2"), "{message}");
}
