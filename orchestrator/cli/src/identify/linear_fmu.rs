//! An identified model as an FMU: the project's `linear-state-space` with the start values of the model.

use std::path::{Path, PathBuf};

use airloop::Error;
use airloop_fmi::derive::{Derivation, Value, derive};
use airloop_fmi::template_folder::template;
use airloop_ident::model::StateSpace;

/// The FMU that is derived from.
const TEMPLATE: &str = "linear-state-space";
/// Most states, inputs and outputs of the template.
const MAX_STATES_INPUTS_OUTPUTS: (usize, usize, usize) = (12, 4, 4);

/// Longest delay of an input \[samples\].
const LONGEST_DELAY: usize = 64;

/// An FMU that is to be written once there is a model.
#[derive(Debug, Clone)]
pub struct Wanted {
    template: PathBuf,
    name: String,
}

/// Refuses a name that is more than the name of a file and of a model.
///
/// # Errors
/// [`Error::LinearFmu`].
pub fn check_name(name: &str) -> Result<(), Error> {
    if !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || "-_".contains(c)) {
        return Ok(());
    }
    let problem = "the name may have letters, digits, - and _ only".to_owned();
    Err(Error::LinearFmu { name: name.to_owned(), problem })
}

impl Wanted {
    /// Checks before any work is done that an FMU of `n_u` inputs and `n_y` outputs can be written.
    ///
    /// # Errors
    /// [`Error::LinearFmu`] for a name or a size that does not do, [`Error::Template`] if the FMU to derive from is not
    /// found.
    pub fn new(name: &str, (n_u, n_y): (usize, usize)) -> Result<Wanted, Error> {
        check_name(name)?;
        let refused = |problem: String| Error::LinearFmu { name: name.to_owned(), problem };
        if n_u > MAX_STATES_INPUTS_OUTPUTS.1 || n_y > MAX_STATES_INPUTS_OUTPUTS.2 {
            return Err(refused(format!(
                "there are {n_u} inputs and {n_y} outputs, and FMUs of linear models have {} and {} at most; leave some out",
                MAX_STATES_INPUTS_OUTPUTS.1, MAX_STATES_INPUTS_OUTPUTS.2
            )));
        }
        Ok(Wanted { template: template(TEMPLATE, None)?, name: name.to_owned() })
    }

    /// File name in the folder of the results.
    pub fn file(&self) -> String {
        format!("{}.fmu", self.name)
    }

    /// Checks that a model of `states` states whose inputs act `delays` samples later fits.
    ///
    /// # Errors
    /// [`Error::LinearFmu`] for too many states or a delay that is too long.
    pub fn check(&self, states: usize, delays: &[usize]) -> Result<(), Error> {
        let refused = |problem: String| Err(Error::LinearFmu { name: self.name.clone(), problem });
        if let Some(delay) = delays.iter().find(|delay| **delay > LONGEST_DELAY) {
            return refused(format!(
                "a delay of {delay} samples is more than {LONGEST_DELAY}; leave --fmu away"
            ));
        }
        if states > MAX_STATES_INPUTS_OUTPUTS.0 {
            return refused(format!(
                "the model has {states} states, and FMUs of linear models {} at most; lower the order",
                MAX_STATES_INPUTS_OUTPUTS.0
            ));
        }
        Ok(())
    }

    /// Writes the FMU into `folder`. Its inputs `u[i]` and outputs `y[i]` are those of the model in their order; it
    /// starts at rest at the operating point.
    ///
    /// # Errors
    /// [`Error::LinearFmu`] for too many states, [`Error::Derive`] for a file that cannot be written.
    pub fn write(&self, model: &StateSpace, description: &str, folder: &Path) -> Result<(), Error> {
        self.write_delayed(model, &[], description, folder)
    }

    /// Same as [`Wanted::write`], with inputs that act `delays[j]` samples later, shape \[n_u\] or none.
    ///
    /// # Errors
    /// Same as [`Wanted::write`], also for delays that are too long.
    pub fn write_delayed(
        &self,
        model: &StateSpace,
        delays: &[usize],
        description: &str,
        folder: &Path,
    ) -> Result<(), Error> {
        self.check(model.order(), delays)?;
        let derivation = Derivation {
            name: self.name.clone(),
            description: description.to_owned(),
            start: start_values(model, delays),
            resources: Vec::new(),
        };
        derive(&self.template, &folder.join(self.file()), &derivation)?;
        Ok(())
    }
}

fn start_values(model: &StateSpace, delays: &[usize]) -> Vec<(String, Value)> {
    let (n_x, n_u, n_y) = (model.order(), model.d.ncols(), model.d.nrows());
    let count =
        |name: &str, n: usize| (name.to_owned(), Value::Integer(i64::try_from(n).unwrap_or(i64::MAX)));
    let mut start = vec![count("n_x", n_x), count("n_u", n_u), count("n_y", n_y)];
    start.push(("sample_time".into(), Value::Real(model.sample_time)));
    for (name, matrix) in [("A", &model.a), ("B", &model.b), ("C", &model.c), ("D", &model.d)] {
        for i in 0..matrix.nrows() {
            for j in 0..matrix.ncols() {
                start.push((format!("{name}[{},{}]", i + 1, j + 1), Value::Real(matrix[(i, j)])));
            }
        }
    }
    for (name, offsets) in [("u_offset", &model.input_offset), ("y_offset", &model.output_offset)] {
        for (index, offset) in offsets.iter().enumerate() {
            start.push((format!("{name}[{}]", index + 1), Value::Real(*offset)));
        }
    }
    start.extend(delays.iter().enumerate().map(|(j, &delay)| count(&format!("nk[{}]", j + 1), delay)));
    start
}
