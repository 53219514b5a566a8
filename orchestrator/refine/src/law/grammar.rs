//! Terms of formulas: an amplitude times shapes of one or two variables. Units follow from those of the variables.

use airloop_series::compound_unit;

/// A function of one variable `u`; its parameters in this order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// `u^n`
    Power(i32),
    /// `u - m`, beside a shape of another variable: alone it is a line and a constant
    Line,
    /// `abs(u)`
    Magnitude,
    /// `abs(u)*u`
    Square,
    /// `tanh(u/s)`: a sign, smooth over `s`
    Sign,
    /// `tanh((u - m)/w)`: a step at `m`
    Step,
    /// `exp(-((u - m)/w)^2)`
    Bump,
    /// `exp(-(u/w)^2)*tanh(u/s)`: a peak behind a change of sign
    Peak,
    /// `sin(q*u + p)`
    Sine,
    /// `exp(-u/w)`
    Decay,
    /// `max(0, u - m)`
    Above,
    /// `max(0, m - u)`
    Below,
    /// `max(0, u - m)^2`
    AboveSquared,
    /// `max(0, m - u)^2`
    BelowSquared,
    /// `sqrt(max(0, u - m))`, its amplitude within the root
    Root,
    /// `max(0, u - m)^1.5`, its amplitude within the root
    Weir,
}

impl Shape {
    /// Parameters with the sign of the exponent of the variable's unit: 1 as the variable, -1 its inverse, 0 a number.
    pub fn parameters(self) -> &'static [(&'static str, i32)] {
        match self {
            Shape::Power(_) | Shape::Magnitude | Shape::Square => &[],
            Shape::Sign => &[("s", 1)],
            Shape::Step | Shape::Bump => &[("m", 1), ("w", 1)],
            Shape::Peak => &[("w", 1), ("s", 1)],
            Shape::Sine => &[("q", -1), ("p", 0)],
            Shape::Decay => &[("w", 1)],
            Shape::Above | Shape::Below | Shape::AboveSquared | Shape::BelowSquared => &[("m", 1)],
            Shape::Line | Shape::Root | Shape::Weir => &[("m", 1)],
        }
    }

    /// Value for the variable and the parameters.
    pub fn value(self, u: f64, p: &[f64]) -> f64 {
        match self {
            Shape::Power(n) => u.powi(n),
            Shape::Line => u - p[0],
            Shape::Magnitude => u.abs(),
            Shape::Square => u.abs() * u,
            Shape::Sign => (u / p[0]).tanh(),
            Shape::Step => ((u - p[0]) / p[1]).tanh(),
            Shape::Bump => (-((u - p[0]) / p[1]).powi(2)).exp(),
            Shape::Peak => (-(u / p[0]).powi(2)).exp() * (u / p[1]).tanh(),
            Shape::Sine => (p[0] * u + p[1]).sin(),
            Shape::Decay => (-u / p[0]).exp(),
            Shape::Above => (u - p[0]).max(0.0),
            Shape::Below => (p[0] - u).max(0.0),
            Shape::AboveSquared => (u - p[0]).max(0.0).powi(2),
            Shape::BelowSquared => (p[0] - u).max(0.0).powi(2),
            Shape::Root => (u - p[0]).max(0.0).sqrt(),
            Shape::Weir => (u - p[0]).max(0.0).powf(1.5),
        }
    }

    /// Whether the amplitude stands within a root, so that its unit has whole powers.
    fn rooted(self) -> bool {
        matches!(self, Shape::Root | Shape::Weir)
    }

    /// Power of the variable's unit in the value; of its square where rooted.
    fn power(self) -> i32 {
        match self {
            Shape::Power(n) => n,
            Shape::Line | Shape::Magnitude | Shape::Above | Shape::Below | Shape::Root => 1,
            Shape::Square | Shape::AboveSquared | Shape::BelowSquared => 2,
            Shape::Weir => 3,
            _ => 0,
        }
    }

    /// Text over the name of a variable; parameters are numbered by `tag`.
    fn text(self, u: &str, tag: &str) -> String {
        match self {
            Shape::Power(1) => u.to_owned(),
            Shape::Power(n) => format!("{u}^{n}"),
            Shape::Line => format!("({u} - m{tag})"),
            Shape::Magnitude => format!("abs({u})"),
            Shape::Square => format!("abs({u})*{u}"),
            Shape::Sign => format!("tanh({u}/s{tag})"),
            Shape::Step => format!("tanh(({u} - m{tag})/w{tag})"),
            Shape::Bump => format!("exp(-(({u} - m{tag})/w{tag})^2)"),
            Shape::Peak => format!("exp(-({u}/w{tag})^2)*tanh({u}/s{tag})"),
            Shape::Sine => format!("sin(q{tag}*{u} + p{tag})"),
            Shape::Decay => format!("exp(-{u}/w{tag})"),
            Shape::Above | Shape::Root => format!("max(0, {u} - m{tag})"),
            Shape::Below => format!("max(0, m{tag} - {u})"),
            Shape::AboveSquared => format!("max(0, {u} - m{tag})^2"),
            Shape::BelowSquared => format!("max(0, m{tag} - {u})^2"),
            Shape::Weir => format!("max(0, {u} - m{tag})^3"),
        }
    }

    /// Parameters to start from, for a variable between two values.
    pub fn starts(self, (low, high): (f64, f64)) -> Vec<Vec<f64>> {
        let (span, size) = (high - low, low.abs().max(high.abs()));
        let at = |part: f64| low + part * span;
        let turn = std::f64::consts::TAU / span;
        let pairs = |a: &[f64], b: &[f64]| -> Vec<Vec<f64>> {
            a.iter().flat_map(|a| b.iter().map(move |b| vec![*a, *b])).collect()
        };
        match self {
            Shape::Power(_) | Shape::Magnitude | Shape::Square => vec![Vec::new()],
            Shape::Sign => [0.01, 0.05, 0.25].map(|part| vec![part * size]).into(),
            Shape::Step => pairs(&[0.2, 0.5, 0.8].map(at), &[0.05, 0.2].map(|part| part * span)),
            Shape::Bump => pairs(&[0.1, 0.3, 0.5, 0.7, 0.9].map(at), &[0.07, 0.2].map(|part| part * span)),
            Shape::Peak => pairs(&[0.05, 0.2].map(|part| part * size), &[0.01, 0.04].map(|part| part * size)),
            Shape::Sine => {
                let turns = [0.5, 1.0, 1.5, 2.0, 2.7, 3.5, 4.5, 6.0, 8.0, 10.0].map(|turns| turns * turn);
                pairs(&turns, &[0.0, 1.6])
            }
            Shape::Decay => [0.15, 0.5, 1.5].map(|part| vec![part * span]).into(),
            _ => [0.15, 0.35, 0.55, 0.75, 0.88].map(|part| vec![at(part)]).into(),
        }
    }
}

/// A shape of a variable, by its place among those of a formula.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Factor {
    /// Variable.
    pub variable: usize,
    /// Shape.
    pub shape: Shape,
}

/// An amplitude times factors.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// One or two.
    pub factors: Vec<Factor>,
}

impl Term {
    /// A shape of one variable.
    pub fn of(variable: usize, shape: Shape) -> Term {
        Term { factors: vec![Factor { variable, shape }] }
    }

    /// Parameters, the amplitude first.
    pub fn count(&self) -> usize {
        1 + self.factors.iter().map(|own| own.shape.parameters().len()).sum::<usize>()
    }

    /// How much it assumes.
    pub fn complexity(&self) -> usize {
        self.count() + self.factors.iter().filter(|own| own.shape != Shape::Power(0)).count()
    }

    /// Value without the amplitude; `p`: parameters of the shapes.
    pub fn shape(&self, at: &[f64], p: &[f64]) -> f64 {
        let (mut value, mut first) = (1.0, 0);
        for own in &self.factors {
            let count = own.shape.parameters().len();
            value *= own.shape.value(at[own.variable], &p[first..first + count]);
            first += count;
        }
        value
    }
}

/// A variable of formulas: name, unit, least and largest value.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Name: x, v, f or t.
    pub name: &'static str,
    /// Unit.
    pub unit: String,
    /// Least and largest value.
    pub range: (f64, f64),
}

impl Axis {
    /// Whether a law over it may come back to the same value again and again: teeth along a way, a turn of a shaft, a
    /// rhythm in time.
    fn repeats(&self) -> bool {
        self.name != "v"
    }
}

/// A sum of terms.
#[derive(Debug, Clone, PartialEq)]
pub struct Formula {
    /// Terms.
    pub terms: Vec<Term>,
    /// Parameters of the terms, one after the other, the amplitude of each first.
    pub p: Vec<f64>,
}

impl Formula {
    /// Value for the variables.
    pub fn value(&self, at: &[f64]) -> f64 {
        let (mut sum, mut first) = (0.0, 0);
        for term in &self.terms {
            let count = term.count();
            sum += self.p[first] * term.shape(at, &self.p[first + 1..first + count]);
            first += count;
        }
        sum
    }

    /// Factors of all terms, each with the parameters of its shape.
    pub fn by_factor(&self) -> impl Iterator<Item = (&Factor, &[f64])> {
        let mut first = 0;
        self.terms.iter().flat_map(move |term| {
            let mut place = first + 1;
            first += term.count();
            term.factors.iter().map(move |own| {
                let begin = place;
                place += own.shape.parameters().len();
                (own, &self.p[begin..place])
            })
        })
    }

    /// Names of the parameters.
    pub fn names(&self) -> Vec<String> {
        let mut names = Vec::new();
        for (index, term) in self.terms.iter().enumerate() {
            let number = if self.terms.len() == 1 { String::new() } else { (index + 1).to_string() };
            names.push(format!("a{number}"));
            for (k, own) in term.factors.iter().enumerate() {
                let second = if k == 0 { "" } else { "b" };
                names
                    .extend(own.shape.parameters().iter().map(|(role, _)| format!("{role}{number}{second}")));
            }
        }
        names
    }

    /// How much it assumes.
    pub fn complexity(&self) -> usize {
        self.terms.iter().map(Term::complexity).sum()
    }

    /// The formula without a term.
    pub fn without(&self, term: usize) -> Formula {
        let mut found = self.clone();
        let first: usize = self.terms[..term].iter().map(Term::count).sum();
        found.p.drain(first..first + self.terms[term].count());
        found.terms.remove(term);
        found
    }

    /// Whether two have the same terms, in whatever order.
    pub fn same_form(&self, other: &Formula) -> bool {
        self.terms.len() == other.terms.len() && self.terms.iter().all(|term| other.terms.contains(term))
    }

    /// Text, and name, unit and value of each parameter; `unit`: that of the value.
    pub fn written(&self, axes: &[Axis], unit: &str) -> (String, Vec<(String, String, f64)>) {
        let (mut text, mut parameters, mut first) = (String::new(), Vec::new(), 0);
        let names = self.names();
        for (index, term) in self.terms.iter().enumerate() {
            let number = if self.terms.len() == 1 { String::new() } else { (index + 1).to_string() };
            let rooted = term.factors.iter().any(|own| own.shape.rooted());
            let amplitude = self.p[first];
            let powers: Vec<(&str, i32)> = term
                .factors
                .iter()
                .map(|own| {
                    (
                        axes[own.variable].unit.as_str(),
                        -own.shape.power() * if rooted && !own.shape.rooted() { 2 } else { 1 },
                    )
                })
                .collect();
            let own_unit = product(&[&[(unit, if rooted { 2 } else { 1 })], &powers[..]].concat());
            let name = &names[first];
            let mut place = first + 1;
            let mut factors = Vec::new();
            let mut inside = Vec::new();
            for (k, own) in term.factors.iter().enumerate() {
                let axis = &axes[own.variable];
                let tag = if k == 0 { number.clone() } else { format!("{number}b") };
                if own.shape.power() != 0 || own.shape != Shape::Power(0) {
                    let list = if own.shape.rooted() { &mut inside } else { &mut factors };
                    list.push(own.shape.text(axis.name, &tag));
                }
                for (_, sign) in own.shape.parameters() {
                    parameters.push((names[place].clone(), product(&[(&axis.unit, *sign)]), self.p[place]));
                    place += 1;
                }
            }
            let value = if rooted { amplitude * amplitude } else { amplitude };
            parameters.push((name.clone(), own_unit, value));
            let head = if rooted { format!("sqrt({name}*{})", inside.join("*")) } else { name.clone() };
            let own_text = std::iter::once(head).chain(factors).collect::<Vec<_>>().join("*");
            let negative = rooted && amplitude < 0.0;
            text += match (text.is_empty(), negative) {
                (true, true) => "-",
                (true, false) => "",
                (false, true) => " - ",
                (false, false) => " + ",
            };
            text += &own_text;
            first += term.count();
        }
        (text, parameters)
    }
}

/// Text of a product of units with powers.
pub fn product(parts: &[(&str, i32)]) -> String {
    let plain = |unit: &str| unit.chars().all(|c| c.is_alphabetic() || c == '/' || c == '.' || c == '1');
    if !parts.iter().all(|(unit, _)| plain(unit)) {
        return by_exponents(parts);
    }
    let mut powers: Vec<(String, i32)> = Vec::new();
    for (unit, power) in parts {
        for (k, half) in unit.split('/').enumerate() {
            for one in half.split('.').filter(|one| !one.is_empty() && *one != "1") {
                let own = if k == 0 { *power } else { -*power };
                match powers.iter_mut().find(|(name, _)| name == one) {
                    Some((_, known)) => *known += own,
                    None => powers.push((one.to_owned(), own)),
                }
            }
        }
    }
    let join = |sign: i32| {
        let own = powers.iter().filter(|(_, power)| power * sign > 0);
        let own = own.map(|(name, power)| match power.abs() {
            1 => name.clone(),
            n => format!("{name}{n}"),
        });
        own.collect::<Vec<_>>()
    };
    let (up, down) = (join(1), join(-1));
    let top = if up.is_empty() { "1".to_owned() } else { up.join(".") };
    match down.len() {
        0 => top,
        1 => format!("{top}/{}", down[0]),
        _ => format!("{top}/({})", down.join(".")),
    }
}

/// The same for units that are written otherwise, in base units.
fn by_exponents(parts: &[(&str, i32)]) -> String {
    let mut sums: Vec<(&str, i32)> = Vec::new();
    for (unit, power) in parts {
        let Some(unit) = compound_unit::parse(unit) else { return "1".into() };
        for (name, exponent) in unit.exponents.symbols() {
            match sums.iter_mut().find(|(own, _)| *own == name) {
                Some((_, known)) => *known += power * exponent,
                None => sums.push((name, power * exponent)),
            }
        }
    }
    let own = sums.iter().filter(|(_, power)| *power != 0);
    let text =
        own.map(|(name, power)| if *power == 1 { (*name).to_owned() } else { format!("{name}{power}") });
    let text = text.collect::<Vec<_>>().join(".");
    if text.is_empty() { "1".into() } else { text }
}

/// Terms over the variables: shapes of each, and products over two. Shapes that make no sense for a variable are left
/// out.
pub fn terms(axes: &[Axis]) -> Vec<Term> {
    let mut found = vec![Term::of(0, Shape::Power(0))];
    for (variable, axis) in axes.iter().enumerate() {
        let both = axis.range.0 < 0.0 && axis.range.1 > 0.0;
        let mut shapes = vec![Shape::Power(1), Shape::Power(2), Shape::Power(3), Shape::Bump];
        shapes.extend(axis.repeats().then_some(Shape::Sine));
        shapes.extend([Shape::Above, Shape::Below, Shape::AboveSquared, Shape::BelowSquared, Shape::Step]);
        if both {
            shapes.extend([Shape::Magnitude, Shape::Square, Shape::Sign, Shape::Peak, Shape::Power(5)]);
        } else {
            shapes.extend([Shape::Decay, Shape::Root, Shape::Weir, Shape::Power(4)]);
        }
        if axis.name == "x" && both {
            shapes.extend([Shape::Root, Shape::Weir]);
        }
        found.extend(shapes.into_iter().map(|shape| Term::of(variable, shape)));
    }
    if axes.len() == 2 {
        let left = [
            Shape::Power(1),
            Shape::Line,
            Shape::Power(2),
            Shape::Magnitude,
            Shape::Sine,
            Shape::Bump,
            Shape::Above,
            Shape::Decay,
        ];
        let right = [Shape::Power(1), Shape::Power(2), Shape::Square, Shape::Sign, Shape::Magnitude];
        for (a, b) in [(0, 1), (1, 0)] {
            for one in left {
                for other in right {
                    let term = Term {
                        factors: vec![
                            Factor { variable: a, shape: one },
                            Factor { variable: b, shape: other },
                        ],
                    };
                    let mirrored = Term { factors: term.factors.iter().rev().copied().collect() };
                    let sense = match one {
                        Shape::Decay => axes[a].range.0 >= 0.0,
                        Shape::Sine => axes[a].repeats(),
                        _ => true,
                    };
                    if sense && !found.contains(&mirrored) {
                        found.push(term);
                    }
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use airloop_expression::Expression;

    fn axes() -> Vec<Axis> {
        let axis = |name, unit: &str, range| Axis { name, unit: unit.into(), range };
        vec![axis("x", "m", (-0.2, 0.3)), axis("v", "m/s", (-1.0, 1.0))]
    }

    #[test]
    fn what_is_written_has_the_value_and_the_unit_of_the_formula() {
        for (index, term) in terms(&axes()).into_iter().enumerate() {
            let shape: Vec<f64> = (1..term.count()).map(|k| 0.3 + 0.1 * k as f64).collect();
            let amplitude = if index % 2 == 0 { 2.5 } else { -1.5 };
            let second = Term::of(1, Shape::Power(1));
            let p = [&[amplitude], &shape[..], &[0.7]].concat();
            let formula = Formula { terms: vec![term, second], p };
            let (text, parameters) = formula.written(&axes(), "N");
            let mut names = vec!["x", "v"];
            names.extend(parameters.iter().map(|own| own.0.as_str()));
            let values: Vec<f64> = parameters.iter().map(|own| own.2).collect();
            let read = Expression::parse(&text, &names).unwrap_or_else(|e| panic!("{text}: {e}"));
            for at in [[0.25, -0.6], [-0.1, 0.4], [0.29, 0.9]] {
                let found = read.value(&[&at[..], &values].concat());
                assert!((found - formula.value(&at)).abs() < 1e-12, "{text}");
            }
            let coherent = |unit: &str| {
                crate::vocabulary::units::coherent(unit).unwrap_or_else(|e| panic!("{unit}: {e}"))
            };
            let mut units = vec![coherent("m"), coherent("m/s")];
            units.extend(parameters.iter().map(|own| coherent(&own.1)));
            let unit = read.dimension(&units).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert!(unit.is_some_and(|unit| unit.same(&coherent("N"))), "{text}: {unit:?} {parameters:?}");
        }
    }

    #[test]
    fn units_are_written_as_people_do() {
        assert_eq!(product(&[("N", 1), ("m", -3)]), "N/m3");
        assert_eq!(product(&[("N", 1), ("m/s", -2)]), "N.s2/m2");
        assert_eq!(product(&[("N.m", 1), ("rad/s", -1), ("rad", -1)]), "N.m.s/rad2");
        assert_eq!(product(&[("m", 1), ("m", -1)]), "1");
        assert_eq!(product(&[("m3/s", 2), ("m", -3)]), "m3.s-2");
    }
}
