//! Declared values of a case: finite, positive where physics asks for it, and an actuator that is stable.

use super::case::{Actuator, CartPole, Declared, Friction};

/// Modulus from which on a pole of the actuator is unstable; an integrator is not, whatever its digits.
const MIN_UNSTABLE_MODULUS: f64 = 1.0 + 1e-6;

impl Declared {
    /// Refuses values with which nothing can be simulated.
    ///
    /// # Errors
    /// Table, name, value, and what is allowed.
    pub fn check(&self) -> Result<(), String> {
        if let Some(actuator) = &self.actuator {
            actuator.check().map_err(|problem| format!("[model.actuator]: {problem}"))?;
        }
        for (table, friction) in
            [("piston_friction", &self.piston_friction), ("cart_friction", &self.cart_friction)]
        {
            if let Some(friction) = friction {
                friction.check().map_err(|problem| format!("[model.{table}]: {problem}"))?;
            }
        }
        if let Some(cart_pole) = &self.cart_pole {
            cart_pole.check().map_err(|problem| format!("[model.cart_pole]: {problem}"))?;
        }
        Ok(())
    }
}

/// Range allowed for a declared value.
#[derive(Clone, Copy)]
enum Range {
    Finite,
    NotNegative,
    Positive,
}

fn check(values: &[(&str, f64, Range)]) -> Result<(), String> {
    for &(name, value, range) in values {
        let (is_good, allowed) = match range {
            Range::Finite => (true, "a finite number"),
            Range::NotNegative => (value >= 0.0, "a number of at least zero"),
            Range::Positive => (value > 0.0, "a number above zero"),
        };
        if !(is_good && value.is_finite()) {
            return Err(format!("{name} = {value} where {allowed} is needed; correct it in case.toml"));
        }
    }
    Ok(())
}

impl Actuator {
    fn check(&self) -> Result<(), String> {
        check(&[("sample_time", self.sample_time, Range::Positive)])?;
        let rows = [("A1", self.A1.as_flattened()), ("B0", &self.B0), ("B1", &self.B1)];
        for (name, values) in rows {
            if let Some(value) = values.iter().find(|value| !value.is_finite()) {
                return Err(format!("{name} has the element {value} where finite numbers are needed"));
            }
        }
        let modulus = self.largest_pole();
        if modulus >= MIN_UNSTABLE_MODULUS {
            return Err(format!(
                "A1 = {:?} has a pole of modulus {modulus:.4}, so that y(k) = -A1 y(k-1) + ... grows without bound; check its signs: poles of a stable actuator are inside of the unit circle",
                self.A1
            ));
        }
        Ok(())
    }

    /// Modulus of the pole that is farthest from zero.
    fn largest_pole(&self) -> f64 {
        let [[a, b], [c, d]] = self.A1;
        let (half, determinant) = (0.5 * (a + d), a * d - b * c);
        let discriminant = half * half - determinant;
        if discriminant < 0.0 { determinant.sqrt() } else { half.abs() + discriminant.sqrt() }
    }
}

impl Friction {
    fn check(&self) -> Result<(), String> {
        check(&[
            ("c1", self.c1, Range::Finite),
            ("c2", self.c2, Range::NotNegative),
            ("c3", self.c3, Range::Finite),
            ("c4", self.c4, Range::Finite),
            ("c5", self.c5, Range::Finite),
        ])
    }
}

impl CartPole {
    fn check(&self) -> Result<(), String> {
        check(&[
            ("m_c", self.m_c, Range::Positive),
            ("m_p", self.m_p, Range::Positive),
            ("l", self.l, Range::Positive),
            ("g", self.g, Range::NotNegative),
            ("b_p", self.b_p, Range::NotNegative),
            ("tip_distance", self.tip_distance, Range::NotNegative),
            ("stroke", self.stroke, Range::NotNegative),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn declared() -> Declared {
        Declared {
            actuator: Some(Actuator {
                sample_time: 0.001,
                A1: [[-1.0144, 0.0216], [-0.0527, -0.9537]],
                B0: [0.6619, 0.0764],
                B1: [-0.6557, -0.0847],
            }),
            piston_friction: Some(Friction { c1: 1.5, c2: 40.0, c3: 0.0, c4: 49.0, c5: 0.0 }),
            cart_friction: Some(Friction { c1: 5.8, c2: 64.0, c3: 0.006, c4: 0.0, c5: -2.3 }),
            cart_pole: Some(CartPole { m_c: 0.4, m_p: 0.1, l: 0.2, g: 9.81, ..CartPole::default() }),
            ..Declared::default()
        }
    }

    #[test]
    fn poles_are_those_of_the_paper() {
        // Equation 8: modulus 0.98416.
        let actuator = declared().actuator.unwrap();
        assert!((actuator.largest_pole() - 0.98416).abs() < 1e-4, "{}", actuator.largest_pole());
        let real = Actuator { A1: [[-0.5, 0.0], [0.0, 0.9]], ..actuator };
        assert!((real.largest_pole() - 0.9).abs() < 1e-12);
    }

    #[test]
    fn what_cannot_be_simulated_is_refused_by_name() {
        assert_eq!(declared().check(), Ok(()));
        type Spoil = fn(&mut Declared);
        let cases: [(&str, Spoil); 6] = [
            ("[model.actuator]: A1 has the element NaN", |d| {
                d.actuator.as_mut().unwrap().A1[0][1] = f64::NAN
            }),
            ("[model.actuator]: A1", |d| d.actuator.as_mut().unwrap().A1[0][0] = -1.2),
            ("[model.actuator]: sample_time = 0", |d| d.actuator.as_mut().unwrap().sample_time = 0.0),
            ("[model.cart_friction]: c5 = inf", |d| d.cart_friction.as_mut().unwrap().c5 = f64::INFINITY),
            ("[model.cart_pole]: m_p = 0", |d| d.cart_pole.as_mut().unwrap().m_p = 0.0),
            ("[model.cart_pole]: l = -0.2", |d| d.cart_pole.as_mut().unwrap().l = -0.2),
        ];
        for (part, spoil) in cases {
            let mut declared = declared();
            spoil(&mut declared);
            let message = declared.check().unwrap_err();
            assert!(message.contains(part), "{part}: {message}");
        }
    }
}
