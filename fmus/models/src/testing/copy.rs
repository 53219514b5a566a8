//! One Real input copied to one Real output: what an FMU costs when it does nothing.

use fmi_export::{Identity, Model, Outcome, Real, Scalar, Table, Values};

/// `y = u`.
pub struct Copy {
    u: Real,
    y: Real,
}

impl Model for Copy {
    const IDENTITY: Identity = Identity {
        model_identifier: "test_copy",
        model_name: "test-copy",
        description: "Test FMU: copies its input to its output",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    fn declare(t: &mut Table) -> Self {
        Self { u: t.input("u").about("input").real(0.0), y: t.output("y").about("the input").computed() }
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        q[self.y] = q[self.u];
        Ok(())
    }
}
