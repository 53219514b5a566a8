//! Sentences on ports whose effects need a statement of the study.

use super::{Kind, is_speed};
use crate::study::declaration::Attachment;
use airloop_cosim::system::SystemGraph;

/// Statements for the motion between two bodies, and for forces along a velocity that a command moves.
pub fn hints(attachments: &[Attachment], graph: &SystemGraph) -> Vec<String> {
    let between = attachments.iter().filter_map(between_bodies);
    between.chain(attachments.iter().filter_map(|own| without_forces(own, attachments, graph))).collect()
}

/// A sentence on a command that moves a velocity and is no force, where forces have no place.
fn without_forces(own: &Attachment, all: &[Attachment], graph: &SystemGraph) -> Option<String> {
    let velocity = own.position.as_ref().filter(|name| is_speed(graph, name))?;
    let is_found = own.channels.is_empty() && own.effects.is_none();
    let is_force = matches!(own.port?.kind, Kind::Mechanical | Kind::Electrical);
    let rate = format!("der({velocity})");
    if !is_found || is_force || all.iter().any(|other| other.input == rate) {
        return None;
    }
    Some(format!(
        "`{0}` moves `{velocity}` and is no force, so friction and drag along `{velocity}` are not looked for there. They have a place at its rate: [[attachment]] with input = \"{rate}\", beside one with input = \"{0}\" for what that lacks.",
        own.input
    ))
}

/// A sentence on a force between two bodies, whose friction and stops go by how these move against each other.
fn between_bodies(own: &Attachment) -> Option<String> {
    let (velocity, against) = (own.velocity.as_ref()?, own.against.as_ref()?);
    Some(format!(
        "`{0}` moves `{velocity}` one way and `{against}` the other: a force between two bodies. Its effects are looked for over `{velocity}` alone. What depends on how the bodies move against each other, such as friction or a stop between them, needs that motion stated: [[attachment]] with input = \"{0}\" and as velocity and position signals of the difference, for example [signals] gap_rate = {{ derivative_of = \"COLUMN\" }} of a column that shows the gap.",
        own.input
    ))
}
