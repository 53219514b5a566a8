//! The declared rig with candidate effects, resolved from the parameter vector to coefficients.

use super::parameters::*;
use crate::refine::case::{Actuator, CartPole, Declared, Friction};

/// `1 - 2/(exp(2x) + 1)`: tanh to 1e-16, at a third of the time of the library function.
pub fn tanh(x: f64) -> f64 {
    1.0 - 2.0 / ((2.0 * x).exp() + 1.0)
}

/// One friction law with the terms that may be missing from it.
#[derive(Debug, Clone, Default)]
pub struct FrictionTerms {
    c: Friction,
    viscous: f64,
    coulomb: f64,
    stribeck: f64,
    vs: f64,
    pressure: f64,
    offset: f64,
    asym_force: f64,
    asym_coef: f64,
    position: f64,
    /// Presliding displacement \[m\]; 0: the declared tanh.
    pub disp: f64,
}

impl FrictionTerms {
    /// Friction force \[N\] at speed `v` \[m/s\], position `x` \[m\], pressure force magnitude `p` \[N\] and presliding
    /// state `z` \[m\].
    #[inline]
    pub fn force(&self, v: f64, x: f64, p: f64, z: f64) -> f64 {
        let w = v - self.c.c3;
        let s = tanh(self.c.c2 * w); // eq. 2
        let main = if self.disp > 0.0 { z / self.disp } else { s };
        let mut level = self.coulomb + self.pressure * p + self.position * x;
        if self.stribeck != 0.0 {
            level += self.stribeck * (-(w / self.vs).powi(2)).exp();
        }
        let mut force =
            self.c.c1 * main + (self.c.c4 + self.viscous) * v + self.c.c5 + self.offset + level * s;
        if v > 0.0 {
            force += self.asym_force * s + self.asym_coef * v;
        }
        force
    }

    /// Rate of the presliding state \[m/s\].
    #[inline]
    pub fn presliding_rate(&self, v: f64, z: f64) -> f64 {
        let w = v - self.c.c3;
        w - w.abs() * z / self.disp
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
}

/// Everything the equations of motion need.
#[derive(Debug, Clone, Default)]
pub struct Mechanics {
    /// Friction between piston and cylinder.
    pub piston: FrictionTerms,
    /// Friction between cart and guide.
    pub cart: FrictionTerms,
    /// Cart and pole together, M \[kg\].
    pub mass: f64,
    /// m_p l \[kg m\].
    pub ml: f64,
    /// m_p l^2 \[kg m2\].
    pub inertia: f64,
    /// Gravity \[m/s2\].
    pub g: f64,
    /// b_p with its correction \[N m s/rad\].
    pub damping: f64,
    /// pole.coulomb \[N m\].
    pub pole_coulomb: f64,
    /// pole.quaddrag \[N m s2/rad2\].
    pub pole_drag: f64,
    /// cart.spring: stiffness \[N/m\], stiffness times rest \[N\].
    pub spring: (f64, f64),
    /// cart.endstop: position \[m\], stiffness \[N/m\], damping \[N s/m\].
    pub stop: (f64, f64, f64),
    /// cart.cogging: amplitudes of sine and cosine \[N\], period \[m\].
    pub cogging: (f64, f64, f64),
    /// cart.tilt \[rad\].
    pub tilt: f64,
    /// Cart alone (pole taken off) \[kg\].
    pub cart_mass: f64,
}

/// States of the mechanics: x, v, theta, omega, presliding of piston and cart.
pub type State = [f64; 6];

impl Mechanics {
    /// Time derivative of the state under the held force `f_act` \[N\]; `p` is the magnitude of the pressure force \[N\],
    /// `extra` a torque on the pole \[N m\].
    #[inline]
    pub fn derivative(&self, s: &State, f_act: f64, p: f64, extra: f64) -> State {
        let [x, v, th, om, zp, zc] = *s;
        let mut f = f_act - self.piston.force(v, x, p, zp) - self.cart.force(v, x, p, zc);
        f -= self.spring.0 * x - self.spring.1;
        if x > self.stop.0 {
            f -= (self.stop.1 * (x - self.stop.0) + self.stop.2 * v).max(0.0);
        }
        let (sin_amp, cos_amp, period) = self.cogging;
        if sin_amp != 0.0 || cos_amp != 0.0 {
            let (s, c) = (std::f64::consts::TAU * x / period).sin_cos();
            f -= sin_amp * s + cos_amp * c;
        }
        let (sin, cos) = th.sin_cos();
        let mut weight = self.ml * self.g * sin;
        if self.tilt != 0.0 {
            f -= self.mass * self.g * self.tilt.sin();
            weight = self.ml * self.g * (th + self.tilt).sin();
        }
        let mut torque = extra - self.damping * om - weight;
        if self.pole_coulomb != 0.0 {
            torque -= self.pole_coulomb * tanh(om / 0.05);
        }
        torque -= self.pole_drag * om.abs() * om;
        let row = f + self.ml * om * om * sin; // eq. 4
        let (m, c, j) = (self.mass, self.ml * cos, self.inertia);
        let det = m * j - c * c;
        let a = (row * j - c * torque) / det;
        let alpha = (m * torque - c * row) / det;
        let rate = |friction: &FrictionTerms, z| {
            if friction.disp > 0.0 { friction.presliding_rate(v, z) } else { 0.0 }
        };
        [v, a, om, alpha, rate(&self.piston, zp), rate(&self.cart, zc)]
    }

    /// One Runge-Kutta step of order 4.
    #[inline]
    pub fn step(&self, s: &State, f_act: f64, p: f64, h: f64) -> State {
        self.step_with(s, f_act, p, h, 0.0)
    }

    /// As [`Mechanics::step`], with a torque `extra` \[N m\] on the pole.
    #[inline]
    pub fn step_with(&self, s: &State, f_act: f64, p: f64, h: f64, extra: f64) -> State {
        let add = |k: &State, h: f64| -> State { std::array::from_fn(|i| s[i] + h * k[i]) };
        let k1 = self.derivative(s, f_act, p, extra);
        let k2 = self.derivative(&add(&k1, 0.5 * h), f_act, p, extra);
        let k3 = self.derivative(&add(&k2, 0.5 * h), f_act, p, extra);
        let k4 = self.derivative(&add(&k3, h), f_act, p, extra);
        std::array::from_fn(|i| s[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
    }
}

/// Actuator of the parameter vector `p`.
pub fn actuator(declared: &Actuator, p: &[f64]) -> ActuatorTerms {
    // Slower or faster by a common factor: y(k) - y(k-1) = -(I + A1) y(k-1) + ...; the static gain stays.
    let rate = 1.0 + p[D_ACT_RATE];
    let a: [[f64; 2]; 2] = std::array::from_fn(|i| {
        std::array::from_fn(|j| rate * (declared.A1[i][j] + f64::from(i == j)) - f64::from(i == j))
    });
    let scale = rate * (1.0 + p[D_ACT_GAIN]);
    ActuatorTerms {
        a,
        b0: declared.B0.map(|value| scale * value),
        b1: declared.B1.map(|value| scale * value),
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
    }
}

/// Mechanics of the parameter vector `p`.
pub fn mechanics(declared: &Declared, p: &[f64]) -> Mechanics {
    let piston = declared.piston_friction.clone().unwrap_or_default();
    let cart = declared.cart_friction.clone().unwrap_or_default();
    let rel = |value: f64, index: usize| value * (1.0 + p[index]);
    let piston = FrictionTerms {
        c: Friction {
            c1: rel(piston.c1, D_PF_C1),
            c2: rel(piston.c2, D_PF_C2),
            c3: piston.c3,
            c4: rel(piston.c4, D_PF_C4),
            c5: piston.c5,
        },
        viscous: p[PF_VISCOUS],
        coulomb: p[PF_COULOMB],
        stribeck: p[PF_STRIBECK],
        vs: p[PF_STRIBECK_VS],
        pressure: p[PF_PRESSURE],
        offset: p[PF_OFFSET],
        asym_force: p[PF_ASYM_FORCE],
        asym_coef: p[PF_ASYM_COEF],
        position: 0.0,
        disp: p[PF_PRESLIDING],
    };
    let cart = FrictionTerms {
        c: Friction {
            c1: rel(cart.c1, D_CF_C1),
            c2: rel(cart.c2, D_CF_C2),
            c3: rel(cart.c3, D_CF_C3),
            c4: cart.c4,
            c5: rel(cart.c5, D_CF_C5),
        },
        viscous: p[CF_VISCOUS],
        coulomb: p[CF_COULOMB],
        stribeck: p[CF_STRIBECK],
        vs: p[CF_STRIBECK_VS],
        pressure: 0.0,
        offset: p[CF_OFFSET],
        asym_force: p[CF_ASYM_FORCE],
        asym_coef: p[CF_ASYM_COEF],
        position: p[CF_POSCOULOMB],
        disp: p[CF_PRESLIDING],
    };
    let body =
        declared.cart_pole.clone().unwrap_or(CartPole { m_c: 1.0, m_p: 0.0, l: 1.0, ..CartPole::default() });
    let (m_c, m_p) = (rel(body.m_c, D_M_C), rel(body.m_p, D_M_P));
    let l = rel(body.l, D_L) + p[LENGTH];
    let (payload, d) = (p[PAYLOAD], body.tip_distance);
    Mechanics {
        piston,
        cart,
        mass: m_c + p[MASS] + m_p + payload,
        ml: m_p * l + payload * d,
        inertia: m_p * l * l + payload * d * d,
        g: body.g,
        damping: rel(body.b_p, D_B_P) + p[POLE_VISCOUS],
        pole_coulomb: p[POLE_COULOMB],
        pole_drag: p[POLE_DRAG],
        spring: (p[SPRING], p[SPRING_FORCE]),
        stop: (p[STOP_POS], p[STOP_STIFFNESS], p[STOP_DAMPING]),
        cogging: (p[COG_SIN], p[COG_COS], p[COG_PERIOD]),
        tilt: p[TILT],
        cart_mass: m_c + p[MASS],
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
    fn the_fast_tanh_is_that_of_the_library() {
        for x in [-800.0, -20.0, -0.3, -1e-9, 0.0, 1e-12, 0.7, 5.0, 900.0f64] {
            assert!((tanh(x) - x.tanh()).abs() < 3e-16, "{x}");
        }
    }

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
    fn the_hanging_pole_swings_with_its_period() {
        let declared = Declared {
            cart_pole: Some(CartPole { m_c: 1e6, m_p: 0.1, l: 0.2, g: 9.81, ..CartPole::default() }),
            ..Declared::default()
        };
        let plant = mechanics(&declared, &neutral());
        let period = std::f64::consts::TAU * (0.2f64 / 9.81).sqrt();
        let mut s: State = [0.0, 0.0, 1e-3, 0.0, 0.0, 0.0];
        let steps = 2000;
        for _ in 0..steps {
            s = plant.step(&s, 0.0, 0.0, period / f64::from(steps));
        }
        assert!((s[2] / 1e-3 - 1.0).abs() < 1e-6 && (s[3] / 1e-3).abs() < 1e-4);
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
