//! An effect of one's own that an FMU computes: one of its outputs, from inputs that are the variables of a port.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use airloop_fmi::{Causality, Error, Fmu, InterfaceKind, Model, RealAttributes, Variable, VariableKind};

use super::own::{MAX_STATES, VARIABLES, exponential_step};

/// Event iterations at one place at most.
const MAX_ITERATIONS: usize = 100;
/// Difference of a state for the slope of its rate, relative.
const STATE_STEP: f64 = 1e-6;

/// Variables of the FMU that the file of an effect names.
#[derive(Debug, Clone, Default)]
pub struct Interface<'a> {
    /// Output that is the effect.
    pub output: &'a str,
    /// Place of a variable in [`VARIABLES`], and the input that gets it.
    pub inputs: Vec<(usize, &'a str)>,
    /// Parameters that are fitted.
    pub parameters: Vec<&'a str>,
}

/// Part of the file that does not fit the FMU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The FMU itself.
    Fmu,
    /// The output.
    Output,
    /// An input, by its place in [`Interface::inputs`].
    Input(usize),
    /// A parameter, by its place in [`Interface::parameters`].
    Parameter(usize),
}

/// An FMU that stands for the formula of an effect. Model Exchange; its instances are made as threads ask for them.
///
/// States are deviations from those that the FMU begins with. Relations (event indicators) are evaluated anew wherever
/// the effect is: an FMU whose states jump, or that has time events, is refused.
#[derive(Debug)]
pub struct FmuLaw {
    fmu: Arc<Fmu>,
    /// Name of the output.
    pub output: String,
    /// Place of each input in [`VARIABLES`], and its name.
    pub inputs: Vec<(usize, String)>,
    /// Names of the states.
    pub states: Vec<String>,
    output_reference: u32,
    input_references: Vec<u32>,
    parameter_references: Vec<u32>,
    has_relations: bool,
    idle: Mutex<Vec<Evaluator>>,
    problem: Mutex<Option<String>>,
    /// Its process came to an end: it would do so again.
    ended: AtomicBool,
}

/// One instance.
#[derive(Debug)]
struct Evaluator {
    model: Model,
    /// Parameters that it was initialized with; none: not yet.
    p: Option<Vec<f64>>,
    /// States after the initialization.
    start: Vec<f64>,
    inputs: Vec<f64>,
    states: Vec<f64>,
}

impl PartialEq for FmuLaw {
    fn eq(&self, other: &FmuLaw) -> bool {
        self.fmu.path == other.fmu.path
            && (&self.output, &self.inputs) == (&other.output, &other.inputs)
            && self.parameter_references == other.parameter_references
    }
}

impl FmuLaw {
    /// Opens the FMU and finds the variables of its interface.
    ///
    /// # Errors
    /// The part of the file that does not fit, and why.
    pub fn open(path: &Path, asked: &Interface) -> Result<FmuLaw, (Fault, String)> {
        let fmu = Fmu::open(path).map_err(|error| (Fault::Fmu, error.to_string()))?;
        let Some(interface) = fmu.interface(InterfaceKind::ModelExchange) else {
            let way = "export it for Model Exchange, or make it a component of the system";
            return Err((Fault::Fmu, format!("{} has no Model Exchange; {way}", path.display())));
        };
        if interface.can_be_instantiated_only_once_per_process {
            let problem =
                "can be instantiated once per process only, and a search needs an instance for every thread";
            return Err((Fault::Fmu, format!("{} {problem}", path.display())));
        }
        let description = &fmu.description;
        let states: Vec<String> =
            description.continuous_states().map(|v| description.variables[v].name.clone()).collect();
        if states.len() > MAX_STATES {
            let problem = format!("it has {} states; {MAX_STATES} are allowed", states.len());
            return Err((Fault::Fmu, problem));
        }
        let find = |name: &str, wanted: Causality| -> Result<u32, String> {
            let of_kind = |v: &&Variable| v.causality == wanted && matches!(v.kind, VariableKind::Real(_));
            let mut known = description.variables.iter().filter(of_kind);
            let found = known.clone().find(|v| v.name == name).map(|v| v.value_reference);
            found.ok_or_else(|| {
                let names: Vec<&str> = known.by_ref().take(20).map(|v| v.name.as_str()).collect();
                let what = format!("{wanted:?}").to_lowercase();
                let names = if names.is_empty() { "it has none".into() } else { names.join(", ") };
                format!("the FMU has no Real {what} `{name}`; known: {names}")
            })
        };
        let output_reference =
            find(asked.output, Causality::Output).map_err(|problem| (Fault::Output, problem))?;
        let mut input_references = Vec::new();
        for (place, (_, name)) in asked.inputs.iter().enumerate() {
            let found = find(name, Causality::Input).map_err(|problem| (Fault::Input(place), problem))?;
            input_references.push(found);
        }
        let mut parameter_references = Vec::new();
        for (place, name) in asked.parameters.iter().enumerate() {
            let found =
                find(name, Causality::Parameter).map_err(|problem| (Fault::Parameter(place), problem))?;
            parameter_references.push(found);
        }
        let has_relations = description.number_of_event_indicators > 0;
        Ok(FmuLaw {
            output: asked.output.to_owned(),
            inputs: asked.inputs.iter().map(|(place, name)| (*place, (*name).to_owned())).collect(),
            states,
            output_reference,
            input_references,
            parameter_references,
            has_relations,
            idle: Mutex::default(),
            problem: Mutex::default(),
            ended: AtomicBool::new(false),
            fmu,
        })
    }

    /// File of the FMU.
    pub fn path(&self) -> &Path {
        &self.fmu.path
    }

    /// The effect in words: the output and the name of the file.
    pub fn words(&self) -> String {
        let file = self.fmu.path.file_name().unwrap_or_default().to_string_lossy();
        format!("{} of {file}", self.output)
    }

    /// Unit, start value and range of a Real variable of the FMU.
    pub fn attributes(&self, name: &str) -> Option<&RealAttributes> {
        let description = &self.fmu.description;
        match &description.variables[description.index_of(name)?].kind {
            VariableKind::Real(real) => Some(real),
            _ => None,
        }
    }

    /// Whether an input gets a variable, by its place in [`VARIABLES`].
    pub fn uses(&self, variable: usize) -> bool {
        self.inputs.iter().any(|(place, _)| *place == variable)
    }

    /// Output for the variables, the states `z`, `[states]`, as deviations from their start, and the parameters `p`,
    /// `[parameters]`, all in the units of the FMU; not a number where the FMU refuses ([`FmuLaw::problem`] says why).
    pub fn value(&self, variables: [f64; VARIABLES.len()], z: &[f64], p: &[f64]) -> f64 {
        let mut value = [0.0];
        let found = self.evaluate(variables, z, p, |model| {
            model.get_real(&[self.output_reference], &mut value)?;
            Ok(value[0])
        });
        found.unwrap_or(f64::NAN)
    }

    /// States `z`, `[states]`, after `step` \[s\] with the variables held, each by the exponential of its own rate; not
    /// numbers where the FMU refuses.
    pub fn advance(&self, variables: [f64; VARIABLES.len()], z: &mut [f64], p: &[f64], step: f64) {
        let count = self.states.len();
        if count == 0 {
            return;
        }
        let rates = |z: &[f64]| {
            let mut rates = [f64::NAN; MAX_STATES];
            let own = &mut rates[..count];
            let _ = self.evaluate(variables, z, p, |model| model.get_derivatives(own));
            rates
        };
        let now = rates(z);
        let mut next = [0.0; MAX_STATES];
        for i in 0..count {
            let (kept, width) = (z[i], STATE_STEP * (z[i].abs() + now[i].abs() * step).max(1e-12));
            z[i] += width;
            let slope = (rates(z)[i] - now[i]) / width;
            z[i] = kept;
            next[i] = kept + exponential_step(now[i], slope, step);
        }
        z[..count].copy_from_slice(&next[..count]);
    }

    /// Calls an instance at a place; none where the FMU refuses.
    fn evaluate<R>(
        &self,
        variables: [f64; VARIABLES.len()],
        z: &[f64],
        p: &[f64],
        ask: impl FnOnce(&mut Model) -> Result<R, Error>,
    ) -> Option<R> {
        if self.ended.load(Ordering::Relaxed) {
            return None;
        }
        let found = self.take(p).and_then(|mut own| {
            own.initialize(self, p)?;
            own.go_to(self, variables, z)?;
            let found = ask(&mut own.model)?;
            self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(own);
            Ok(found)
        });
        found
            .map_err(|refusal: Refusal| {
                if matches!(refusal, Refusal::Call(Error::Lost(_) | Error::Dead { .. })) {
                    self.ended.store(true, Ordering::Relaxed);
                }
                let mut first = self.problem.lock().unwrap_or_else(PoisonError::into_inner);
                first.get_or_insert_with(|| refusal.to_string());
            })
            .ok()
    }

    /// An idle instance, one with these parameters where there is one, or a new one.
    fn take(&self, p: &[f64]) -> Result<Evaluator, Refusal> {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let same = idle.iter().rposition(|own| own.p.as_deref() == Some(p));
        if let Some(place) = same.or(idle.len().checked_sub(1)) {
            return Ok(idle.swap_remove(place));
        }
        drop(idle);
        let model = self.instantiate()?;
        let (inputs, states) = (vec![0.0; self.inputs.len()], vec![0.0; self.states.len()]);
        Ok(Evaluator { model, p: None, start: states.clone(), inputs, states })
    }

    fn instantiate(&self) -> Result<Model, Error> {
        Model::instantiate(&self.fmu, &self.fmu.description.model_name, false)
    }

    /// Why the FMU refused, where it first did.
    pub fn problem(&self) -> Option<String> {
        self.problem.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Why an FMU gives no value.
#[derive(Debug, thiserror::Error)]
enum Refusal {
    /// A call failed.
    #[error(transparent)]
    Call(#[from] Error),
    /// It does what an effect must not do.
    #[error("{0}; make it a component of the system")]
    Kind(String),
}

impl Evaluator {
    /// Initializes the FMU with parameters `p`, unless it is already.
    fn initialize(&mut self, law: &FmuLaw, p: &[f64]) -> Result<(), Refusal> {
        if self.p.as_deref() == Some(p) {
            return Ok(());
        }
        if self.p.take().is_some() && self.model.reset().is_err() {
            self.model = law.instantiate()?;
        }
        if !p.is_empty() {
            self.model.set_real(&law.parameter_references, p)?;
        }
        self.model.setup_experiment(None, 0.0, None)?;
        self.model.enter_initialization_mode()?;
        self.model.exit_initialization_mode()?;
        // Its states may follow from what is known at the beginning.
        if self.iterate()?.is_some() {
            return Err(Refusal::Kind(format!("{} has time events", law.fmu.shown.display())));
        }
        if !self.start.is_empty() {
            self.model.get_continuous_states(&mut self.start)?;
        }
        self.p = Some(p.to_vec());
        Ok(())
    }

    /// Event iterations, from event mode to continuous-time mode; the time of the next event.
    fn iterate(&mut self) -> Result<Option<f64>, Refusal> {
        for _ in 0..MAX_ITERATIONS {
            let event = self.model.new_discrete_states()?;
            if !event.new_discrete_states_needed {
                self.model.enter_continuous_time_mode()?;
                return Ok(event.next_event_time);
            }
        }
        Err(Refusal::Kind(format!("its event iteration does not end after {MAX_ITERATIONS} rounds")))
    }

    /// Goes to a place.
    fn go_to(&mut self, law: &FmuLaw, variables: [f64; VARIABLES.len()], z: &[f64]) -> Result<(), Refusal> {
        self.model.set_time(variables[3])?;
        if !self.start.is_empty() {
            for ((state, start), z) in self.states.iter_mut().zip(&self.start).zip(z) {
                *state = start + z;
            }
            self.model.set_continuous_states(&self.states)?;
        }
        if !self.inputs.is_empty() {
            for (value, (place, _)) in self.inputs.iter_mut().zip(&law.inputs) {
                *value = variables[*place];
            }
            self.model.set_real(&law.input_references, &self.inputs)?;
        }
        if !law.has_relations {
            return Ok(());
        }
        self.model.enter_event_mode()?;
        self.iterate()?;
        let mut there = [0.0; MAX_STATES];
        let there = &mut there[..self.start.len()];
        if !there.is_empty() {
            self.model.get_continuous_states(there)?;
        }
        if there == self.states {
            return Ok(());
        }
        Err(Refusal::Kind(format!("the states of {} jump at events", law.fmu.shown.display())))
    }
}
