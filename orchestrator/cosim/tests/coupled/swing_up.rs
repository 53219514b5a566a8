//! The pneumatic cart-pole of example 01 against its equations typed by hand.

use std::path::Path;

use airloop_cosim::coupled::{Options, System};
use airloop_cosim::system::SystemGraph;
use airloop_fmi::InterfaceKind;
use airloop_ocp::transcription::dynamics::{Dynamics, Entry, Point};

use airloop_testing::mechanics::{FEED, accelerations, continuous_actuator};

const STATES: [&str; 6] =
    ["cart_pole.x", "cart_pole.theta", "cart_pole.v", "cart_pole.omega", "actuator.z[1]", "actuator.z[2]"];
const OUTPUTS: [&str; 4] = ["F_p", "cart_pole.x", "cart_friction.f", "cart_pole.energy"];

/// The system in the order of the problem statement; `None` where the FMUs are not built.
fn open(outputs: &[&str]) -> Option<System> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    if !root.join("target/fmu/arx-actuator.fmu").exists() {
        println!("skipped: target/fmu/arx-actuator.fmu is not there; run `make fmu`");
        return None;
    }
    let graph = SystemGraph::open_for(&root.join("examples/01_run/system.ssd"), InterfaceKind::ModelExchange);
    let options = Options {
        states: Some(STATES.map(str::to_owned).to_vec()),
        outputs: outputs.iter().map(|&name| name.to_owned()).collect(),
        ..Options::default()
    };
    Some(System::open(&graph.unwrap(), &options).unwrap())
}

/// Points around the motion, some with small velocities where the frictions bend most.
fn points() -> Vec<([f64; 6], f64)> {
    let point = |k: usize| {
        let wave = |i: usize| (1.3 * (i + 1) as f64 + 0.7 * (k * k) as f64).sin();
        let v = if k.is_multiple_of(2) { 0.02 } else { 0.6 } * wave(2);
        ([0.1 * wave(0), 3.0 * wave(1), v, 8.0 * wave(3), 20.0 * wave(4), 30.0 * wave(5)], 60.0 * wave(6))
    };
    (0..40).map(point).collect()
}

/// Rates and their Jacobian by hand, `[6]` and `[6][7]`.
fn by_hand(y: &[f64; 6], u: f64) -> ([f64; 6], [[f64; 7]; 6]) {
    let f = accelerations([y[1], y[2], y[3], y[5] + FEED * u]);
    let (ac, bc) = continuous_actuator();
    let z = [0, 1].map(|i| ac[i][0] * y[4] + ac[i][1] * y[5] + bc[i] * u);
    let mut rows = [[0.0; 7]; 6];
    (rows[0][2], rows[1][3]) = (1.0, 1.0);
    for i in 0..2 {
        let [theta, v, w, force] = f.gradient[i];
        rows[2 + i] = [0.0, theta, v, w, 0.0, force, FEED * force];
        (rows[4 + i][4], rows[4 + i][5], rows[4 + i][6]) = (ac[i][0], ac[i][1], bc[i]);
    }
    ([y[2], y[3], f.value[0], f.value[1], z[0], z[1]], rows)
}

#[test]
fn rates_at_the_check_point_are_those_of_the_statement() {
    let Some(mut system) = open(&[]) else { return };
    let mut found = [0.0; 6];
    let at = Point { time: 0.0, states: &[0.01, 0.5, 0.1, -1.0, 2.0, 3.0], inputs: &[10.0] };
    system.evaluate(at, &mut found).unwrap();
    // From the check values of the problem statement, computed with NumPy.
    let expected =
        [0.1, -1.0, -13.581567750692567, 36.228912437166095, 106.19628514496608, 198.75268298783277];
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= 1e-12 * expected.abs(), "{found} {expected}");
    }
}

#[test]
fn rates_and_their_jacobian_are_those_of_the_equations() {
    let Some(mut system) = open(&[]) else { return };
    let (mut values, mut jacobian) = ([0.0; 6], [0.0; 42]);
    for (y, u) in points() {
        let at = Point { time: 0.0, states: &y, inputs: &[u] };
        system.jacobian(at, &mut values, &mut jacobian).unwrap();
        let (rates, rows) = by_hand(&y, u);
        for i in 0..6 {
            let gap = (values[i] - rates[i]).abs();
            assert!(gap <= 1e-11 * rates[i].abs().max(1.0), "{y:?} {u}: rate {i} is {}", values[i]);
            for j in 0..7 {
                let gap = (jacobian[i * 7 + j] - rows[i][j]).abs();
                let size = rows[i].iter().fold(1.0f64, |size, entry| size.max(entry.abs()));
                assert!(
                    gap <= 1e-11 * size,
                    "{y:?} {u}: ({i}, {j}) is {}, by hand {}",
                    jacobian[i * 7 + j],
                    rows[i][j]
                );
            }
        }
    }
}

#[test]
fn the_hessian_is_that_of_the_equations() {
    let Some(mut system) = open(&[]) else { return };
    let mut hessian = [0.0; 49];
    let mut worst = 0.0f64;
    for (k, (y, u)) in points().into_iter().enumerate() {
        let weights: [f64; 6] = std::array::from_fn(|i| (0.4 + 1.9 * (i + k) as f64).cos());
        let at = Point { time: 0.0, states: &y, inputs: &[u] };
        system.hessian(at, &weights, &mut hessian).unwrap();
        let inner = accelerations([y[1], y[2], y[3], y[5] + FEED * u]).hessian([weights[2], weights[3]]);
        // (theta, v, w, force) by (x, theta, v, w, z1, z2, u).
        let rows = [
            [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, FEED],
        ];
        let mut expected = [0.0; 49];
        for (a, row) in rows.iter().enumerate() {
            for (b, other) in rows.iter().enumerate() {
                for i in 0..7 {
                    for j in 0..7 {
                        expected[i * 7 + j] += inner[a][b] * row[i] * other[j];
                    }
                }
            }
        }
        let size = expected.iter().fold(1.0f64, |size, entry| size.max(entry.abs()));
        for (index, (found, expected)) in hessian.iter().zip(expected).enumerate() {
            worst = worst.max((found - expected).abs() / size);
            assert!(
                (found - expected).abs() <= 1e-7 * size,
                "{y:?} {u}: {index} is {found}, by hand {expected}"
            );
            assert_eq!(*found, hessian[index % 7 * 7 + index / 7], "not symmetric");
        }
    }
    println!("largest difference of a block, relative to its largest entry: {worst:e}");
}

#[test]
fn outputs_have_values_and_derivatives_too() {
    let Some(mut system) = open(&OUTPUTS) else { return };
    let (count, width) = (system.size().values(), system.size().arguments());
    let (mut values, mut jacobian) = (vec![0.0; count], vec![0.0; count * width]);
    let (mut up, mut down) = (values.clone(), values.clone());
    for (y, u) in points() {
        let at = Point { time: 0.0, states: &y, inputs: &[u] };
        system.jacobian(at, &mut values, &mut jacobian).unwrap();
        // Load cell: force of the actuator less the friction of the piston.
        let load = y[5] + FEED * u - 1.5145 * (40.8926 * y[2]).tanh() - 49.2734 * y[2];
        assert!((values[6] - load).abs() < 1e-12 * load.abs().max(1.0));
        assert_eq!(values[7], y[0]);
        let mut point = [y[0], y[1], y[2], y[3], y[4], y[5], u];
        for j in 0..width {
            let here = point[j];
            let step = 1e-6 * if j == 2 { 0.01 } else { 1.0 };
            for (value, side) in [(here + step, &mut up), (here - step, &mut down)] {
                point[j] = value;
                system.evaluate(Point { time: 0.0, states: &point[..6], inputs: &point[6..] }, side).unwrap();
            }
            point[j] = here;
            for row in 6..count {
                let slope = (up[row] - down[row]) / (2.0 * step);
                let found = jacobian[row * width + j];
                assert!((slope - found).abs() < 1e-5 * slope.abs().max(1.0), "{row} {j}: {found} {slope}");
            }
        }
    }
}

#[test]
fn the_structure_claims_nothing_that_is_not_so() {
    let Some(mut system) = open(&OUTPUTS) else { return };
    let (count, width) = (system.size().values(), system.size().arguments());
    let structure = system.structure().clone();
    let (mut values, mut jacobian) = (vec![0.0; count], vec![0.0; count * width]);
    let mut first: Option<Vec<f64>> = None;
    for (y, u) in points() {
        system.jacobian(Point { time: 0.0, states: &y, inputs: &[u] }, &mut values, &mut jacobian).unwrap();
        let first = first.get_or_insert_with(|| jacobian.clone());
        for row in 0..count {
            for column in 0..width {
                let index = row * width + column;
                match structure.entry(row, column) {
                    Entry::Zero => assert_eq!(jacobian[index], 0.0, "({row}, {column})"),
                    Entry::Constant => assert_eq!(jacobian[index], first[index], "({row}, {column})"),
                    Entry::Varying => {}
                }
            }
        }
    }
    // And it claims what it can: x and theta move with v and w, the actuator is linear, nothing depends on x.
    assert_eq!(structure.entry(0, 2), Entry::Constant);
    assert_eq!(structure.entry(2, 0), Entry::Zero);
    assert_eq!(structure.entry(2, 6), Entry::Varying);
    assert_eq!(structure.linear_states(&[0, 1, 2, 3, 4, 5]), [4, 5]);
}

#[test]
fn names_units_and_notes_come_from_the_descriptions() {
    let Some(system) = open(&OUTPUTS) else { return };
    let expected = STATES.iter().chain(&["u"]).chain(&OUTPUTS);
    assert!(system.names().iter().map(String::as_str).eq(expected.copied()));
    let units: Vec<&str> = system.units().iter().map(|unit| unit.as_deref().unwrap_or("")).collect();
    assert_eq!(units, ["m", "rad", "m/s", "rad/s", "N", "N", "N", "N", "m", "N", "J"]);
    assert_eq!(system.nominals()[..7], [0.1, 1.0, 1.0, 1.0, 100.0, 100.0, 100.0]);
    assert_eq!(system.start_states(), [0.0; 6]);
    let notes = system.notes().join("\n");
    assert!(notes.contains("component `actuator` runs in its continuous form"), "{notes}");
    assert!(notes.contains("`actuator.z[3]`"), "{notes}");
}

#[test]
fn another_instance_gives_the_same_bits() {
    let Some(mut system) = open(&OUTPUTS) else { return };
    let mut other = system.duplicate().unwrap();
    let (count, width) = (system.size().values(), system.size().arguments());
    let mut found = [vec![0.0; width * width], vec![0.0; width * width]];
    let weights = vec![0.7; count];
    for (y, u) in points() {
        let at = Point { time: 0.3, states: &y, inputs: &[u] };
        system.hessian(at, &weights, &mut found[0]).unwrap();
        other.hessian(at, &weights, &mut found[1]).unwrap();
        assert_eq!(found[0], found[1]);
    }
}
