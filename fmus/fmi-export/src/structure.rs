//! Dependencies between variables: the content of `ModelStructure`, found by differentiating the equations.
//!
//! Nothing is typed by hand. At several points (the draws of [`Model::probe`]) each known is seeded with a dual
//! number, and each is also moved on its own, which shows what no derivative shows: dependencies of and on
//! Booleans, Integers and Strings, and those through a branch only.

use crate::dual::Dual;
use crate::model::Model;
use crate::scalar::Scalar;
use crate::table::{Causality, Initial, Kind, Table, Variability, Variable};
use crate::values::{Interface, Values};

/// Number of points of [`Model::probe`] that are looked at.
pub const DRAWS: usize = 4;

/// FMI `dependenciesKind`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DependencyKind {
    /// No particular structure.
    Dependent,
    /// A factor that never changes.
    Constant,
    /// A factor that depends on fixed parameters.
    Fixed,
    /// A factor that depends on tunable parameters.
    Tunable,
    /// A factor that changes at samples.
    Discrete,
}

/// One computed variable with the knowns that it depends on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unknown {
    /// Index into [`Table::variables`] (0-based).
    pub variable: usize,
    /// Index (0-based) and kind of every known that matters, in order of the index.
    pub dependencies: Vec<(usize, DependencyKind)>,
}

/// `ModelStructure` of the model description.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Structure {
    /// All outputs in table order; knowns are the inputs and the continuous states.
    pub outputs: Vec<Unknown>,
    /// State derivatives in the order of the states; same knowns.
    pub derivatives: Vec<Unknown>,
    /// Unknowns that initialization computes (FMI 2.0.4 section 2.2.8), in table order; knowns are inputs, states and
    /// parameters.
    pub initial_unknowns: Vec<Unknown>,
}

impl Structure {
    /// Finds the dependencies of a model, in both interfaces.
    ///
    /// # Panics
    /// If the equations refuse every draw: an error of the model's author, whose `probe` must give at least one
    /// point where they have a value.
    pub fn of<M: Model>(model: &M, table: &Table) -> Self {
        let variables = table.variables();
        let indices = |wanted: &dyn Fn(&Variable) -> bool| -> Vec<usize> {
            (0..variables.len()).filter(|i| wanted(&variables[*i])).collect()
        };
        let outputs = indices(&|v| v.causality == Causality::Output);
        let derivatives: Vec<usize> = table.derivatives().iter().map(|d| table.index_of(*d)).collect();
        let initial_unknowns = indices(&|v| {
            v.initial == Some(Initial::Calculated)
                && (v.causality == Causality::Output
                    || v.causality == Causality::CalculatedParameter
                    || v.is_state
                    || v.derivative_of().is_some())
        });
        let input_or_state = |v: &Variable| v.causality == Causality::Input || v.is_state;
        let knowns = indices(&input_or_state);
        let initial_knowns =
            indices(&|v| (input_or_state(v) && !v.is_computed()) || v.causality == Causality::Parameter);

        let search = Search { model, table, draws: draws(model, table) };
        let both: Vec<usize> = outputs.iter().chain(&derivatives).copied().collect();
        let mut running = search.run(&both, &knowns, Phase::Running);
        let derivatives = running.split_off(outputs.len());
        let initial_unknowns = search.run(&initial_unknowns, &initial_knowns, Phase::Initialization);
        Self { outputs: running, derivatives, initial_unknowns }
    }
}

/// Mode in which the dependencies hold.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// Parameters stand still.
    Running,
    /// Parameters are knowns, too; the first sample has not been taken.
    Initialization,
}

fn draws<M: Model>(model: &M, table: &Table) -> Vec<Values<f64>> {
    (0..DRAWS)
        .map(|draw| {
            let mut values = table.start_values(Interface::ModelExchange);
            model.probe(draw, table, &mut values);
            values
        })
        .collect()
}

/// Parts of the way to another draw, also the other way, that are tried until the equations have a value there.
const PARTS_OF_A_STEP: [f64; 3] = [1.0, 1e-2, -1e-2];

/// A place where the equations have a value.
struct Point {
    /// Draws of the fixed parameters, the tunable ones, and the rest.
    fixed: usize,
    tunable: usize,
    rest: usize,
    /// Before the equations, derived parameters in place.
    base: Values<f64>,
    /// After the equations.
    value: Values<f64>,
}

/// Slope of one unknown with respect to one known at one point; NaN where it is not a straight line.
struct Slope {
    point: usize,
    slope: f64,
}

struct Search<'m, M> {
    model: &'m M,
    table: &'m Table,
    draws: Vec<Values<f64>>,
}

impl<M: Model> Search<'_, M> {
    fn run(&self, unknowns: &[usize], knowns: &[usize], phase: Phase) -> Vec<Unknown> {
        let points = self.points(phase);
        assert!(
            !points.is_empty(),
            "{}: the equations refuse every draw of probe(); let it give a point where they have a value",
            M::IDENTITY.model_name
        );
        let mut found: Vec<Unknown> =
            unknowns.iter().map(|&variable| Unknown { variable, dependencies: Vec::new() }).collect();
        let mut dual: Values<Dual> = self.draws[0].convert();
        let mut moved = self.draws[0].clone();
        for &known in knowns {
            let known_variable = &self.table.variables()[known];
            let mut slopes: Vec<Vec<Slope>> = unknowns.iter().map(|_| Vec::new()).collect();
            for (i, point) in points.iter().enumerate() {
                let seeded = self.seed(known_variable, point, &mut dual, phase);
                let step = self.step(known_variable, point, &mut moved, phase);
                for (&unknown, slopes) in unknowns.iter().zip(&mut slopes) {
                    let slope = match self.table.variables()[unknown].real() {
                        Some(y) if seeded => {
                            let [slope] = dual[y].eps;
                            let straight =
                                step.is_none_or(|s| is_straight(point.value[y], moved[y], slope, s));
                            if straight { slope } else { f64::NAN }
                        }
                        _ if step.is_some() && self.differs(unknown, &point.value, &moved) => f64::NAN,
                        _ => 0.0,
                    };
                    slopes.push(Slope { point: i, slope });
                }
            }
            for (unknown, slopes) in found.iter_mut().zip(&slopes) {
                if let Some(kind) = classify(slopes, &points, phase) {
                    unknown.dependencies.push((known, kind));
                }
            }
        }
        found
    }

    /// Combines the draws so that fixed parameters, tunable parameters and the rest change one without the other.
    fn points(&self, phase: Phase) -> Vec<Point> {
        let mut points = Vec::new();
        let has_tunable = self.table.variables().iter().any(|v| v.variability == Variability::Tunable);
        for interface in [Interface::ModelExchange, Interface::CoSimulation] {
            for draw in 0..DRAWS {
                let next = (draw + 1) % DRAWS;
                let mut combinations = vec![(draw, draw)];
                if phase == Phase::Running {
                    combinations.push((draw, next));
                    if has_tunable {
                        combinations.push((next, draw));
                    }
                }
                for (tunable, rest) in combinations {
                    for at_sample in [true, false] {
                        let mut base = self.combine(draw, tunable, rest);
                        base.interface = interface;
                        base.at_sample = at_sample;
                        if phase == Phase::Initialization && !at_sample {
                            continue;
                        }
                        if self.model.prepare(&mut base).is_err() || !self.initialize(&mut base, phase) {
                            continue;
                        }
                        let mut value = base.clone();
                        if self.model.equations(&mut value).is_ok() {
                            points.push(Point { fixed: draw, tunable, rest, base, value });
                        }
                    }
                }
            }
        }
        points
    }

    fn combine(&self, fixed: usize, tunable: usize, rest: usize) -> Values<f64> {
        let mut values = self.draws[rest].clone();
        for variable in self.table.variables().iter().filter(|v| v.causality == Causality::Parameter) {
            let draw = if variable.variability == Variability::Tunable { tunable } else { fixed };
            copy_variable(variable, &self.draws[draw], &mut values);
        }
        values
    }

    /// Computes initial states where they are still to be found.
    fn initialize<S: Scalar>(&self, values: &mut Values<S>, phase: Phase) -> bool {
        phase == Phase::Running || self.model.initialize(values).is_ok()
    }

    /// Evaluates with one known changed; only a parameter asks for new derived parameters.
    fn evaluate<S: Scalar>(&self, known: &Variable, values: &mut Values<S>, phase: Phase) -> bool {
        (known.causality != Causality::Parameter || self.model.prepare(values).is_ok())
            && self.initialize(values, phase)
            && self.model.equations(values).is_ok()
    }

    /// Derivatives with respect to a Real known; false where there are none.
    fn seed(&self, known: &Variable, point: &Point, dual: &mut Values<Dual>, phase: Phase) -> bool {
        let Some(x) = known.real() else { return false };
        dual.copy_from_f64(&point.base);
        dual[x].eps = [1.0];
        self.evaluate(known, dual, phase)
    }

    /// Values with the known moved to where another draw has it, or part of the way where the equations refuse the
    /// whole; gives the distance (1 for what is not Real).
    fn step(&self, known: &Variable, point: &Point, moved: &mut Values<f64>, phase: Phase) -> Option<f64> {
        let from = if known.causality == Causality::Parameter { point.fixed } else { point.rest };
        let parts: &[f64] = if known.real().is_some() { &PARTS_OF_A_STEP } else { &[1.0] };
        parts.iter().find_map(|part| {
            moved.copy_from(&point.base);
            match &known.kind {
                Kind::Boolean { handle, .. } => moved[*handle] = !moved[*handle],
                Kind::Text { handle, .. } => moved[*handle].push('x'),
                _ => copy_variable(known, &self.draws[(from + 1) % DRAWS], moved),
            }
            let distance = known.real().map_or(1.0, |x| {
                // The whole way ends at the very value of the draw.
                if *part != 1.0 {
                    moved[x] = point.base[x] + part * (moved[x] - point.base[x]);
                }
                moved[x] - point.base[x]
            });
            (distance != 0.0 && self.evaluate(known, moved, phase)).then_some(distance)
        })
    }

    fn differs(&self, unknown: usize, a: &Values<f64>, b: &Values<f64>) -> bool {
        match &self.table.variables()[unknown].kind {
            Kind::Real { handle, .. } => a[*handle].to_bits() != b[*handle].to_bits(),
            Kind::Integer { handle, .. } | Kind::Enumeration { handle, .. } => a[*handle] != b[*handle],
            Kind::Boolean { handle, .. } => a[*handle] != b[*handle],
            Kind::Text { handle, .. } => a[*handle] != b[*handle],
        }
    }
}

fn copy_variable(variable: &Variable, from: &Values<f64>, to: &mut Values<f64>) {
    match &variable.kind {
        Kind::Real { handle, .. } => to[*handle] = from[*handle],
        Kind::Integer { handle, .. } | Kind::Enumeration { handle, .. } => to[*handle] = from[*handle],
        Kind::Boolean { handle, .. } => to[*handle] = from[*handle],
        Kind::Text { handle, .. } => to[*handle].clone_from(&from[*handle]),
    }
}

/// True where the slope alone explains the way from `y0` to `y1`.
fn is_straight(y0: f64, y1: f64, slope: f64, step: f64) -> bool {
    if y0.is_nan() && y1.is_nan() {
        return slope == 0.0;
    }
    let explained = slope * step;
    let scale = y0.abs().max(y1.abs()).max(explained.abs());
    (y1 - y0 - explained).abs() <= 1e-9 * scale
}

/// The most particular kind that all slopes agree with; none where nothing depends.
fn classify(slopes: &[Slope], points: &[Point], phase: Phase) -> Option<DependencyKind> {
    if slopes.iter().all(|s| s.slope == 0.0) {
        return None;
    }
    let agree = |same: &dyn Fn(&Point, &Point) -> bool| {
        slopes.iter().enumerate().all(|(i, a)| {
            slopes[..=i].iter().all(|b| {
                !same(&points[a.point], &points[b.point])
                    || (a.slope - b.slope).abs() <= 1e-9 * a.slope.abs().max(b.slope.abs())
            })
        })
    };
    let instance = |a: &Point, b: &Point| a.fixed == b.fixed && a.base.interface == b.base.interface;
    Some(if agree(&|_, _| true) {
        DependencyKind::Constant
    } else if phase == Phase::Initialization {
        // The other kinds are about what happens after initialization.
        DependencyKind::Dependent
    } else if agree(&instance) {
        DependencyKind::Fixed
    } else if agree(&|a, b| instance(a, b) && a.tunable == b.tunable) {
        DependencyKind::Tunable
    } else if agree(&|a, b| instance(a, b) && a.tunable == b.tunable && a.base.at_sample == b.base.at_sample)
    {
        DependencyKind::Discrete
    } else {
        DependencyKind::Dependent
    })
}

#[cfg(test)]
mod tests {
    use super::DependencyKind::{Constant, Dependent, Discrete, Fixed, Tunable};
    use super::*;
    use crate::{Boolean, Identity, Outcome, Real};

    /// One output for each kind of dependency.
    struct Zoo {
        u: Real,
        w: Real,
        flag: Boolean,
        k: Real,
        t: Real,
        x: Real,
        der_x: Real,
        y: [Real; 7],
        above: Boolean,
        half_k: Real,
    }

    impl Model for Zoo {
        const IDENTITY: Identity = Identity {
            model_identifier: "zoo",
            model_name: "zoo",
            description: "one output for each kind of dependency",
            version: "1",
            author: "me",
            generation_tool: "test",
            stop_time: 1.0,
            step_size: 0.1,
        };
        fn declare(t: &mut Table) -> Self {
            let u = t.input("u").real(0.0);
            let w = t.input("w").real(0.0);
            let flag = t.input("flag").boolean(false);
            let k = t.parameter("k").real(2.0);
            let tunable = t.tunable("t").real(3.0);
            let x = t.state("x").output().real(0.5);
            let der_x = t.derivative("der(x)", x).computed();
            let y = ["y_constant", "y_fixed", "y_tunable", "y_square", "y_sample", "y_branch", "y_none"]
                .map(|name| t.output(name).computed());
            let above = t.output("above").computed_boolean();
            let half_k = t.calculated("half_k").computed();
            Self { u, w, flag, k, t: tunable, x, der_x, y, above, half_k }
        }
        fn prepare<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
            q[self.half_k] = q[self.k] * 0.5;
            Ok(())
        }
        fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
            let (u, x) = (q[self.u], q[self.x]);
            q[self.der_x] = u - x * q[self.half_k];
            q[self.y[0]] = x * 4.0 + 1.0;
            q[self.y[1]] = q[self.k] * u;
            q[self.y[2]] = q[self.k] * q[self.t] * u;
            q[self.y[3]] = u * u + q[self.w];
            q[self.y[4]] = if q.at_sample { u * 2.0 } else { S::zero() };
            // No derivative shows either of these two.
            q[self.y[5]] = S::from(if q[self.flag] { 1.0 } else { 0.0 })
                + S::from(if q[self.w].value() > 0.0 { 1.0 } else { 0.0 });
            q[self.y[6]] = S::from(7.0);
            q[self.above] = u.value() > 0.0;
            Ok(())
        }
    }

    fn named(table: &Table, unknowns: &[Unknown]) -> Vec<(String, Vec<(String, DependencyKind)>)> {
        let name = |i: usize| table.variables()[i].name.clone();
        let list = |u: &Unknown| u.dependencies.iter().map(|(i, kind)| (name(*i), *kind)).collect();
        unknowns.iter().map(|u| (name(u.variable), list(u))).collect()
    }

    fn expected<'a>(
        rows: &[(&str, &'a [(&'a str, DependencyKind)])],
    ) -> Vec<(String, Vec<(String, DependencyKind)>)> {
        let list = |l: &[(&str, DependencyKind)]| l.iter().map(|(n, k)| ((*n).to_owned(), *k)).collect();
        rows.iter().map(|(name, l)| ((*name).to_owned(), list(l))).collect()
    }

    #[test]
    fn kinds_follow_from_what_the_factor_depends_on() {
        let (model, table) = Table::of::<Zoo>();
        let structure = Structure::of(&model, &table);
        assert_eq!(
            named(&table, &structure.outputs),
            expected(&[
                ("x", &[("x", Constant)]),
                ("y_constant", &[("x", Constant)]),
                ("y_fixed", &[("u", Fixed)]),
                ("y_tunable", &[("u", Tunable)]),
                ("y_square", &[("u", Dependent), ("w", Constant)]),
                ("y_sample", &[("u", Discrete)]),
                ("y_branch", &[("w", Dependent), ("flag", Dependent)]),
                ("y_none", &[]),
                ("above", &[("u", Dependent)]),
            ])
        );
        assert_eq!(
            named(&table, &structure.derivatives),
            expected(&[("der(x)", &[("u", Constant), ("x", Fixed)])])
        );
    }

    #[test]
    fn initial_unknowns_are_what_initialization_computes() {
        let (model, table) = Table::of::<Zoo>();
        let structure = Structure::of(&model, &table);
        // x is an output, too, but its start value is exact.
        assert_eq!(
            named(&table, &structure.initial_unknowns),
            expected(&[
                ("der(x)", &[("u", Constant), ("k", Dependent), ("x", Dependent)]),
                ("y_constant", &[("x", Constant)]),
                ("y_fixed", &[("u", Dependent), ("k", Dependent)]),
                ("y_tunable", &[("u", Dependent), ("k", Dependent), ("t", Dependent)]),
                ("y_square", &[("u", Dependent), ("w", Constant)]),
                ("y_sample", &[("u", Constant)]),
                ("y_branch", &[("w", Dependent), ("flag", Dependent)]),
                ("y_none", &[]),
                ("above", &[("u", Dependent)]),
                ("half_k", &[("k", Constant)]),
            ])
        );
    }
}
