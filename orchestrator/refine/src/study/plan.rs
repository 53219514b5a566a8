//! Plan of a search without the search: ports, signals and candidates of a study.

use super::declaration::File;
use super::prepared::{Prepared, prepared};
use crate::Error;

/// Places and candidates of a study.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plan {
    /// Inputs where something may be missing.
    pub places: Vec<Place>,
    /// Measured outputs with the kinds of sensor effects.
    pub sensors: Vec<(String, Vec<String>)>,
    /// Effects that cannot be looked for, and why.
    pub not_testable: Vec<(String, String)>,
    /// Assumptions made, one sentence each.
    pub notes: Vec<String>,
}

/// One place.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Place {
    /// Input of the system or of a component, or rate of a state.
    pub port: String,
    /// Units of the value, of velocity and position.
    pub units: [String; 3],
    /// Signal: velocity along a force.
    pub velocity: Option<String>,
    /// Signal: position along a force, or level.
    pub position: Option<String>,
    /// Kinds of effects.
    pub kinds: Vec<String>,
}

/// Reads the study and simulates the declared model; fits and searches nothing else.
///
/// # Errors
/// As [`prepared`].
pub fn plan(file: &File) -> Result<Plan, Error> {
    let Prepared { study, attachments, .. } = prepared(file, 1, &|_| ())?;
    let kinds = |port: &str| -> Vec<String> {
        let own = study.candidates.iter().filter(|own| !own.probe && own.port == port);
        own.map(|own| own.id.to_owned()).collect()
    };
    let places = attachments.iter().zip(&study.taps).map(|(attachment, tap)| Place {
        port: tap.name.clone(),
        units: tap.units.clone(),
        velocity: attachment.velocity.clone(),
        position: attachment.position.clone(),
        kinds: kinds(&tap.name),
    });
    let sensors = study.outputs.iter().map(|output| (output.port.clone(), kinds(&output.port)));
    Ok(Plan {
        places: places.collect(),
        sensors: sensors.filter(|(_, kinds)| !kinds.is_empty()).collect(),
        not_testable: study.not_testable.clone(),
        notes: study.notes.clone(),
    })
}
