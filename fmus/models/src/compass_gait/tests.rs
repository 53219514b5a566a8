//! Golden values of the reference problem, conservation, and the order of events.

use super::body::{Body, Pose};
use super::contact::Mechanics;
use super::feet::Feet;
use super::*;
use fmi_export::{Definition, Interface};

const BODY: Body<f64> = Body {
    m3: 6.0,
    d: 0.10,
    i3: 0.10,
    mu: 3.7,
    a: 0.35,
    iu: 0.20,
    mt: 0.8,
    c: 0.10,
    it: 0.005,
    ir: 0.05,
    g: 9.81,
};
const Q: [f64; 6] = [0.1, 1.0, 0.2, -0.3, 1.02, 0.97];
const V: [f64; 6] = [0.5, -0.2, 1.0, -2.0, 0.3, -0.4];
const U: [f64; 3] = [5.0, 150.0, -10.0];
/// The reference values are given to 12 decimals.
const DIGITS: f64 = 1e-11;

fn near<const K: usize>(got: [f64; K], expected: [f64; K], tolerance: f64) {
    for (got, expected) in got.iter().zip(expected) {
        assert!((got - expected).abs() <= tolerance * expected.abs().max(1.0), "{got} {expected}");
    }
}

fn mechanics(q: [f64; 6], v: [f64; 6]) -> Mechanics<f64> {
    Mechanics::new(BODY, Pose::new(q, v)).expect("regular")
}

#[test]
fn rigid_body_terms_have_the_reference_values() {
    let pose = Pose::new(Q, V);
    let h = BODY.mass_matrix(&pose);
    near(h[2], [1.690890141477, 0.418491161626, 1.42537, -0.01, 0.0, 0.0], DIGITS);
    near(h[3], [1.602449871731, -0.573386980682, -0.01, 1.35377, 0.0, 0.0], DIGITS);
    near([h[0][4], h[0][5]], [0.158935464636, -0.236416165329], DIGITS);
    near([h[1][4], h[1][5]], [-0.784053262273, -0.7642691913], DIGITS);
    near([h[0][0], h[1][1], h[4][4], h[5][5], h[4][5], h[0][1]], [15.0, 15.0, 0.8, 0.8, 0.0, 0.0], DIGITS);
    near(BODY.coriolis(&pose), [3.63579130306, 9.166097894188, 0.4416, 1.1136, -0.736, -2.784], DIGITS);
    let gravity = [0.0, 147.15, 4.105398295551, -5.624926280486, -7.691562502898, -7.497480766658];
    near(BODY.gravity(&pose), gravity, DIGITS);
}

#[test]
fn mass_matrix_and_gravity_are_those_of_the_energy() {
    // Kinetic energy is quadratic: differences of it along pairs of directions give H; those of the potential give G.
    let energy = |q: [f64; 6], v: [f64; 6]| {
        let pose = Pose::new(q, v);
        BODY.energy(&pose, &BODY.mass_matrix(&pose))
    };
    // Independent: sum over the five masses and inertias.
    let independent = |q: [f64; 6], v: [f64; 6]| {
        let th3 = (q[2] + q[3]) / 2.0;
        let w3 = (v[2] + v[3]) / 2.0;
        let (vx3, vy3) = (v[0] - 0.1 * th3.cos() * w3, v[1] - 0.1 * th3.sin() * w3);
        let mut e = 3.0 * (vx3 * vx3 + vy3 * vy3) + 0.05 * w3 * w3 + 0.025 * (v[3] - v[2]).powi(2);
        e += 6.0 * 9.81 * (q[1] + 0.1 * th3.cos());
        for i in 0..2 {
            let (s, c, w) = (q[2 + i].sin(), q[2 + i].cos(), v[2 + i]);
            for (m, r, rate, inertia) in [(3.7, 0.35, 0.0, 0.2), (0.8, q[4 + i] - 0.1, v[4 + i], 0.005)] {
                let (vx, vy) = (v[0] + r * c * w + rate * s, v[1] + r * s * w - rate * c);
                e += 0.5 * m * (vx * vx + vy * vy) + 0.5 * inertia * w * w + m * 9.81 * (q[1] - r * c);
            }
        }
        e
    };
    near([energy(Q, V)], [independent(Q, V)], 1e-14);
    near([energy(Q, [0.0; 6])], [independent(Q, [0.0; 6])], 1e-14);
}

#[test]
fn accelerations_and_forces_have_the_reference_values() {
    let m = mechanics(Q, V);
    let (flight, _) = m.motion(U, Feet::NONE).expect("regular");
    let expected = [
        -3.193005591913,
        0.484724930526,
        -2.975327782779,
        10.988675600899,
        199.143868116647,
        -0.128671300751,
    ];
    near(flight, expected, DIGITS);
    let (a, f) = m.motion(U, Feet::only(0)).expect("regular");
    near(
        [a[2], a[3], a[4], a[5]],
        [2.550563865201, 11.197251399474, 2.108563307228, -0.227761752818],
        DIGITS,
    );
    near(f[0], [-24.029793344957, 155.946119371361], DIGITS);
    let (a, f) = m.motion(U, Feet::only(1)).expect("regular");
    near(
        [a[2], a[3], a[4], a[5]],
        [-3.293014417601, 1.372815125575, 198.984909130526, 3.361481707048],
        DIGITS,
    );
    assert_eq!(f[0], [0.0; 2]);
}

/// Position and velocities of the reference impact: foot 1 at the origin, hip above between the feet.
fn before_impact() -> ([f64; 6], [f64; 6]) {
    let l = 0.125 / 0.12f64.sin();
    let (th, w, r) = ([-0.12, 0.12], [-1.0, -0.4], [0.1, -0.1]);
    let (s, c) = f64::sin_cos(th[0]);
    let hip = [-l * s, l * c];
    let hip_rate = [-l * c * w[0] - r[0] * s, -l * s * w[0] + r[0] * c];
    ([hip[0], hip[1], th[0], th[1], l, l], [hip_rate[0], hip_rate[1], w[0], w[1], r[0], r[1]])
}

#[test]
fn impacts_have_the_reference_values() {
    let (q, v) = before_impact();
    let m = mechanics(q, v);
    let (after, impulses) = m.impact(Feet::only(1)).expect("regular");
    near(
        [after[2], after[3], after[4], after[5]],
        [-1.0267664232028, -1.0130124824017, 0.1056744371485, -0.1500584264326],
        DIGITS,
    );
    near(impulses[1], [-0.8235004272466, -0.0581465174472], DIGITS);
    near([mechanics(q, after).energy - m.energy], [-0.2567924615944], DIGITS);
    let (after, impulses) = m.impact(Feet::BOTH).expect("regular");
    near(
        [after[2], after[3], after[4], after[5]],
        [-1.0178670107401, -1.0127529881175, 0.1056903053891, -0.1499757824053],
        DIGITS,
    );
    near(impulses[0], [0.0118917114119, -0.0014338946804], DIGITS);
    near(impulses[1], [-0.8236731383501, -0.0581673428376], DIGITS);
}

/// A model with its values at a start, as an FMU has it after initialization.
fn start(prepare: impl Fn(&Variables, &mut Values<f64>)) -> (CompassGait, Values<f64>) {
    let Definition { model, table, .. } = Definition::<CompassGait>::new();
    let mut q = table.start_values(Interface::ModelExchange);
    prepare(&model.k, &mut q);
    model.initialize(&mut q).expect("a start that exists");
    model.equations(&mut q).expect("regular");
    (model, q)
}

#[test]
fn robot_stands_at_the_start_values() {
    let (m, mut q) = start(|_, _| ());
    assert_eq!(q[m.k.mode], Feet::only(0).number() + 1);
    assert_eq!(m.event(&mut q), Event::default());
    near(m.k.der_v.map(|h| q[h]), [0.0; 6], 1e-12);
    near(m.k.feet[0].force.map(|h| q[h]), [0.0, 147.15], 1e-12);
}

#[test]
fn start_below_the_ground_or_sliding_on_it_is_refused_by_name() {
    let refusal = |prepare: &dyn Fn(&Variables, &mut Values<f64>)| {
        let Definition { model, table, .. } = Definition::<CompassGait>::new();
        let mut q = table.start_values(Interface::CoSimulation);
        prepare(&model.k, &mut q);
        format!("{:?}", model.initialize(&mut q).expect_err("refused"))
    };
    let below = refusal(&|k, q| q[k.q[4]] = 1.05);
    assert!(below.contains("foot 1") && below.contains("below the ground"), "{below}");
    let sliding = refusal(&|k, q| q[k.v[0]] = 0.1);
    assert!(sliding.contains("foot 1") && sliding.contains("no sliding is modeled"), "{sliding}");
}

#[test]
fn a_foot_that_is_pulled_up_lifts_off_and_one_that_lands_holds() {
    let (m, mut q) = start(|k, q| q[k.inputs[1]] = -200.0);
    assert_eq!(m.event(&mut q), Event::default()); // states stay, the mode changes
    m.equations(&mut q).expect("regular");
    assert_eq!(q[m.k.mode], 1);
    assert!(q[m.k.feet[0].acceleration[1]] > 0.0);
    assert!(m.explain_event(&q).expect("an event").contains("foot 1 lifted off"));

    let (m, mut q) = start(|k, q| {
        (q[k.q[4]], q[k.q[5]]) = (1.0, 1.045);
        q[k.v[1]] = -0.3; // foot 2 comes down from height 0 at once
    });
    let event = m.event(&mut q);
    assert!(event.states_changed && !event.terminate);
    m.equations(&mut q).expect("regular");
    assert_eq!(q[m.k.mode], Feet::only(1).number() + 1);
    near(m.k.feet[1].velocity.map(|h| q[h]), [0.0; 2], 1e-14);
    // Along the leg the impulse sees the toe alone: 0.8 kg at 0.3 m/s.
    near(m.k.feet[1].last_impulse.map(|h| q[h]), [0.0, 0.24], 1e-12);
}

#[test]
fn old_stance_foot_is_let_go_where_the_impact_would_pull_at_it() {
    // Legs spread by 0.24 rad, the trailing foot at rest, the leading foot swinging down across its leg.
    let (q0, _) = before_impact();
    let place = |w: [f64; 2], r: [f64; 2]| {
        start(move |k, q| {
            let (s, c) = f64::sin_cos(q0[2]);
            let hip_rate = [-q0[4] * c * w[0] - r[0] * s, -q0[4] * s * w[0] + r[0] * c];
            let v = [hip_rate[0], hip_rate[1], w[0], w[1], r[0], r[1]];
            for i in 0..6 {
                (q[k.q[i]], q[k.v[i]]) = (q0[i], v[i]);
            }
            q[k.inputs[2]] = 80.0;
            q[k.inputs[1]] = 80.0;
            q[k.on_slide] = 2;
        })
    };
    let mut kept = [false; 2];
    for (w, r) in [([0.0, 0.0], [0.0, 0.3]), ([0.5, 1.5], [0.0, 0.5]), ([-1.0, -2.0], [0.0, 0.3])] {
        let (m, mut q) = place(w, r);
        if q[m.k.feet[1].velocity[1]] >= 0.0 {
            continue;
        }
        let mechanics = mechanics(m.k.q.map(|h| q[h]), m.k.v.map(|h| q[h]));
        let both = mechanics.impact(Feet::BOTH).expect("regular");
        let alone = mechanics.impact(Feet::only(1)).expect("regular");
        let expected = if both.1[0][1] < -1e-9 { alone } else { both };
        kept[usize::from(both.1[0][1] < -1e-9)] = true;
        assert!(m.event(&mut q).states_changed);
        near(m.k.v.map(|h| q[h]), expected.0, 1e-13);
    }
    assert_eq!(kept, [true; 2], "both answers are met");
}

#[test]
fn a_foot_without_normal_force_leaves_the_ground_also_with_a_tangential_one() {
    // Both feet down, the hip torque pushes them apart, the toe of leg 1 pulls so that its normal force is negative.
    let (q0, _) = before_impact();
    let (m, mut q) = start(|k, q| {
        (0..6).for_each(|i| q[k.q[i]] = q0[i]);
        (q[k.inputs[0]], q[k.inputs[1]], q[k.inputs[2]]) = (-10.0, -20.0, 150.0);
        q[k.on_slide] = 2;
    });
    assert_eq!(q[m.k.mode], Feet::BOTH.number() + 1);
    assert!(q[m.k.feet[0].force[1]] < 0.0 && q[m.k.feet[0].force[0]].abs() > 0.1);
    m.event(&mut q);
    m.equations(&mut q).expect("regular");
    assert_eq!(q[m.k.mode], Feet::only(1).number() + 1);
}

#[test]
fn an_input_that_jumps_at_a_communication_point_makes_an_event_due() {
    let (m, mut q) = start(|_, _| ());
    assert_eq!(m.next_event_time(&q), Some(0.0)); // the look at the start
    m.event(&mut q);
    assert_eq!(m.next_event_time(&q), None);
    q[m.k.inputs[1]] = -200.0;
    assert_eq!(m.next_event_time(&q), Some(0.0));
    m.event(&mut q);
    assert_eq!(m.next_event_time(&q), None);
}
