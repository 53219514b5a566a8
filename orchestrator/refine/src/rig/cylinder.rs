//! A pneumatic cylinder from first principles: two chambers, each fed by a pressure-control valve through a tube.
//!
//! A moving piston compresses the air in front of it and expands the air behind. An actuator identified with its rod
//! fixed cannot know that; this model has it from geometry and gas law, and takes the place of an identified actuator
//! that moving records contradict. The equations are those of the FMU `pneumatic-cylinder`, written for several
//! simulations side by side; a test compares the two.

use serde::Deserialize;

use super::lanes::{Lanes, each};

/// Parameters of cylinder, valves and tubes, SI units, named as those of the FMU `pneumatic-cylinder`; what a case does
/// not state is the value of that FMU.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(non_snake_case, reason = "names of the FMU")]
pub struct Cylinder {
    /// Bore \[m\].
    pub bore: f64,
    /// Diameter of the rod \[m\].
    pub rod: f64,
    /// Stroke \[m\].
    pub stroke: f64,
    /// Dead volume of a chamber \[m3\].
    pub dead: f64,
    /// Supply pressure, gauge \[Pa\].
    pub psup: f64,
    /// Ambient pressure \[Pa\].
    pub patm: f64,
    /// Temperature \[K\].
    pub T: f64,
    /// Gas constant \[J/(kg K)\].
    pub R: f64,
    /// Heat-transfer exponent of inflow.
    pub kin: f64,
    /// Heat-transfer exponent of outflow.
    pub kout: f64,
    /// Heat-transfer exponent of volume work.
    pub kv: f64,
    /// Discharge coefficient.
    pub Cd: f64,
    /// Opening of a valve \[m2\].
    pub Avmax: f64,
    /// Overlap of a spool, as a share of its travel.
    pub overlap: f64,
    /// Natural frequency of a spool \[rad/s\].
    pub ws: f64,
    /// Damping of a spool.
    pub zs: f64,
    /// Proportional gain of the pressure controller \[1/Pa\].
    pub Kp: f64,
    /// Integral gain \[1/(Pa s)\].
    pub Ki: f64,
    /// Time constant of the command filter \[s\].
    pub tau_cmd: f64,
    /// Half width of the play on the pressure commands \[Pa\].
    pub vhys: f64,
    /// Volume of tube and valve port \[m3\].
    pub Vt: f64,
    /// Orifice that the tube is worth \[m2\].
    pub At: f64,
    /// Transport delay of the tube \[s\].
    pub tdelay: f64,
    /// Leak past the piston \[m2\].
    pub leak: f64,
    /// Share of the pressure force that reaches the rod.
    pub eta: f64,
}

impl Default for Cylinder {
    fn default() -> Cylinder {
        Cylinder {
            bore: 0.020,
            rod: 0.008,
            stroke: 0.300,
            dead: 2e-6,
            psup: 0.5e6,
            patm: 101_325.0,
            T: 293.0,
            R: 287.0,
            kin: 1.4,
            kout: 1.0,
            kv: 1.2,
            Cd: 0.8,
            Avmax: 3e-6,
            overlap: 0.02,
            ws: std::f64::consts::TAU * 70.0,
            zs: 0.7,
            Kp: 8e-6,
            Ki: 1e-4,
            tau_cmd: 0.0015,
            vhys: 1500.0,
            Vt: 9e-6,
            At: 1.4e-6,
            tdelay: 0.003,
            leak: 1e-8,
            eta: 0.955,
        }
    }
}

impl Cylinder {
    /// Parameters by their name in the FMU.
    pub fn named(&self) -> [(&'static str, f64); 25] {
        [
            ("bore", self.bore),
            ("rod", self.rod),
            ("stroke", self.stroke),
            ("dead", self.dead),
            ("psup", self.psup),
            ("patm", self.patm),
            ("T", self.T),
            ("R", self.R),
            ("kin", self.kin),
            ("kout", self.kout),
            ("kv", self.kv),
            ("Cd", self.Cd),
            ("Avmax", self.Avmax),
            ("overlap", self.overlap),
            ("ws", self.ws),
            ("zs", self.zs),
            ("Kp", self.Kp),
            ("Ki", self.Ki),
            ("tau_cmd", self.tau_cmd),
            ("vhys", self.vhys),
            ("Vt", self.Vt),
            ("At", self.At),
            ("tdelay", self.tdelay),
            ("leak", self.leak),
            ("eta", self.eta),
        ]
    }

    /// The first parameter that makes no sense, with what would.
    ///
    /// # Errors
    /// One sentence.
    pub fn check(&self) -> Result<(), String> {
        let positive = ["bore", "stroke", "dead", "psup", "patm", "T", "R", "tau_cmd", "Vt"];
        for (name, value) in self.named() {
            let least = if positive.contains(&name) { f64::MIN_POSITIVE } else { 0.0 };
            if !(value.is_finite() && value >= least) {
                let sign = if least > 0.0 { "positive" } else { "zero or positive" };
                return Err(format!("{name} = {value} is not {sign}"));
            }
        }
        if self.rod >= self.bore {
            return Err(format!("rod = {} m is not thinner than bore = {} m", self.rod, self.bore));
        }
        Ok(())
    }
}

/// Usual [`Chambers::exchange`]: the substep of the FMU.
const EXCHANGE: f64 = 1e-4;
/// Polytropic exponent of the air in a valve port.
const PORT_EXPONENT: f64 = 1.2;
/// Bound on the integrator of a valve, and the time \[s\] that it looks ahead.
const INTEGRATOR: (f64, f64) = (0.3, 1e-3);
/// Pressure ratios between which the flow follows its curve: critical flow below, linear above.
const CURVE_RATIO: (f64, f64) = (0.528, 0.995);
/// Flow over the larger pressure and the root of the temperature: critical, and factor of the curve, for R = 287.
const FLOW: (f64, f64) = (0.040418, 0.156174);
/// Coefficients of the polynomial for the curve.
const TERMS: usize = 12;

/// Curve of the flow over the pressure ratio, R = 287 J/(kg K).
fn curve(ratio: f64) -> f64 {
    FLOW.1 * ratio.powf(1.0 / 1.4) * (1.0 - ratio.powf(0.4 / 1.4)).sqrt()
}

/// Coefficients of the equations, computed from the parameters once for each simulation.
#[derive(Debug, Clone)]
pub struct Chambers {
    k: Cylinder,
    /// Time \[s\] after which cylinder and mechanics of the rig exchange force and motion.
    pub exchange: f64,
    /// Piston areas \[m2\].
    area: [f64; 2],
    /// Force of either side at rest \[N\].
    bias: f64,
    /// Square of the curve over 1 - ratio, as a polynomial of the ratio from -1 to 1 over [`CURVE_RATIO`], lowest power
    /// first.
    squared: [f64; TERMS],
    /// Flow over 1 - ratio above the curve.
    linear: f64,
    /// Factor of all flows \[1/sqrt(K)\] times the root of the gas constant over 287.
    factor: f64,
}

/// States of one side: filtered command \[Pa\], integrator, spool, its rate \[1/s\], pressure of port and chamber
/// \[Pa\].
pub type Side<const L: usize> = [Lanes<L>; 6];

/// Rates of both sides, and the flows \[kg/s\] that enter the tubes.
pub struct Rates<const L: usize> {
    /// Time derivatives of the states.
    pub states: [Side<L>; 2],
    /// Flow into the tube of each side.
    pub tubes: [Lanes<L>; 2],
}

#[inline(always)]
fn clamp<const L: usize>(value: Lanes<L>, low: f64, high: f64) -> Lanes<L> {
    each(|i| {
        let value = if value.0[i] < low { low } else { value.0[i] };
        if value > high { high } else { value }
    })
}

impl Chambers {
    /// Resolves the parameters.
    pub fn new(k: &Cylinder) -> Chambers {
        let whole = std::f64::consts::FRAC_PI_4 * k.bore * k.bore;
        let area = [whole, whole - std::f64::consts::FRAC_PI_4 * k.rod * k.rod];
        // Interpolation at Chebyshev nodes: the function is smooth, twelve terms leave some 1e-11 of it.
        let node = |j: usize| (std::f64::consts::PI * (j as f64 + 0.5) / TERMS as f64).cos();
        let ratio = |s: f64| 0.5 * (CURVE_RATIO.0 + CURVE_RATIO.1 + (CURVE_RATIO.1 - CURVE_RATIO.0) * s);
        let matrix = nalgebra::DMatrix::from_fn(TERMS, TERMS, |j, power| node(j).powi(power as i32));
        let values = nalgebra::DVector::from_fn(TERMS, |j, _| {
            let r = ratio(node(j));
            curve(r).powi(2) / (1.0 - r)
        });
        let found = matrix.lu().solve(&values).unwrap_or_else(|| nalgebra::DVector::zeros(TERMS));
        Chambers {
            k: *k,
            exchange: EXCHANGE,
            area,
            bias: 0.25 * k.psup * (area[0] + area[1]),
            squared: std::array::from_fn(|i| found[i]),
            linear: curve(CURVE_RATIO.1) / (1.0 - CURVE_RATIO.1),
            factor: (287.0 / k.R).sqrt() / k.T.sqrt(),
        }
    }

    /// Delay of the tubes \[s\].
    pub fn delay(&self) -> f64 {
        self.k.tdelay
    }

    /// Pressures of the chambers and ports at rest, all else zero.
    pub fn rest<const L: usize>(&self) -> [Side<L>; 2] {
        self.area.map(|area| {
            let p = Lanes::all(self.bias / area + self.k.patm);
            [p, Lanes::default(), Lanes::default(), Lanes::default(), p, p]
        })
    }

    /// Pressure commands \[Pa\] behind their play, from the force command `u` \[N\], paper eq. 3.
    #[inline(always)]
    pub fn command<const L: usize>(&self, u: Lanes<L>, play: &mut [Lanes<L>; 2]) {
        for (i, own) in play.iter_mut().enumerate() {
            let half = u * [0.5, -0.5][i];
            let target = (half + self.bias) / self.area[i] + self.k.patm;
            let target = clamp(target, self.k.patm, self.k.patm + self.k.psup);
            let (low, high) = (target - self.k.vhys, target + self.k.vhys);
            *own = each(|i| own.0[i].max(low.0[i]).min(high.0[i]));
        }
    }

    /// Flow of air through an orifice per area \[kg/(s m2)\], from pressure `a` to `b` \[Pa\].
    #[inline(always)]
    fn flow<const L: usize>(&self, a: Lanes<L>, b: Lanes<L>) -> Lanes<L> {
        let high: Lanes<L> = each(|i| if a.0[i] > b.0[i] { a.0[i] } else { b.0[i] });
        let low: Lanes<L> = each(|i| if a.0[i] > b.0[i] { b.0[i] } else { a.0[i] });
        let ratio = low / high;
        let rest = Lanes::all(1.0) - ratio;
        let s = clamp(
            (ratio * 2.0 - (CURVE_RATIO.0 + CURVE_RATIO.1)) / (CURVE_RATIO.1 - CURVE_RATIO.0),
            -1.0,
            1.0,
        );
        let mut squared = Lanes::all(self.squared[TERMS - 1]);
        for &term in self.squared[..TERMS - 1].iter().rev() {
            squared = squared * s + term;
        }
        let squared = squared * rest;
        each(|i| {
            let curved = squared.0[i].abs().sqrt();
            let value = if ratio.0[i] >= CURVE_RATIO.1 { self.linear * rest.0[i] } else { curved };
            let value = if ratio.0[i] <= CURVE_RATIO.0 { FLOW.0 } else { value };
            let value = value * high.0[i] * self.factor;
            if a.0[i] < b.0[i] { -value } else { value }
        })
    }

    /// Rates under the pressure commands `play` \[Pa\], the flows `delayed` \[kg/s\] that leave the tubes, and the
    /// motion of the piston \[m, m/s\].
    #[inline(always)]
    pub fn rates<const L: usize>(
        &self,
        sides: &[Side<L>; 2],
        play: &[Lanes<L>; 2],
        delayed: &[Lanes<L>; 2],
        (x, v): (Lanes<L>, Lanes<L>),
    ) -> Rates<L> {
        let k = &self.k;
        let heat = k.R * k.T;
        let leak = self.flow(sides[0][5], sides[1][5]) * (k.kout * k.leak);
        let mut rates = Rates { states: [[Lanes::default(); 6]; 2], tubes: [Lanes::default(); 2] };
        for i in 0..2 {
            let [c, q, s, rate, port, p] = sides[i];
            let sign = [1.0, -1.0][i];
            let error = c - port;
            let spool = clamp(error * k.Kp + q, -1.0, 1.0);
            let integral = error * k.Ki;
            let ahead = q + integral * INTEGRATOR.1;
            let integral = each(|i| if ahead.0[i].abs() >= INTEGRATOR.0 { 0.0 } else { integral.0[i] });
            let open = clamp(s - clamp(s, -k.overlap, k.overlap), -1.0, 1.0);
            let from = each(|i| if open.0[i] >= 0.0 { k.psup + k.patm } else { port.0[i] });
            let to = each(|i| if open.0[i] >= 0.0 { port.0[i] } else { k.patm });
            let valve = self.flow(from, to) * open * (k.Cd * k.Avmax);
            let tube = self.flow(port, p) * (k.Cd * k.At);
            // At the end of the stroke the dead volume remains.
            let gap = x * sign + 0.5 * k.stroke;
            let volume = gap.where_positive(gap) * self.area[i] + k.dead;
            let inflow = each(|j| if delayed[i].0[j] > 0.0 { k.kin } else { k.kout } * delayed[i].0[j]);
            let work = p * v * (k.kv * self.area[i] * sign);
            rates.states[i] = [
                (play[i] - c) / k.tau_cmd,
                integral,
                rate,
                (spool - s) * (k.ws * k.ws) - rate * (2.0 * k.zs * k.ws),
                (valve - tube) * (PORT_EXPONENT * heat / k.Vt),
                ((inflow - leak * sign) * heat - work) / volume,
            ];
            rates.tubes[i] = tube;
        }
        rates
    }

    /// Force of the pressures at the valve ports \[N\], eq. 5.
    #[inline(always)]
    pub fn port_force<const L: usize>(&self, sides: &[Side<L>; 2]) -> Lanes<L> {
        (sides[0][4] - self.k.patm) * self.area[0] - (sides[1][4] - self.k.patm) * self.area[1]
    }

    /// Force on the piston \[N\].
    #[inline(always)]
    pub fn piston_force<const L: usize>(&self, sides: &[Side<L>; 2]) -> Lanes<L> {
        let force = (sides[0][5] - self.k.patm) * self.area[0] - (sides[1][5] - self.k.patm) * self.area[1];
        force * self.k.eta
    }

    /// Rate of the force on the piston \[N/s\].
    #[inline(always)]
    pub fn piston_force_rate<const L: usize>(&self, rates: &Rates<L>) -> Lanes<L> {
        (rates.states[0][5] * self.area[0] - rates.states[1][5] * self.area[1]) * self.k.eta
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flow_follows_its_law_in_all_three_ranges_both_ways() {
        let air = Chambers::new(&Cylinder::default());
        let (p, root) = (3e5, 293f64.sqrt());
        for ratio in [0.3, 0.52, 0.53, 0.6, 0.75, 0.9, 0.98, 0.994, 0.996, 0.9995] {
            let flow = match ratio {
                r if r <= 0.528 => 0.040418,
                r if r < 0.995 => curve(r),
                r => curve(0.995) * (1.0 - r) / 0.005,
            };
            let expected = p / root * flow;
            let found = air.flow(Lanes([p, ratio * p]), Lanes([ratio * p, p]));
            assert!((found.0[0] / expected - 1.0).abs() < 1e-9, "{ratio}: {} {expected}", found.0[0]);
            assert_eq!(found.0[1], -found.0[0]);
        }
    }

    #[test]
    fn a_cylinder_at_rest_only_leaks() {
        let k = Cylinder { leak: 0.0, ..Cylinder::default() };
        let chambers = Chambers::new(&k);
        let sides = chambers.rest::<1>();
        let play = [sides[0][0], sides[1][0]];
        let motion = (Lanes([0.02]), Lanes([0.0]));
        let rates = chambers.rates(&sides, &play, &[Lanes::default(); 2], motion);
        assert!(rates.states.iter().flatten().all(|rate| rate.0[0] == 0.0));
        assert!(chambers.port_force(&sides).0[0].abs() < 1e-9);
    }

    #[test]
    fn a_closed_chamber_follows_its_polytrope() {
        // No flow at all: p V^kv stays, so p' = -kv p V'/V.
        let chambers = Chambers::new(&Cylinder { leak: 0.0, At: 0.0, ..Cylinder::default() });
        let sides = chambers.rest::<1>();
        let play = [sides[0][0], sides[1][0]];
        let (x, v) = (0.03, 0.4);
        let rates = chambers.rates(&sides, &play, &[Lanes::default(); 2], (Lanes([x]), Lanes([v])));
        let area = std::f64::consts::FRAC_PI_4 * 0.02 * 0.02;
        let expected = -1.2 * sides[0][5].0[0] * area * v / (2e-6 + area * (0.15 + x));
        assert!((rates.states[0][5].0[0] / expected - 1.0).abs() < 1e-12);
    }

    #[test]
    fn parameters_that_make_no_sense_are_named() {
        let bore = Cylinder { bore: -0.02, ..Cylinder::default() };
        assert!(bore.check().unwrap_err().contains("bore = -0.02"));
        let rod = Cylinder { rod: 0.03, ..Cylinder::default() };
        assert!(rod.check().unwrap_err().contains("rod = 0.03"));
        assert_eq!(Cylinder::default().check(), Ok(()));
    }
}
