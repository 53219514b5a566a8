//! Attachments with their signals, units and declared friction resolved in the system.

use super::Problem;
use super::declaration::{Attachment, File, Signal};
use super::model::{Entry, Level, Tap};
use super::names;
use super::plant::{self, Plant};
use crate::Error;
use airloop_cosim::system::SystemGraph;
use airloop_fmi::Causality;

/// The attachments of a study; `entries` and `fixed` are its declared parameters.
///
/// # Errors
/// A signal or parameter that is not there, with the place of its attachment.
pub(super) fn taps(
    file: &File,
    attachments: &[Attachment],
    graph: &SystemGraph,
    plant: &Plant,
    entries: &[Entry],
    fixed: &[(plant::Parameter, f64)],
) -> Result<Vec<Tap>, Error> {
    let mut found = Vec::new();
    for (index, attachment) in attachments.iter().enumerate() {
        let refuse = |problem: String| match file.declaration.attachment.get(index) {
            Some(spanned) => file.refuse(spanned, problem),
            None => file.refuse_all(problem),
        };
        let slot = |name: &Option<String>| -> Result<Option<usize>, Error> {
            let Some(name) = name else { return Ok(None) };
            let known = || plant.signal_names();
            let slot = plant.slot(name).ok_or_else(|| {
                refuse(Problem::Name { what: "signal", name: name.clone(), known: known() }.to_string())
            })?;
            Ok(Some(slot))
        };
        let signals =
            [&attachment.velocity, &attachment.position, &attachment.pressure_force, &attachment.pressure];
        let mut slots = [None; 4];
        for (slot_of, name) in slots.iter_mut().zip(signals) {
            *slot_of = slot(name)?;
        }
        for name in [&attachment.coulomb, &attachment.viscous, &attachment.bias].into_iter().flatten() {
            if Plant::parameter(graph, name).is_none() {
                let known = names::known(graph, &[Causality::Parameter]);
                let problem = Problem::Name { what: "Real parameter", name: name.clone(), known };
                return Err(refuse(problem.to_string()));
            }
        }
        let coulomb = attachment.coulomb.as_ref().and_then(|name| {
            let (parameter, value, _) = Plant::parameter(graph, name)?;
            let entry = entries.iter().position(|entry| entry.name == *name);
            let set = fixed.iter().find(|(own, _)| *own == parameter).map(|(_, value)| *value);
            Some(entry.map_or(Level::Value(set.unwrap_or(value)), Level::Entry))
        });
        // One that is free is fitted itself.
        let viscous = attachment.viscous.as_ref().and_then(|name| {
            let (parameter, value, _) = Plant::parameter(graph, name)?;
            let set = fixed.iter().find(|(own, _)| *own == parameter).map(|(_, value)| *value);
            entries.iter().all(|entry| entry.name != *name).then_some(set.unwrap_or(value))
        });
        let pole = attachment.channels.iter().any(|channel| channel == "pole");
        let vt = attachment.sign_velocity();
        if !(vt > 0.0 && vt.is_finite()) {
            return Err(refuse("vt must be above zero".into()));
        }
        let unit = |name: &Option<String>| {
            let name = name.as_ref()?;
            names::unit_of(graph, name).or_else(|| unit_of_signal(file, graph, name))
        };
        let units =
            [Some(attachment.input.clone()), attachment.velocity.clone(), attachment.position.clone()];
        let usual = if pole { ["N m", "rad/s", "rad"] } else { ["N", "m/s", "m"] };
        let stated = !attachment.channels.is_empty();
        let units = std::array::from_fn(|i| {
            let fallback = if stated { usual[i] } else { "1" };
            unit(&units[i]).unwrap_or_else(|| fallback.to_owned())
        });
        let words = match (stated, pole) {
            (true, false) => ["xdot", "x"].map(str::to_owned),
            (true, true) => ["thetadot", "theta"].map(str::to_owned),
            (false, _) => {
                [&attachment.velocity, &attachment.position].map(|name| name.clone().unwrap_or_default())
            }
        };
        let sign = attachment.port.map_or(1.0, |port| port.sign);
        let name = attachment.input.clone();
        let v0 = attachment.v0.unwrap_or(0.0);
        let attachment = attachment.clone();
        found.push(Tap {
            name,
            signals: slots,
            words,
            units,
            stated,
            attachment,
            sign,
            vt,
            v0,
            angular: pole,
            coulomb,
            viscous: viscous.unwrap_or(0.0),
            crossed: None,
        });
    }
    Ok(found)
}

/// Unit of a further signal of the study: that of its column, as the signal or an output made of the same column says
/// it, by or times seconds where it is a derivative or an integral.
fn unit_of_signal(file: &File, graph: &SystemGraph, name: &str) -> Option<String> {
    let signal = file.declaration.signals.get(name)?.get_ref();
    let column = signal.source()?;
    let shown = || {
        let (output, own) =
            file.declaration.outputs.iter().find(|(_, own)| own.get_ref().column == *column)?;
        own.get_ref().unit.clone().or_else(|| names::unit_of(graph, output))
    };
    let unit = signal.unit.clone().or_else(shown)?;
    Some(match signal {
        Signal { derivative_of: Some(_), .. } => format!("{unit}/s"),
        Signal { integral_of: Some(_), .. } => format!("{unit} s"),
        _ => unit,
    })
}
