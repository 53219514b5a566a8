//! A phase made discrete, without its dynamics: variables, functions, constraints and where everything lies.

use super::dynamics::Dynamics;
use super::error::Error;
use super::functions::{Combination, Functions};
use super::layout::Layout;
use super::linear;
use super::mesh::Mesh;
use super::problem::{Duration, Limit, LimitPlace, Path, Phase, Place, Shooting};
use super::scheme::{Collocation, MultipleShooting, Scheme, ShootingCollocation};
use super::{Transcription, check};

/// A constraint that is linear in the variables of an interval.
#[derive(Debug, Clone)]
pub(super) struct Linear {
    /// Variables, from the first of the interval, with their factors.
    pub terms: Vec<(usize, f64)>,
    pub lower: f64,
    pub upper: f64,
    pub label: Label,
}

/// Subject of a constraint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Label {
    /// Number among the rate limits of the phase.
    Rate(usize),
    /// The duration is the same at both nodes.
    Duration,
}

pub(super) struct Part {
    pub name: String,
    /// Names of states, inputs, outputs, and their typical magnitudes.
    pub names: Vec<String>,
    pub nominals: Vec<f64>,
    pub layout: Layout,
    pub functions: Functions,
    pub scheme: Box<dyn Scheme>,
    /// Fractions of the knots, `[N + 1]`.
    pub fractions: Vec<f64>,
    /// Duration where it is fixed.
    pub duration: Duration,
    pub duration_weight: f64,
    /// Limits along the path (their number), at the start (theirs too) and at the end, with their combinations.
    pub paths: usize,
    pub starts: usize,
    /// Nodes at which each limit of the path holds, and intervals in whose middle it does.
    pub places: Vec<[Vec<usize>; 2]>,
    pub limits: Vec<Limit>,
    pub combinations: Vec<Combination>,
    /// Names and units of the rate limits.
    pub rates: Vec<(String, String)>,
    /// Limits that are constraints at every node, `[N + 1]`, and in the middle of every interval, `[N]`.
    pub node_rows: Vec<Vec<usize>>,
    pub middle_rows: Vec<Vec<usize>>,
    pub linear_rows: Vec<Vec<Linear>>,
    /// Whether the functions are needed at a node.
    pub evaluated: Vec<bool>,
    /// First constraint of every node and of every interval.
    pub node_constraints: Vec<usize>,
    pub interval_constraints: Vec<usize>,
    /// First constraint after the part.
    pub end_constraint: usize,
    /// First stage of the part.
    pub stage: usize,
}

impl Part {
    /// Makes a phase discrete. Its variables, constraints and stages begin at the given numbers.
    pub fn new(
        phase: &mut Phase,
        transcription: Transcription,
        mesh: &Mesh,
        [variable, constraint, stage]: [usize; 3],
    ) -> Result<Part, Error> {
        check::phase(phase)?;
        let dynamics: &mut dyn Dynamics = phase.dynamics[0].as_mut();
        let size = dynamics.size();
        let free = matches!(phase.duration, Duration::Free { .. });
        let (names, nominals) = (dynamics.names(), dynamics.nominals());
        let functions =
            Functions::new(dynamics.structure(), size, free, [&phase.integral, &phase.final_cost]);
        let scheme = scheme(phase, transcription, mesh)?;
        let layout = Layout {
            first: variable,
            intervals: mesh.intervals(),
            free: functions.free,
            states: size.states,
            inputs: size.inputs,
            middle: scheme.middle(size.states, size.inputs),
            held: scheme.held(),
        };
        let path = phase.paths.iter().map(|path| &path.limit);
        let limits: Vec<Limit> = path.chain(&phase.start).chain(&phase.end).cloned().collect();
        let combinations = limits.iter().map(|limit| functions.combination(&limit.quantity)).collect();
        let n = mesh.intervals();
        let mut part = Part {
            name: phase.name.clone(),
            names,
            nominals,
            paths: phase.paths.len(),
            starts: phase.start.len(),
            places: Vec::new(),
            layout,
            functions,
            scheme,
            fractions: mesh.fractions().to_vec(),
            duration: phase.duration,
            duration_weight: phase.duration_weight,
            limits,
            combinations,
            rates: phase.rates.iter().map(|rate| (rate.name.clone(), rate.unit.clone())).collect(),
            node_rows: vec![Vec::new(); n + 1],
            middle_rows: vec![Vec::new(); n],
            linear_rows: (0..n).map(|_| Vec::new()).collect(),
            evaluated: vec![false; n + 1],
            node_constraints: Vec::with_capacity(n + 1),
            interval_constraints: Vec::with_capacity(n),
            end_constraint: constraint,
            stage,
        };
        part.places = phase.paths.iter().map(|path| part.places(path)).collect();
        part.place_limits();
        part.place_rates(phase);
        part.number(constraint);
        Ok(part)
    }

    /// Length of interval `k` in the time of the mesh: seconds, or fractions where the duration is free.
    pub fn length(&self, k: usize) -> f64 {
        let fraction = self.fractions[k + 1] - self.fractions[k];
        match self.duration {
            Duration::Fixed(duration) => {
                let n = self.layout.intervals as f64;
                // Equal intervals have equal lengths to the last bit.
                if (fraction * n - 1.0).abs() < 1e-12 * n { duration / n } else { fraction * duration }
            }
            Duration::Free { .. } => fraction,
        }
    }

    /// Duration at the variables of the whole problem.
    pub fn duration_at(&self, x: &[f64]) -> f64 {
        match self.duration {
            Duration::Fixed(duration) => duration,
            Duration::Free { .. } => x[self.layout.first],
        }
    }

    /// Constraints of interval `k`: defects, limits in the middle, linear ones.
    pub fn interval_rows(&self, k: usize) -> usize {
        self.scheme.defects(self.layout.states) + self.middle_rows[k].len() + self.linear_rows[k].len()
    }

    /// Number of a limit among all of the phase.
    pub fn limit_number(&self, place: LimitPlace) -> Option<usize> {
        let (first, end, i) = match place {
            LimitPlace::Path(i) => (0, self.paths, i),
            LimitPlace::Start(i) => (self.paths, self.paths + self.starts, i),
            LimitPlace::End(i) => (self.paths + self.starts, self.limits.len(), i),
        };
        (i < end - first).then_some(first + i)
    }

    /// The limit as a bound of one argument of the functions: its number and factor.
    pub fn single(&self, limit: usize) -> Option<(usize, f64)> {
        let combination = &self.combinations[limit];
        match (&combination.arguments[..], &combination.values[..]) {
            (&[(argument, factor)], []) if factor != 0.0 => Some((argument, factor)),
            _ => None,
        }
    }

    /// Nodes at which a limit of the path holds, and intervals in whose middle it does.
    fn places(&self, path: &Path) -> [Vec<usize>; 2] {
        let inside = |s: f64| s >= path.window[0] - 1e-12 && s <= path.window[1] + 1e-12;
        let n = self.layout.intervals;
        let nodes = (0..=n).filter(|&k| path.place != Place::Midpoints && inside(self.fractions[k]));
        let middle = |k: usize| 0.5 * (self.fractions[k] + self.fractions[k + 1]);
        let has = self.scheme.midpoint().is_some() && path.place != Place::Nodes;
        let middles = (0..n).filter(|&k| has && inside(middle(k)));
        [nodes.collect(), middles.collect()]
    }

    /// Constraints for the limits that are not bounds of variables.
    fn place_limits(&mut self) {
        let n = self.layout.intervals;
        for path in 0..self.paths {
            let single = self.single(path);
            let [nodes, middles] = &self.places[path];
            if single.is_none() {
                nodes.iter().for_each(|&k| self.node_rows[k].push(path));
            }
            for &k in middles {
                if single.is_none_or(|(argument, _)| self.layout.midpoint(k, argument).is_none()) {
                    self.middle_rows[k].push(path);
                }
            }
        }
        let (paths, starts) = (self.paths, self.starts);
        for limit in paths..self.limits.len() {
            if self.single(limit).is_none() {
                self.node_rows[if limit < paths + starts { 0 } else { n }].push(limit);
            }
        }
        let [nodes, last] = self.scheme.needs_nodes();
        for k in 0..=n {
            let rows = self.node_rows[k].iter();
            let outputs = rows.clone().any(|&limit| !self.combinations[limit].values.is_empty());
            let ending = k == n && self.functions.has_ending();
            self.evaluated[k] = outputs || ending || if k == n { last } else { nodes };
        }
    }

    fn place_rates(&mut self, phase: &Phase) {
        let layout = self.layout;
        let free = layout.free == 1;
        let n = layout.intervals;
        for k in 0..n {
            let right = layout.stride();
            let length = self.length(k);
            if free {
                let terms = vec![(0, -1.0), (right, 1.0)];
                self.linear_rows[k].push(Linear { terms, lower: 0.0, upper: 0.0, label: Label::Duration });
            }
            for (number, rate) in phase.rates.iter().enumerate() {
                let input = layout.free + layout.states + rate.input;
                let combinations: Vec<Vec<(usize, f64)>> = if layout.held {
                    if k + 1 == n {
                        continue;
                    }
                    vec![vec![(input, -1.0), (right + input, 1.0)]]
                } else if layout.middle == 0 {
                    vec![vec![(input, -1.0), (right + input, 1.0)]]
                } else {
                    // Slopes of the parabola at both ends, between which its slope is linear.
                    let middle = right - layout.inputs + rate.input;
                    let slope = |a: f64, b: f64, c: f64| vec![(input, a), (middle, b), (right + input, c)];
                    vec![slope(-3.0, 4.0, -1.0), slope(1.0, -4.0, 3.0)]
                };
                for terms in combinations {
                    self.push_rate(k, terms, [rate.lower, rate.upper], length, Label::Rate(number));
                }
            }
        }
    }

    /// `lower <= terms / length <= upper`; where the duration is free it is the first variable of the interval.
    fn push_rate(
        &mut self,
        k: usize,
        terms: Vec<(usize, f64)>,
        [lower, upper]: [f64; 2],
        length: f64,
        label: Label,
    ) {
        let rows = &mut self.linear_rows[k];
        if self.layout.free == 0 {
            rows.push(Linear { terms, lower: lower * length, upper: upper * length, label });
            return;
        }
        let with = |rate: f64| terms.iter().copied().chain([(0, -rate * length)]).collect::<Vec<_>>();
        if lower.is_finite() {
            rows.push(Linear { terms: with(lower), lower: 0.0, upper: f64::INFINITY, label });
        }
        if upper.is_finite() {
            rows.push(Linear { terms: with(upper), lower: f64::NEG_INFINITY, upper: 0.0, label });
        }
    }

    fn number(&mut self, first: usize) {
        let mut next = first;
        for k in 0..=self.layout.intervals {
            self.node_constraints.push(next);
            next += self.node_rows[k].len();
            if k < self.layout.intervals {
                self.interval_constraints.push(next);
                next += self.interval_rows(k);
            }
        }
        self.end_constraint = next;
    }
}

fn scheme(phase: &mut Phase, transcription: Transcription, mesh: &Mesh) -> Result<Box<dyn Scheme>, Error> {
    Ok(match transcription {
        Transcription::Trapezoidal => Box::new(Collocation::trapezoidal()),
        Transcription::HermiteSimpson => Box::new(Collocation::compressed()),
        Transcription::HermiteSimpsonSeparated => Box::new(Collocation::separated()),
        Transcription::MultipleShooting => {
            let (states, simplified) = (phase.dynamics[0].size().states, phase.simplified_curvature);
            match &phase.shooting {
                Shooting::Steps(steps) => {
                    let steps = vec![*steps; mesh.intervals()];
                    Box::new(MultipleShooting::new(states, Default::default(), steps, simplified))
                }
                Shooting::Sampled { sample_time, .. } => {
                    let steps = linear::samples(phase, mesh, *sample_time)?;
                    let sample = linear::flow(phase, &linear::sampled_states(phase)?, *sample_time)?;
                    Box::new(MultipleShooting::new(states, sample, steps, simplified))
                }
            }
        }
        Transcription::ShootingCollocation => {
            let size = phase.dynamics[0].size();
            let linear = linear::sampled_states(phase)?;
            let flows = linear::flows(phase, &linear, mesh)?;
            Box::new(ShootingCollocation::new(size.states, linear, flows))
        }
    })
}
