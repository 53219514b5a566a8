//! Defects of one interval with derivatives, for every transcription: functions of the variables at its ends.

use airloop_testing::mechanics::{
    AD, Accelerations, BD, FEED, SAMPLE, accelerations, actuator_flow, continuous_actuator,
};

/// Most variables of an interval: state, command, midpoint command; state and command of the next node.
pub const WIDTH: usize = 15;
pub type Row = [f64; WIDTH];

/// Defects with their Jacobian; the Hessian of a weighted sum is added on demand.
pub trait Interval {
    /// Defects and Jacobian at the variables of the interval.
    fn defects(&self, x: &Row, jacobian: Option<&mut [Row; 6]>) -> [f64; 6];
    /// Hessian of `weight . defects`.
    fn hessian(&self, x: &Row, weight: [f64; 6]) -> [Row; WIDTH];
}

fn unit(i: usize) -> Row {
    let mut row = [0.0; WIDTH];
    row[i] = 1.0;
    row
}

fn dot(a: &Row, b: &Row) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add(target: &mut Row, factor: f64, row: &Row) {
    target.iter_mut().zip(row).for_each(|(t, r)| *t += factor * r);
}

/// Adds G^T H G.
fn add_congruence(sum: &mut [Row; WIDTH], h: &[[f64; 4]; 4], g: &[Row; 4], width: usize) {
    for i in 0..4 {
        let mut product = [0.0; WIDTH];
        for j in 0..4 {
            if h[i][j] != 0.0 {
                add(&mut product, h[i][j], &g[j]);
            }
        }
        for a in 0..width {
            if g[i][a] != 0.0 {
                add(&mut sum[a], g[i][a], &product);
            }
        }
    }
}

/// Collocation of the mechanics; the force and the actuator are linear in the variables of the interval.
pub struct Collocation {
    h: f64,
    /// Trapezoidal without, Hermite-Simpson with the midpoint.
    simpson: bool,
    /// Force at the beginning, in the middle and at the end.
    forces: [Row; 3],
    /// Defects of the actuator states.
    actuator: [Row; 2],
    /// Place of the second node's state.
    next: usize,
    width: usize,
}

impl Collocation {
    /// The actuator collocated as well. With `simpson`: y, u, um, y', u'; without: y, u, y', u'.
    pub fn of_actuator(h: f64, simpson: bool) -> Self {
        let next = if simpson { 8 } else { 7 };
        let (ac, bc) = continuous_actuator();
        let slope = |at: [&Row; 3]| {
            [0, 1].map(|i| {
                let mut row = [0.0; WIDTH];
                add(&mut row, ac[i][0], at[0]);
                add(&mut row, ac[i][1], at[1]);
                add(&mut row, bc[i], at[2]);
                row
            })
        };
        let (a, b) = ([4, 5, 6].map(unit), [4, 5, 6].map(|i| unit(next + i)));
        let (fa, fb) = (slope(a.each_ref()), slope(b.each_ref()));
        let mut middle = [[0.0; WIDTH]; 2];
        for i in 0..2 {
            add(&mut middle[i], 0.5, &a[i]);
            add(&mut middle[i], 0.5, &b[i]);
            add(&mut middle[i], h / 8.0, &fa[i]);
            add(&mut middle[i], -h / 8.0, &fb[i]);
        }
        let um = unit(7);
        let fm = slope([&middle[0], &middle[1], &um]);
        let actuator = [0, 1].map(|i| {
            let mut row = b[i];
            add(&mut row, -1.0, &a[i]);
            let weights = if simpson { [h / 6.0, 4.0 * h / 6.0] } else { [h / 2.0, 0.0] };
            add(&mut row, -weights[0], &fa[i]);
            add(&mut row, -weights[0], &fb[i]);
            add(&mut row, -weights[1], &fm[i]);
            row
        });
        let force = |z: &Row, u: &Row| {
            let mut row = *z;
            add(&mut row, FEED, u);
            row
        };
        let forces = [force(&a[1], &a[2]), force(&middle[1], &um), force(&b[1], &b[2])];
        Self { h, simpson, forces, actuator, next, width: next + 7 }
    }

    /// Shooting plus collocation: y, u, y', the command constant.
    pub fn of_mechanics(h: f64) -> Self {
        let next = 7;
        let flow = |t: f64| {
            actuator_flow(t).map(|row| {
                let mut out = [0.0; WIDTH];
                out[4..7].copy_from_slice(&row);
                out
            })
        };
        let force = |z: Row| {
            let mut row = z;
            row[6] += FEED;
            row
        };
        let (half, full) = (flow(0.5 * h), flow(h));
        let actuator = [0, 1].map(|i| {
            let mut row = unit(next + 4 + i);
            add(&mut row, -1.0, &full[i]);
            row
        });
        let forces = [force(unit(5)), force(half[1]), force(full[1])];
        Self { h, simpson: true, forces, actuator, next, width: 13 }
    }

    fn end(&self, x: &Row, second: bool) -> Accelerations {
        let at = if second { self.next } else { 0 };
        let force = &self.forces[if second { 2 } else { 0 }];
        accelerations([x[at + 1], x[at + 2], x[at + 3], dot(force, x)])
    }

    /// q at an end as functions of the variables.
    fn end_rows(&self, second: bool) -> [Row; 4] {
        let at = if second { self.next } else { 0 };
        [unit(at + 1), unit(at + 2), unit(at + 3), self.forces[if second { 2 } else { 0 }]]
    }

    /// Gradient rows of (v, w, dv, dw) at an end.
    fn slopes(&self, ends: &Accelerations, second: bool) -> [Row; 4] {
        let g = self.end_rows(second);
        let of = |i: usize| {
            let mut row = [0.0; WIDTH];
            (0..4).for_each(|j| add(&mut row, ends.gradient[i][j], &g[j]));
            row
        };
        [g[1], g[2], of(0), of(1)]
    }

    /// q in the middle.
    fn middle(&self, x: &Row, fa: &Accelerations, fb: &Accelerations) -> [f64; 4] {
        let n = self.next;
        let rates = [[x[3], x[n + 3]], [fa.value[0], fb.value[0]], [fa.value[1], fb.value[1]]];
        let s =
            [0, 1, 2].map(|i| 0.5 * (x[i + 1] + x[n + i + 1]) + self.h / 8.0 * (rates[i][0] - rates[i][1]));
        [s[0], s[1], s[2], dot(&self.forces[1], x)]
    }

    fn middle_rows(&self, ga: &[Row; 4], gb: &[Row; 4]) -> [Row; 4] {
        let mut rows = [[0.0; WIDTH]; 4];
        for i in 0..3 {
            rows[i][i + 1] = 0.5;
            rows[i][self.next + i + 1] = 0.5;
            add(&mut rows[i], self.h / 8.0, &ga[i + 1]);
            add(&mut rows[i], -self.h / 8.0, &gb[i + 1]);
        }
        rows[3] = self.forces[1];
        rows
    }

    fn weights(&self) -> [f64; 2] {
        if self.simpson { [self.h / 6.0, 4.0 * self.h / 6.0] } else { [self.h / 2.0, 0.0] }
    }
}

impl Interval for Collocation {
    fn defects(&self, x: &Row, jacobian: Option<&mut [Row; 6]>) -> [f64; 6] {
        let n = self.next;
        let (fa, fb) = (self.end(x, false), self.end(x, true));
        let [we, wm] = self.weights();
        let rates = |v: f64, w: f64, f: &Accelerations| [v, w, f.value[0], f.value[1]];
        let (ra, rb) = (rates(x[2], x[3], &fa), rates(x[n + 2], x[n + 3], &fb));
        let mut out = [0.0; 6];
        for i in 0..4 {
            out[i] = x[n + i] - x[i] - we * (ra[i] + rb[i]);
        }
        out[4] = dot(&self.actuator[0], x);
        out[5] = dot(&self.actuator[1], x);
        let fm = self.simpson.then(|| {
            let q = self.middle(x, &fa, &fb);
            (q, accelerations(q))
        });
        if let Some((q, fm)) = &fm {
            let rm = rates(q[1], q[2], fm);
            (0..4).for_each(|i| out[i] -= wm * rm[i]);
        }
        if let Some(jacobian) = jacobian {
            let (ga, gb) = (self.slopes(&fa, false), self.slopes(&fb, true));
            for i in 0..4 {
                jacobian[i] = [0.0; WIDTH];
                jacobian[i][i] = -1.0;
                jacobian[i][n + i] = 1.0;
                add(&mut jacobian[i], -we, &ga[i]);
                add(&mut jacobian[i], -we, &gb[i]);
            }
            jacobian[4..].copy_from_slice(&self.actuator);
            if let Some((_, fm)) = &fm {
                let g = self.middle_rows(&ga, &gb);
                add(&mut jacobian[0], -wm, &g[1]);
                add(&mut jacobian[1], -wm, &g[2]);
                for i in 0..2 {
                    (0..4).for_each(|j| add(&mut jacobian[2 + i], -wm * fm.gradient[i][j], &g[j]));
                }
            }
        }
        out
    }

    fn hessian(&self, x: &Row, weight: [f64; 6]) -> [Row; WIDTH] {
        let (fa, fb) = (self.end(x, false), self.end(x, true));
        let [we, wm] = self.weights();
        let mut sum = [[0.0; WIDTH]; WIDTH];
        let mut of_ends = [[-we * weight[2], -we * weight[3]]; 2];
        if self.simpson {
            let fm = accelerations(self.middle(x, &fa, &fb));
            let mu = [0, 1, 2, 3].map(|i| -wm * weight[i]);
            // Adjoint of (v, w) in the middle, through which the accelerations at the ends enter.
            for (i, extra) in [(0, mu[0]), (1, mu[1])] {
                let adjoint = extra + mu[2] * fm.gradient[0][i + 1] + mu[3] * fm.gradient[1][i + 1];
                of_ends[0][i] += self.h / 8.0 * adjoint;
                of_ends[1][i] -= self.h / 8.0 * adjoint;
            }
            let g = self.middle_rows(&self.slopes(&fa, false), &self.slopes(&fb, true));
            add_congruence(&mut sum, &fm.hessian([mu[2], mu[3]]), &g, self.width);
        }
        add_congruence(&mut sum, &fa.hessian(of_ends[0]), &self.end_rows(false), self.width);
        add_congruence(&mut sum, &fb.hessian(of_ends[1]), &self.end_rows(true), self.width);
        sum
    }
}

/// Multiple shooting on the sampled system: y, u, y'; the force is held within a sample.
pub struct Shooting {
    samples: usize,
}

/// Intermediate results of one evaluation of the mechanics in the roll-out.
struct Stage {
    at: Accelerations,
    /// q as functions of (y, u).
    rows: [Row; 4],
}

impl Shooting {
    pub fn new(samples: usize) -> Self {
        Self { samples }
    }

    /// State at the end, its Jacobian, and the stages where derivatives are wanted.
    fn roll(&self, x: &Row, derivatives: bool) -> ([f64; 6], [Row; 6], Vec<Stage>) {
        let mut y: [f64; 6] = x[..6].try_into().expect("six states");
        let u = x[6];
        let mut rows = [0, 1, 2, 3, 4, 5].map(unit);
        let mut stages = Vec::with_capacity(if derivatives { 4 * self.samples } else { 0 });
        for _ in 0..self.samples {
            let force = y[5] + FEED * u;
            let mut force_row = rows[5];
            force_row[6] += FEED;
            let (start, start_rows) = (y, rows);
            let (mut at, mut at_rows) = (start, start_rows);
            for (part, weight) in [(0.5, 1.0), (0.5, 2.0), (1.0, 2.0), (0.0, 1.0)] {
                let f = accelerations([at[1], at[2], at[3], force]);
                let rate = [at[2], at[3], f.value[0], f.value[1]];
                let q = [at_rows[1], at_rows[2], at_rows[3], force_row];
                for i in 0..4 {
                    y[i] += SAMPLE / 6.0 * weight * rate[i];
                    at[i] = start[i] + SAMPLE * part * rate[i];
                }
                if derivatives {
                    let mut slopes = [at_rows[2], at_rows[3], [0.0; WIDTH], [0.0; WIDTH]];
                    for i in 0..2 {
                        (0..4).for_each(|j| add(&mut slopes[2 + i], f.gradient[i][j], &q[j]));
                    }
                    for i in 0..4 {
                        add(&mut rows[i], SAMPLE / 6.0 * weight, &slopes[i]);
                        at_rows[i] = start_rows[i];
                        add(&mut at_rows[i], SAMPLE * part, &slopes[i]);
                    }
                    stages.push(Stage { at: f, rows: q });
                }
            }
            let z = [y[4], y[5]];
            for i in 0..2 {
                y[4 + i] = AD[i][0] * z[0] + AD[i][1] * z[1] + BD[i] * u;
                let mut row = [0.0; WIDTH];
                add(&mut row, AD[i][0], &start_rows[4]);
                add(&mut row, AD[i][1], &start_rows[5]);
                row[6] += BD[i];
                rows[4 + i] = row;
            }
        }
        (y, rows, stages)
    }
}

impl Interval for Shooting {
    fn defects(&self, x: &Row, jacobian: Option<&mut [Row; 6]>) -> [f64; 6] {
        let (end, rows, _) = self.roll(x, jacobian.is_some());
        if let Some(jacobian) = jacobian {
            for i in 0..6 {
                jacobian[i] = unit(7 + i);
                add(&mut jacobian[i], -1.0, &rows[i]);
            }
        }
        [0, 1, 2, 3, 4, 5].map(|i| x[7 + i] - end[i])
    }

    fn hessian(&self, x: &Row, weight: [f64; 6]) -> [Row; WIDTH] {
        let (_, _, stages) = self.roll(x, true);
        let mut sum = [[0.0; WIDTH]; WIDTH];
        // Adjoint of the state, backwards through the samples and their four stages.
        let mut adjoint = weight.map(|w| -w);
        for sample in stages.chunks(4).rev() {
            let mut of_force = 0.0;
            let mut state = [adjoint[0], adjoint[1], adjoint[2], adjoint[3]];
            let end = state;
            // Adjoint of the point at which the following stage was evaluated.
            let mut later = [0.0; 4];
            for (stage, (part, weight)) in
                sample.iter().zip([(0.5, 1.0), (0.5, 2.0), (1.0, 2.0), (0.0, 1.0)]).rev()
            {
                let rate = [0, 1, 2, 3].map(|i| SAMPLE / 6.0 * weight * end[i] + SAMPLE * part * later[i]);
                let g = &stage.at.gradient;
                let back = |j: usize| rate[2] * g[0][j] + rate[3] * g[1][j];
                later = [0.0, back(0), rate[0] + back(1), rate[1] + back(2)];
                of_force += back(3);
                (0..4).for_each(|i| state[i] += later[i]);
                add_congruence(&mut sum, &stage.at.hessian([rate[2], rate[3]]), &stage.rows, 7);
            }
            let z = [adjoint[4], adjoint[5]];
            adjoint = [
                state[0],
                state[1],
                state[2],
                state[3],
                AD[0][0] * z[0] + AD[1][0] * z[1],
                AD[0][1] * z[0] + AD[1][1] * z[1] + of_force,
            ];
        }
        sum
    }
}
