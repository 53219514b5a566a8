//! Forces that actuators deliver, and their commands, with and without the model of the actuators (Fig. 14 of the
//! paper).

use super::Plan;
use crate::plot::axes::range;
use crate::plot::identification::panel::{Entry, Scale, Sheet};

/// Curves of a force: suffix of its column, class, words.
const DELIVERED: [(&str, &str, &str); 3] = [
    (".planned", "s0", "planned"),
    (".delivered.optimized", "s1 d1", "delivered, command from the model of the actuator"),
    (".delivered.naive", "s2 d2", "delivered, planned force as command"),
];
const COMMANDS: [(&str, &str); 2] = [(".command.optimized", "s1"), (".command.naive", "s2")];

/// For every force what is planned and delivered, and below it the commands.
pub(super) fn forces(plan: &Plan) -> String {
    let series = plan.forces.as_ref();
    let names: Vec<&str> = series
        .iter()
        .flat_map(|series| series.channels())
        .filter_map(|channel| channel.name.strip_suffix(DELIVERED[0].0))
        .collect();
    let entries = DELIVERED.map(|(_, class, text)| Entry { class, shape: None, text });
    let mut sheet = Sheet::new("Forces of the actuators", "", &entries, 2 * names.len(), 1, 170.0);
    for (index, name) in names.iter().enumerate() {
        let Some(series) = series else { break };
        let delivered = DELIVERED.map(|(suffix, class, _)| (format!("{name}{suffix}"), class));
        let commands = COMMANDS.map(|(suffix, class)| (format!("{name}{suffix}"), class));
        let rows =
            [(&delivered[..], format!("{name}: force [N]")), (&commands[..], format!("{name}: command [N]"))];
        for (row, (lines, text)) in rows.iter().enumerate() {
            let found: Vec<(&[f64], &str)> = lines
                .iter()
                .filter_map(|(column, class)| Some((series.channel(column)?.values.as_slice(), *class)))
                .collect();
            let (low, high) = range(found.iter().flat_map(|(values, _)| values.iter().copied()));
            let room = 0.06 * (high - low).max(1e-9);
            let across = range(series.time().iter().copied());
            let panel = sheet.panel(
                2 * index + row,
                "",
                (across, Scale::Linear, "time [s]"),
                ((low - room, high + room), Scale::Linear, text),
            );
            for (values, class) in found {
                panel.line(&mut sheet.svg, series.time(), values, class);
            }
        }
    }
    sheet.svg.finish("Planned and delivered forces, and commands")
}
