//! `[guess.name]`: guesses of a problem file.

use std::fmt;

use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, Visitor};

use super::source::Place;
use super::value::{Entries, Placed, Text};

/// A guess: each named variable piecewise linear.
#[derive(Debug, Clone, PartialEq, Default, JsonSchema)]
pub struct Guess {
    /// Variables that the guess does not name.
    #[schemars(default)]
    pub others: Others,
    /// Trajectories of variables.
    #[schemars(flatten)]
    pub trajectories: Entries<GuessLine>,
}

/// Trajectories of variables that a guess does not name.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
pub enum Others {
    /// Zero.
    #[default]
    Zero,
    /// On a line from the initial to the final condition.
    Linear,
}

/// A piecewise linear trajectory.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GuessLine {
    /// Part of the whole duration, 0 to 1, increasing.
    #[schemars(length(min = 2), inner(range(min = 0, max = 1)))]
    pub t: Placed<Vec<f64>>,
    /// Values, as many.
    #[schemars(length(min = 2))]
    pub value: Placed<Vec<f64>>,
    /// Unit of the values; default: that of the variable.
    pub unit: Option<String>,
}

impl GuessLine {
    /// Points are as many as values, two or more, and lie one after the other within the duration.
    pub(super) fn check(&self) -> Result<(), (Place, String)> {
        let (t, n) = (&self.t, self.value.len());
        if t.len() != n {
            let problem = format!("`t` has {} values and `value` has {n}; give as many of each", t.len());
            return Err((self.value.place, problem));
        }
        let problem = if n < 2 {
            "a trajectory needs at least two points".into()
        } else if let Some(pair) = t.windows(2).find(|pair| pair[1] <= pair[0]) {
            format!("`t` must increase, but {} does not come after {}", pair[1], pair[0])
        } else if t[0] < 0.0 || t[n - 1] > 1.0 {
            "`t` is the part of the whole duration, from 0 to 1".into()
        } else {
            return Ok(());
        };
        Err((t.place, problem))
    }
}

/// By hand, as `flatten` would lose the places.
impl<'de> Deserialize<'de> for Guess {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Guess, D::Error> {
        struct Keys;

        impl<'de> Visitor<'de> for Keys {
            type Value = Guess;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a map")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Guess, A::Error> {
                let mut guess = Guess::default();
                while let Some(name) = map.next_key::<Text>()? {
                    match name.text.as_str() {
                        "others" => guess.others = map.next_value()?,
                        _ => guess.trajectories.0.push((name, map.next_value()?)),
                    }
                }
                guess.trajectories.0.sort_by_key(|(name, _)| name.place);
                Ok(guess)
            }
        }
        deserializer.deserialize_map(Keys)
    }
}
