//! FMUs with closed forms and faults: accuracy without directional derivatives, wrong descriptions, refusals.

use std::path::{Path, PathBuf};

use airloop_cosim::coupled::{Error, Options, System};
use airloop_cosim::system::SystemGraph;
use airloop_fmi::InterfaceKind;
use airloop_ocp::transcription::dynamics::{Dynamics, Entry, Point};
use tempfile::TempDir;

use airloop_testing::bent::{self, Kind};
use airloop_testing::looped;

fn graph(path: &Path) -> SystemGraph {
    SystemGraph::open_for(path, InterfaceKind::ModelExchange).unwrap()
}

fn open(path: &Path, outputs: &[&str]) -> System {
    let outputs = outputs.iter().map(|&name| name.to_owned()).collect();
    System::open(&graph(path), &Options { outputs, ..Options::default() }).unwrap()
}

fn at<'a>(states: &'a [f64], inputs: &'a [f64]) -> Point<'a> {
    Point { time: 0.0, states, inputs }
}

/// Largest errors of Jacobian and Hessian of a single FMU over some points, by the closed form.
fn errors(system: &mut System) -> [f64; 2] {
    let (mut values, mut jacobian, mut hessian) = ([0.0; 3], [0.0; 9], [0.0; 9]);
    let weights = [0.7, -1.3, 0.4];
    let mut worst = [0.0f64; 2];
    for k in 0..20 {
        let k = f64::from(k);
        let (x, u) = ([1.5 * (1.1 * k).sin(), (0.7 * k).cos()], 2.0 * (0.3 * k).sin());
        system.jacobian(at(&x, &[u]), &mut values, &mut jacobian).unwrap();
        system.hessian(at(&x, &[u]), &weights, &mut hessian).unwrap();
        let e = x[1].exp();
        let rates = [3.0 * x[1], u * x[0] * x[0] - x[0].sin(), u * x[0] + e];
        let rows = [0.0, 3.0, 0.0, 2.0 * u * x[0] - x[0].cos(), 0.0, x[0] * x[0], u, e, x[0]];
        let [_, w, v] = weights;
        let mixed = w * 2.0 * x[0] + v;
        let bends = [w * (2.0 * u + x[0].sin()), 0.0, mixed, 0.0, v * e, 0.0, mixed, 0.0, 0.0];
        for (found, expected) in values.iter().zip(rates) {
            assert!((found - expected).abs() < 1e-14 * 10.0, "{found} {expected}");
        }
        let gap = |found: &[f64], expected: &[f64]| {
            found.iter().zip(expected).fold(0.0f64, |worst, (a, b)| worst.max((a - b).abs()))
        };
        worst = [worst[0].max(gap(&jacobian, &rows)), worst[1].max(gap(&hessian, &bends))];
    }
    worst
}

#[test]
fn derivatives_are_those_of_the_closed_form() {
    let folder = TempDir::new().unwrap();
    let exact = errors(&mut open(&bent::fmu(&folder, "bent.fmu", Kind::Honest), &["y"]));
    assert!(exact[0] < 1e-14 && exact[1] < 1e-8, "{exact:?}");
    let mut plain = open(&bent::fmu(&folder, "plain.fmu", Kind::Plain), &["y"]);
    let notes = plain.notes().join("\n");
    assert!(
        notes.contains("`plain` has no directional derivatives of `plain.der(x1)`, `plain.y`"),
        "{notes}"
    );
    let approximate = errors(&mut plain);
    assert!(approximate[0] < 1e-8 && approximate[1] < 1e-5, "{approximate:?}");
}

#[test]
fn missing_dependencies_cost_structure_but_no_accuracy() {
    let folder = TempDir::new().unwrap();
    let mut silent = open(&bent::fmu(&folder, "bent.fmu", Kind::Silent), &["y"]);
    assert_eq!(silent.structure().entry(0, 0), Entry::Varying);
    let found = errors(&mut silent);
    assert!(found[0] < 1e-14 && found[1] < 1e-8, "{found:?}");
}

#[test]
fn dependencies_that_are_wrong_are_found_and_not_used() {
    let folder = TempDir::new().unwrap();
    let mut wrong = open(&bent::fmu(&folder, "bent.fmu", Kind::Wrong), &["y"]);
    assert_eq!(wrong.structure().entry(1, 0), Entry::Varying);
    assert_eq!(wrong.structure().entry(1, 2), Entry::Varying);
    assert_eq!(wrong.structure().entry(0, 1), Entry::Constant);
    let notes = wrong.notes().join("\n");
    assert!(notes.contains("`bent.der(x1)` by `bent.x0`"), "{notes}");
    let found = errors(&mut wrong);
    assert!(found[0] < 1e-14 && found[1] < 1e-8, "{found:?}");
}

#[test]
fn second_derivatives_pass_through_connections() {
    let folder = TempDir::new().unwrap();
    bent::fmu(&folder, "one.fmu", Kind::Honest);
    bent::fmu(&folder, "two.fmu", Kind::Honest);
    let mut system = open(&bent::chain(&folder, "one.fmu", "two.fmu"), &["b.y", "b.u"]);
    assert_eq!(system.names(), ["a.x0", "a.x1", "b.x0", "b.x1", "in", "b.y", "b.u"]);
    let (x, u) = ([0.3, -0.2, 0.9, 0.4], [0.6]);
    let mut values = [0.0; 6];
    system.evaluate(at(&x, &u), &mut values).unwrap();
    // a.u = 2 in + 0.5; b.u = 1 - 0.5 a.y
    let inner = 2.0 * u[0] + 0.5;
    let passed = 1.0 - 0.5 * (inner * x[0] + x[1].exp());
    let expected = [
        3.0 * x[1],
        inner * x[0] * x[0] - x[0].sin(),
        3.0 * x[3],
        passed * x[2] * x[2] - x[2].sin(),
        passed * x[2] + x[3].exp(),
        passed,
    ];
    for (found, expected) in values.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-14 * 10.0, "{values:?}");
    }
    // w0 der(b.x1) + w1 b.y + w2 b.u as a function of (a.x0, a.x1, b.x0, b.x1, in).
    let weights = [0.0, 0.0, 0.0, 0.8, -0.6, 0.3];
    let mut hessian = [0.0; 25];
    system.hessian(at(&x, &u), &weights, &mut hessian).unwrap();
    let e = x[1].exp();
    let through = 0.8 * x[2] * x[2] - 0.6 * x[2] + 0.3;
    let slope = 1.6 * x[2] - 0.6;
    let by_passed = [-0.5 * inner, -0.5 * e, 0.0, 0.0, -x[0]];
    let mut expected = [0.0; 25];
    expected[6] = -0.5 * e * through;
    expected[4] = -through;
    expected[20] = -through;
    expected[12] = 0.8 * (2.0 * passed + x[2].sin());
    expected[18] = -0.6 * x[3].exp();
    for (j, by) in by_passed.into_iter().enumerate() {
        expected[10 + j] += slope * by;
        expected[5 * j + 2] += slope * by;
    }
    for (index, (found, expected)) in hessian.iter().zip(expected).enumerate() {
        assert!((found - expected).abs() < 1e-8, "{index}: {found} {expected}");
    }
}

fn faulty(folder: &TempDir, fault: &str) -> System {
    let mut graph = graph(&bent::fmu(folder, "bent.fmu", Kind::Honest));
    graph.set_start("fault", fault, "test").unwrap();
    graph.set_start("limit", "10", "test").unwrap();
    System::open(&graph, &Options::default()).unwrap()
}

#[test]
fn a_failing_component_is_named_and_works_again_elsewhere() {
    let folder = TempDir::new().unwrap();
    for (fault, words) in
        [("1", "component `bent`"), ("2", "component `bent`"), ("3", "`bent.der(x1)`: it is NaN")]
    {
        let mut system = faulty(&folder, fault);
        let mut values = [0.0; 2];
        let error = system.evaluate(at(&[0.5, 0.1], &[11.0]), &mut values).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
        let mut jacobian = [0.0; 6];
        assert!(system.jacobian(at(&[0.5, 0.1], &[11.0]), &mut values, &mut jacobian).is_err(), "{fault}");
        assert!(system.hessian(at(&[0.5, 0.1], &[11.0]), &[1.0; 2], &mut [0.0; 9]).is_err(), "{fault}");
        system.evaluate(at(&[0.5, 0.1], &[9.0]), &mut values).unwrap();
        assert!((values[1] - (9.0 * 0.25 - 0.5f64.sin())).abs() < 1e-14, "{values:?}");
    }
}

#[test]
fn at_a_limit_derivatives_are_taken_from_the_side_that_the_component_allows() {
    let folder = TempDir::new().unwrap();
    for kind in [Kind::Honest, Kind::Plain] {
        let mut graph = graph(&bent::fmu(&folder, "bent.fmu", kind));
        graph.set_start("fault", "1", "test").unwrap();
        graph.set_start("limit", "10", "test").unwrap();
        let mut system = System::open(&graph, &Options::default()).unwrap();
        let (mut values, mut jacobian, mut hessian) = ([0.0; 2], [0.0; 6], [0.0; 9]);
        let x = [0.5, 0.1];
        system.jacobian(at(&x, &[10.0]), &mut values, &mut jacobian).unwrap();
        system.hessian(at(&x, &[10.0]), &[0.0, 1.0], &mut hessian).unwrap();
        let expected = [10.0 - x[0].cos(), 0.0, 0.25];
        jacobian[3..].iter().zip(expected).for_each(|(a, b)| assert!((a - b).abs() < 1e-4, "{jacobian:?}"));
        let expected = [20.0 + x[0].sin(), 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
        hessian.iter().zip(expected).for_each(|(a, b)| assert!((a - b).abs() < 1e-3, "{hessian:?}"));
    }
}

#[test]
fn numbers_that_are_none_are_refused_by_name() {
    let folder = TempDir::new().unwrap();
    let mut system = open(&bent::fmu(&folder, "bent.fmu", Kind::Honest), &[]);
    let error = system.evaluate(at(&[0.5, f64::NAN], &[1.0]), &mut [0.0; 2]).unwrap_err().to_string();
    assert!(error.contains("`bent.x1`"), "{error}");
}

fn refusal(path: &Path, options: Options) -> Error {
    System::open(&graph(path), &options).unwrap_err()
}

#[test]
fn names_that_mean_nothing_are_refused_with_those_there_are() {
    let folder = TempDir::new().unwrap();
    let path = bent::fmu(&folder, "bent.fmu", Kind::Honest);
    let list = |names: &[&str]| Some(names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>());
    let states =
        |names: &[&str]| refusal(&path, Options { states: list(names), ..Options::default() }).to_string();
    assert!(states(&["bent.x0", "bent.z"]).contains("bent.x0, bent.x1"));
    assert!(states(&["bent.x0"]).contains("`bent.x1` is not in the list"));
    assert!(states(&["bent.x0", "x0", "bent.x1"]).contains("given twice"));
    let inputs = refusal(&path, Options { inputs: list(&["v"]), ..Options::default() }).to_string();
    assert!(inputs.contains("input `v`") && inputs.contains("there are u"), "{inputs}");
    let outputs = |name: &str| {
        refusal(&path, Options { outputs: vec![name.to_owned()], ..Options::default() }).to_string()
    };
    assert!(outputs("bent.limit").contains("is a parameter"));
    assert!(outputs("nothing").contains("output `nothing`"));
}

#[test]
fn states_stand_in_the_order_of_the_problem() {
    let folder = TempDir::new().unwrap();
    let path = bent::fmu(&folder, "bent.fmu", Kind::Honest);
    let states = Some(vec!["x1".to_owned(), "bent.x0".to_owned()]);
    let mut system = System::open(&graph(&path), &Options { states, ..Options::default() }).unwrap();
    let (mut values, mut jacobian) = ([0.0; 2], [0.0; 6]);
    system.jacobian(at(&[0.2, 0.5], &[1.0]), &mut values, &mut jacobian).unwrap();
    assert!(
        (values[0] - (0.25 - 0.5f64.sin())).abs() < 1e-15 && (values[1] - 0.6).abs() < 1e-15,
        "{values:?}"
    );
    assert!((jacobian[1] - (1.0 - 0.5f64.cos())).abs() < 1e-15, "{jacobian:?}");
    assert_eq!(jacobian[3..], [3.0, 0.0, 0.0]);
}

#[test]
fn an_algebraic_loop_is_refused_by_name() {
    let folder = TempDir::new().unwrap();
    looped::fmu(&folder, "able.fmu", looped::ABLE);
    let connections = [("b.y", "a.u", 1.0, 0.0), ("a.y", "b.u", 1.0, 0.0)];
    let path = looped::system(&folder, &[("a", "able.fmu"), ("b", "able.fmu")], &connections);
    let error = refusal(&path, Options::default()).to_string();
    assert!(error.contains("a.u") && error.contains("b.y"), "{error}");
}

fn built(path: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: {} is not there; run `make fmu`", path.display());
    None
}

#[test]
fn a_sampled_component_is_refused_with_the_remedy() {
    let Some(path) = built("target/fmu/arx-actuator.fmu") else { return };
    let mut graph = graph(&path);
    graph.set_start("realization", "1", "test").unwrap();
    let error = System::open(&graph, &Options::default()).unwrap_err().to_string();
    assert!(error.contains("`arx-actuator`") && error.contains("realization"), "{error}");
}

#[test]
fn an_input_left_out_keeps_its_start_value() {
    let Some(path) = built("target/fmu/cart-pole.fmu") else { return };
    let mut graph = graph(&path);
    graph.set_start("F_ext", "2", "test").unwrap();
    let inputs = Some(vec!["F".to_owned()]);
    let mut system = System::open(&graph, &Options { inputs, ..Options::default() }).unwrap();
    let mut values = [0.0; 4];
    // Pole hanging at rest: both masses move with the cart at first, (m_c + m_p sin^2) a = F.
    system.evaluate(at(&[0.0; 4], &[1.0]), &mut values).unwrap();
    assert!((values[2] - 3.0 / 0.399).abs() < 1e-13, "{values:?}");
    assert!(system.notes().join("\n").contains("`F_ext`, `tau_ext`"), "{:?}", system.notes());
}

#[test]
fn a_reference_fmu_has_its_textbook_derivatives() {
    let Some(folder) = std::env::var_os("AIRLOOP_REFERENCE_FMUS").map(PathBuf::from) else {
        println!("skipped: AIRLOOP_REFERENCE_FMUS does not name a folder with the Reference FMUs");
        return;
    };
    let mut system = open(&folder.join("VanDerPol.fmu"), &[]);
    let (mut values, mut jacobian, mut hessian) = ([0.0; 2], [0.0; 4], [0.0; 4]);
    for k in 0..10 {
        let x = [2.0 * f64::from(k).sin(), 3.0 * f64::from(k).cos()];
        system.jacobian(at(&x, &[]), &mut values, &mut jacobian).unwrap();
        system.hessian(at(&x, &[]), &[0.5, 1.0], &mut hessian).unwrap();
        // x0' = x1, x1' = (1 - x0^2) x1 - x0
        let rate = (1.0 - x[0] * x[0]) * x[1] - x[0];
        assert!((values[0] - x[1]).abs() < 1e-14 && (values[1] - rate).abs() < 1e-13, "{values:?}");
        let expected = [0.0, 1.0, -2.0 * x[0] * x[1] - 1.0, 1.0 - x[0] * x[0]];
        jacobian.iter().zip(expected).for_each(|(a, b)| assert!((a - b).abs() < 1e-8, "{jacobian:?}"));
        let expected = [-2.0 * x[1], -2.0 * x[0], -2.0 * x[0], 0.0];
        hessian
            .iter()
            .zip(expected)
            .for_each(|(a, b)| assert!((a - b).abs() < 1e-4, "{hessian:?} {expected:?}"));
    }
}
