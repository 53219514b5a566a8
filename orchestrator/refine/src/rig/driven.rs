//! The mechanics behind a pneumatic cylinder: both move in the same Runge-Kutta steps, since the cylinder feels its
//! piston.
//!
//! The two parts of the rig exchange force and motion after short times ([`Chambers::exchange`]): the cylinder steps
//! first, under the motion at the beginning, and the mechanics under the force at the end. Steps here are longer, so
//! the force is early, the motion late and the tube shorter by half of that time, as on average.

use super::cylinder::{Chambers, Rates, Side};
use super::lanes::Lanes;
use super::plant::{Mechanics, State};

/// Cylinder and mechanics of several simulations.
pub struct Driven<'a, const L: usize> {
    chambers: &'a Chambers,
    /// States of the cylinder.
    sides: [Side<L>; 2],
    play: [Lanes<L>; 2],
    /// Flows that entered the tubes, two entries per step.
    line: Vec<[Lanes<L>; 2]>,
    /// Acceleration \[m/s2\] of the last stage.
    acceleration: Lanes<L>,
    /// Length of a step \[s\].
    h: f64,
}

impl<'a, const L: usize> Driven<'a, L> {
    /// At rest, before `steps` steps of `h` \[s\].
    pub fn new(chambers: &'a Chambers, steps: usize, h: f64) -> Driven<'a, L> {
        let sides = chambers.rest();
        let play = [sides[0][0], sides[1][0]];
        Driven {
            chambers,
            sides,
            play,
            line: Vec::with_capacity(2 * steps + 2),
            acceleration: Lanes::default(),
            h,
        }
    }

    /// Begins a sample with the force command `u` \[N\]; returns pressure force and force on the piston \[N\].
    #[inline(always)]
    pub fn sample(&mut self, u: Lanes<L>) -> [Lanes<L>; 2] {
        self.chambers.command(u, &mut self.play);
        [self.chambers.port_force(&self.sides), self.chambers.piston_force(&self.sides)]
    }

    /// Flows that leave the tubes, `half` half steps after the end of the line.
    #[inline(always)]
    fn delayed(&self, half: usize) -> [Lanes<L>; 2] {
        let back = (self.chambers.delay() - 0.5 * self.chambers.exchange).max(0.0) * 2.0 / self.h;
        let (whole, part) = (back.floor() as usize, back.fract());
        // Nothing flowed before the start; a delay shorter than a step sees the last flow known.
        let at = |back: usize| match (self.line.len() + half).checked_sub(back) {
            Some(index) => self.line.get(index).or(self.line.last()).copied().unwrap_or_default(),
            None => [Lanes::default(); 2],
        };
        let (near, far) = (at(whole), at(whole + 1));
        [0, 1].map(|i| near[i] * (1.0 - part) + far[i] * part)
    }

    /// One step of order 4; `p` is the magnitude of the pressure force \[N\], `lost` what speed takes from the force on
    /// the piston \[N s/m\].
    #[inline(always)]
    pub fn step(&mut self, plant: &Mechanics<L>, s: &State<L>, p: Lanes<L>, lost: Lanes<L>) -> State<L> {
        let (h, told) = (self.h, 0.5 * self.chambers.exchange);
        let mut acceleration = self.acceleration;
        let mut stage =
            |sides: &[Side<L>; 2], s: &State<L>, delayed: &[Lanes<L>; 2]| -> (Rates<L>, State<L>) {
                let motion = (s[0] - s[1] * told, s[1] - acceleration * told);
                let rates = self.chambers.rates(sides, &self.play, delayed, motion);
                let force =
                    self.chambers.piston_force(sides) + self.chambers.piston_force_rate(&rates) * told;
                let moved = plant.derivative(s, force - lost * s[1], p, Lanes::default());
                acceleration = moved[1];
                (rates, moved)
            };
        let moved = |k: &(Rates<L>, State<L>), h: f64| -> ([Side<L>; 2], State<L>) {
            let mut sides = self.sides;
            for (side, rates) in sides.iter_mut().zip(&k.0.states) {
                (0..6).for_each(|i| side[i] = side[i] + rates[i] * h);
            }
            let mut next = *s;
            (0..6).for_each(|i| next[i] = next[i] + k.1[i] * h);
            (sides, next)
        };
        let delayed: [[Lanes<L>; 2]; 3] = [0, 1, 2].map(|half| self.delayed(half));
        let k1 = stage(&self.sides, s, &delayed[0]);
        let (sides, at) = moved(&k1, 0.5 * h);
        let k2 = stage(&sides, &at, &delayed[1]);
        let (sides, at) = moved(&k2, 0.5 * h);
        let k3 = stage(&sides, &at, &delayed[1]);
        let (sides, at) = moved(&k3, h);
        let k4 = stage(&sides, &at, &delayed[2]);
        let mut next = *s;
        (0..6).for_each(|i| next[i] = next[i] + (k1.1[i] + (k2.1[i] + k3.1[i]) * 2.0 + k4.1[i]) * (h / 6.0));
        for (j, side) in self.sides.iter_mut().enumerate() {
            let [a, b, c, d] = [&k1, &k2, &k3, &k4].map(|k| &k.0.states[j]);
            (0..6).for_each(|i| side[i] = side[i] + (a[i] + (b[i] + c[i]) * 2.0 + d[i]) * (h / 6.0));
        }
        self.acceleration = acceleration;
        self.line.push(k1.0.tubes);
        self.line.push(k3.0.tubes);
        next
    }
}
