//! A problem that is solved again and again: other initial states, bounds and parameters, each time from the solution
//! before.

use std::ops::ControlFlow;
use std::time::Instant;

use super::Error;
use super::file::{Place, StartValue, Statement, Text};
use super::prepare::{Prepared, prepare_statement};
use super::solve::{self, Begin, Session, Settings, Solved};
use airloop_ocp::transcription::{self, Discretization, LimitPlace, Problem, Trajectory};
use airloop_optim::{Method, Solution, Status};

/// A problem file over its FMUs, kept to be solved again.
///
/// [`Solver::new`] finds the first motion as `airloop optimize` does. After that other initial states and bounds cost
/// no allocation and few iterations ([`transcription::Solver`]); other parameters open the FMUs anew.
///
/// ```no_run
/// use airloop_plan::{prepare::prepare, solver::Solver};
/// # fn main() -> Result<(), airloop_plan::Error> {
/// let mut solver = Solver::new(prepare("examples/03_swing_up/problem.toml".as_ref())?, None)?;
/// let mut states = solver.initial().to_vec();
/// states[1] += 0.02;
/// solver.set_initial(&states)?;
/// println!("{}", solver.solve()?.objective);
/// # Ok(())
/// # }
/// ```
pub struct Solver {
    prepared: Prepared,
    settings: Settings,
    discretization: Discretization,
    inner: transcription::Solver,
    /// Initial states, and limits with other bounds, as they were asked for.
    initial: Vec<f64>,
    bounds: Vec<(usize, LimitPlace, [f64; 2])>,
    /// Name and place of every limit along the path, with its phase.
    named: Vec<(String, usize, LimitPlace)>,
}

impl Solver {
    /// Finds the first motion, with the settings of the problem file where none are given.
    ///
    /// # Errors
    /// [`Error`]: nothing to begin with, or no motion was found, with the reason.
    pub fn new(prepared: Prepared, settings: Option<Settings>) -> Result<Solver, Error> {
        Solver::watched(prepared, settings, &mut |_| ControlFlow::Continue(()))
    }

    /// Same as [`Solver::new`], with a monitor that can end the search for the first motion.
    ///
    /// # Errors
    /// See [`Solver::new`].
    pub fn watched(
        prepared: Prepared,
        settings: Option<Settings>,
        monitor: &mut solve::Monitor<'_>,
    ) -> Result<Solver, Error> {
        let choice = super::guess::choose(&prepared.statement, None)?;
        let rough = super::guess::guess(&prepared.statement, &prepared.catalog, &prepared.task, &choice)?;
        let settings = settings.unwrap_or_else(|| Settings::of(&prepared.statement));
        Solver::from(prepared, settings, Begin::From(&rough), monitor)
    }

    /// Same as [`Solver::watched`], from a start of the caller's.
    ///
    /// # Errors
    /// See [`Solver::new`].
    pub fn from(
        prepared: Prepared,
        settings: Settings,
        begin: Begin,
        monitor: &mut solve::Monitor<'_>,
    ) -> Result<Solver, Error> {
        let mut session = Session::new(&prepared, 1)?;
        let solved = session.solve(&prepared.setup, &settings, begin, monitor)?;
        check(&prepared.statement, &solved)?;
        let Solved { outcome, .. } = solved;
        let problem = session.into_problem();
        let initial = outcome.trajectory.phases[0].states[0].clone();
        let (named, discretization) = (named(&problem), outcome.discretization.clone());
        let options = options(&settings);
        let inner = transcription::Solver::new(problem, &discretization, &outcome, &options)?;
        Ok(Solver { prepared, settings, discretization, inner, initial, bounds: Vec::new(), named })
    }

    /// Names of the states, in the order of [`Solver::set_initial`].
    pub fn states(&self) -> Vec<&str> {
        let variables = self.prepared.catalog.variables();
        self.prepared.task.signals.states.iter().map(|&index| variables[index].name.as_str()).collect()
    }

    /// Names of the inputs.
    pub fn inputs(&self) -> Vec<&str> {
        let variables = self.prepared.catalog.variables();
        self.prepared.task.signals.inputs.iter().map(|&index| variables[index].name.as_str()).collect()
    }

    /// Names of the bounds along the path, in the order of the phases, each once.
    pub fn bounds(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for (name, ..) in &self.named {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        names
    }

    /// Initial states, `[n_x]`, in the units of the FMUs.
    pub fn initial(&self) -> &[f64] {
        &self.initial
    }

    /// Fixes the initial states, `[n_x]`, in the units of the FMUs.
    ///
    /// # Errors
    /// A value that is not finite; see also [`transcription::Solver::set_initial`].
    pub fn set_initial(&mut self, states: &[f64]) -> Result<(), Error> {
        if let Some(wrong) = states.iter().position(|value| !value.is_finite()) {
            let name = self.states().get(wrong).map_or(String::new(), |name| format!("`{name}` = "));
            let problem = format!("{name}{} is not possible: it must be finite", states[wrong]);
            return Err(Error::Place { place: "initial states".into(), problem });
        }
        self.inner.set_initial(states)?;
        self.initial.copy_from_slice(states);
        Ok(())
    }

    /// Gives all limits along the path of this name other bounds, in the units of the FMUs, without margin.
    ///
    /// # Errors
    /// [`Error::Place`] with the names there are; see also [`transcription::Program::set_limits`].
    pub fn set_bounds(&mut self, name: &str, bounds: [f64; 2]) -> Result<(), Error> {
        let named = self.named.iter().filter(|(own, ..)| own == name);
        let limits: Vec<_> = named.map(|&(_, phase, place)| (phase, place, bounds)).collect();
        if limits.is_empty() {
            let names: Vec<String> = self.bounds().iter().map(|name| format!("`{name}`")).collect();
            let problem = format!("there is no bound `{name}`; the problem has {}", names.join(", "));
            return Err(Error::Place { place: "bounds".into(), problem });
        }
        self.inner.set_limits(&limits)?;
        self.bounds.retain(|(phase, place, _)| limits.iter().all(|own| (own.0, own.1) != (*phase, *place)));
        self.bounds.extend(limits);
        Ok(())
    }

    /// Gives parameters other values: opens the FMUs anew, and starts from the last solution, with its multipliers.
    /// Initial states and bounds that were set stay. Where it fails nothing has changed.
    ///
    /// # Errors
    /// Unknown names and values that an FMU refuses.
    pub fn set_parameters(&mut self, values: &[(&str, f64)]) -> Result<(), Error> {
        let mut statement = self.prepared.statement.clone();
        for (name, value) in values {
            let start = StartValue::Number(*value);
            match statement.parameters.0.iter_mut().find(|(known, _)| known.text == *name) {
                Some((_, known)) => *known = start,
                None => {
                    statement.parameters.0.push((Text { place: Place(0), text: (*name).to_owned() }, start))
                }
            }
        }
        let prepared = prepare_statement(statement, Instant::now())?;
        let problem = Session::new(&prepared, 1)?.into_problem();
        let options = options(&self.settings);
        let mut inner = transcription::Solver::like(&self.inner, problem, &self.discretization, &options)?;
        inner.set_initial(&self.initial)?;
        inner.set_limits(&self.bounds)?;
        (self.inner, self.prepared) = (inner, prepared);
        Ok(())
    }

    /// Moves the start of the next solve ahead by `seconds`.
    ///
    /// # Errors
    /// See [`transcription::Solver::shift`].
    pub fn shift(&mut self, seconds: f64) -> Result<(), Error> {
        Ok(self.inner.shift(seconds)?)
    }

    /// Solves from the last solution; how it ended is the status of what is returned.
    ///
    /// # Errors
    /// See [`transcription::Solver::solve`].
    pub fn solve(&mut self) -> Result<&Solution, Error> {
        self.solve_watched(&mut |_| ControlFlow::Continue(()))
    }

    /// Same as [`Solver::solve`], with a monitor that can end it.
    ///
    /// # Errors
    /// See [`Solver::solve`].
    pub fn solve_watched(&mut self, monitor: &mut airloop_optim::Monitor<'_>) -> Result<&Solution, Error> {
        Ok(self.inner.solve(monitor)?)
    }

    /// The motion of the last solve.
    ///
    /// # Errors
    /// See [`transcription::Solver::trajectory`].
    pub fn trajectory(&mut self) -> Result<Trajectory, Error> {
        Ok(self.inner.trajectory()?)
    }

    /// The solver of the program, for other starts.
    pub fn inner(&mut self) -> &mut transcription::Solver {
        &mut self.inner
    }

    /// The problem as it was prepared.
    pub fn prepared(&self) -> &Prepared {
        &self.prepared
    }
}

/// An error where no first motion was found.
fn check(statement: &Statement, solved: &Solved) -> Result<(), Error> {
    if matches!(solved.status(), Status::Solved | Status::Acceptable) {
        return Ok(());
    }
    let worst = solved.worst.as_ref().map_or(String::new(), |worst| format!("; {worst}"));
    let reason = format!("{}{worst}", solved.status());
    Err(Error::NoMotion { file: statement.source.file.clone(), reason })
}

fn options(settings: &Settings) -> airloop_optim::Settings {
    airloop_optim::Settings {
        method: Method::Sqp,
        tolerance: settings.tolerance,
        max_iterations: settings.max_iterations,
        ..airloop_optim::Settings::default()
    }
}

fn named(problem: &Problem) -> Vec<(String, usize, LimitPlace)> {
    let of_phase = |(number, phase): (usize, &transcription::Phase)| {
        let path =
            |(i, path): (usize, &transcription::Path)| (path.limit.name.clone(), number, LimitPlace::Path(i));
        phase.paths.iter().enumerate().map(path).collect::<Vec<_>>()
    };
    problem.phases.iter().enumerate().flat_map(of_phase).collect()
}
