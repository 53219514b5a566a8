//! The trajectory with its gains, from the table in the resources of the FMU.

use std::path::Path;

/// Most states, disturbances included.
pub(super) const MAX_NX: usize = 16;
/// Most inputs of the plant.
pub(super) const MAX_NU: usize = 4;
/// Most measured signals.
pub(super) const MAX_NY: usize = 8;
/// Name of the table in the resources folder.
pub(super) const FILE: &str = "controller.csv";

/// Numbers of states, inputs of the plant and measured signals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sizes {
    pub n: usize,
    pub m: usize,
    pub p: usize,
}

impl Sizes {
    /// Blocks of a row in their order: letter, rows, columns (0: a vector).
    fn blocks(self) -> [(&'static str, usize, usize); 9] {
        let Self { n, m, p } = self;
        [
            ("x", n, 0),
            ("u", m, 0),
            ("y", p, 0),
            ("K", m, n),
            ("L", n, p),
            ("A", n, n),
            ("B", n, m),
            ("c", n, 0),
            ("C", p, n),
        ]
    }

    /// Names of the columns: `time`, then the blocks row by row.
    fn header(self) -> Vec<String> {
        let mut names = vec!["time".to_owned()];
        for (letter, rows, columns) in self.blocks() {
            for i in 1..=rows {
                match columns {
                    0 => names.push(format!("{letter}[{i}]")),
                    _ => names.extend((1..=columns).map(|j| format!("{letter}[{i}][{j}]"))),
                }
            }
        }
        names
    }

    fn fit(self) -> bool {
        (1..=MAX_NX).contains(&self.n) && (1..=MAX_NU).contains(&self.m) && (1..=MAX_NY).contains(&self.p)
    }
}

/// One sample of the table; matrices row by row.
pub(super) struct Row<'a> {
    /// Nominal states, `[n]`.
    pub x: &'a [f64],
    /// Nominal inputs of the plant, `[m]`.
    pub u: &'a [f64],
    /// Nominal measured signals, `[p]`.
    pub y: &'a [f64],
    /// Feedback, `[m, n]`.
    pub feedback: &'a [f64],
    /// Correction of the estimate, `[n, p]`.
    pub correction: &'a [f64],
    /// Deviations one sample later, `[n, n]`.
    pub a: &'a [f64],
    /// Effect of the inputs one sample later, `[n, m]`.
    pub b: &'a [f64],
    /// What the nominal trajectory lacks of the model's, one sample later, `[n]`.
    pub c: &'a [f64],
    /// Measured signals of deviations, `[p, n]`.
    pub output: &'a [f64],
}

/// Trajectory and gains, one row per sample; the last row holds from there on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Gains {
    pub sizes: Sizes,
    width: usize,
    data: Vec<f64>,
}

impl Gains {
    /// One row without zeros, of the largest sizes: for the search of dependencies.
    pub fn dense() -> Self {
        let sizes = Sizes { n: MAX_NX, m: MAX_NU, p: MAX_NY };
        let width = sizes.header().len() - 1;
        let data = (0..width).map(|i| 0.01 + 0.02 * ((7 * i) as f64).sin().abs()).collect();
        Self { sizes, width, data }
    }

    /// The row of sample `k`.
    pub fn row(&self, k: usize) -> Row<'_> {
        let last = self.data.len() / self.width - 1;
        let mut rest = &self.data[k.min(last) * self.width..];
        let mut take = |len: usize| {
            let (block, tail) = rest.split_at(len);
            rest = tail;
            block
        };
        let Sizes { n, m, p } = self.sizes;
        Row {
            x: take(n),
            u: take(m),
            y: take(p),
            feedback: take(m * n),
            correction: take(n * p),
            a: take(n * n),
            b: take(n * m),
            c: take(n),
            output: take(p * n),
        }
    }

    /// Reads the table; `path` is for messages.
    ///
    /// # Errors
    /// File, line, column, what was found and what is allowed.
    pub fn parse(text: &str, path: &Path) -> Result<Self, String> {
        let place = path.display();
        let mut lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty());
        let (line, header) = lines.next().ok_or_else(|| format!("{place}: the table is empty"))?;
        let names: Vec<&str> = header.split(',').map(str::trim).collect();
        let count = |letter: &str| {
            let of_letter =
                |name: &&&str| name.strip_prefix(letter).is_some_and(|rest| rest.starts_with('['));
            names.iter().filter(of_letter).count()
        };
        let sizes = Sizes { n: count("x"), m: count("u"), p: count("y") };
        if !sizes.fit() {
            return Err(format!(
                "{place}, line {line}: {} states, {} inputs, {} measured signals; allowed: 1..{MAX_NX} columns x[i], \
                 1..{MAX_NU} columns u[i], 1..{MAX_NY} columns y[i]",
                sizes.n, sizes.m, sizes.p
            ));
        }
        let expected = sizes.header();
        if names.len() != expected.len() {
            let (found, wanted) = (names.len(), expected.len());
            return Err(format!("{place}, line {line}: {found} columns; allowed for these sizes: {wanted}"));
        }
        if let Some((found, wanted)) = names.iter().zip(&expected).find(|(found, wanted)| found != wanted) {
            return Err(format!("{place}, line {line}: column `{found}` where `{wanted}` is expected"));
        }
        let width = expected.len() - 1;
        let mut data = Vec::new();
        for (line, text) in lines {
            let before = data.len();
            for (field, name) in text.split(',').zip(&expected) {
                let value = field.trim().parse::<f64>().ok().filter(|value| value.is_finite());
                let value = value.ok_or_else(|| {
                    format!(
                        "{place}, line {line}, column `{name}`: `{}` is not a finite number",
                        field.trim()
                    )
                })?;
                if name != "time" {
                    data.push(value);
                }
            }
            let found = text.split(',').count();
            if data.len() - before != width || found != width + 1 {
                return Err(format!("{place}, line {line}: {found} fields; allowed: {}", width + 1));
            }
        }
        if data.is_empty() {
            return Err(format!("{place}: the table has no row below its header"));
        }
        Ok(Self { sizes, width, data })
    }
}
