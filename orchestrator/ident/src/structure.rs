//! Orders and delays of an ARX model, output by output and input by input.

use std::fmt;
use std::ops::RangeInclusive;

/// Orders of `A(z) y(k) = B(z) u(k) + e(k)` (eq. 6). Row i belongs to the equation of output i.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Structure {
    /// Coefficients from `y_l(k-1)` on, shape \[n_y\]\[n_y\].
    pub na: Vec<Vec<usize>>,
    /// Coefficients from `u_j(k - nk)` on, shape \[n_y\]\[n_u\].
    pub nb: Vec<Vec<usize>>,
    /// Delay in samples, shape \[n_y\]\[n_u\]; 0 is a direct term.
    pub nk: Vec<Vec<usize>>,
}

/// One regressor of an equation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Term {
    /// `-y_l(k - lag)`.
    Output {
        /// 0-based output l.
        channel: usize,
        /// Lag, from 1.
        lag: usize,
    },
    /// `u_j(k - lag)`.
    Input {
        /// 0-based input j.
        channel: usize,
        /// Lag, from 0.
        lag: usize,
    },
}

impl Term {
    /// Name of the regressor in messages, e.g. `F_hat(k-2)`.
    pub fn name(&self, inputs: &[String], outputs: &[String]) -> String {
        let (name, lag) = match *self {
            Term::Output { channel, lag } => (&outputs[channel], lag),
            Term::Input { channel, lag } => (&inputs[channel], lag),
        };
        if lag == 0 { format!("{name}(k)") } else { format!("{name}(k-{lag})") }
    }

    /// Samples before k.
    pub fn lag(&self) -> usize {
        match *self {
            Term::Output { lag, .. } | Term::Input { lag, .. } => lag,
        }
    }
}

/// Reason why orders cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// Not a number, nor a matrix of numbers.
    #[error(
        "--{option} {text}: `{part}` is not an order; write one number for all, or rows such as \"2,1;1,2\"{}",
        if part.contains("..") { "; a range is searched with --order auto" } else { "" }
    )]
    Number {
        /// `na`, `nb` or `nk`.
        option: &'static str,
        /// Text as given.
        text: String,
        /// The part that is wrong.
        part: String,
    },
    /// A matrix of another shape.
    #[error(
        "--{option} {text}: {found} numbers in a row of {rows} rows, but there are {n_y} outputs (rows) and {columns} {of} (numbers in a row); rows are separated by semicolons"
    )]
    Shape {
        /// `na`, `nb` or `nk`.
        option: &'static str,
        /// Text as given.
        text: String,
        /// Numbers in the row.
        found: usize,
        /// Rows.
        rows: usize,
        /// Outputs.
        n_y: usize,
        /// Numbers that a row should have.
        columns: usize,
        /// Variables they belong to.
        of: &'static str,
    },
    /// Nothing to estimate.
    #[error("{output} has no coefficient to estimate: na and nb are 0 in all its columns; raise one of them")]
    Empty {
        /// Its name, or `output` and its number.
        output: String,
        /// Its place.
        index: usize,
    },
    /// A range of orders without structures, or with too many.
    #[error(
        "--order auto: the ranges of na, nb and nk make {found} structures; choose them for 1 to {most}, as --na 1..4 --nb 1..4 --nk 0..3"
    )]
    Ranges {
        /// Structures.
        found: usize,
        /// Most allowed.
        most: usize,
    },
    /// Orders out of reach.
    #[error("--{option} {text}: {value} is more than {limit}, the largest order or delay")]
    Large {
        /// `na`, `nb` or `nk`.
        option: &'static str,
        /// Text as given.
        text: String,
        /// Value that is too large.
        value: usize,
        /// Largest allowed.
        limit: usize,
    },
}

/// Largest order or delay.
pub const MAX_ORDER_OR_DELAY: usize = 1000;

impl Error {
    /// The same error with the name of the output.
    #[must_use]
    pub fn named(self, outputs: &[String]) -> Error {
        match self {
            Error::Empty { output, index } => {
                Error::Empty { output: outputs.get(index).cloned().unwrap_or(output), index }
            }
            other => other,
        }
    }
}

impl Structure {
    /// The same orders for all outputs and inputs.
    ///
    /// ```
    /// use airloop_ident::structure::Structure;
    /// let eq7 = Structure::uniform((1, 2), 1, 2, 0);
    /// assert_eq!((eq7.lags(), eq7.parameters()), (1, 8));
    /// ```
    pub fn uniform((n_u, n_y): (usize, usize), na: usize, nb: usize, nk: usize) -> Structure {
        Structure { na: vec![vec![na; n_y]; n_y], nb: vec![vec![nb; n_u]; n_y], nk: vec![vec![nk; n_u]; n_y] }
    }

    /// From texts: one number for all, or a matrix like `2,1;1,2` with a row for each output.
    ///
    /// # Errors
    /// [`Error`] says what cannot be read or has the wrong shape.
    pub fn parse((n_u, n_y): (usize, usize), na: &str, nb: &str, nk: &str) -> Result<Structure, Error> {
        let structure = Structure {
            na: matrix("na", na, (n_y, n_y), "outputs")?,
            nb: matrix("nb", nb, (n_y, n_u), "inputs")?,
            nk: matrix("nk", nk, (n_y, n_u), "inputs")?,
        };
        match (0..n_y).find(|&output| structure.terms(output).is_empty()) {
            Some(index) => Err(Error::Empty { output: format!("output {}", index + 1), index }),
            None => Ok(structure),
        }
    }

    /// Number of outputs.
    pub fn n_y(&self) -> usize {
        self.na.len()
    }

    /// Number of inputs.
    pub fn n_u(&self) -> usize {
        self.nb.first().map_or(0, Vec::len)
    }

    /// Regressors of the equation of an output, by lag; so that of several dependent ones the oldest is named.
    pub fn terms(&self, output: usize) -> Vec<Term> {
        let lags = 0..=self.na[output].iter().copied().max().unwrap_or(0).max(self.input_span(output));
        let at_lag = |lag: usize| {
            let (na, nb, nk) = (&self.na[output], &self.nb[output], &self.nk[output]);
            let outputs = (0..self.n_y()).filter(move |&channel| lag > 0 && lag <= na[channel]);
            let inputs = (0..self.n_u()).filter(move |&j| nk[j] <= lag && lag < nk[j] + nb[j]);
            let outputs = outputs.map(move |channel| Term::Output { channel, lag });
            outputs.chain(inputs.map(move |channel| Term::Input { channel, lag }))
        };
        lags.flat_map(at_lag).collect()
    }

    /// One more than the largest lag of an input in the equation of an output.
    fn input_span(&self, output: usize) -> usize {
        let spans =
            self.nb[output].iter().zip(&self.nk[output]).map(|(&nb, &nk)| if nb > 0 { nb + nk } else { 0 });
        spans.max().unwrap_or(0)
    }

    /// All regressors of all equations, in the order of [`Structure::terms`].
    pub fn all_terms(&self) -> Vec<Term> {
        let mut terms: Vec<Term> = (0..self.n_y()).flat_map(|output| self.terms(output)).collect();
        let key = |term: &Term| match *term {
            Term::Output { channel, lag } => (lag, 0, channel),
            Term::Input { channel, lag } => (lag, 1, channel),
        };
        terms.sort_by_key(key);
        terms.dedup();
        terms
    }

    /// Samples before k that the model looks back on.
    pub fn lags(&self) -> usize {
        self.all_terms().iter().map(Term::lag).max().unwrap_or(0)
    }

    /// Number of coefficients.
    pub fn parameters(&self) -> usize {
        (0..self.n_y()).map(|output| self.terms(output).len()).sum()
    }
}

impl fmt::Display for Structure {
    /// `na=1 nb=2 nk=0`, or rows where orders differ.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "na={} nb={} nk={}", text(&self.na), text(&self.nb), text(&self.nk))
    }
}

/// One number, if all are the same, else rows as [`Structure::parse`] reads them.
pub fn text(orders: &[Vec<usize>]) -> String {
    let first = orders.first().and_then(|row| row.first());
    if let Some(first) = first.filter(|first| orders.iter().flatten().all(|order| order == *first)) {
        return first.to_string();
    }
    let row = |row: &Vec<usize>| row.iter().map(usize::to_string).collect::<Vec<_>>().join(",");
    orders.iter().map(row).collect::<Vec<_>>().join(";")
}

/// A range of orders like `1..4` (both ends included), or one number.
///
/// # Errors
/// [`Error::Number`] or [`Error::Large`].
pub fn range(option: &'static str, text: &str) -> Result<RangeInclusive<usize>, Error> {
    let number = |part: &str| {
        let part = part.trim();
        let value =
            part.parse().map_err(|_| Error::Number { option, text: text.into(), part: part.into() })?;
        let limit = MAX_ORDER_OR_DELAY;
        if value > limit { Err(Error::Large { option, text: text.into(), value, limit }) } else { Ok(value) }
    };
    match text.split_once("..") {
        Some((first, last)) => Ok(number(first)?..=number(last.trim_start_matches('='))?),
        None => number(text).map(|order| order..=order),
    }
}

fn matrix(
    option: &'static str,
    text: &str,
    (n_y, columns): (usize, usize),
    of: &'static str,
) -> Result<Vec<Vec<usize>>, Error> {
    let number = |part: &str| {
        let value = part.trim().parse::<usize>();
        let value =
            value.map_err(|_| Error::Number { option, text: text.into(), part: part.trim().into() })?;
        if value > MAX_ORDER_OR_DELAY {
            return Err(Error::Large { option, text: text.into(), value, limit: MAX_ORDER_OR_DELAY });
        }
        Ok(value)
    };
    if !text.contains([',', ';']) {
        return Ok(vec![vec![number(text)?; columns]; n_y]);
    }
    let rows: Vec<Vec<usize>> =
        text.split(';').map(|row| row.split(',').map(number).collect()).collect::<Result<_, Error>>()?;
    let wrong = rows.iter().find(|row| row.len() != columns).or(rows.first().filter(|_| rows.len() != n_y));
    match wrong {
        Some(row) => {
            let (found, rows) = (row.len(), rows.len());
            Err(Error::Shape { option, text: text.into(), found, rows, n_y, columns, of })
        }
        None => Ok(rows),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_or_a_matrix_give_the_orders_of_all_channels() {
        let structure = Structure::parse((1, 2), "2,1;1,2", "3", "0;1").unwrap();
        assert_eq!(structure.na, [[2, 1], [1, 2]]);
        assert_eq!((&structure.nb, &structure.nk), (&vec![vec![3], vec![3]], &vec![vec![0], vec![1]]));
        assert_eq!((structure.lags(), structure.parameters()), (3, 12));
        assert_eq!(structure.to_string(), "na=2,1;1,2 nb=3 nk=0;1");
    }

    #[test]
    fn terms_come_by_lag_and_nb_counts_from_the_delay() {
        let structure = Structure::parse((2, 1), "1", "2,1", "0,3").unwrap();
        let names: Vec<String> = structure
            .terms(0)
            .iter()
            .map(|term| term.name(&["u1".into(), "u2".into()], &["y".into()]))
            .collect();
        assert_eq!(names, ["u1(k)", "y(k-1)", "u1(k-1)", "u2(k-3)"]);
    }

    #[test]
    fn orders_that_cannot_be_read_are_refused_with_the_option() {
        for (na, nb, expected) in [
            ("x", "1", "--na x: `x` is not an order"),
            (
                "1..6",
                "1",
                "--na 1..6: `1..6` is not an order; write one number for all, or rows such as \"2,1;1,2\"; a range is searched with --order auto",
            ),
            ("2,1;1", "1", "--na 2,1;1: 1 numbers in a row of 2 rows"),
            (
                "1",
                "1,2",
                "--nb 1,2: 2 numbers in a row of 1 rows, but there are 2 outputs (rows) and 1 inputs",
            ),
            ("0", "0;1", "output 1 has no coefficient"),
            ("1", "5000", "--nb 5000: 5000 is more than 1000"),
        ] {
            let message = Structure::parse((1, 2), na, nb, "0").unwrap_err().to_string();
            assert!(message.starts_with(expected), "{message}");
        }
        let empty = Structure::parse((1, 1), "0", "0", "0").unwrap_err().named(&["F_hat".into()]);
        assert!(empty.to_string().starts_with("F_hat has no coefficient"), "{empty}");
    }
}
