//! The mechanics behind a pneumatic cylinder: both move in the same Runge-Kutta steps, since the cylinder feels its
//! piston.
//!
//! The two parts of the rig exchange force and motion after short times ([`Chambers::exchange`]): the cylinder steps
//! first, under the motion at the beginning, and the mechanics under the force at the end. Steps here are longer, so
//! the force is early, the motion late and the tube shorter by half of that time, as on average.

use super::cylinder::{Chambers, Rates, Side};
use super::lanes::{Lanes, each};
use super::plant::{Mechanics, State};

/// The load of a cylinder over a sample.
pub struct Load<'a, const L: usize> {
    /// Mechanics.
    pub plant: &'a Mechanics<L>,
    /// Magnitude of the pressure force \[N\].
    pub p: Lanes<L>,
    /// Loss of force on the piston with speed \[N s/m\].
    pub lost: Lanes<L>,
}

/// Cylinder and mechanics of several simulations.
pub struct Driven<'a, const L: usize> {
    chambers: &'a Chambers<L>,
    /// States of the cylinder.
    sides: [Side<L>; 2],
    play: [Lanes<L>; 2],
    /// Flows that entered the tubes, two entries per step.
    line: Vec<[Lanes<L>; 2]>,
    /// Acceleration \[m/s2\] of the last stage.
    acceleration: Lanes<L>,
    /// Half steps that the tubes delay, whole and part.
    back: [(usize, f64); L],
    /// Length of a step \[s\].
    h: f64,
}

impl<'a, const L: usize> Driven<'a, L> {
    /// At rest, before `steps` steps of `h` \[s\].
    pub fn new(chambers: &'a Chambers<L>, steps: usize, h: f64) -> Driven<'a, L> {
        let sides = chambers.rest();
        let play = [sides[0][0], sides[1][0]];
        let (delay, told) = (chambers.delay(), 0.5 * chambers.exchange());
        let back = delay.0.map(|delay| (delay - told).max(0.0) * 2.0 / h);
        Driven {
            chambers,
            sides,
            play,
            line: Vec::with_capacity(2 * steps + 2),
            acceleration: Lanes::default(),
            back: back.map(|back| (back.floor() as usize, back.fract())),
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
        // Nothing flowed before the start; a delay shorter than a step sees the last flow known.
        let at = |i: usize, lane: usize, back: usize| match (self.line.len() + half).checked_sub(back) {
            Some(index) => self.line.get(index).or(self.line.last()).map_or(0.0, |flows| flows[i].0[lane]),
            None => 0.0,
        };
        let of = |i: usize| {
            each(|lane| {
                let (whole, part) = self.back[lane];
                at(i, lane, whole) * (1.0 - part) + at(i, lane, whole + 1) * part
            })
        };
        [of(0), of(1)]
    }

    /// Rates of both parts in the states `sides` and `s`, under the flows `delayed` that leave the tubes; `late`: the
    /// acceleration \[m/s2\] of the stage before.
    #[inline(always)]
    fn stage(
        &self,
        (sides, s): (&[Side<L>; 2], &State<L>),
        delayed: &[Lanes<L>; 2],
        late: Lanes<L>,
        load: &Load<L>,
    ) -> (Rates<L>, State<L>) {
        let told = 0.5 * self.chambers.exchange();
        let motion = (s[0] - s[1] * told, s[1] - late * told);
        let rates = self.chambers.rates(sides, &self.play, delayed, motion);
        let force = self.chambers.piston_force(sides) + self.chambers.piston_force_rate(&rates) * told;
        let moved = load.plant.derivative(s, force - load.lost * s[1], load.p, Lanes::default());
        (rates, moved)
    }

    /// States after the time `h` \[s\] at the rates `k`.
    #[inline(always)]
    fn moved(&self, s: &State<L>, k: &(Rates<L>, State<L>), h: f64) -> ([Side<L>; 2], State<L>) {
        let (mut sides, mut next) = (self.sides, *s);
        for (side, rates) in sides.iter_mut().zip(&k.0.states) {
            (0..6).for_each(|i| side[i] = side[i] + rates[i] * h);
        }
        (0..6).for_each(|i| next[i] = next[i] + k.1[i] * h);
        (sides, next)
    }

    /// One step of order 4.
    #[inline(always)]
    pub fn step(&mut self, s: &State<L>, load: &Load<L>) -> State<L> {
        let h = self.h;
        let delayed = [self.delayed(0), self.delayed(1), self.delayed(2)];
        let k1 = self.stage((&self.sides, s), &delayed[0], self.acceleration, load);
        let (sides, at) = self.moved(s, &k1, 0.5 * h);
        let k2 = self.stage((&sides, &at), &delayed[1], k1.1[1], load);
        let (sides, at) = self.moved(s, &k2, 0.5 * h);
        let k3 = self.stage((&sides, &at), &delayed[1], k2.1[1], load);
        let (sides, at) = self.moved(s, &k3, h);
        let k4 = self.stage((&sides, &at), &delayed[2], k3.1[1], load);
        let mut next = *s;
        (0..6).for_each(|i| next[i] = next[i] + (k1.1[i] + (k2.1[i] + k3.1[i]) * 2.0 + k4.1[i]) * (h / 6.0));
        for (j, side) in self.sides.iter_mut().enumerate() {
            let (a, b) = (&k1.0.states[j], &k2.0.states[j]);
            let (c, d) = (&k3.0.states[j], &k4.0.states[j]);
            (0..6).for_each(|i| side[i] = side[i] + (a[i] + (b[i] + c[i]) * 2.0 + d[i]) * (h / 6.0));
        }
        self.acceleration = k4.1[1];
        self.line.push(k1.0.tubes);
        self.line.push(k3.0.tubes);
        next
    }
}
