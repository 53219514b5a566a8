//! One phase of a motion, as a problem file declares it.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::{Deserializer, Error};
use toml::Spanned;

use super::quantity::{Quantity, QuantityOr, Raw};
use super::source::Place;
use super::value::{Entries, Parameters, Placed, Text, intervals, not_negative, one, same_schema};

/// One phase of a motion.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Phase {
    /// Name; default: its number.
    #[serde(default)]
    pub name: String,
    /// Intervals; default: those of the settings.
    #[serde(default, deserialize_with = "intervals::<_, Option<usize>>")]
    #[schemars(range(min = 1))]
    pub intervals: Option<usize>,
    /// Start values of parameters in this phase, such as a pinned mode.
    #[serde(default)]
    pub parameters: Parameters,
    /// "2 s", or a range in which it is to be found.
    pub duration: Duration,
    /// A jump of states from the end of the phase before, in a cycle also of the first phase from the end of the last;
    /// default: they are continuous.
    pub reset: Option<Placed<Reset>>,
    /// Conditions at the start; states that are not named keep the start values of the system.
    #[serde(default)]
    pub initial: Entries<Condition>,
    /// Conditions at the end; states that are not named are free.
    #[serde(default, rename = "final")]
    pub terminal: Entries<Condition>,
    /// Bounds along the way, by variable.
    #[serde(default)]
    #[schemars(schema_with = "bounds_schema")]
    pub bounds: Entries<Placed<Bound>>,
    /// Bounds on sums of factor times variable.
    #[serde(default)]
    #[schemars(schema_with = "sums_schema")]
    pub constraint: Vec<Placed<Bound>>,
    /// Limits of the rates of inputs.
    #[serde(default)]
    pub rates: Entries<Rate>,
    /// Terms of the cost.
    #[serde(default, rename = "cost")]
    pub costs: Vec<Placed<Cost>>,
}

impl Phase {
    /// Its bounds and constraints.
    pub fn limits(&self) -> impl Iterator<Item = &Placed<Bound>> {
        self.bounds.iter().map(|(_, bound)| bound).chain(&self.constraint)
    }

    /// Gives each bound its variable as its only term, and finds the first thing that no type rules out.
    pub(super) fn complete(&mut self) -> Result<(), (Place, String)> {
        let of_reset = self.reset.iter_mut().flat_map(|reset| &mut reset.bounds.0);
        for (variable, bound) in self.bounds.0.iter_mut().chain(of_reset) {
            if !bound.terms.is_empty() {
                let problem =
                    format!("the bound of `{}` has `terms`; a sum belongs to [[constraint]]", variable.text);
                return Err((bound.place, problem));
            }
            bound.terms.0.push((variable.clone(), 1.0));
        }
        for bound in self.limits().chain(self.reset.iter().flat_map(|reset| reset.limits())) {
            if bound.terms.is_empty() {
                let problem = "`terms` of a constraint names at least one variable with its factor";
                return Err((bound.place, problem.into()));
            }
            if bound.min.is_none() && bound.max.is_none() {
                return Err((bound.place, "a bound needs `min`, `max` or both".into()));
            }
        }
        for (_, rate) in &self.rates {
            if let QuantityOr::Quantity(one) = rate
                && one.value < 0.0
            {
                let problem = "one number limits the rate both ways and is not negative";
                return Err((one.place, problem.into()));
            }
        }
        Ok(())
    }
}

/// "2 s", or a range in which it is to be found.
pub type Duration = QuantityOr<FreeDuration>;

/// A duration that is to be found.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FreeDuration {
    /// Shortest.
    pub min: Quantity,
    /// Longest.
    pub max: Quantity,
    /// Start of the search.
    pub guess: Quantity,
}

/// A jump of states from the end of the phase before, read from outputs there, such as an impact.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Reset {
    /// Start values of parameters of the system that shows the outputs.
    #[serde(default)]
    pub parameters: Parameters,
    /// State after = variable before; others are continuous.
    pub states: Entries<Text>,
    /// Bounds of outputs, such as impulses.
    #[serde(default)]
    #[schemars(schema_with = "bounds_schema")]
    pub bounds: Entries<Placed<Bound>>,
    /// Bounds on sums of factor times output.
    #[serde(default)]
    #[schemars(schema_with = "sums_schema")]
    pub constraint: Vec<Placed<Bound>>,
}

impl Reset {
    /// Its bounds and constraints.
    pub fn limits(&self) -> impl Iterator<Item = &Placed<Bound>> {
        self.bounds.iter().map(|(_, bound)| bound).chain(&self.constraint)
    }
}

/// A range of values; equal ends fix the value.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Smallest.
    pub min: Option<Quantity>,
    /// Largest.
    pub max: Option<Quantity>,
}

/// Value or range of a variable at one end of a phase.
#[derive(Debug, Clone, PartialEq, JsonSchema)]
#[schemars(untagged)]
pub enum Condition {
    /// "free"
    Free(Free),
    /// A value, or a range.
    Set(QuantityOr<Range>),
}

/// No condition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, JsonSchema)]
#[schemars(rename_all = "kebab-case", inline)]
#[allow(missing_docs, reason = "the word of the file")]
pub enum Free {
    Free,
}

impl<'de> Deserialize<'de> for Condition {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Condition, D::Error> {
        let raw = Spanned::<Raw<Range>>::deserialize(deserializer)?;
        match raw.get_ref() {
            Raw::Text(text) if text == "free" => Ok(Condition::Free(Free::Free)),
            _ => raw.try_into().map(Condition::Set).map_err(D::Error::custom),
        }
    }
}

impl Condition {
    /// The range; both ends none where it is free.
    pub fn range(&self) -> Range {
        match self {
            Condition::Free(_) => Range::default(),
            Condition::Set(QuantityOr::Quantity(one)) => {
                Range { min: Some(one.clone()), max: Some(one.clone()) }
            }
            Condition::Set(QuantityOr::Table(range)) => range.clone(),
        }
    }
}

/// Limits of the rate of an input per second: one number for both ways, or a range.
pub type Rate = QuantityOr<Range>;

impl Rate {
    /// The range.
    pub fn range(&self) -> Range {
        match self {
            QuantityOr::Quantity(one) => {
                Range { min: Some(Quantity { value: -one.value, ..one.clone() }), max: Some(one.clone()) }
            }
            QuantityOr::Table(range) => range.clone(),
        }
    }
}

/// Where a bound holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
pub enum Where {
    /// At the nodes: states and outputs by default.
    Nodes,
    /// In the middle of the intervals.
    Midpoints,
    /// At both: inputs by default.
    Everywhere,
}

/// A variable, or a sum of factor times variable, between limits along the way.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("anyOf" = [{ "required": ["min"] }, { "required": ["max"] }]))]
pub struct Bound {
    /// Name for messages; default: the variable.
    pub name: Option<String>,
    /// Variables with their factors; only in a constraint, as a bound has its variable for key.
    #[serde(default)]
    #[schemars(extend("minProperties" = 1))]
    pub terms: Entries<f64>,
    /// Smallest; unit that of the first variable unless said.
    pub min: Option<Quantity>,
    /// Largest.
    pub max: Option<Quantity>,
    /// Where it holds; default: everywhere for inputs, nodes for others.
    pub at: Option<Where>,
    /// Part of the phase in which it holds, from and to.
    #[serde(default = "whole", deserialize_with = "during")]
    #[schemars(inner(range(min = 0, max = 1)))]
    pub during: [f64; 2],
    /// By how much stricter it is at the points of the mesh, so that it holds between them, in the unit of the plan.
    #[serde(default, deserialize_with = "not_negative")]
    #[schemars(range(min = 0))]
    pub margin: f64,
}

impl Bound {
    /// Its range.
    pub fn range(&self) -> Range {
        Range { min: self.min.clone(), max: self.max.clone() }
    }
}

/// Bounds have their variable for key and no terms.
pub(super) fn bounds_schema(generator: &mut SchemaGenerator) -> Schema {
    let one =
        json_schema!({ "allOf": [generator.subschema_for::<Bound>(), { "properties": { "terms": false } }] });
    json_schema!({ "type": "object", "additionalProperties": one })
}

/// Constraints have terms.
pub(super) fn sums_schema(generator: &mut SchemaGenerator) -> Schema {
    let one = json_schema!({ "allOf": [generator.subschema_for::<Bound>(), { "required": ["terms"] }] });
    json_schema!({ "type": "array", "items": one })
}

fn whole() -> [f64; 2] {
    [0.0, 1.0]
}

fn during<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 2], D::Error> {
    match Vec::<f64>::deserialize(deserializer)?[..] {
        [from, to] if 0.0 <= from && from <= to && to <= 1.0 => Ok([from, to]),
        _ => Err(D::Error::custom("wanted is [from, to] as parts of the phase, 0 <= from <= to <= 1")),
    }
}

/// A term of the cost.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "CostKeys")]
pub struct Cost {
    /// Quantity that costs.
    pub of: Of,
    /// Weight.
    pub weight: f64,
}

/// Quantity that costs.
#[derive(Debug, Clone, PartialEq)]
pub enum Of {
    /// Integral of `(variable - reference)^2` over the phase.
    Integral(Text, Option<Quantity>),
    /// `(variable - reference)^2` at the end.
    Final(Text, Option<Quantity>),
    /// The duration of the phase.
    Duration,
}

/// One of `integral`, `final` and `duration`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["integral"] }, { "required": ["final"] }, { "required": ["duration"] }]))]
struct CostKeys {
    /// Integral of (variable - reference)^2.
    integral: Option<Text>,
    /// (variable - reference)^2 at the end.
    #[serde(rename = "final")]
    terminal: Option<Text>,
    /// Weight of the duration per second.
    duration: Option<f64>,
    /// Weight; default: 1.
    #[schemars(range(min = 0))]
    weight: Option<f64>,
    /// Value from which deviations cost; default: 0.
    reference: Option<Quantity>,
}

same_schema! {
    [] Cost = CostKeys;
}

impl TryFrom<CostKeys> for Cost {
    type Error = String;

    fn try_from(keys: CostKeys) -> Result<Cost, String> {
        let (of, weight) = match (keys.integral, keys.terminal, keys.duration, keys.weight, keys.reference) {
            (Some(variable), None, None, weight, reference) => (Of::Integral(variable, reference), weight),
            (None, Some(variable), None, weight, reference) => (Of::Final(variable, reference), weight),
            (None, None, Some(own), None, None) => (Of::Duration, Some(own)),
            _ => {
                return Err(
                    "a cost is one of `integral = \"variable\"`, `final = \"variable\"` (each with `weight` \
                            and `reference`) or `duration = weight`"
                        .into(),
                );
            }
        };
        match weight.unwrap_or(one()) {
            weight if weight < 0.0 => {
                Err(format!("the weight {weight} is negative; the cost would fall without end"))
            }
            weight => Ok(Cost { of, weight }),
        }
    }
}
