//! An effect that is written as a formula, as a block in series.
//!
//! [`law`] reads the formulas, [`library`] keeps those of all instances.

mod law;
mod library;
#[cfg(test)]
mod tests;

use fmi_export::{Boolean, Identity, Memory, Model, Outcome, Real, Refusal, Scalar, Table, Text, Values};

use law::Law;
use library::Library;

/// Most states.
const STATES: usize = 3;
/// Most parameters.
const PARAMETERS: usize = 12;
/// Names that every formula may use: position, velocity, the value that passes, time.
const PORT: [&str; 4] = ["x", "v", "f", "t"];
/// Values that formulas may use.
const VALUES: usize = PORT.len() + STATES + PARAMETERS;

/// `f_out = f_in - formula(x, v, f_in, t, states, parameters)`, or the formula itself where it `replaces` the value.
///
/// | name | unit | meaning |
/// |---|---|---|
/// | `f_in`, `f_out` | any | value before and after |
/// | `x`, `v` | any | position and velocity |
/// | `f` | of `f_in` | value of the formula |
/// | `formula`, `rate[i]` | | formulas of the effect and of the rates of its states |
/// | `states`, `parameters` | | names, with spaces between them |
/// | `p[i]` | any | values of the parameters |
///
/// States start at zero. Texts are read when the instance is initialized; the FMU state holds their fingerprint.
pub struct ExpressionEffect {
    f_in: Real,
    x: Real,
    v: Real,
    f_out: Real,
    f: Real,
    formula: Text,
    replaces: Boolean,
    states: Text,
    rate: [Text; STATES],
    parameters: Text,
    p: [Real; PARAMETERS],
    z: [Real; STATES],
    der_z: [Real; STATES],
    /// Fingerprint of the texts.
    law: Memory,
    library: Library,
}

impl ExpressionEffect {
    /// The texts in the order that [`Law::read`] takes them in.
    fn texts<'v, S: Scalar>(&self, q: &'v Values<S>) -> [&'v str; 3 + STATES] {
        let texts = [self.formula, self.states, self.parameters, self.rate[0], self.rate[1], self.rate[2]];
        texts.map(|text| q[text].as_str())
    }

    /// Values that formulas may use, in the order of the names of [`Law::read`].
    fn values<S: Scalar>(&self, q: &Values<S>, law: &Law) -> [S; VALUES] {
        let mut values = [S::zero(); VALUES];
        let own = [q[self.x], q[self.v], q[self.f_in], q.time];
        let states = self.z.iter().take(law.rates.len()).map(|z| q[*z]);
        let parameters = self.p.iter().map(|p| q[*p]);
        for (value, own) in values.iter_mut().zip(own.into_iter().chain(states).chain(parameters)) {
            *value = own;
        }
        values
    }
}

impl Model for ExpressionEffect {
    const IDENTITY: Identity = Identity {
        model_identifier: "expression_effect",
        model_name: "expression-effect",
        description: "An effect written as a formula, in series: f_out = f_in - formula",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    fn declare(t: &mut Table) -> Self {
        use std::array::from_fn;
        let z = from_fn(|i| {
            t.state(format!("z[{}]", i + 1)).about(format!("state {} of the effect", i + 1)).real(0.0)
        });
        Self {
            der_z: from_fn(|i| {
                let about = format!("rate of z[{}]", i + 1);
                t.derivative(format!("der(z[{}])", i + 1), z[i]).about(about).computed()
            }),
            z,
            f_in: t.input("f_in").about("value that comes in").real(0.0),
            x: t.input("x").about("position").real(0.0),
            v: t.input("v").about("velocity").real(0.0),
            f_out: t.output("f_out").about("value that is given on").computed(),
            f: t.output("f").about("value of the formula").computed(),
            formula: t.parameter("formula").about("formula of the effect").text("0"),
            replaces: t
                .parameter("replaces")
                .about("true: the formula is what is given on; false: it is taken off")
                .boolean(false),
            states: t.parameter("states").about("names of the states, with spaces between them").text(""),
            rate: from_fn(|i| {
                let about = format!("formula of the rate of z[{}]", i + 1);
                t.parameter(format!("rate[{}]", i + 1)).about(about).text("0")
            }),
            parameters: t
                .parameter("parameters")
                .about("names of the parameters, with spaces between them")
                .text(""),
            p: from_fn(|i| {
                let about = format!("value of parameter {}", i + 1);
                t.parameter(format!("p[{}]", i + 1)).about(about).real(0.0)
            }),
            law: t.memory(1).at(0),
            library: Library::default(),
        }
    }

    fn prepare<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let fingerprint = self.library.load(&self.texts(q)).map_err(Refusal::Error)?;
        q[self.law] = S::from(fingerprint);
        Ok(())
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let unknown =
            || Refusal::Error("the formulas have not been read; the instance is not initialized".into());
        let law = self.library.get(q[self.law].value()).ok_or_else(unknown)?;
        let values = self.values(q, &law);
        let f = law.formula.evaluate(&values, &law::call);
        if !f.value().is_finite() {
            return Err(Refusal::Discard(law.without_value(&q[self.formula], &values.map(|v| v.value()))));
        }
        q[self.f] = f;
        q[self.f_out] = if q[self.replaces] { f } else { q[self.f_in] - f };
        for (i, der_z) in self.der_z.iter().enumerate() {
            let rate = law.rates.get(i).map_or(S::zero(), |rate| rate.evaluate(&values, &law::call));
            if !rate.value().is_finite() {
                return Err(Refusal::Discard(
                    law.without_value(&q[self.rate[i]], &values.map(|v| v.value())),
                ));
            }
            q[*der_z] = rate;
        }
        Ok(())
    }

    /// Formulas in which everything depends on everything.
    fn probe(&self, draw: usize, table: &Table, q: &mut Values<f64>) {
        table.spread(draw, q);
        let all = "x + 2*v + 3*f + t + x*v + a + 2*b + 3*c";
        q[self.states] = "a b c".into();
        q[self.formula] = all.into();
        for rate in self.rate {
            q[rate] = all.into();
        }
        q[self.replaces] = draw % 2 == 1;
    }
}
