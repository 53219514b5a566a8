//! The trajectory with its gains, from the table in the resources of the FMU.

use std::path::Path;

/// Most states, disturbances included.
pub(super) const MAX_NX: usize = 16;
/// Most inputs of the plant.
pub(super) const MAX_NU: usize = 4;
/// Most measured signals.
pub(super) const MAX_NY: usize = 16;
/// Columns of a table with phases: number of the sample, 0 at the start of the plan, and the mode in which the row
/// holds.
const PHASES: [&str; 2] = ["sample", "mode"];
/// First field of the last line of a table whose phases begin again after the last one.
const REPEAT: &str = "repeat";
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

    /// Names of the columns: `time`, with phases the two of [`PHASES`], then the blocks row by row.
    fn header(self, phases: bool) -> Vec<String> {
        let mut names = vec!["time".to_owned()];
        names.extend(PHASES.iter().filter(|_| phases).map(|name| (*name).to_owned()));
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
    /// Defect of the nominal trajectory in the model equations over the next sample, `[n]`.
    pub c: &'a [f64],
    /// Measured signals of deviations, `[p, n]`.
    pub output: &'a [f64],
}

/// Rows of one phase, from sample to sample without gaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Phase {
    /// Value of `mode` while it lasts.
    pub mode: i32,
    /// First row and sample, and number of rows.
    row: usize,
    sample: i64,
    rows: usize,
}

/// Begin of the phases from anew.
#[derive(Clone, Debug, PartialEq)]
struct Repeat {
    /// Samples after which they begin again.
    samples: i64,
    /// Change of the nominal states until then, `[n]`.
    advance: Vec<f64>,
}

/// A phase of a turn; turns are the times at which the phases have begun again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub turn: i64,
    pub phase: usize,
}

/// Trajectory and gains, one row per sample of each phase; the first and the last row of a phase hold beyond it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Gains {
    pub sizes: Sizes,
    width: usize,
    data: Vec<f64>,
    phases: Vec<Phase>,
    repeat: Option<Repeat>,
}

impl Gains {
    /// One row without zeros, of the largest sizes: for the search of dependencies.
    pub fn dense() -> Self {
        let sizes = Sizes { n: MAX_NX, m: MAX_NU, p: MAX_NY };
        let width = sizes.header(false).len() - 1;
        let data = (0..width).map(|i| 0.01 + 0.02 * ((7 * i) as f64).sin().abs()).collect();
        let phases = vec![Phase { mode: 0, row: 0, sample: 0, rows: 1 }];
        Self { sizes, width, data, phases, repeat: None }
    }

    /// The phase after this one, if its mode has been entered; else the same.
    pub fn place_in(&self, Place { turn, phase }: Place, mode: i32) -> Place {
        let phase = phase.min(self.phases.len() - 1);
        let next = match phase + 1 == self.phases.len() && self.repeat.is_some() {
            true => Place { turn: turn + 1, phase: 0 },
            false => Place { turn, phase: phase + 1 },
        };
        let entered = self.phases.get(next.phase).is_some_and(|next| next.mode == mode);
        if entered && self.phases[phase].mode != mode { next } else { Place { turn, phase } }
    }

    /// The phase of sample `k` by plan: where two overlap, the second one from the middle on.
    pub fn place_at(&self, k: i64) -> Place {
        let turn = self.repeat.as_ref().map_or(0, |repeat| k.div_euclid(repeat.samples));
        let k = self.within(turn, k);
        let begun = |pair: &&[Phase]| 2 * k >= pair[0].sample + pair[0].rows as i64 + pair[1].sample;
        Place { turn, phase: self.phases.windows(2).take_while(begun).count() }
    }

    /// Sample `k` counted from the begin of a turn.
    fn within(&self, turn: i64, k: i64) -> i64 {
        k - turn * self.repeat.as_ref().map_or(0, |repeat| repeat.samples)
    }

    /// Change of nominal state `i` up to a turn.
    pub fn advance(&self, turn: i64, i: usize) -> f64 {
        self.repeat.as_ref().map_or(0.0, |repeat| turn as f64 * repeat.advance[i])
    }

    /// The row of sample `k` in a phase; its states and measured signals are those of the first turn.
    pub fn row(&self, Place { turn, phase }: Place, k: i64) -> Row<'_> {
        let Phase { row, sample, rows, .. } = self.phases[phase.min(self.phases.len() - 1)];
        let row = row + (self.within(turn, k) - sample).clamp(0, rows as i64 - 1) as usize;
        let mut rest = &self.data[row * self.width..];
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
        let with_phases = names.get(1) == Some(&PHASES[0]);
        let expected = sizes.header(with_phases);
        if names.len() != expected.len() {
            let (found, wanted) = (names.len(), expected.len());
            return Err(format!("{place}, line {line}: {found} columns; allowed for these sizes: {wanted}"));
        }
        if let Some((found, wanted)) = names.iter().zip(&expected).find(|(found, wanted)| found != wanted) {
            return Err(format!("{place}, line {line}: column `{found}` where `{wanted}` is expected"));
        }
        let width = expected.len() - if with_phases { 1 + PHASES.len() } else { 1 };
        let mut data = Vec::new();
        let mut phases: Vec<Phase> = Vec::new();
        // Phases that begin again begin before sample 0.
        let repeats = text.lines().any(|line| line.starts_with(REPEAT));
        let mut repeat = None;
        for (line, text) in lines {
            let wrong = |problem: String| Err(format!("{place}, line {line}: {problem}"));
            if repeat.is_some() {
                return wrong(format!("the line `{REPEAT}` is the last one"));
            }
            if let Some(fields) = text.strip_prefix(REPEAT) {
                match Repeat::parse(fields, sizes.n).filter(|_| with_phases) {
                    Some(found) => repeat = Some(found),
                    None => {
                        return wrong(format!(
                            "`{REPEAT}` stands below phases, before a number of samples and {} finite numbers",
                            sizes.n
                        ));
                    }
                }
                continue;
            }
            let before = data.len();
            let mut place_in_phases = [0.0; 2];
            for (field, name) in text.split(',').zip(&expected) {
                let value = field.trim().parse::<f64>().ok().filter(|value| value.is_finite());
                let value = value.ok_or_else(|| {
                    format!(
                        "{place}, line {line}, column `{name}`: `{}` is not a finite number",
                        field.trim()
                    )
                })?;
                match PHASES.iter().position(|phase| with_phases && phase == name) {
                    Some(column) => place_in_phases[column] = value,
                    None if name != "time" => data.push(value),
                    None => {}
                }
            }
            let found = text.split(',').count();
            if data.len() - before != width || found != expected.len() {
                return Err(format!("{place}, line {line}: {found} fields; allowed: {}", expected.len()));
            }
            let row = before / width;
            let [sample, mode] = if with_phases { place_in_phases } else { [row as f64, 0.0] };
            let whole = |value: f64| value.fract() == 0.0 && (0.0..1e9).contains(&value);
            let whole_sample = whole(if repeats && phases.len() <= 1 { sample.abs() } else { sample });
            if !whole_sample || !whole(mode.abs()) {
                return Err(format!(
                    "{place}, line {line}: sample {sample}, mode {mode}; both are whole numbers, samples from 0 on behind the \
                     first phase"
                ));
            }
            let (sample, mode) = (sample as i64, mode as i32);
            match phases.last_mut().filter(|phase| phase.mode == mode) {
                Some(phase) if sample == phase.sample + phase.rows as i64 => phase.rows += 1,
                Some(phase) => {
                    let next = phase.sample + phase.rows as i64;
                    return Err(format!(
                        "{place}, line {line}: sample {sample}; in this phase {next} is next"
                    ));
                }
                None => phases.push(Phase { mode, row, sample, rows: 1 }),
            }
        }
        if data.is_empty() {
            return Err(format!("{place}: the table has no row below its header"));
        }
        Ok(Self { sizes, width, data, phases, repeat })
    }
}

impl Repeat {
    /// Reads what stands behind the word: `,samples,advance[1]..advance[n]`.
    fn parse(fields: &str, n: usize) -> Option<Self> {
        let mut fields = fields.strip_prefix(',')?.split(',').map(str::trim);
        let samples = fields.next()?.parse().ok().filter(|samples| (1..1_000_000_000).contains(samples))?;
        let advance: Option<Vec<f64>> =
            fields.map(|field| field.parse().ok().filter(|x: &f64| x.is_finite())).collect();
        advance.filter(|advance| advance.len() == n).map(|advance| Self { samples, advance })
    }
}
