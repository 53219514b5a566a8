//! A system of FMUs as one right-hand side with derivatives, for optimization and control.
//!
//! [`System::open`] makes Model Exchange instances of all components; values pass along the connections within one
//! evaluation, so that there is no coupling error. Derivatives follow by the chain rule over those of the components;
//! second derivatives are differences of the components' first ones: central, but for arguments along which these run
//! straight. That is learned once, as are the parts that are linear with constant factors, which need no calls.
//!
//! `anatomy` takes the components as functions, `learn` finds what is constant, `program` orders the work, `plan` holds
//! all that instances share, `work` computes. Meshes and solvers are left to `transcription` and `optim`. Events have
//! no place here: what happens at them is fixed when the system is opened.

mod anatomy;
mod calls;
mod chain;
mod choices;
mod error;
mod learn;
mod memory;
mod names;
mod options;
mod plan;
mod program;
mod start;
mod work;

use std::sync::Arc;

use crate::system::SystemGraph;
use airloop_dynamics::EvaluationError;
use airloop_dynamics::{Dynamics, Point, Size, Structure};
use airloop_fmi::Model;
use calls::is_discarded;
use memory::Known;
use plan::Plan;
use work::{Trouble, Work};

pub use error::Error;
pub use options::Options;

/// A system of FMUs as one [`Dynamics`].
#[derive(Debug)]
pub struct System {
    plan: Arc<Plan>,
    /// In the order of the components.
    models: Vec<Model>,
    work: Work,
    /// An FMU refused so that it has to be made anew.
    broken: bool,
}

impl System {
    /// Instantiates and initializes the components of a system, and learns the structure of its derivatives.
    ///
    /// # Errors
    /// [`Error`]: a component without Model Exchange or with time events, an algebraic loop, unknown names, or an FMU
    /// that fails.
    pub fn open(graph: &SystemGraph, options: &Options) -> Result<System, Error> {
        let (plan, models, widths) = Plan::make(graph, options)?;
        let mut work = Work::new(&plan.program, widths, plan.size);
        work.combine_constants(&plan.program);
        Ok(System { plan: Arc::new(plan), models, work, broken: false })
    }

    /// Units of states, inputs and outputs, where they have one, `[n_x + n_u + n_g]`.
    pub fn units(&self) -> &[Option<String>] {
        &self.plan.units
    }

    /// Assumptions, omissions and approximations, one sentence each.
    pub fn notes(&self) -> &[String] {
        &self.plan.notes
    }

    /// States at which the components were initialized, `[n_x]`.
    pub fn start_states(&self) -> &[f64] {
        &self.plan.start
    }

    /// Makes the instances anew after an FMU refused for good.
    fn repair(&mut self) -> Result<(), EvaluationError> {
        if self.broken {
            self.models = start::instances(&self.plan.graph, self.plan.time).map_err(|error| {
                EvaluationError { function: "the system".to_owned(), reason: error.to_string() }
            })?;
            self.work.forget();
            self.broken = false;
        }
        Ok(())
    }

    /// Brings values, or values and first derivatives, to a point.
    fn at(&mut self, at: Point<'_>, wanted: Known) -> Result<(), EvaluationError> {
        self.repair()?;
        let (program, models) = (&self.plan.program, &mut self.models);
        let done = self.work.recall(at).and_then(|known| {
            match (known, wanted) {
                (Known::Nothing, Known::Derivatives) => {
                    self.work.visit(program, models)?;
                    self.work.differentiate(program, models)?;
                }
                (Known::Nothing, _) => self.work.visit(program, models)?,
                (Known::Values, Known::Derivatives) => self.work.revisit(program, models)?,
                _ => return Ok(()),
            }
            self.work.remember(wanted);
            Ok(())
        });
        done.map_err(|trouble| self.explain(trouble))
    }

    #[cold]
    fn explain(&mut self, trouble: Trouble) -> EvaluationError {
        match trouble {
            Trouble::Fmu { component, error } => {
                self.broken = !is_discarded(&error);
                let function = format!("component `{}`", self.plan.graph.components[component].name);
                EvaluationError { function, reason: error.to_string() }
            }
            Trouble::NotFinite { value, found } => {
                let function = format!("`{}`", self.plan.value_names[value]);
                EvaluationError { function, reason: format!("it is {found}") }
            }
            Trouble::Derivative { component, argument, found } => {
                let variable = self.plan.argument_names[component][argument].as_str();
                EvaluationError {
                    function: format!("a derivative by `{variable}`"),
                    reason: format!("it is {found}"),
                }
            }
            Trouble::Argument { column, found } => {
                let function = format!("`{}`", self.plan.names[column]);
                EvaluationError { function, reason: format!("it is {found}, no finite number") }
            }
        }
    }
}

impl Dynamics for System {
    fn size(&self) -> Size {
        self.plan.size
    }

    fn structure(&self) -> &Structure {
        &self.plan.structure
    }

    fn names(&self) -> Vec<String> {
        self.plan.names.clone()
    }

    fn nominals(&self) -> Vec<f64> {
        self.plan.nominals.clone()
    }

    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        self.at(at, Known::Values)?;
        self.work.write_values(&self.plan.rates, &self.plan.outputs, values);
        Ok(())
    }

    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.at(at, Known::Derivatives)?;
        let plan = &*self.plan;
        self.work.write_values(&plan.rates, &plan.outputs, values);
        self.work.combine(&plan.program);
        self.work.write_jacobian(&plan.rates, &plan.outputs, jacobian);
        Ok(())
    }

    fn hessian(
        &mut self,
        at: Point<'_>,
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.at(at, Known::Derivatives)?;
        let plan = &*self.plan;
        self.work.combine(&plan.program);
        self.work.weigh(&plan.program, &plan.rates, &plan.outputs, weights);
        let done = self.work.bend(&plan.program, &mut self.models, hessian);
        done.map_err(|trouble| self.explain(trouble))
    }

    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        let refuse = |error: Error| EvaluationError {
            function: "another instance of the system".to_owned(),
            reason: error.to_string(),
        };
        let plan = Arc::clone(&self.plan);
        let models = start::instances(&plan.graph, plan.time).map_err(refuse)?;
        Ok(Box::new(System { models, work: self.work.fresh(), plan, broken: false }))
    }
}
