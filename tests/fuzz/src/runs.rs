//! Short runs over the FMUs of this repository, for targets that go further than reading.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use airloop::cosim::master::simulate::{Record, Run, Saving, Watch, run_recorded};
use airloop::cosim::master::{Algorithm, Error, Settings};
use airloop::cosim::system::SystemGraph;

/// FMU whose states are saved, in its place.
pub const FMU: &str = "pendulum.fmu";
/// End of a run \[s\].
const STOP: f64 = 0.02;

/// Twenty steps.
///
/// # Errors
/// Those of the run.
pub fn some_steps(graph: &SystemGraph, algorithm: Algorithm, record: Record) -> Result<Run, Error> {
    let settings = Settings { stop_time: STOP, step_size: 1e-3, algorithm, ..Settings::default() };
    let stop = AtomicBool::new(false);
    let watch = Watch { stop: &stop, progress: &mut |_, _| {} };
    run_recorded(graph, &settings, None, watch, record)
}

/// States that a run of the FMU at `fmu` saves; none where it cannot run.
pub fn saved_states(fmu: &Path) -> Option<Vec<u8>> {
    let folder = tempfile::tempdir().ok()?;
    let file = folder.path().join("result.states.json");
    let saving = Saving { interval: Duration::ZERO, file: file.clone() };
    let rows = tempfile::tempfile().ok();
    let record = Record { saving: Some(saving), file: rows, ..Record::default() };
    some_steps(&SystemGraph::open(fmu).ok()?, Algorithm::GaussSeidel, record).ok()?;
    std::fs::read(file).ok()
}

/// Unpacks an archive into a folder; the files that cannot be written are not there.
pub fn unpack(archive: &Path, folder: &Path) {
    if let Some(mut archive) =
        std::fs::File::open(archive).ok().and_then(|file| zip::ZipArchive::new(file).ok())
    {
        let _ = archive.extract(folder);
    }
}
