//! The declared rig with candidate effects, resolved from the parameter vector to coefficients.

use std::sync::Arc;

use super::extra::{Extra, Place};
use super::lanes::{Lanes, each};
use super::parameters::*;
use crate::case::{Actuator, CartPole, Declared, Friction};
use crate::study::law::Point;

/// Fastest rate of presliding \[1/s\] that Runge-Kutta steps of half a millisecond are to follow.
const MAX_PRESLIDING_RATE: f64 = 4000.0;

/// One friction law with the terms that may be missing from it.
#[derive(Debug, Clone, Default)]
pub struct FrictionTerms<const L: usize> {
    c1: Lanes<L>,
    c2: Lanes<L>,
    c3: Lanes<L>,
    /// All viscous coefficients together.
    slope: Lanes<L>,
    /// All constant forces together.
    offset: Lanes<L>,
    coulomb: Lanes<L>,
    stribeck: Option<(Lanes<L>, Lanes<L>)>,
    pressure: Lanes<L>,
    asymmetry: Option<(Lanes<L>, Lanes<L>)>,
    position: Lanes<L>,
    /// Presliding displacement \[m\]; lanes with 0 keep the declared tanh. `None`: all of them do.
    pub disp: Option<Lanes<L>>,
}

impl<const L: usize> FrictionTerms<L> {
    /// Friction force \[N\] at speed `v` \[m/s\], position `x` \[m\], pressure force magnitude `p` \[N\] and presliding
    /// state `z` \[m\].
    #[inline(always)]
    pub fn force(&self, v: Lanes<L>, x: Lanes<L>, p: Lanes<L>, z: Lanes<L>) -> Lanes<L> {
        let w = v - self.c3;
        let s = (self.c2 * w).tanh(); // eq. 2
        let main = match self.disp {
            Some(disp) => each(|i| if disp.0[i] > 0.0 { z.0[i] / disp.0[i] } else { s.0[i] }),
            None => s,
        };
        // Presliding softens the whole level, whatever adds to it.
        let mut level = self.c1 + self.coulomb + self.pressure * p + self.position * x;
        if let Some((force, vs)) = self.stribeck {
            let ratio = w / vs;
            level = level + force * (-(ratio * ratio)).exp();
        }
        let mut force = level * main + self.slope * v + self.offset;
        if let Some((level, slope)) = self.asymmetry {
            force = force + (level * main + slope * v).where_positive(v);
        }
        force
    }

    /// Presliding state \[m\] after the time `h` \[s\] at a constant speed.
    pub fn presliding_after(&self, v: Lanes<L>, z: Lanes<L>, h: f64) -> Lanes<L> {
        let Some(disp) = self.disp else { return z };
        let w = v - self.c3;
        each(|i| {
            let end = disp.0[i].copysign(w.0[i]);
            if disp.0[i] > 0.0 {
                end + (z.0[i] - end) * (-w.0[i].abs() * h / disp.0[i]).exp()
            } else {
                z.0[i]
            }
        })
    }

    /// Rate of the presliding state \[m/s\]; zero in lanes without one.
    #[inline(always)]
    pub fn presliding_rate(&self, v: Lanes<L>, z: Lanes<L>) -> Lanes<L> {
        let Some(disp) = self.disp else { return Lanes::default() };
        let w = v - self.c3;
        // w - |w| z/disp, where it is not too fast for the steps: there z has reached its end long before.
        each(|i| {
            let pace = (w.0[i].abs() / disp.0[i]).min(MAX_PRESLIDING_RATE);
            if disp.0[i] > 0.0 { pace * (disp.0[i].copysign(w.0[i]) - z.0[i]) } else { 0.0 }
        })
    }
}

/// The command path and the sampled actuator.
#[derive(Debug, Clone)]
pub struct ActuatorTerms {
    /// A1 of eq. 6.
    pub a: [[f64; 2]; 2],
    /// B0 of eq. 6.
    pub b0: [f64; 2],
    /// B1 of eq. 6.
    pub b1: [f64; 2],
    /// act.gain.
    pub gain: f64,
    /// act.delay \[samples\].
    pub delay: f64,
    /// act.deadband \[N\].
    pub deadband: f64,
    /// act.saturation \[N\]; infinite: none.
    pub limit: f64,
    /// act.hysteresis \[N\].
    pub hysteresis: f64,
    /// act.posgain \[1/m\].
    pub posgain: f64,
    /// act.backpressure \[N s/m\].
    pub backpressure: f64,
    /// act.droop: depth, time constant \[s\].
    pub droop: (f64, f64),
    /// Sampled second-order mode: transition \[2, 2\] and input \[2\] matrices.
    pub mode: Option<([[f64; 2]; 2], [f64; 2])>,
    /// A law that the vocabulary does not have, with its parameters.
    pub extra: Option<(Arc<Extra>, Vec<f64>)>,
}

/// Everything the equations of motion need.
#[derive(Debug, Clone, Default)]
pub struct Mechanics<const L: usize> {
    /// Friction between piston and cylinder.
    pub piston: FrictionTerms<L>,
    /// Friction between cart and guide.
    pub cart: FrictionTerms<L>,
    /// Cart and pole together, M \[kg\].
    mass: Lanes<L>,
    /// m_p l \[kg m\].
    ml: Lanes<L>,
    /// m_p l^2 \[kg m2\].
    inertia: Lanes<L>,
    /// m_p g l \[N m\].
    weight: Lanes<L>,
    /// b_p with its correction \[N m s/rad\].
    damping: Lanes<L>,
    /// pole.coulomb \[N m\].
    pole_coulomb: Option<Lanes<L>>,
    /// pole.quaddrag \[N m s2/rad2\].
    pole_drag: Lanes<L>,
    /// cart.spring: stiffness \[N/m\], stiffness times rest \[N\].
    spring: (Lanes<L>, Lanes<L>),
    /// cart.endstop: position \[m\], stiffness \[N/m\], damping \[N s/m\].
    stop: Option<[Lanes<L>; 3]>,
    /// cart.cogging: amplitudes of sine and cosine \[N\], radians per meter.
    cogging: Option<[Lanes<L>; 3]>,
    /// cart.tilt: angle \[rad\] and the force it takes from the cart \[N\].
    tilt: Option<(Lanes<L>, Lanes<L>)>,
    /// Cart alone (pole taken off) \[kg\].
    pub cart_mass: Lanes<L>,
    /// A law that the vocabulary does not have, with its parameters.
    pub extra: Option<(Arc<Extra>, [Vec<f64>; L])>,
    /// Time of the sample \[s\], for such a law.
    pub time: f64,
}

/// States of the mechanics: x, v, theta, omega, presliding of piston and cart.
pub type State<const L: usize> = [Lanes<L>; 6];

impl<const L: usize> Mechanics<L> {
    /// Force \[N\] that cart.cogging takes from the cart at position `x` \[m\]; none without the effect.
    #[inline(always)]
    pub fn cogging(&self, x: Lanes<L>) -> Option<Lanes<L>> {
        let [sin_amp, cos_amp, wave] = self.cogging?;
        let (sin, cos) = (wave * x).sin_cos();
        Some(sin_amp * sin + cos_amp * cos)
    }

    /// Force \[N\] or torque \[N m\] that a law beyond the vocabulary takes off at a place, at a position and velocity
    /// there.
    pub fn taken(&self, place: Place, position: Lanes<L>, velocity: Lanes<L>) -> Option<Lanes<L>> {
        let (extra, p) = self.extra.as_ref().filter(|own| own.0.place == place)?;
        let time = self.time;
        Some(each(|i| {
            let (position, velocity) = (position.0[i], velocity.0[i]);
            extra.value(&p[i], &Point { position, velocity, time, ..Point::default() })
        }))
    }

    /// Time derivative of the state under the held force `f_act` \[N\]; `p` is the magnitude of the pressure force
    /// \[N\], `extra` a torque on the pole \[N m\].
    #[inline(always)]
    pub fn derivative(&self, s: &State<L>, f_act: Lanes<L>, p: Lanes<L>, extra: Lanes<L>) -> State<L> {
        let [x, v, th, om, zp, zc] = *s;
        let mut f = f_act - self.piston.force(v, x, p, zp) - self.cart.force(v, x, p, zc);
        f = f - (self.spring.0 * x - self.spring.1);
        f = self.cogging(x).map_or(f, |taken| f - taken);
        if let Some([position, stiffness, damping]) = self.stop {
            let depth = x - position;
            let push = stiffness * depth + damping * v;
            f = f - push.where_positive(push).where_positive(depth);
        }
        let (sin, cos) = th.sin_cos();
        let mut weight = self.weight * sin;
        if let Some((angle, force)) = self.tilt {
            f = f - force;
            weight = self.weight * (th + angle).sin_cos().0;
        }
        let mut torque = extra - self.damping * om - weight - self.pole_drag * om.abs() * om;
        if let Some(dry) = self.pole_coulomb {
            torque = torque - dry * (om * (1.0 / 0.05)).tanh();
        }
        if self.extra.is_some() {
            for place in [Place::Piston, Place::Cart] {
                f = self.taken(place, x, v).map_or(f, |taken| f - taken);
            }
            torque = self.taken(Place::Pole, th, om).map_or(torque, |taken| torque - taken);
        }
        let row = f + self.ml * om * om * sin; // eq. 4
        let (m, c, j) = (self.mass, self.ml * cos, self.inertia);
        let inverse = Lanes::all(1.0) / (m * j - c * c);
        let a = (row * j - c * torque) * inverse;
        let alpha = (m * torque - c * row) * inverse;
        [v, a, om, alpha, self.piston.presliding_rate(v, zp), self.cart.presliding_rate(v, zc)]
    }

    /// One Runge-Kutta step of order 4, with a torque `extra` \[N m\] on the pole.
    #[inline(always)]
    pub fn step(&self, s: &State<L>, f_act: Lanes<L>, p: Lanes<L>, extra: Lanes<L>, h: f64) -> State<L> {
        let add = |k: &State<L>, h: f64| {
            let mut moved = *s;
            (0..6).for_each(|i| moved[i] = moved[i] + k[i] * h);
            moved
        };
        let k1 = self.derivative(s, f_act, p, extra);
        let k2 = self.derivative(&add(&k1, 0.5 * h), f_act, p, extra);
        let k3 = self.derivative(&add(&k2, 0.5 * h), f_act, p, extra);
        let k4 = self.derivative(&add(&k3, h), f_act, p, extra);
        let mut next = *s;
        (0..6).for_each(|i| next[i] = next[i] + (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * (h / 6.0));
        next
    }
}

/// Actuator of the parameter vector `p`.
pub fn actuator(declared: &Actuator, p: &[f64]) -> ActuatorTerms {
    let moved = declared.moved(p[D_ACT_GAIN], p[D_ACT_DECAY], p[D_ACT_TURN]);
    ActuatorTerms {
        a: moved.A1,
        b0: moved.B0,
        b1: moved.B1,
        gain: p[GAIN],
        delay: p[DELAY] / declared.sample_time,
        deadband: p[DEADBAND],
        limit: p[LIMIT],
        hysteresis: p[HYSTERESIS],
        posgain: p[POSGAIN],
        backpressure: p[BACKPRESSURE],
        droop: (p[DROOP_DEPTH], p[DROOP_TAU]),
        mode: p[MODE_FREQ]
            .is_finite()
            .then(|| sampled_mode(p[MODE_FREQ], p[MODE_ZETA], declared.sample_time)),
        extra: None,
    }
}

/// Mechanics of one parameter vector per lane.
pub fn mechanics<const L: usize>(declared: &Declared, vectors: [&[f64]; L]) -> Mechanics<L> {
    let p = |index: usize| Lanes(vectors.map(|vector| vector[index]));
    let rel = |value: f64, index: usize| (p(index) + 1.0) * value;
    let used = |index: usize| p(index).any(|value| value != 0.0);
    let friction = |c: &Friction, corrections: [Option<usize>; 5], own: [usize; 8]| {
        let [c1, c2, c3, c4, c5] = [(c.c1, 0), (c.c2, 1), (c.c3, 2), (c.c4, 3), (c.c5, 4)]
            .map(|(value, i)| corrections[i].map_or(Lanes::all(value), |index| rel(value, index)));
        let [viscous, coulomb, offset, stribeck, vs, force, slope, disp] = own;
        FrictionTerms {
            c1,
            c2,
            c3,
            slope: c4 + p(viscous),
            offset: c5 + p(offset),
            coulomb: p(coulomb),
            stribeck: used(stribeck).then(|| (p(stribeck), p(vs))),
            asymmetry: (used(force) || used(slope)).then(|| (p(force), p(slope))),
            disp: used(disp).then(|| p(disp)),
            ..FrictionTerms::default()
        }
    };
    let mut piston = friction(
        &declared.piston_friction.clone().unwrap_or_default(),
        [Some(D_PF_C1), Some(D_PF_C2), None, Some(D_PF_C4), None],
        [
            PF_VISCOUS,
            PF_COULOMB,
            PF_OFFSET,
            PF_STRIBECK,
            PF_STRIBECK_VS,
            PF_ASYM_FORCE,
            PF_ASYM_COEF,
            PF_PRESLIDING,
        ],
    );
    piston.pressure = p(PF_PRESSURE);
    let mut cart = friction(
        &declared.cart_friction.clone().unwrap_or_default(),
        [Some(D_CF_C1), Some(D_CF_C2), Some(D_CF_C3), None, Some(D_CF_C5)],
        [
            CF_VISCOUS,
            CF_COULOMB,
            CF_OFFSET,
            CF_STRIBECK,
            CF_STRIBECK_VS,
            CF_ASYM_FORCE,
            CF_ASYM_COEF,
            CF_PRESLIDING,
        ],
    );
    cart.position = p(CF_POSCOULOMB);
    let body =
        declared.cart_pole.clone().unwrap_or(CartPole { m_c: 1.0, m_p: 0.0, l: 1.0, ..CartPole::default() });
    let (cart_mass, m_p) = (rel(body.m_c, D_M_C) + p(MASS), rel(body.m_p, D_M_P));
    let l = rel(body.l, D_L) + p(LENGTH);
    let (payload, d) = (p(PAYLOAD), body.tip_distance);
    let mass = cart_mass + m_p + payload;
    let ml = m_p * l + payload * d;
    let uphill = Lanes(p(TILT).0.map(f64::sin));
    Mechanics {
        piston,
        cart,
        mass,
        ml,
        inertia: m_p * l * l + payload * (d * d),
        weight: ml * body.g,
        damping: rel(body.b_p, D_B_P) + p(POLE_VISCOUS),
        pole_coulomb: used(POLE_COULOMB).then(|| p(POLE_COULOMB)),
        pole_drag: p(POLE_DRAG),
        spring: (p(SPRING), p(SPRING_FORCE)),
        stop: p(STOP_POS).any(f64::is_finite).then(|| [p(STOP_POS), p(STOP_STIFFNESS), p(STOP_DAMPING)]),
        cogging: (used(COG_SIN) || used(COG_COS))
            .then(|| [p(COG_SIN), p(COG_COS), Lanes::all(std::f64::consts::TAU) / p(COG_PERIOD)]),
        tilt: used(TILT).then(|| (p(TILT), mass * uphill * body.g)),
        cart_mass,
        extra: None,
        time: 0.0,
    }
}

/// `q'' + 2 zeta w q' + w^2 q = w^2 u` over one sample `dt` \[s\] with `u` held.
fn sampled_mode(freq: f64, zeta: f64, dt: f64) -> ([[f64; 2]; 2], [f64; 2]) {
    let w = std::f64::consts::TAU * freq;
    let steps = 4 + (w * dt * 20.0) as usize;
    let h = dt / steps as f64;
    let rate = |q: [f64; 2], u: f64| [q[1], w * w * (u - q[0]) - 2.0 * zeta * w * q[1]];
    let run = |mut q: [f64; 2], u: f64| {
        for _ in 0..steps {
            let k1 = rate(q, u);
            let k2 = rate([q[0] + 0.5 * h * k1[0], q[1] + 0.5 * h * k1[1]], u);
            let k3 = rate([q[0] + 0.5 * h * k2[0], q[1] + 0.5 * h * k2[1]], u);
            let k4 = rate([q[0] + h * k3[0], q[1] + h * k3[1]], u);
            for i in 0..2 {
                q[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
        }
        q
    };
    let (e1, e2, input) = (run([1.0, 0.0], 0.0), run([0.0, 1.0], 0.0), run([0.0, 0.0], 1.0));
    ([[e1[0], e2[0]], [e1[1], e2[1]]], input)
}

impl ActuatorTerms {
    /// Force \[N\] that a law beyond the vocabulary takes off at a place; zero without one.
    pub fn taken(&self, place: Place, point: &Point) -> f64 {
        let own = self.extra.as_ref().filter(|own| own.0.place == place);
        own.map_or(0.0, |(extra, p)| extra.value(p, point))
    }

    /// Command after delay, hysteresis, dead band, saturation and gain, shape \[n\]; before the first sample it is 0.
    pub fn shaped_command(&self, u: &[f64]) -> Vec<f64> {
        let at = |index: i64| if index < 0 { 0.0 } else { u[index as usize] };
        let mut play = 0.0f64;
        (0..u.len())
            .map(|k| {
                let mut value = u[k];
                if self.delay > 0.0 {
                    let (whole, part) = (self.delay.floor(), self.delay.fract());
                    let k = k as i64 - whole as i64;
                    value = (1.0 - part) * at(k) + part * at(k - 1);
                }
                if self.hysteresis > 0.0 {
                    play = play.max(value - self.hysteresis).min(value + self.hysteresis);
                    value = play;
                }
                if self.deadband > 0.0 {
                    value -= value.clamp(-self.deadband, self.deadband);
                }
                (1.0 + self.gain) * value.clamp(-self.limit, self.limit)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_critically_damped_mode_has_the_closed_step_response() {
        let (freq, dt) = (20.0, 1e-3);
        let (transition, input) = sampled_mode(freq, 1.0, dt);
        let w = std::f64::consts::TAU * freq;
        let mut q = [0.0; 2];
        for k in 1..200 {
            q = std::array::from_fn(|i| transition[i][0] * q[0] + transition[i][1] * q[1] + input[i]);
            let t = f64::from(k) * dt;
            let exact = 1.0 - (1.0 + w * t) * (-w * t).exp();
            // Runge-Kutta of order 4 with w h = 0.02: some 1e-10.
            assert!((q[0] - exact).abs() < 1e-7, "{k}: {} {exact}", q[0]);
        }
    }

    #[test]
    fn presliding_softens_the_whole_level_and_ends_in_it() {
        let piston = Friction { c1: 1.5, c2: 40.0, c4: 50.0, ..Friction::default() };
        let declared = Declared { piston_friction: Some(piston), ..Declared::default() };
        let mut p = neutral();
        (p[PF_COULOMB], p[PF_PRESSURE], p[PF_PRESLIDING]) = (2.0, 0.1, 1e-3);
        let friction = mechanics(&declared, [&p[..]]).piston;
        let force = |z: f64| friction.force(Lanes([0.3]), Lanes([0.0]), Lanes([20.0]), Lanes([z])).0[0];
        // Declared 1.5 N, 2 N more, and a tenth of 20 N, beside 50 N s/m.
        assert!((force(0.0) - 15.0).abs() < 1e-12 && (force(5e-4) - 15.0 - 2.75).abs() < 1e-12);
        assert!((force(1e-3) - 15.0 - 5.5).abs() < 1e-12);
    }

    #[test]
    fn the_hanging_pole_swings_with_its_period() {
        let declared = Declared {
            cart_pole: Some(CartPole { m_c: 1e6, m_p: 0.1, l: 0.2, g: 9.81, ..CartPole::default() }),
            ..Declared::default()
        };
        let plant = mechanics(&declared, [&neutral()[..]]);
        let period = std::f64::consts::TAU * (0.2f64 / 9.81).sqrt();
        let none = Lanes::default();
        let mut s: State<1> = [0.0, 0.0, 1e-3, 0.0, 0.0, 0.0].map(Lanes::all);
        let steps = 2000;
        for _ in 0..steps {
            s = plant.step(&s, none, none, none, period / f64::from(steps));
        }
        assert!((s[2].0[0] / 1e-3 - 1.0).abs() < 1e-6 && (s[3].0[0] / 1e-3).abs() < 1e-4);
    }

    #[test]
    fn play_and_dead_band_shape_a_ramp_as_drawn_by_hand() {
        let mut terms = actuator(
            &Actuator { sample_time: 1e-3, A1: [[0.0; 2]; 2], B0: [1.0; 2], B1: [0.0; 2] },
            &neutral(),
        );
        terms.hysteresis = 1.0;
        assert_eq!(terms.shaped_command(&[0.0, 2.0, 3.0, 2.0, 1.0, 0.0]), [0.0, 1.0, 2.0, 2.0, 2.0, 1.0]);
        terms.hysteresis = 0.0;
        terms.deadband = 1.0;
        assert_eq!(terms.shaped_command(&[0.5, 2.0, -3.0]), [0.0, 1.0, -2.0]);
        terms.deadband = 0.0;
        terms.delay = 1.5;
        assert_eq!(terms.shaped_command(&[2.0, 4.0, 6.0]), [0.0, 1.0, 3.0]);
    }
}
