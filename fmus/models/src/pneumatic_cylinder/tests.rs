//! The cylinder against closed forms and balances. The whole of it is compared with an independent simulation in
//! `tests/fmpy/test_pneumatic_cylinder.py`.

use super::*;
use fmi_export::Interface;

/// An instance without FMI: classical Runge-Kutta with a step of one substep.
struct Run {
    model: PneumaticCylinder,
    q: Values<f64>,
    states: Vec<Real>,
    derivatives: Vec<Real>,
}

impl Run {
    fn new(set: impl FnOnce(&PneumaticCylinder, &mut Values<f64>)) -> Self {
        let (model, table) = Table::of::<PneumaticCylinder>();
        let mut q = table.start_values(Interface::CoSimulation);
        set(&model, &mut q);
        model.prepare(&mut q).expect("legal parameters");
        model.initialize(&mut q).expect("legal parameters");
        let (states, derivatives) = (table.states().to_vec(), table.derivatives().to_vec());
        Self { model, q, states, derivatives }
    }

    /// One substep; piston position and speed from `motion` of the time since its start.
    fn step(&mut self, motion: impl Fn(f64) -> (f64, f64)) {
        let (m, q) = (&self.model, &mut self.q);
        let h = m.substep(q);
        (q[m.x], q[m.v]) = motion(0.0);
        q.at_sample = true;
        m.equations(q).expect("inside of the stroke");
        m.sample(q);
        q.at_sample = false;
        let x0: Vec<f64> = self.states.iter().map(|x| q[*x]).collect();
        let mut rates = vec![vec![0.0; x0.len()]; 4];
        for (stage, part) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
            (q[m.x], q[m.v]) = motion(part * h);
            for (i, state) in self.states.iter().enumerate() {
                q[*state] = x0[i] + if stage == 0 { 0.0 } else { part * h * rates[stage - 1][i] };
            }
            m.equations(q).expect("inside of the stroke");
            rates[stage] = self.derivatives.iter().map(|d| q[*d]).collect();
        }
        for (i, state) in self.states.iter().enumerate() {
            q[*state] = x0[i] + h / 6.0 * (rates[0][i] + 2.0 * (rates[1][i] + rates[2][i]) + rates[3][i]);
        }
        m.equations(q).expect("inside of the stroke");
    }

    fn at_rest(&mut self, substeps: usize) {
        (0..substeps).for_each(|_| self.step(|_| (0.0, 0.0)));
    }
}

#[test]
fn it_starts_at_the_bias_pressures_without_force() {
    let mut run = Run::new(|_, _| {});
    run.model.equations(&mut run.q).expect("start values");
    let (m, q) = (&run.model, &run.q);
    // The page: S1 = 3.1416e-4 m², S2 = 2.6389e-4 m², F_eq = 72.3 N.
    assert!((q[m.S1] - 3.1416e-4).abs() < 1e-8 && (q[m.S2] - 2.6389e-4).abs() < 1e-8);
    assert!((q[m.F_eq] - 72.3).abs() < 0.05);
    assert!(q[m.F_hat].abs() < 1e-10 && q[m.F_act].abs() < 1e-10);
    assert!((q[m.sides[1].p] - (q[m.F_eq] / q[m.S2] + 101_325.0)).abs() < 1e-6);
}

#[test]
fn closed_chambers_are_compressed_along_the_polytrope() {
    let mut run = Run::new(|m, q| {
        (q[m.k.Avmax], q[m.k.At], q[m.k.leak]) = (0.0, 0.0, 0.0);
    });
    let volume = |run: &Run, x: f64| {
        let (m, q) = (&run.model, &run.q);
        [q[m.k.dead] + q[m.S1] * (0.15 + x), q[m.k.dead] + q[m.S2] * (0.15 - x)]
    };
    let invariant = |run: &Run, x: f64| {
        let volumes = volume(run, x);
        [0, 1].map(|i| run.q[run.model.sides[i].p] * volumes[i].powf(1.2))
    };
    let before = invariant(&run, 0.0);
    let speed = 0.8;
    for k in 0..1500 {
        run.step(|t| (speed * (1e-4 * f64::from(k) + t), speed));
    }
    let after = invariant(&run, 0.12);
    for i in 0..2 {
        // Runge-Kutta of order 4 with 1500 steps of 1/1500 of the way.
        assert!((after[i] / before[i] - 1.0).abs() < 1e-10, "{before:?} {after:?}");
    }
}

#[test]
fn mass_is_kept_between_supply_ports_tubes_and_chambers() {
    // Isothermal chambers, so that pressure times volume is R T times the mass in them.
    let mut run = Run::new(|m, q| {
        (q[m.k.kin], q[m.k.kout], q[m.k.kv]) = (1.0, 1.0, 1.0);
        q[m.u] = 35.0;
    });
    let rt = 287.0 * 293.0;
    let mass = |run: &Run, x: f64| {
        let (m, q) = (&run.model, &run.q);
        let volumes = [q[m.k.dead] + q[m.S1] * (0.15 + x), q[m.k.dead] + q[m.S2] * (0.15 - x)];
        let side = |i: usize| {
            let s = &m.sides[i];
            // What entered the tube over the last 30 substeps has not left it. The port loses the integral of a flow of
            // which the tube takes the value at the start of each substep: half a substep of the present flow is
            // between.
            let on_the_way = (0..30).map(|k| q[s.line.at(k)] * 1e-4).sum::<f64>() + 0.5e-4 * q[s.m_tube];
            let port = q[s.valve.pv] * q[m.k.Vt] / (1.2 * rt);
            [port, on_the_way, q[s.p] * volumes[i] / rt]
        };
        (side(0), side(1))
    };
    let total = |(a, b): ([f64; 3], [f64; 3])| a.iter().chain(&b).sum::<f64>();
    let before = total(mass(&run, 0.0));
    let motion = |t: f64| (0.02 * (20.0 * t).sin(), 0.4 * (20.0 * t).cos());
    let mut supplied = 0.0;
    let mut largest: f64 = 0.0;
    for k in 0..3000 {
        let start = 1e-4 * f64::from(k);
        let flow = |run: &Run| run.model.sides.iter().map(|s| run.q[s.m_valve]).sum::<f64>();
        run.model.equations(&mut run.q).expect("inside of the stroke");
        let left = flow(&run);
        run.step(|t| motion(start + t));
        supplied += 0.5e-4 * (left + flow(&run)); // trapezoidal rule
        let change = total(mass(&run, motion(start + 1e-4).0)) - before;
        largest = largest.max((change - supplied).abs());
    }
    // Trapezoidal sums of flows of up to 1e-4 kg/s with kinks, steps of a substep.
    assert!(supplied.abs() > 1e-6, "{supplied}");
    assert!(largest < 1e-10, "{largest} of {supplied}");
}

#[test]
fn the_chamber_hears_of_the_command_after_valve_and_tube() {
    let mut run = Run::new(|m, q| q[m.u] = 40.0);
    let mut still = Run::new(|_, _| {});
    let p = |run: &Run, i: usize| run.q[run.model.sides[i].p];
    let pv = |run: &Run| run.q[run.model.sides[0].valve.pv];
    for k in 1..=60 {
        run.at_rest(1);
        still.at_rest(1);
        let moved = p(&run, 0) != p(&still, 0);
        assert!(!moved || k > 30, "the chamber moves {k} substeps after the command");
    }
    assert!(pv(&run) > pv(&still) + 1e3 && p(&run, 0) > p(&still, 0));
}

#[test]
fn play_follows_a_command_only_beyond_its_half_width() {
    let mut run = Run::new(|_, _| {});
    let play = |run: &Run| run.q[run.model.sides[0].play.at(0)];
    let start = play(&run);
    let area = run.q[run.model.S1];
    // Force to pressure: u / (2 S1).
    let mut command = |pressure: f64| {
        run.q[run.model.u] = 2.0 * area * pressure;
        run.at_rest(10);
        play(&run) - start
    };
    for (pressure, expected) in
        [(1400.0, 0.0), (5000.0, 3500.0), (2100.0, 3500.0), (1000.0, 2500.0), (-9e5, -2.27e5)]
    {
        let moved = command(pressure);
        // The last command is below ambient pressure and limited to it.
        let tolerance = if pressure < -1e5 { 3e3 } else { 1e-6 };
        assert!((moved - expected).abs() < tolerance, "{pressure}: {moved}");
    }
}

#[test]
fn seal_of_a_fixed_rod_holds_back_up_to_its_force() {
    let set = |m: &PneumaticCylinder, q: &mut Values<f64>| q[m.u] = 40.0;
    let mut free = Run::new(set);
    let mut fixed = Run::new(|m, q| {
        set(m, q);
        q[m.k.rod_fixed] = true;
    });
    let mut held: Vec<f64> = Vec::new();
    for _ in 0..2000 {
        free.at_rest(1);
        fixed.at_rest(1);
        held.push(free.q[free.model.F_act] - fixed.q[fixed.model.F_act]);
    }
    // The force rises by far more than klc sealx = 3.2 N, so that the seal comes to slide at its full force of 1.2 N.
    assert!(free.q[free.model.F_act] > 30.0);
    let largest = held.iter().fold(0.0, |a: f64, b| a.max(*b));
    assert!((largest - 1.2).abs() < 0.01, "{largest}");
}

#[test]
fn what_the_plant_cannot_be_is_refused_with_the_value() {
    let refused = |set: &dyn Fn(&PneumaticCylinder, &mut Values<f64>)| {
        let (model, table) = Table::of::<PneumaticCylinder>();
        let mut q = table.start_values(Interface::CoSimulation);
        set(&model, &mut q);
        let outcome = model.prepare(&mut q).and_then(|()| model.initialize(&mut q));
        match outcome.and_then(|()| model.equations(&mut q)) {
            Err(Refusal::Error(text) | Refusal::Discard(text)) => text,
            Ok(()) => panic!("accepted"),
        }
    };
    assert!(refused(&|m, q| q[m.k.rod] = 0.03).contains("rod = 0.03 m must be thinner"));
    assert!(refused(&|m, q| q[m.k.tdelay] = 0.5).contains("tdelay = 0.5 s"));
    assert!(refused(&|m, q| q[m.x] = -0.2).contains("leaves chamber 1 no volume"));
}
