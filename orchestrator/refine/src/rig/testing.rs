//! A rig with records of its own for tests: the simulated sensor signals of a rig with some effects, noise included.

use super::coupled::{Coupled, Trial};
use super::cylinder::{Cylinder, EXCHANGE};
use super::parameters::neutral;
use super::record::Measured;
use crate::case::{Actuator, CartPole, Declared, Friction};
use crate::engine::System;
use crate::engine::noise::Noise;

/// Records.
const RECORDS: usize = 2;

/// Two records of `n` samples from rest with the parameters `values`; `noises`: measured signals with their rms \[SI\].
pub fn rig(actuator: Actuator, n: usize, noises: &[(&str, f64)], values: &[(usize, f64)]) -> Coupled {
    let declared = Declared {
        piston_friction: Some(Friction { c1: 1.5, c2: 40.0, c4: 50.0, ..Friction::default() }),
        cart_friction: Some(Friction { c1: 6.0, c2: 60.0, ..Friction::default() }),
        cart_pole: Some(CartPole { m_c: 0.4, m_p: 0.1, l: 0.2, g: 9.81, ..CartPole::default() }),
        ..Declared::default()
    };
    let trial = |r: usize| {
        let w = 0.008 + 0.003 * r as f64;
        let u = (0..n).map(|k| 30.0 * (w * k as f64).sin() + 10.0 * (2.7 * w * k as f64).sin()).collect();
        let measured = noises.iter().map(|&(name, noise)| Measured::new(name, vec![0.0; n], noise)).collect();
        Trial { u, measured, estimation: true, fixed: false, restart: None }
    };
    let (cylinder, trials) = (Cylinder::default(), (0..RECORDS).map(trial).collect());
    let mut rig = Coupled { declared, actuator, cylinder, exchange: EXCHANGE, trials, extra: None };
    let mut p = neutral();
    values.iter().for_each(|&(index, value)| p[index] = value);
    for r in 0..RECORDS {
        let shown = rig.predict(r, &p, &[0.0, 0.0]);
        let mut noise = Noise::new(11, r as u64);
        for (m, own) in rig.trials[r].measured.iter_mut().zip(shown.chunks(n)) {
            let values = own.iter().map(|value| value + m.noise * noise.normal()).collect();
            *m = Measured::new(&m.name, values, m.noise);
        }
    }
    rig
}
