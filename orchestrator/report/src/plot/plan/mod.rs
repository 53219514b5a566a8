//! Figures of a plan, and the page that shows them with an animation; all from the files of its folder.

mod animation;
mod figures;
mod forces;
mod page;
pub(super) mod stick;

use std::path::{Path, PathBuf};

use super::Error;
use super::run::write;
use airloop_plan::record::{self, Summary};
use airloop_series::{TimeSeries, csv};

/// The plan at its knots.
pub const TRAJECTORY: &str = "trajectory.csv";
/// Roll-out with all components in continuous time.
pub const CONTINUOUS: &str = "rollout_continuous.csv";
/// Roll-out with sampled components at their rate.
pub const SAMPLED: &str = "rollout_sampled.csv";
/// Estimated error of every state over every interval.
pub const DEFECTS: &str = "defects.csv";

/// Planned forces, commands of the actuators and the forces that they deliver.
pub const FORCES: &str = "feed_forward.csv";
/// Figures that a plan may have in addition to those of [`figure_files`]: its stick figure, and the forces of
/// actuators.
pub const MORE_FIGURES: [&str; 2] = ["stick_figure.svg", "forces.svg"];

/// Plan to draw.
struct Plan {
    summary: Summary,
    trajectory: TimeSeries,
    continuous: Option<TimeSeries>,
    sampled: Option<TimeSeries>,
    defects: Option<TimeSeries>,
    forces: Option<TimeSeries>,
}

impl Plan {
    fn read(folder: &Path) -> Result<Plan, Error> {
        let summary = record::read(&folder.join("summary.json"))?;
        let listed = |name: &str| -> Result<Option<TimeSeries>, Error> {
            match summary.files.iter().any(|file| file == name) {
                true => Ok(Some(csv::read(&folder.join(name))?)),
                false => Ok(None),
            }
        };
        let (continuous, sampled, defects) = (listed(CONTINUOUS)?, listed(SAMPLED)?, listed(DEFECTS)?);
        let trajectory = csv::read(&folder.join(TRAJECTORY))?;
        let forces = listed(FORCES)?;
        Ok(Plan { summary, trajectory, continuous, sampled, defects, forces })
    }

    /// Values of a signal in a series.
    fn values<'a>(&self, series: &'a TimeSeries, name: &str) -> Option<&'a [f64]> {
        series.channel(name).map(|channel| channel.values.as_slice())
    }
}

/// The files that [`draw`] writes next to the page.
pub fn figure_files(with_portrait: bool, with_defects: bool) -> Vec<String> {
    let mut files = vec!["states.svg".to_owned(), "input.svg".to_owned()];
    if with_portrait {
        files.push("phase_portrait.svg".into());
    }
    if with_defects {
        files.push("interval_error.svg".into());
    }
    files
}

/// Draws the figures of a plan and the page; returns what was written, the page first.
///
/// # Errors
/// A file cannot be read or written.
pub fn draw(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let plan = Plan::read(folder)?;
    let mut written = vec![folder.join("index.html")];
    let mut figures = Vec::new();
    for name in &plan.summary.figures {
        let text = match name.as_str() {
            "states.svg" => figures::states(&plan),
            "input.svg" => figures::inputs(&plan),
            "phase_portrait.svg" => figures::portrait(&plan),
            "stick_figure.svg" => stick::stick_figure(&plan),
            "forces.svg" => forces::forces(&plan),
            _ => figures::interval_error(&plan),
        };
        let path = folder.join(name);
        write(&path, &text)?;
        written.push(path);
        figures.push(text);
    }
    write(&written[0], &page::page(&plan, &figures))?;
    Ok(written)
}
