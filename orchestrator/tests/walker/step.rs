//! The half step (variants A and B) as a problem of three phases over the FMU compass-gait with its mode pinned.

use std::path::{Path as File, PathBuf};

use airloop::coupled::{Options, System};
use airloop::fmu::InterfaceKind;
use airloop::system::SystemGraph;
use airloop::transcription::{
    After, Cost, Duration, Dynamics, Integrated, Interpolation, Limit, Link, OutputReset, Path, Phase,
    PhaseTrajectory, Place, Problem, Quantity, Trajectory, Variable,
};

/// Largest torque and lumped toe forces, W-6 and W-9.
pub const U_MAX: [f64; 3] = [60.0, 1055.5751, 1055.5751];
const RATES: [&str; 6] = ["vx", "vy", "omega1", "omega2", "dl1", "dl2"];
/// Static forces on foot 1 and on foot 2.
const HOLD: [[f64; 3]; 2] = [[0.0, 139.302, -7.848], [0.0, -7.848, 139.302]];
/// Durations of the guess, s.
const DURATIONS: [f64; 3] = [0.8, 0.15, 0.8];

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Variant {
    A,
    B,
}

pub fn root() -> PathBuf {
    File::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

pub fn fmu() -> Option<PathBuf> {
    let path = root().join("target/fmu/compass-gait.fmu");
    if !path.exists() {
        println!("skipped: target/fmu/compass-gait.fmu is not there; run `make fmu`");
        return None;
    }
    Some(path)
}

/// The walker with parameters set, showing some outputs.
pub fn system(fmu: &File, parameters: &[(&str, &str)], outputs: &[&str]) -> System {
    let mut graph = SystemGraph::open_for(fmu, InterfaceKind::ModelExchange).unwrap();
    for (name, value) in parameters {
        graph.set_start(name, value, "test").unwrap();
    }
    let component = graph.components[0].name.clone();
    let outputs = outputs.iter().map(|name| format!("{component}.{name}")).collect();
    System::open(&graph, &Options { outputs, ..Options::default() }).unwrap()
}

/// State indices.
const TH: usize = 2;
const L: usize = 4;
const V: usize = 6;

fn feet_outputs(feet: &[usize]) -> Vec<String> {
    let all = ["x", "y", "ft", "fn", "vy", "ay"];
    feet.iter().flat_map(|i| all.iter().map(move |name| format!("foot{}.{name}", i + 1))).collect()
}

/// Output of a foot by its name in the order of [`feet_outputs`] for both feet.
fn foot(i: usize, name: &str) -> Variable {
    let at = ["x", "y", "ft", "fn", "vy", "ay"].iter().position(|one| *one == name).unwrap();
    Variable::Output(6 * i + at)
}

pub fn problem(fmu: &File, variant: Variant) -> Problem {
    let b = variant == Variant::B;
    let shown = feet_outputs(&[0, 1]);
    let shown: Vec<&str> = shown.iter().map(String::as_str).collect();
    let wrap = |system: System| -> Box<dyn Dynamics> {
        if b { Box::new(Integrated::new(Box::new(system), U_MAX.to_vec())) } else { Box::new(system) }
    };
    let input = |i: usize| if b { Variable::State(12 + i) } else { Variable::Input(i) };
    let scaled = |i: usize| if b { 1.0 } else { U_MAX[i] };
    let phase = |name: &str, mode: &str, bounds: [f64; 2], stance: &[usize]| {
        let dynamics = wrap(system(fmu, &[("contact_mode", mode)], &shown));
        let mut phase =
            Phase::new(name, vec![dynamics], Duration::Free { lower: bounds[0], upper: bounds[1] });
        let mut path = |name: &str, unit: &str, quantity: Quantity, lower: f64, upper: f64| {
            phase.paths.push(Path::everywhere(Limit::between(name, unit, quantity, lower, upper)));
        };
        for i in 0..2 {
            path(&format!("leg {} length", i + 1), "m", Variable::State(L + i).into(), 0.90, 1.05);
            path(&format!("leg {} angle", i + 1), "rad", Variable::State(TH + i).into(), -0.6, 0.6);
            path(
                &format!("leg {} angular velocity", i + 1),
                "rad/s",
                Variable::State(V + 2 + i).into(),
                -8.0,
                8.0,
            );
            path(
                &format!("leg {} rate of length", i + 1),
                "m/s",
                Variable::State(V + 4 + i).into(),
                -1.0,
                1.0,
            );
        }
        let between = |k: usize| vec![(Variable::State(k + 1), 1.0), (Variable::State(k), -1.0)].into();
        path("angle between the legs", "rad", between(TH), -0.8, 0.8);
        path("hip rate", "rad/s", between(V + 2), -8.0, 8.0);
        for i in 0..3 {
            path(["torque", "toe force 1", "toe force 2"][i], "", input(i).into(), -scaled(i), scaled(i));
            if b {
                path("rate", "1/s", Variable::Input(i).into(), -500.0, 500.0);
                phase.integral.push(Cost::square(Variable::Input(i), 4e-4));
            }
            phase.integral.push(Cost::square(input(i), 1.0 / scaled(i).powi(2)));
        }
        for i in 0..2 {
            let quantity = Variable::State(L + i).into();
            phase.integral.push(Cost { quantity, reference: 1.02, weight: 1e-3 / 0.05f64.powi(2) });
        }
        for &i in stance {
            let end = if b && stance.len() == 2 && i == 0 { 0.999 } else { 1.0 };
            for (side, sign) in [("forwards", -1.0), ("backwards", 1.0)] {
                // In units of 100 N.
                let quantity: Quantity = vec![(foot(i, "fn"), 0.006), (foot(i, "ft"), 0.01 * sign)].into();
                let limit = Limit::between(
                    &format!("friction cone of foot {} {side}", i + 1),
                    "100 N",
                    quantity,
                    0.0,
                    f64::INFINITY,
                );
                phase.paths.push(Path { limit, place: Place::Everywhere, window: [0.0, end] });
            }
        }
        if let [stance] = stance {
            let swing = 1 - stance;
            for (window, lower) in [
                ([0.001, 0.199], if swing == 0 { -1e-4 } else { 0.0 }),
                ([0.2, 0.8], 0.02),
                ([0.801, 0.999], 0.0),
            ] {
                let limit = Limit::between("clearance", "m", foot(swing, "y"), lower, f64::INFINITY);
                phase.paths.push(Path { limit, place: Place::Everywhere, window });
            }
        }
        phase
    };
    let mut phases = vec![
        phase("swing of leg 2", "foot1", [0.15, 2.5], &[0]),
        phase("double support", "both", [0.05, 0.20], &[0, 1]),
        phase("swing of leg 1", "foot2", [0.15, 2.5], &[1]),
    ];
    let start = [0.0, 1.045, 0.0, 0.0, 1.045, 1.0];
    for i in 0..6 {
        phases[0].start.push(Limit::equal("start", "", Variable::State(i), start[i]));
        phases[0].start.push(Limit::equal("rest at the start", "", Variable::State(V + i), 0.0));
    }
    phases[0].end.push(Limit::equal("foothold", "m", foot(1, "x"), 0.25));
    phases[0].end.push(Limit::equal("foothold", "m", foot(1, "y"), 0.0));
    phases[0].end.push(Limit::between("touch-down speed", "m/s", foot(1, "vy"), -0.4, -0.1));
    if b {
        phases[1].end.push(Limit::equal("release", "100 N", vec![(foot(0, "ft"), 0.01)], 0.0));
        phases[1].end.push(Limit::equal("release", "100 N", vec![(foot(0, "fn"), 0.01)], 0.0));
        for i in 0..3 {
            phases[0].start.push(Limit::equal("holding force", "", input(i), HOLD[0][i] / U_MAX[i]));
            phases[2].end.push(Limit::equal("holding force", "", input(i), HOLD[1][i] / U_MAX[i]));
        }
    } else {
        phases[2].start.push(Limit::between("release", "m/s2", foot(0, "ay"), 0.0, f64::INFINITY));
    }
    // The foot on the ground stays where it is, so position and rates of the hip follow.
    for (i, value) in [(TH, 0.0), (TH + 1, 0.0), (L, 1.0), (L + 1, 1.045)] {
        phases[2].end.push(Limit::equal("end", "", Variable::State(i), value));
        phases[2].end.push(Limit::equal("rest at the end", "", Variable::State(V + i), 0.0));
    }
    let impulses = ["after.foot1.Lt", "after.foot1.Ln", "after.foot2.Lt", "after.foot2.Ln"];
    let outputs: Vec<String> = RATES.iter().map(|name| format!("after.{name}")).collect();
    let outputs: Vec<&str> = outputs.iter().map(String::as_str).chain(impulses).collect();
    let impact = wrap(system(fmu, &[("contact_mode", "foot1"), ("impact_map", "both")], &outputs));
    let states = impact.size().states;
    let after =
        (0..states).map(|i| if (V..V + 6).contains(&i) { After::Output(i - V) } else { After::State(i) });
    let reset = OutputReset::new(impact, after.collect(), vec![6, 7, 8, 9], vec![0.0; 3]);
    let impulse = |i: usize| Variable::Output(i);
    let limits = vec![
        Limit::equal("tangential impulse on foot 1", "N s", impulse(0), 0.0),
        Limit::equal("normal impulse on foot 1", "N s", impulse(1), 0.0),
        Limit::between(
            "impulse cone",
            "N s",
            vec![(impulse(3), 0.6), (impulse(2), -1.0)],
            0.0,
            f64::INFINITY,
        ),
        Limit::between("impulse cone", "N s", vec![(impulse(3), 0.6), (impulse(2), 1.0)], 0.0, f64::INFINITY),
    ];
    Problem { phases, links: vec![Link::reset(Box::new(reset), limits), Link::continuous()] }
}

/// Hip on a straight line, feet on straight lines while they swing.
pub fn guess(variant: Variant) -> Trajectory {
    let total: f64 = DURATIONS.iter().sum();
    let position = |t: f64| -> [f64; 6] {
        let part = |from: f64, length: f64| ((t - from) / length).clamp(0.0, 1.0);
        let (first, last) = (part(0.0, DURATIONS[0]), part(DURATIONS[0] + DURATIONS[1], DURATIONS[2]));
        let hip = [0.25 * t / total, 1.03];
        let feet = [[0.25 * last, 0.045 * last], [0.25 * first, 0.045 * (1.0 - first)]];
        let leg = |i: usize| [feet[i][0] - hip[0], hip[1] - feet[i][1]];
        let (a, b) = (leg(0), leg(1));
        [hip[0], hip[1], a[0].atan2(a[1]), b[0].atan2(b[1]), a[0].hypot(a[1]), b[0].hypot(b[1])]
    };
    let mut begin = 0.0;
    let phase = |(number, duration): (usize, &f64)| {
        let times: Vec<f64> = (0..=20).map(|k| begin + duration * f64::from(k) / 20.0).collect();
        begin += duration;
        let hold: Vec<f64> = (0..3)
            .map(|i| match number {
                0 => HOLD[0][i],
                1 => 0.5 * (HOLD[0][i] + HOLD[1][i]),
                _ => HOLD[1][i],
            })
            .collect();
        let state = |t: &f64| {
            let (before, after) = ((t - 1e-4).max(0.0), (t + 1e-4).min(total));
            let (a, b) = (position(before), position(after));
            let rates = (0..6).map(|i| (b[i] - a[i]) / (after - before));
            let mut state: Vec<f64> = position(*t).into_iter().chain(rates).collect();
            if variant == Variant::B {
                state.extend((0..3).map(|i| hold[i] / U_MAX[i]));
            }
            state
        };
        let states = times.iter().map(state).collect();
        let input = if variant == Variant::B { vec![0.0; 3] } else { hold.clone() };
        let inputs = vec![input; times.len()];
        let name = format!("guess {number}");
        PhaseTrajectory::from_knots(&name, times, states, inputs, Interpolation::Quadratic).unwrap()
    };
    Trajectory::guess(DURATIONS.iter().enumerate().map(phase).collect())
}
