//! A pneumatic cylinder from first principles: two chambers, each fed by a pressure-control valve through a tube.
//!
//! A moving piston compresses the air in front of it and expands the air behind. An actuator identified with its rod
//! fixed cannot know that; this model has it from geometry and gas law, and takes the place of an identified actuator
//! that moving records contradict. The equations are those of the FMU `pneumatic-cylinder`, written for several
//! simulations side by side; a test compares the two.

use std::sync::LazyLock;

use serde::Deserialize;

use super::lanes::{Lanes, each};

macro_rules! parameters {
    ($($(#[$doc:meta])* $name:ident = $value:expr;)*) => {
        /// Parameters of cylinder, valves and tubes, SI units, named as those of the FMU `pneumatic-cylinder`.
        #[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
        #[serde(deny_unknown_fields)]
        #[allow(non_snake_case, reason = "names of the FMU")]
        pub struct Parameters<V> {
            $($(#[$doc])* pub $name: V,)*
        }

        impl<V: Copy> Parameters<V> {
            /// Every parameter by its name.
            pub fn map<W>(&self, of: impl Fn(&'static str, V) -> W) -> Parameters<W> {
                Parameters { $($name: of(stringify!($name), self.$name),)* }
            }

            /// Parameters by their name in the FMU.
            pub fn named(&self) -> Vec<(&'static str, V)> {
                vec![$((stringify!($name), self.$name),)*]
            }
        }

        impl Default for Parameters<f64> {
            fn default() -> Self {
                Parameters { $($name: $value,)* }
            }
        }

        impl Default for Parameters<Option<f64>> {
            fn default() -> Self {
                Parameters { $($name: None,)* }
            }
        }

        impl<const L: usize> Parameters<Lanes<L>> {
            /// Puts a cylinder into lane `i`.
            fn set_lane(&mut self, i: usize, own: &Cylinder) {
                $(self.$name.0[i] = own.$name;)*
            }
        }

        impl Parameters<Option<f64>> {
            /// The cylinder; what is not stated is the value of the FMU.
            pub fn cylinder(&self) -> Cylinder {
                Parameters { $($name: self.$name.unwrap_or($value),)* }
            }
        }
    };
}

parameters! {
    /// Bore \[m\].
    bore = 0.020;
    /// Diameter of the rod \[m\].
    rod = 0.008;
    /// Stroke \[m\].
    stroke = 0.300;
    /// Dead volume of a chamber \[m3\].
    dead = 2e-6;
    /// Supply pressure, gauge \[Pa\].
    psup = 0.5e6;
    /// Ambient pressure \[Pa\].
    patm = 101_325.0;
    /// Temperature \[K\].
    T = 293.0;
    /// Gas constant \[J/(kg K)\].
    R = 287.0;
    /// Heat-transfer exponent of inflow.
    kin = 1.4;
    /// Heat-transfer exponent of outflow.
    kout = 1.0;
    /// Heat-transfer exponent of volume work.
    kv = 1.2;
    /// Discharge coefficient.
    Cd = 0.8;
    /// Opening of a valve \[m2\].
    Avmax = 3e-6;
    /// Overlap of a spool, as a share of its travel.
    overlap = 0.02;
    /// Natural frequency of a spool \[rad/s\].
    ws = std::f64::consts::TAU * 70.0;
    /// Damping of a spool.
    zs = 0.7;
    /// Proportional gain of the pressure controller \[1/Pa\].
    Kp = 8e-6;
    /// Integral gain \[1/(Pa s)\].
    Ki = 1e-4;
    /// Time constant of the command filter \[s\].
    tau_cmd = 0.0015;
    /// Half width of the play on the pressure commands \[Pa\].
    vhys = 1500.0;
    /// Volume of tube and valve port \[m3\].
    Vt = 9e-6;
    /// Orifice that the tube is worth \[m2\].
    At = 1.4e-6;
    /// Transport delay of the tube \[s\].
    tdelay = 0.003;
    /// Leak past the piston \[m2\].
    leak = 1e-8;
    /// Share of the pressure force that reaches the rod.
    eta = 0.955;
}

/// A cylinder: a number for every parameter.
pub type Cylinder = Parameters<f64>;
/// The parameters that a case states of its cylinder.
pub type Stated = Parameters<Option<f64>>;

impl Cylinder {
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

/// Usual time \[s\] after which cylinder and mechanics of the rig exchange force and motion: the substep of the FMU.
pub const EXCHANGE: f64 = 1e-4;
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

/// Square of [`curve`] over 1 - ratio, as a polynomial of the ratio from -1 to 1 over [`CURVE_RATIO`], lowest power
/// first.
static SQUARED: LazyLock<[f64; TERMS]> = LazyLock::new(|| {
    // Interpolation at Chebyshev nodes: the function is smooth, twelve terms leave some 1e-11 of it.
    let node = |j: usize| (std::f64::consts::PI * (j as f64 + 0.5) / TERMS as f64).cos();
    let ratio = |s: f64| 0.5 * (CURVE_RATIO.0 + CURVE_RATIO.1 + (CURVE_RATIO.1 - CURVE_RATIO.0) * s);
    let matrix = nalgebra::DMatrix::from_fn(TERMS, TERMS, |j, power| node(j).powi(power as i32));
    let values = nalgebra::DVector::from_fn(TERMS, |j, _| {
        let r = ratio(node(j));
        curve(r).powi(2) / (1.0 - r)
    });
    let found = matrix.lu().solve(&values).unwrap_or_else(|| nalgebra::DVector::zeros(TERMS));
    std::array::from_fn(|i| found[i])
});

/// Coefficients of the equations of several cylinders, computed from the parameters once for each simulation.
#[derive(Debug, Clone)]
pub struct Chambers<const L: usize> {
    k: Parameters<Lanes<L>>,
    /// Time \[s\] after which cylinder and mechanics of the rig exchange force and motion.
    exchange: f64,
    /// Piston areas \[m2\].
    area: [Lanes<L>; 2],
    /// Force of either side at rest \[N\].
    bias: Lanes<L>,
    /// Coefficients of [`SQUARED`].
    squared: [f64; TERMS],
    /// Flow over 1 - ratio above the curve.
    linear: f64,
    /// Factor of all flows \[1/sqrt(K)\] times the root of the gas constant over 287.
    factor: Lanes<L>,
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
fn clamp<const L: usize>(value: Lanes<L>, low: Lanes<L>, high: Lanes<L>) -> Lanes<L> {
    each(|i| {
        let value = if value.0[i] < low.0[i] { low.0[i] } else { value.0[i] };
        if value > high.0[i] { high.0[i] } else { value }
    })
}

impl<const L: usize> Chambers<L> {
    /// Resolves the parameters of each cylinder; `exchange`: time \[s\] after which cylinder and mechanics of the rig
    /// exchange force and motion.
    pub fn new(cylinders: &[Cylinder; L], exchange: f64) -> Chambers<L> {
        let mut k = Cylinder::default().map(|_, _| Lanes::<L>::default());
        for (i, own) in cylinders.iter().enumerate() {
            k.set_lane(i, own);
        }
        let quarter = std::f64::consts::FRAC_PI_4;
        let area = [k.bore * k.bore * quarter, (k.bore * k.bore - k.rod * k.rod) * quarter];
        Chambers {
            k,
            exchange,
            area,
            bias: k.psup * (area[0] + area[1]) * 0.25,
            squared: *SQUARED,
            linear: curve(CURVE_RATIO.1) / (1.0 - CURVE_RATIO.1),
            factor: each(|i| (287.0 / k.R.0[i]).sqrt() / k.T.0[i].sqrt()),
        }
    }

    /// Time \[s\] after which force and motion are exchanged.
    pub fn exchange(&self) -> f64 {
        self.exchange
    }

    /// Delay of the tubes \[s\].
    pub fn delay(&self) -> Lanes<L> {
        self.k.tdelay
    }

    /// Pressures of the chambers and ports at rest, all else zero.
    pub fn rest(&self) -> [Side<L>; 2] {
        self.area.map(|area| {
            let p = self.bias / area + self.k.patm;
            [p, Lanes::default(), Lanes::default(), Lanes::default(), p, p]
        })
    }

    /// Pressure commands \[Pa\] behind their play, from the force command `u` \[N\], paper eq. 3.
    #[inline(always)]
    pub fn command(&self, u: Lanes<L>, play: &mut [Lanes<L>; 2]) {
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
    fn flow(&self, a: Lanes<L>, b: Lanes<L>) -> Lanes<L> {
        let high: Lanes<L> = each(|i| if a.0[i] > b.0[i] { a.0[i] } else { b.0[i] });
        let low: Lanes<L> = each(|i| if a.0[i] > b.0[i] { b.0[i] } else { a.0[i] });
        let ratio = low / high;
        let rest = Lanes::all(1.0) - ratio;
        let s = clamp(
            (ratio * 2.0 - (CURVE_RATIO.0 + CURVE_RATIO.1)) / (CURVE_RATIO.1 - CURVE_RATIO.0),
            Lanes::all(-1.0),
            Lanes::all(1.0),
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
            let value = value * high.0[i] * self.factor.0[i];
            if a.0[i] < b.0[i] { -value } else { value }
        })
    }

    /// Rates under the pressure commands `play` \[Pa\], the flows `delayed` \[kg/s\] that leave the tubes, and the
    /// motion of the piston \[m, m/s\].
    #[inline(always)]
    pub fn rates(
        &self,
        sides: &[Side<L>; 2],
        play: &[Lanes<L>; 2],
        delayed: &[Lanes<L>; 2],
        (x, v): (Lanes<L>, Lanes<L>),
    ) -> Rates<L> {
        let k = &self.k;
        let (heat, one) = (k.R * k.T, Lanes::all(1.0));
        let leak = self.flow(sides[0][5], sides[1][5]) * (k.kout * k.leak);
        let mut rates = Rates { states: [[Lanes::default(); 6]; 2], tubes: [Lanes::default(); 2] };
        for i in 0..2 {
            let [c, q, s, rate, port, p] = sides[i];
            let sign = [1.0, -1.0][i];
            let error = c - port;
            let spool = clamp(error * k.Kp + q, -one, one);
            let integral = error * k.Ki;
            let ahead = q + integral * INTEGRATOR.1;
            let integral = each(|i| if ahead.0[i].abs() >= INTEGRATOR.0 { 0.0 } else { integral.0[i] });
            let open = clamp(s - clamp(s, -k.overlap, k.overlap), -one, one);
            let from = each(|i| if open.0[i] >= 0.0 { k.psup.0[i] + k.patm.0[i] } else { port.0[i] });
            let to = each(|i| if open.0[i] >= 0.0 { port.0[i] } else { k.patm.0[i] });
            let valve = self.flow(from, to) * open * (k.Cd * k.Avmax);
            let tube = self.flow(port, p) * (k.Cd * k.At);
            // At the end of the stroke the dead volume remains.
            let gap = x * sign + k.stroke * 0.5;
            let volume = gap.where_positive(gap) * self.area[i] + k.dead;
            let inflow =
                each(|j| if delayed[i].0[j] > 0.0 { k.kin.0[j] } else { k.kout.0[j] } * delayed[i].0[j]);
            let work = p * v * (k.kv * self.area[i] * sign);
            rates.states[i] = [
                (play[i] - c) / k.tau_cmd,
                integral,
                rate,
                (spool - s) * (k.ws * k.ws) - rate * (k.zs * k.ws * 2.0),
                (valve - tube) * (heat * PORT_EXPONENT / k.Vt),
                ((inflow - leak * sign) * heat - work) / volume,
            ];
            rates.tubes[i] = tube;
        }
        rates
    }

    /// Force of the pressures at the valve ports \[N\], eq. 5.
    #[inline(always)]
    pub fn port_force(&self, sides: &[Side<L>; 2]) -> Lanes<L> {
        (sides[0][4] - self.k.patm) * self.area[0] - (sides[1][4] - self.k.patm) * self.area[1]
    }

    /// Force on the piston \[N\].
    #[inline(always)]
    pub fn piston_force(&self, sides: &[Side<L>; 2]) -> Lanes<L> {
        let force = (sides[0][5] - self.k.patm) * self.area[0] - (sides[1][5] - self.k.patm) * self.area[1];
        force * self.k.eta
    }

    /// Rate of the force on the piston \[N/s\].
    #[inline(always)]
    pub fn piston_force_rate(&self, rates: &Rates<L>) -> Lanes<L> {
        (rates.states[0][5] * self.area[0] - rates.states[1][5] * self.area[1]) * self.k.eta
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flow_follows_its_law_in_all_three_ranges_both_ways() {
        let air = Chambers::new(&[Cylinder::default(); 2], EXCHANGE);
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
        let chambers = Chambers::new(&[k], EXCHANGE);
        let sides = chambers.rest();
        let play = [sides[0][0], sides[1][0]];
        let motion = (Lanes([0.02]), Lanes([0.0]));
        let rates = chambers.rates(&sides, &play, &[Lanes::default(); 2], motion);
        assert!(rates.states.iter().flatten().all(|rate| rate.0[0] == 0.0));
        assert!(chambers.port_force(&sides).0[0].abs() < 1e-9);
    }

    #[test]
    fn a_closed_chamber_follows_its_polytrope() {
        // No flow at all: p V^kv stays, so p' = -kv p V'/V.
        let chambers = Chambers::new(&[Cylinder { leak: 0.0, At: 0.0, ..Cylinder::default() }], EXCHANGE);
        let sides = chambers.rest();
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
