//! Cost of one FMU step under the master, against a bare loop of the same C calls.
//!
//! A chain of 20 FMUs that copy one Real input to one Real output (`target/fmu/test/test-copy.fmu`, or the FMU named in
//! `AIRLOOP_BENCH_FMU`): set, step, get for each. Three loops take short turns, so that all see the same machine; the
//! ratio is the median over the turns of master by bare loop. Limits: 1.5 without recording, 2.5 with every signal
//! recorded.
//!
//! Run it with `cargo bench -p airloop-cosim --bench macro_step`.

#![allow(unsafe_code, reason = "the bare loop calls the C functions directly")]
#![allow(missing_docs, reason = "a bench has no public items")]

use std::ffi::{CString, c_void};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use airloop_cosim::master::{Master, Settings};
use airloop_cosim::results::Recorder;
use airloop_cosim::system::SystemGraph;
use airloop_fmi::{Causality, Fmu, VariableKind};
use fmi::fmi2::binding::{Fmi2Binding, fmi2CallbackFunctions, fmi2Component, fmi2Type_fmi2CoSimulation};

const FMUS: usize = 20;
/// Short enough that most turns (half a millisecond) are not interrupted by other programs.
const MACRO_STEPS: usize = 1_000;
const TURNS: usize = 601;
const STEP: f64 = 1e-3;

fn main() -> ExitCode {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let path = std::env::var_os("AIRLOOP_BENCH_FMU")
        .map_or_else(|| workspace.join("target/fmu/test/test-copy.fmu"), PathBuf::from);
    if !path.exists() {
        println!("macro_step: skipped, as there is no {}; package the FMUs first", path.display());
        return ExitCode::SUCCESS;
    }
    let fmu = Fmu::open(&path).expect("the FMU of the bench opens");
    let (input, output) = ports(&fmu);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let graph = chain(&path, &input.0, &output.0, folder.path());

    let mut bare = Bare::new(&path, &fmu, input.1, output.1);
    let settings = |read_all_outputs| Settings {
        stop_time: 2.0 * (TURNS * MACRO_STEPS) as f64 * STEP,
        step_size: STEP,
        read_all_outputs,
        ..Settings::default()
    };
    let mut plain = Master::new(&graph, &settings(false), &[]).expect("the chain starts");
    let mut recorded = Master::new(&graph, &settings(true), &[]).expect("the chain starts");

    let (mut bare_ns, mut plain_ns, mut recorded_ns) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..TURNS {
        bare_ns.push(timed(|| bare.run(MACRO_STEPS)));
        plain_ns.push(timed(|| {
            for k in 0..MACRO_STEPS {
                plain.set_input(0, k as f64);
                plain.step().expect("the chain steps");
            }
        }));
        let values = recorded.values();
        let width = [values.reals.len(), values.integers.len(), values.booleans.len()];
        let mut recorder = Recorder::new(recorded.columns(&graph), width, MACRO_STEPS + 1);
        recorded_ns.push(timed(|| {
            for k in 0..MACRO_STEPS {
                recorded.set_input(0, k as f64);
                recorded.step().expect("the chain steps");
                let values = recorded.values();
                recorder.record(recorded.time(), &values.reals, &values.integers, &values.booleans);
            }
        }));
        assert_eq!(recorder.rows(), MACRO_STEPS);
    }
    println!(
        "chain of {FMUS} x {}: set, step, get; ns per FMU step (medians of {TURNS} turns)",
        path.display()
    );
    println!("  bare loop of C calls        {:7.1} ns", median(&bare_ns));
    let mut good = true;
    let loops = [("master, nothing recorded", &plain_ns, 1.5), ("master, all recorded", &recorded_ns, 2.5)];
    for (name, ns, limit) in loops {
        let ratios: Vec<f64> = ns.iter().zip(&bare_ns).map(|(ns, bare)| ns / bare).collect();
        let ratio = median(&ratios);
        let verdict = if ratio <= limit { "ok" } else { "TOO SLOW" };
        good &= ratio <= limit;
        println!("  {name:26}  {:7.1} ns   ratio {ratio:.2}, at most {limit}: {verdict}", median(ns));
    }
    if good { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Time per FMU step \[ns\].
fn timed(work: impl FnOnce()) -> f64 {
    let began = Instant::now();
    work();
    began.elapsed().as_nanos() as f64 / (MACRO_STEPS * FMUS) as f64
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// First Real input and output: name and value reference.
fn ports(fmu: &Fmu) -> ((String, u32), (String, u32)) {
    let first = |causality| {
        let variables = fmu.description.variables.iter();
        let mut real =
            variables.filter(|v| v.causality == causality && matches!(v.kind, VariableKind::Real(_)));
        real.next().map(|v| (v.name.clone(), v.value_reference)).expect("a Real input and a Real output")
    };
    (first(Causality::Input), first(Causality::Output))
}

/// u -> c0 -> c1 ... -> y
fn chain(path: &Path, input: &str, output: &str, folder: &Path) -> SystemGraph {
    let path = path.canonicalize().expect("the FMU is there");
    let (mut components, mut connections) = (String::new(), String::new());
    for index in 0..FMUS {
        components += &format!(
            "<ssd:Component name=\"c{index}\" source=\"{}\"><ssd:Connectors><ssd:Connector name=\"{input}\" kind=\"input\"/><ssd:Connector name=\"{output}\" kind=\"output\"/></ssd:Connectors></ssd:Component>",
            path.display()
        );
        let start = match index {
            0 => "startConnector=\"u\"".to_owned(),
            _ => format!("startElement=\"c{}\" startConnector=\"{output}\"", index - 1),
        };
        connections += &format!("<ssd:Connection {start} endElement=\"c{index}\" endConnector=\"{input}\"/>");
    }
    let text = format!(
        "<ssd:SystemStructureDescription xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\" version=\"1.0\" name=\"chain\"><ssd:System name=\"chain\"><ssd:Connectors><ssd:Connector name=\"u\" kind=\"input\"/><ssd:Connector name=\"y\" kind=\"output\"/></ssd:Connectors><ssd:Elements>{components}</ssd:Elements><ssd:Connections>{connections}<ssd:Connection startElement=\"c{}\" startConnector=\"{output}\" endConnector=\"y\"/></ssd:Connections></ssd:System></ssd:SystemStructureDescription>",
        FMUS - 1
    );
    let file = folder.join("chain.ssd");
    std::fs::write(&file, text).expect("the temporary folder takes a file");
    SystemGraph::open(&file).expect("the chain is a valid system")
}

unsafe extern "C" {
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(memory: *mut c_void);
}

unsafe extern "C" fn allocate(count: usize, size: usize) -> *mut c_void {
    // SAFETY: calloc takes any sizes.
    unsafe { calloc(count, size) }
}

unsafe extern "C" fn release(memory: *mut c_void) {
    // SAFETY: the FMU passes back what `allocate` gave it.
    unsafe { free(memory) }
}

/// The same chain, called directly.
struct Bare {
    binding: Fmi2Binding,
    components: Vec<fmi2Component>,
    input: [u32; 1],
    output: [u32; 1],
    time: f64,
    // The FMU keeps a pointer to the callbacks; the library lies in the folder.
    _callbacks: Box<fmi2CallbackFunctions>,
    _folder: tempfile::TempDir,
}

impl Bare {
    fn new(path: &Path, fmu: &Fmu, input: u32, output: u32) -> Bare {
        let folder = airloop_fmi::unpack_package(path).expect("the FMU unpacks");
        let identifier =
            &fmu.description.co_simulation.as_ref().expect("a Co-Simulation interface").model_identifier;
        let name = format!("{identifier}{}", std::env::consts::DLL_SUFFIX);
        let library = fmu
            .platforms()
            .into_iter()
            .map(|platform| folder.path().join("binaries").join(platform).join(&name))
            .find(|library| library.exists())
            .expect("a library for this platform");
        let callbacks = Box::new(fmi2CallbackFunctions {
            logger: None,
            allocateMemory: Some(allocate),
            freeMemory: Some(release),
            stepFinished: None,
            componentEnvironment: std::ptr::null_mut(),
        });
        // SAFETY: the library is an FMU that the import has checked; all calls follow the state machine of FMI 2.0,
        // strings and arrays live during the calls, the callbacks as long as the instances.
        unsafe {
            let binding = Fmi2Binding::new(library).expect("the library loads");
            let guid = CString::new(fmu.description.guid.as_str()).expect("no NUL");
            let resources = CString::new(fmu.resources_uri()).expect("no NUL");
            let components = (0..FMUS)
                .map(|index| {
                    let name = CString::new(format!("c{index}")).expect("no NUL");
                    let component = binding.fmi2Instantiate(
                        name.as_ptr(),
                        fmi2Type_fmi2CoSimulation,
                        guid.as_ptr(),
                        resources.as_ptr(),
                        &raw const *callbacks,
                        0,
                        0,
                    );
                    assert!(!component.is_null(), "the FMU makes an instance");
                    assert_eq!(binding.fmi2SetupExperiment(component, 0, 0.0, 0.0, 0, 0.0), 0);
                    assert_eq!(binding.fmi2EnterInitializationMode(component), 0);
                    assert_eq!(binding.fmi2ExitInitializationMode(component), 0);
                    component
                })
                .collect();
            Bare {
                binding,
                components,
                input: [input],
                output: [output],
                time: 0.0,
                _callbacks: callbacks,
                _folder: folder,
            }
        }
    }

    fn run(&mut self, steps: usize) {
        let set = *self.binding.fmi2SetReal.as_ref().expect("FMI 2.0 function");
        let step = *self.binding.fmi2DoStep.as_ref().expect("FMI 2.0 function");
        let get = *self.binding.fmi2GetReal.as_ref().expect("FMI 2.0 function");
        for k in 0..steps {
            let mut value = [k as f64];
            for &component in &self.components {
                // SAFETY: the instances are initialized; all arrays have length 1.
                let status = unsafe {
                    set(component, self.input.as_ptr(), 1, value.as_ptr())
                        | step(component, self.time, STEP, 1)
                        | get(component, self.output.as_ptr(), 1, value.as_mut_ptr())
                };
                assert_eq!(status, 0, "a call failed");
            }
            self.time += STEP;
        }
    }
}

impl Drop for Bare {
    fn drop(&mut self) {
        for &component in &self.components {
            // SAFETY: the instances are alive and not used afterwards.
            unsafe {
                self.binding.fmi2Terminate(component);
                self.binding.fmi2FreeInstance(component);
            }
        }
    }
}
