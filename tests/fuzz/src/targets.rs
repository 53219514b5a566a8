//! The readers: each takes a file of any content, and gives a result or an error, never anything else.

use std::path::{Path, PathBuf};

use airloop::cosim::master::Algorithm;
use airloop::cosim::master::simulate::Record;
use airloop::cosim::results::states;
use airloop::cosim::system::{SystemGraph, ssv};
use airloop::fmi::{Fmu, ModelDescription, check};
use airloop::ident::record::Experiments;
use airloop::ident::record::detrend::Detrend;
use airloop::ident::record::set::Request;
use airloop::ident::source::Source;
use airloop::ident::structure::Structure;
use airloop::ident::subspace::{self, Options, Order};
use airloop::ident::{arx, model};
use airloop::plan::stabilize::settings;
use airloop::refine::case::Case;
use airloop::refine::study;
use airloop::refine::vocabulary::own::Own;
use airloop::series::{compound_unit, csv, units};
use airloop_expression::Expression;
use airloop_sweep::file::PlanFile;
use airloop_sweep::manifest::Tasks;

use crate::runs;

/// A reader.
#[derive(Clone, Copy)]
pub struct Target {
    /// Name on the command line.
    pub name: &'static str,
    /// Input that it reads.
    pub what: &'static str,
    /// Name of the file that it reads, in its place.
    pub file: &'static str,
    /// Reads the file.
    pub read: fn(&Path),
}

impl Target {
    /// All of them.
    pub const ALL: [Target; 18] = [
        target(
            "description",
            "model descriptions of FMI 2.0 and 3.0, and the checks of them",
            "modelDescription.xml",
            description,
        ),
        target("archive", "archives of FMUs", "x.fmu", archive),
        target("ssd", "systems", "system.ssd", system),
        target("ssv", "parameter sets", "set.ssv", parameter_set),
        target("ssp", "packages of systems", "system.ssp", system),
        target("simulate", "systems, and some steps of them by every master", "system.ssd", simulate),
        target("states", "saved states, and runs that go on from them", "result.states.json", states),
        target("problem", "optimal control problems", "problem.toml", problem),
        target("stabilize", "settings of stabilize and trials", "stabilize.toml", stabilize),
        target("study", "studies of refine", "study.toml", study_file),
        target("case", "cases of refine", "case.toml", case),
        target("dataset", "folders of measured data", "dataset.toml", dataset),
        target("effects", "effects of one's own", "effect.toml", effects),
        target("sweep", "plans of sweeps", "plan.toml", sweep),
        target("model", "identified models, and tables of signals", "model.toml", identified),
        target("csv", "records", "record.csv", record),
        target("identify", "records, and models identified from them", "record.csv", identify),
        target("units", "units, times and formulas", "words.txt", words),
    ];

    /// The target of a name.
    pub fn named(name: &str) -> Option<Target> {
        Target::ALL.into_iter().find(|target| target.name == name)
    }
}

const fn target(name: &'static str, what: &'static str, file: &'static str, read: fn(&Path)) -> Target {
    Target { name, what, file, read }
}

/// A refusal is as good as a result.
fn done<T, E>(_: Result<T, E>) {}

fn description(file: &Path) {
    if let Ok(bytes) = std::fs::read(file) {
        done(ModelDescription::parse(&bytes));
    }
    // The folder of the file is an FMU that is unpacked.
    if let Some(Ok(fmu)) = file.parent().map(Fmu::open) {
        let _ = check::static_findings(&fmu);
        done(SystemGraph::from_fmu(&fmu.path, None));
    }
}

fn archive(file: &Path) {
    if let Ok(fmu) = Fmu::open(file) {
        let _ = check::static_findings(&fmu);
    }
    done(airloop::fmi::unpack_package(file));
}

fn system(file: &Path) {
    done(SystemGraph::open(file));
    done(SystemGraph::open_to_read(file));
}

fn simulate(file: &Path) {
    let Ok(graph) = SystemGraph::open(file) else { return };
    for algorithm in
        [Algorithm::GaussSeidel, Algorithm::Jacobi, Algorithm::InterfaceJacobian, Algorithm::Monolithic]
    {
        done(runs::some_steps(&graph, algorithm, Record::default()));
    }
}

fn states(file: &Path) {
    let Ok(states) = states::read(file) else { return };
    let Some(Ok(graph)) = file.parent().map(|folder| SystemGraph::open(&folder.join(runs::FMU))) else {
        return;
    };
    let record = Record { from: Some(states), ..Record::default() };
    done(runs::some_steps(&graph, Algorithm::GaussSeidel, record));
}

fn parameter_set(file: &Path) {
    done(ssv::read(file));
}

fn problem(file: &Path) {
    done(airloop::plan::file::read(file));
}

fn stabilize(file: &Path) {
    done(settings::read(file));
}

fn study_file(file: &Path) {
    if let Ok(file) = study::declaration::File::read(file) {
        done(study::open::open(&file));
    }
}

fn case(file: &Path) {
    if let Some(folder) = file.parent() {
        done(Case::read(folder));
    }
}

fn dataset(file: &Path) {
    if let Some(Ok(file)) = file.parent().map(study::dataset::read) {
        done(study::open::open(&file));
    }
}

fn effects(file: &Path) {
    let Ok(Ok(own)) = std::fs::read_to_string(file).map(|text| Own::read(&text)) else { return };
    let _ = own.starts();
    let _ = own.to_toml(&[]);
}

fn sweep(file: &Path) {
    let Ok(text) = std::fs::read_to_string(file) else { return };
    let Ok(plan) = PlanFile::parse(&text, file) else { return };
    if let Ok(tasks) = Tasks::new(&plan, file.parent().unwrap_or(Path::new(""))) {
        let _ = tasks.task(0);
    }
}

fn identified(file: &Path) {
    done(model::file::load(file));
    done(airloop::discrepancy::signals::SignalTable::read(file));
}

fn record(file: &Path) {
    done(csv::read(file));
    done(Experiments::read(&request(file)));
}

/// Inputs and outputs as in the corpus.
fn request(file: &Path) -> Request {
    Request {
        estimation: vec![PathBuf::from(file)],
        validation: Vec::new(),
        inputs: vec!["u".to_owned()],
        outputs: vec!["y".to_owned()],
        detrend: Detrend::Mean,
    }
}

fn identify(file: &Path) {
    let Ok(data) = Experiments::read(&request(file)) else { return };
    let options = Options::new(Order::UpTo(3), &data.input_offset, &data.output_offset);
    done(subspace::estimate(&data.estimation, &options));
    let records: Vec<&dyn Source> = data.estimation.iter().map(|record| record as &dyn Source).collect();
    let names = arx::Names { inputs: &data.inputs, outputs: &data.outputs };
    let offsets = (data.input_offset.as_slice(), data.output_offset.as_slice());
    done(arx::estimate(&records, &Structure::uniform((1, 1), 2, 2, 1), data.sample_time, offsets, names));
}

fn words(file: &Path) {
    let Ok(text) = std::fs::read_to_string(file) else { return };
    for line in text.lines() {
        let _ = (units::lookup(line), compound_unit::parse(line));
        done(units::parse_duration(line));
        done(units::parse_time(line));
        if let Ok(formula) = Expression::parse(line, &["v", "x", "F", "t"]) {
            let _ = formula.value(&[1.0, 2.0, 3.0, 4.0]);
        }
    }
}
