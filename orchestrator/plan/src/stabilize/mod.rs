//! A plan with a controller that keeps the system on it: design over the FMUs, FMU of the controller, closed loop.
//!
//! [`settings`] reads what the user states; `design` looks its names up and hands trajectory, weights and noise to
//! [`airloop_ocp::control`]; [`wiring`] puts the controller into the system. Folders, figures and words are left to the
//! layers above.

mod design;
mod following;
pub mod predictive;
pub mod record;
pub mod settings;
pub mod wiring;

use std::path::Path;

use super::Error;
use airloop_fmi::derive::{Derivation, Value, derive};
use airloop_fmi::template_folder::template;
use airloop_ocp::control::Controller;

pub use design::{Plan, Repeated, Stabilized, stabilize};
pub use settings::Settings;

/// The FMU that is derived from.
const TEMPLATE: &str = "tvlqr-controller";
/// Its table.
const TABLE: &str = "controller.csv";
/// Largest numbers of states with disturbances, inputs and measured signals of the template.
const MAX_SIZES: [(&str, usize); 3] =
    [("states and disturbances", 16), ("inputs", 4), ("measured signals", 16)];

/// Writes the controller as an FMU.
///
/// # Errors
/// More states, inputs or measured signals than the FMU has, no template, or a file that cannot be written.
pub fn write_fmu(controller: &Controller, name: &str, description: &str, file: &Path) -> Result<(), Error> {
    let row = &controller.rows[0];
    let place = || file.display().to_string();
    for ((what, most), found) in
        MAX_SIZES.into_iter().zip([row.states.len(), row.inputs.len(), row.measured.len()])
    {
        if found > most {
            let problem =
                format!("{found} {what}; the FMU of the controller has {most} at most, leave some out");
            return Err(Error::Place { place: place(), problem });
        }
    }
    let mut start = vec![("sample_time".to_owned(), Value::Real(controller.sample_time))];
    for (j, &(low, high)) in controller.limits.iter().enumerate() {
        let limits = [("u_min", low), ("u_max", high)].into_iter().filter(|(_, limit)| limit.is_finite());
        start.extend(limits.map(|(name, limit)| (format!("{name}[{}]", j + 1), Value::Real(limit))));
    }
    let derivation = Derivation {
        name: name.to_owned(),
        description: description.to_owned(),
        start,
        resources: vec![(TABLE.to_owned(), controller.table().into_bytes())],
    };
    let template = template(TEMPLATE, None)
        .map_err(|error| Error::Place { place: place(), problem: error.to_string() })?;
    derive(&template, file, &derivation)
        .map_err(|error| Error::Place { place: place(), problem: error.to_string() })?;
    Ok(())
}
