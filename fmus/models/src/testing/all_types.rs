//! Every variable type, a resource file, and faults on demand.

use fmi_export::{
    Boolean, Event, Identity, Integer, Model, Outcome, Real, Refusal, Scalar, Table, Text, Values,
};
use std::path::Path;

/// Outputs that are simple functions of the inputs of the same type:
///
/// | output | equation |
/// |---|---|
/// | `y_real` | `gain u_real + offset` |
/// | `y_discrete` | `2 u_discrete` |
/// | `y_integer` | `u_integer + shift` |
/// | `y_boolean` | `u_boolean` xor `invert` |
/// | `y_string` | `prefix` followed by `u_string` |
/// | `y_enumeration` | `u_enumeration` |
/// | `message` | first line of `resources/message.txt` |
///
/// From `fault_time` on the parameter `fault` is what goes wrong.
pub struct AllTypes {
    u_real: Real,
    u_discrete: Real,
    u_integer: Integer,
    u_boolean: Boolean,
    u_string: Text,
    u_enumeration: Integer,
    y_real: Real,
    y_discrete: Real,
    y_integer: Integer,
    y_boolean: Boolean,
    y_string: Text,
    y_enumeration: Integer,
    message: Text,
    gain: Real,
    offset: Real,
    shift: Integer,
    invert: Boolean,
    prefix: Text,
    fault: Integer,
    fault_time: Real,
}

const DISCARD: i32 = 2;
const ERROR: i32 = 3;
const PANIC: i32 = 4;
const NAN_OUTPUT: i32 = 5;
const TERMINATE: i32 = 6;

/// The resource that `message` shows.
const MESSAGE_FILE: &str = "message.txt";

impl AllTypes {
    fn fault<S: Scalar>(&self, q: &Values<S>) -> Option<i32> {
        (q.time.value() >= q[self.fault_time].value()).then_some(q[self.fault])
    }
}

impl Model for AllTypes {
    const IDENTITY: Identity = Identity {
        model_identifier: "test_all_types",
        model_name: "test-all-types",
        description: "Test FMU: every variable type, a resource, faults on demand",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.01,
    };

    fn declare(t: &mut Table) -> Self {
        let option = t.enumeration(
            "Option",
            &[("first", "the first option"), ("second", "the second option"), ("third", "the third option")],
        );
        let fault = t.enumeration(
            "Fault",
            &[
                ("none", "nothing goes wrong"),
                ("discard", "the equations give fmi2Discard"),
                ("error", "the equations give fmi2Error"),
                ("panic", "the equations panic"),
                ("nan_output", "y_real is not a number"),
                ("terminate", "the model asks to end the simulation"),
            ],
        );
        Self {
            u_real: t.input("u_real").about("Real input").real(0.0),
            u_discrete: t.input("u_discrete").about("Real input that changes at events").discrete().real(0.0),
            u_integer: t.input("u_integer").about("Integer input").integer(0),
            u_boolean: t.input("u_boolean").about("Boolean input").boolean(false),
            u_string: t.input("u_string").about("String input").text(""),
            u_enumeration: t.input("u_enumeration").about("Enumeration input").enumeration_of(option, 1),
            y_real: t.output("y_real").about("gain u_real + offset").computed(),
            y_discrete: t.output("y_discrete").about("2 u_discrete").discrete().computed(),
            y_integer: t.output("y_integer").about("u_integer + shift").computed_integer(),
            y_boolean: t.output("y_boolean").about("u_boolean xor invert").computed_boolean(),
            y_string: t.output("y_string").about("prefix followed by u_string").computed_text(),
            y_enumeration: t.output("y_enumeration").about("u_enumeration").computed_enumeration(option),
            message: t.output("message").about("first line of resources/message.txt").computed_text(),
            gain: t.tunable("gain").about("factor of y_real").range(-10.0, 10.0).real(1.0),
            offset: t.parameter("offset").about("added to y_real").range(-100.0, 100.0).real(0.0),
            shift: t.parameter("shift").about("added to y_integer").range(-100.0, 100.0).integer(0),
            invert: t.parameter("invert").about("inverts y_boolean").boolean(false),
            prefix: t.parameter("prefix").about("start of y_string, may hold <, & and \"").text(""),
            fault: t.parameter("fault").about("what goes wrong").enumeration_of(fault, 1),
            fault_time: t.parameter("fault_time").unit("s").about("when it goes wrong").min(0.0).real(0.5),
        }
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let fault = self.fault(q);
        let time = q.time.value();
        match fault {
            Some(DISCARD) => return Err(Refusal::Discard(format!("fault `discard` at t = {time} s"))),
            Some(ERROR) => return Err(Refusal::Error(format!("fault `error` at t = {time} s"))),
            Some(PANIC) => panic!("fault `panic` at t = {time} s"),
            _ => {}
        }
        q[self.y_real] = q[self.gain] * q[self.u_real] + q[self.offset];
        if fault == Some(NAN_OUTPUT) {
            q[self.y_real] = S::from(f64::NAN);
        }
        q[self.y_discrete] = q[self.u_discrete] * 2.0;
        q[self.y_integer] = q[self.u_integer].saturating_add(q[self.shift]);
        q[self.y_boolean] = q[self.u_boolean] != q[self.invert];
        q[self.y_enumeration] = q[self.u_enumeration];
        // The buffer is reused, so that stepping does not allocate.
        let mut y = std::mem::take(&mut q[self.y_string]);
        y.clear();
        y.push_str(&q[self.prefix]);
        y.push_str(&q[self.u_string]);
        q[self.y_string] = y;
        Ok(())
    }

    fn event(&self, q: &mut Values<f64>) -> Event {
        Event { terminate: self.fault(q) == Some(TERMINATE), ..Event::default() }
    }

    fn next_event_time(&self, q: &Values<f64>) -> Option<f64> {
        let fault_time = q[self.fault_time];
        (q[self.fault] == TERMINATE && q.time < fault_time).then_some(fault_time)
    }

    fn load_resources(&self, folder: Option<&Path>, q: &mut Values<f64>) -> Outcome {
        let Some(folder) = folder else { return Ok(()) };
        let file = folder.join(MESSAGE_FILE);
        let text = std::fs::read_to_string(&file).map_err(|e| {
            Refusal::Error(format!("{}: {e}; unpack the FMU with its resources", file.display()))
        })?;
        q[self.message] = text.lines().next().unwrap_or_default().to_owned();
        Ok(())
    }

    fn probe(&self, draw: usize, table: &Table, q: &mut Values<f64>) {
        table.spread(draw, q);
        // The faults that give no value are not points to differentiate at.
        q[self.fault] = if draw == 2 { NAN_OUTPUT } else { 1 };
        q[self.fault_time] = if draw.is_multiple_of(2) { 0.0 } else { 0.25 + q[self.fault_time] };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_export::Interface;

    #[test]
    fn faults_start_at_their_time() {
        let (m, table) = Table::of::<AllTypes>();
        for fault in [DISCARD, ERROR, NAN_OUTPUT, TERMINATE] {
            let mut q = table.start_values(Interface::CoSimulation);
            q[m.fault] = fault;
            q.time = 0.4;
            assert_eq!(m.equations(&mut q), Ok(()));
            assert!(q[m.y_real] == 0.0 && !m.event(&mut q).terminate);
            q.time = 0.5;
            let outcome = m.equations(&mut q);
            match fault {
                DISCARD => assert!(matches!(outcome, Err(Refusal::Discard(_)))),
                ERROR => assert!(matches!(outcome, Err(Refusal::Error(_)))),
                NAN_OUTPUT => assert!(q[m.y_real].is_nan()),
                _ => assert!(m.event(&mut q).terminate),
            }
        }
    }

    #[test]
    fn a_missing_resource_is_named() {
        let (m, table) = Table::of::<AllTypes>();
        let mut q = table.start_values(Interface::CoSimulation);
        let Err(Refusal::Error(message)) = m.load_resources(Some(Path::new("no-such-folder")), &mut q) else {
            panic!("a missing resource was accepted");
        };
        assert!(message.contains("message.txt"), "{message}");
    }
}
