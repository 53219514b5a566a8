//! An instance in a study: differential equations, or an FMU that only steps by itself.

use std::ops::{Deref, DerefMut};

use airloop_cosim::system::graph::Component;
use airloop_fmi::{Error, Instance, InterfaceKind, Model, Slave, StepStatus};

use super::Problem;

/// One instance, by the interface that its FMU offers.
#[derive(Debug)]
pub(super) enum PartInstance {
    /// Model Exchange.
    Equations(Model),
    /// Co-Simulation only.
    Stepped(Stepped),
}

/// Most communication steps of a slave in a sample.
const MAX_STEPS_PER_SAMPLE: f64 = 10.0;
/// The same where the FMU names no step and exchanges values with others.
const USUAL_STEPS_PER_SAMPLE: f64 = 4.0;

/// Length of the communication steps of a slave.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    /// Step of the default experiment \[s\].
    stated: Option<f64>,
    /// The FMU takes steps of any length.
    any: bool,
    /// It gets recorded signals only, so that one step per sample is enough.
    alone: bool,
}

impl Pace {
    /// That of a component, `alone` or coupled to others.
    pub fn of(component: &Component, alone: bool) -> Pace {
        let any = component
            .fmu
            .interface(InterfaceKind::CoSimulation)
            .is_some_and(|own| own.can_handle_variable_communication_step_size);
        let stated = component.fmu.description.default_experiment.step_size;
        Pace { stated: stated.filter(|step| *step > 0.0 && step.is_finite()), any, alone }
    }

    /// Communication step \[s\] between samples of this step \[s\]; `coupled`: something else follows its outputs, too.
    pub fn step(self, sample: f64, coupled: bool) -> f64 {
        let alone = self.alone && !coupled;
        let part = |count: f64| sample / (count - 1e-6).ceil().clamp(1.0, MAX_STEPS_PER_SAMPLE);
        match self.stated {
            // It can only go on in multiples of its own.
            Some(stated) if !self.any => {
                let multiple = (sample / stated).round().max(1.0);
                let fits = (multiple * stated - sample).abs() <= 1e-6 * sample;
                match (fits, alone) {
                    (true, true) => sample,
                    (true, false) => stated * (multiple / MAX_STEPS_PER_SAMPLE).ceil(),
                    (false, _) => stated,
                }
            }
            _ if alone => sample,
            Some(stated) => part(sample / stated),
            None if self.any => part(USUAL_STEPS_PER_SAMPLE),
            None => sample,
        }
    }
}

/// A slave at its last communication point. Its inputs are held from there to the next, and so are its outputs for
/// everything that reads them.
#[derive(Debug)]
pub(super) struct Stepped {
    slave: Slave,
    /// Communication point \[s\].
    time: f64,
    /// Outputs that the study reads, and their values there.
    references: Vec<u32>,
    shown: Vec<f64>,
    /// An output follows an input at the same instant.
    feeds_through: bool,
    /// It was initialized.
    runs: bool,
    /// It gave up a step: its outputs are NaN until the next simulation.
    ended: bool,
}

impl Deref for PartInstance {
    type Target = Instance;

    fn deref(&self) -> &Instance {
        match self {
            PartInstance::Equations(model) => model,
            PartInstance::Stepped(own) => &own.slave,
        }
    }
}

impl DerefMut for PartInstance {
    fn deref_mut(&mut self) -> &mut Instance {
        match self {
            PartInstance::Equations(model) => model,
            PartInstance::Stepped(own) => &mut own.slave,
        }
    }
}

impl PartInstance {
    /// An instance for Model Exchange, or for Co-Simulation where the FMU has nothing else; `outputs`: value references
    /// that a slave shows.
    pub fn new(component: &Component, outputs: &[u32]) -> Result<PartInstance, Problem> {
        if !is_stepped(component) {
            let model = Model::instantiate(&component.fmu, &component.name, false);
            return model.map(PartInstance::Equations).map_err(Problem::fmu);
        }
        let description = &component.fmu.description;
        let feeds_through = (0..description.variables.len()).any(|v| {
            outputs.contains(&description.variables[v].value_reference)
                && !component.fmu.feed_through(v).is_empty()
        });
        Ok(PartInstance::Stepped(Stepped {
            slave: Slave::instantiate(&component.fmu, &component.name, false).map_err(Problem::fmu)?,
            time: 0.0,
            references: outputs.to_vec(),
            shown: vec![0.0; outputs.len()],
            feeds_through,
            runs: false,
            ended: false,
        }))
    }

    /// The equations, if it has some.
    pub fn equations(&mut self) -> Option<&mut Model> {
        match self {
            PartInstance::Equations(model) => Some(model),
            PartInstance::Stepped(_) => None,
        }
    }

    /// Whether it is a slave.
    pub fn is_stepped(&self) -> bool {
        matches!(self, PartInstance::Stepped(_))
    }

    /// The slave, if it is one.
    pub fn stepped(&mut self) -> Option<&mut Stepped> {
        match self {
            PartInstance::Equations(_) => None,
            PartInstance::Stepped(own) => Some(own),
        }
    }

    /// Back to the state after instantiation; a slave that cannot be reset is made anew.
    pub fn restart(&mut self) -> Result<(), Error> {
        match self {
            PartInstance::Equations(model) => model.reset(),
            PartInstance::Stepped(own) => {
                own.runs = false;
                own.ended = false;
                if own.slave.reset().is_err() {
                    let (fmu, name) = (own.slave.fmu().clone(), own.slave.name().to_owned());
                    own.slave = Slave::instantiate(&fmu, &name, false)?;
                }
                Ok(())
            }
        }
    }
}

impl Stepped {
    /// Outputs at the communication point.
    pub fn shown(&self) -> &[f64] {
        &self.shown
    }

    /// Whether it gave up a step.
    pub fn has_ended(&self) -> bool {
        self.ended
    }

    /// Reads the outputs during initialization, before the inputs have their values.
    pub fn preview(&mut self, time: f64) -> Result<(), Error> {
        self.time = time;
        self.slave.get_real(&self.references, &mut self.shown)
    }

    /// Goes to the communication point `time` \[s\], with inputs as they were set at the last one.
    pub fn advance(&mut self, time: f64) -> Result<(), Error> {
        let step = time - self.time;
        if self.ended || !self.runs || step <= 0.0 {
            return Ok(());
        }
        match self.slave.do_step(self.time, step, true)? {
            StepStatus::Complete => {
                self.time = time;
                self.slave.get_real(&self.references, &mut self.shown)
            }
            StepStatus::Discarded { .. } => {
                self.ended = true;
                self.shown.fill(f64::NAN);
                Ok(())
            }
        }
    }

    /// Takes inputs that were just set: ends the initialization, and reads outputs that follow them at once.
    pub fn take_inputs(&mut self) -> Result<(), Error> {
        if self.ended {
            return Ok(());
        }
        let begins = !self.runs;
        if begins {
            self.slave.exit_initialization_mode()?;
            self.runs = true;
        }
        if begins || self.feeds_through {
            self.slave.get_real(&self.references, &mut self.shown)?;
        }
        Ok(())
    }
}

/// Whether a component has no equations to evaluate, only steps.
pub(super) fn is_stepped(component: &Component) -> bool {
    component.fmu.interface(InterfaceKind::ModelExchange).is_none()
}
