//! The variables of one side of the cylinder: valve, tube, chamber.

use fmi_export::{MemoryBlock, Real, Table};

/// Longest delay of a tube \[substeps\].
pub const MAX_DELAY: usize = 200;

/// Handles of the states of one valve, or of their derivatives.
pub struct ValveStates {
    pub c: Real,
    pub q: Real,
    pub s: Real,
    pub s_rate: Real,
    pub pv: Real,
}

/// One side of the cylinder: valve, tube, chamber.
pub struct Side {
    pub valve: ValveStates,
    pub p: Real,
    pub der_valve: ValveStates,
    pub der_p: Real,
    pub m_valve: Real,
    pub m_tube: Real,
    /// Position of the play.
    pub play: MemoryBlock,
    /// Flow into the tube at the last samples of the delay line, youngest first.
    pub line: MemoryBlock,
}

/// Units that only this model has.
pub const UNITS: [(&str, &[(&str, i32)]); 8] = [
    ("m3", &[("m", 3)]),
    ("K", &[("K", 1)]),
    ("J/(kg.K)", &[("m", 2), ("s", -2), ("K", -1)]),
    ("1/Pa", &[("kg", -1), ("m", 1), ("s", 2)]),
    ("1/(Pa.s)", &[("kg", -1), ("m", 1), ("s", 1)]),
    ("Pa/s", &[("kg", 1), ("m", -1), ("s", -3)]),
    ("1/s2", &[("s", -2)]),
    ("kg/s", &[("kg", 1), ("s", -1)]),
];

impl Side {
    /// Declares side `i` (1 or 2).
    pub fn declare(t: &mut Table, i: usize) -> Self {
        let p = t
            .computed_state(format!("p{i}"))
            .output()
            .unit("Pa")
            .about(format!("pressure of chamber {i}, absolute"))
            .nominal(1e5)
            .computed();
        let pv = t
            .computed_state(format!("pv{i}"))
            .output()
            .unit("Pa")
            .about(format!("pressure at the port of valve {i}, absolute"))
            .nominal(1e5)
            .computed();
        let mut state = |name: String, unit: &'static str, about: String, nominal: f64| {
            let d = t.computed_state(name).about(about).nominal(nominal);
            if unit.is_empty() { d.computed() } else { d.unit(unit).computed() }
        };
        let valve = ValveStates {
            c: state(format!("c{i}"), "Pa", format!("filtered pressure command of valve {i}"), 1e5),
            q: state(format!("q{i}"), "", format!("integrator of the controller of valve {i}"), 0.1),
            s: state(format!("s{i}"), "", format!("position of spool {i}, 1: fully open to the supply"), 0.1),
            s_rate: state(format!("s{i}_rate"), "1/s", format!("rate of spool {i}"), 10.0),
            pv,
        };
        let mut rate = |name: String, of: Real, unit: &'static str, nominal: f64| {
            let about = format!("rate of {name}");
            t.derivative(format!("der({name})"), of).unit(unit).about(about).nominal(nominal).computed()
        };
        let der_p = rate(format!("p{i}"), p, "Pa/s", 1e6);
        let der_valve = ValveStates {
            pv: rate(format!("pv{i}"), pv, "Pa/s", 1e6),
            c: rate(format!("c{i}"), valve.c, "Pa/s", 1e6),
            q: rate(format!("q{i}"), valve.q, "1/s", 1.0),
            s: rate(format!("s{i}"), valve.s, "1/s", 10.0),
            s_rate: rate(format!("s{i}_rate"), valve.s_rate, "1/s2", 1e4),
        };
        let mut flow = |name: &str, about: String| {
            t.local(format!("{name}{i}")).unit("kg/s").about(about).nominal(1e-4).computed()
        };
        let m_valve = flow("m_valve", format!("mass flow through valve {i} into its port"));
        let m_tube = flow("m_tube", format!("mass flow from port {i} into its tube"));
        let (play, line) = (t.memory(1), t.memory(MAX_DELAY + 1));
        Side { valve, p, der_valve, der_p, m_valve, m_tube, play, line }
    }
}
