//! A page of the merged results: numbers of every quantity, causes of failures, influence of the factors.

mod figures;
mod indices;
mod statistics;
mod tasks;

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use airloop_report::plot::fit_page::{Page, Table, html};
use airloop_report::plot::run::short;
use airloop_series::file::write_whole;

use crate::Error;
use crate::file::{Method, PlanFile};
use crate::manifest::{Manifest, short as digits};
use crate::merge::RESULTS;
use crate::table::{self, Cell, Column, Type};

/// Page of a sweep.
pub const PAGE: &str = "index.html";
/// A text column with more different values is no group.
const MAX_GROUPS: usize = 12;
/// Quantities that are drawn.
const MAX_DRAWN_QUANTITIES: usize = 8;
/// Points of a scatter figure.
const MAX_POINTS: usize = 4000;

/// A column of the results.
struct Values {
    column: Column,
    numbers: Vec<f64>,
    texts: Vec<String>,
}

impl Values {
    /// Value of a task as a text; empty if it has none.
    fn text(&self, task: usize) -> String {
        match self.column.kind {
            Type::Text => self.texts.get(task).cloned().unwrap_or_default(),
            _ => self
                .numbers
                .get(task)
                .filter(|value| value.is_finite())
                .map_or_else(String::new, |one| short(*one)),
        }
    }
}

/// Writes the page of a merged sweep; its path.
///
/// # Errors
/// A folder without merged results, or a page that cannot be written.
pub fn write(folder: &Path) -> Result<PathBuf, Error> {
    let manifest = Manifest::read(folder)?;
    let plan = manifest.file()?;
    let columns = read(folder, &manifest)?;
    let page = page(&manifest, &plan, &columns);
    let tasks = tasks::table(&columns, folder);
    let text = html(&page).replacen("</main>", &format!("{tasks}</main>"), 1);
    let path = folder.join(PAGE);
    crate::own::check(&path, "<title>Sweep</title>")?;
    write_whole(&path, |out| out.write_all(text.as_bytes())).map_err(Error::io(&path))?;
    Ok(path)
}

/// Merged rows, column by column; a missing number is NaN.
fn read(folder: &Path, manifest: &Manifest) -> Result<Vec<Values>, Error> {
    let path = folder.join(RESULTS);
    let file = std::fs::File::open(&path).map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => Error::Damaged {
            path: path.clone(),
            problem: format!("it is not there; run `airloop sweep merge {}` first", folder.display()),
        },
        _ => Error::io(&path)(source),
    })?;
    let empty = |column: &Column| Values { column: column.clone(), numbers: Vec::new(), texts: Vec::new() };
    let mut columns: Vec<Values> = manifest.columns.iter().map(empty).collect();
    for line in BufReader::new(file).lines().skip(1) {
        let line = line.map_err(Error::io(&path))?;
        let cells = table::read_row(&line, &manifest.columns);
        let cells = cells.ok_or_else(|| Error::Damaged {
            path: path.clone(),
            problem: format!("the row `{line}` cannot be read"),
        })?;
        for (values, cell) in columns.iter_mut().zip(cells) {
            match (values.column.kind, cell) {
                (Type::Text, Cell::Text(text)) => values.texts.push(text),
                (Type::Text, _) => values.texts.push(String::new()),
                (_, Cell::Number(number)) => values.numbers.push(number),
                (_, Cell::Integer(number)) => values.numbers.push(number as f64),
                _ => values.numbers.push(f64::NAN),
            }
        }
    }
    Ok(columns)
}

fn page(manifest: &Manifest, plan: &PlanFile, columns: &[Values]) -> Page {
    let [inner @ .., status, cause] = columns else { return Page::default() };
    let inner = inner.get(2..).unwrap_or_default();
    let (factors, results) = inner.split_at(plan.factors.len().min(inner.len()));
    let bad = status.texts.iter().filter(|status| *status != "ok").count();
    let numbers: Vec<&Values> = results.iter().filter(|one| one.column.kind != Type::Text).collect();
    let mut tables = vec![quantities(&numbers)];
    let is_group = |one: &&Values| {
        let groups = one.column.kind == Type::Text && !tasks::is_folder(one);
        groups && (1..=MAX_GROUPS).contains(&counts(&one.texts).len())
    };
    tables.extend(inner.iter().filter(is_group).map(|one| groups(one, &numbers)));
    for factor in factors.iter().filter(is_group) {
        tables.extend(results.iter().filter(is_group).map(|outcome| crossed(factor, outcome)));
    }
    if plan.sample.as_ref().is_some_and(|sample| sample.method == Method::Saltelli) {
        tables.extend(numbers.iter().filter_map(|quantity| sobol_indices(quantity, factors)));
    }
    let mut figures: Vec<String> = results.iter().filter(is_group).map(count_figure).collect();
    for quantity in numbers.iter().take(MAX_DRAWN_QUANTITIES) {
        figures.extend(influence_figures(quantity, factors));
        if !factors.is_empty() && factors.iter().all(|one| one.column.kind == Type::Text) {
            figures.extend(tasks::figure(quantity, factors));
        }
    }
    Page {
        title: "Sweep".into(),
        lead: format!(
            "{} tasks, {bad} of them not ok; plan {}, airloop {}",
            manifest.tasks,
            digits(&manifest.digest),
            manifest.program.version
        ),
        remarks: vec![("Not ok".into(), failures(&status.texts, &cause.texts))],
        tables,
        figures,
        ..Page::default()
    }
}

/// Rank correlation of a quantity with every factor that is a number, and the quantity over the strongest; none if
/// nothing moves it.
fn influence_figures(quantity: &Values, factors: &[Values]) -> Vec<String> {
    let numbers = factors.iter().filter(|one| one.column.kind != Type::Text);
    let mut influence: Vec<(&Values, f64)> = numbers
        .filter_map(|factor| {
            Some((factor, statistics::rank_correlation(&factor.numbers, &quantity.numbers)?))
        })
        .collect();
    influence.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    let Some((strongest, _)) = influence.first() else { return Vec::new() };
    let bars: Vec<(&str, f64)> =
        influence.iter().map(|(factor, value)| (factor.column.name.as_str(), *value)).collect();
    let pairs = strongest.numbers.iter().copied().zip(quantity.numbers.iter().copied());
    let every = strongest.numbers.len().div_ceil(MAX_POINTS).max(1);
    let points: Vec<(f64, f64)> =
        pairs.filter(|(a, b)| a.is_finite() && b.is_finite()).step_by(every).collect();
    vec![
        figures::tornado(&quantity.column.name, &bars),
        figures::scatter(&points, (&strongest.column.title(), &quantity.column.title())),
    ]
}

/// Number of tasks of each text, the most frequent first.
fn count_figure(group: &Values) -> String {
    let mut bars: Vec<(&str, usize)> = counts(&group.texts).into_iter().collect();
    bars.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    figures::counts(&group.column.name, &bars)
}

fn counts(texts: &[String]) -> BTreeMap<&str, usize> {
    let mut counts = BTreeMap::new();
    for text in texts.iter().filter(|text| !text.is_empty()) {
        *counts.entry(text.as_str()).or_insert(0) += 1;
    }
    counts
}

/// Each cause with its number and its first task, the most frequent first.
fn failures(status: &[String], causes: &[String]) -> Vec<String> {
    let mut found: BTreeMap<(&str, &str), (usize, usize)> = BTreeMap::new();
    for (task, (status, cause)) in
        status.iter().zip(causes).enumerate().filter(|(_, (status, _))| *status != "ok")
    {
        found.entry((status, cause)).or_insert((0, task)).0 += 1;
    }
    let mut sorted: Vec<_> = found.into_iter().collect();
    sorted.sort_by_key(|(_, (count, first))| (usize::MAX - count, *first));
    let line = |((status, cause), (count, first)): ((&str, &str), (usize, usize))| {
        format!("{count} tasks {status}, first task {first}: {cause}")
    };
    sorted.into_iter().map(line).collect()
}

/// A number for a table; a dash where there is none.
fn number(value: f64) -> String {
    if value.is_finite() { short(value) } else { "-".into() }
}

fn quantities(numbers: &[&Values]) -> Table {
    let row = |one: &&Values| {
        let all = statistics::Statistics::of(&one.numbers);
        let values = [all.min, all.median, all.mean, all.max, all.deviation].map(number);
        [one.column.title(), all.count.to_string()].into_iter().chain(values).collect()
    };
    Table {
        sentences: false,
        heading: "Quantities".into(),
        header: ["quantity", "values", "least", "median", "mean", "largest", "standard deviation"]
            .map(String::from)
            .to_vec(),
        rows: numbers.iter().map(row).collect(),
    }
}

/// Share of the variance of a quantity that each factor makes.
fn sobol_indices(quantity: &Values, factors: &[Values]) -> Option<Table> {
    let (found, points) = indices::indices(&quantity.numbers, factors.len())?;
    let header = ["factor", "first order", "95 % interval", "total", "95 % interval"];
    let row = |(factor, own): (&Values, &indices::Indices)| {
        let mut cells = vec![factor.column.name.clone()];
        for estimate in [own.first, own.total] {
            let [low, high] = estimate.interval;
            cells.extend([format!("{:.3}", estimate.value), format!("{low:.3} to {high:.3}")]);
        }
        cells
    };
    Some(Table {
        sentences: false,
        heading: format!("Sobol' indices of {}, from {points} points", quantity.column.name),
        header: header.map(String::from).to_vec(),
        rows: factors.iter().zip(&found).map(row).collect(),
    })
}

/// Number of tasks with each outcome for each value of a factor, both texts.
fn crossed(factor: &Values, outcome: &Values) -> Table {
    let outcomes: Vec<&str> = counts(&outcome.texts).into_keys().collect();
    let row = |text: &str| {
        let tasks = |wanted: &str| {
            let both = factor.texts.iter().zip(&outcome.texts);
            both.filter(|(own, found)| *own == text && *found == wanted).count().to_string()
        };
        let none = std::iter::once(tasks(""));
        let numbers = outcomes.iter().map(|wanted| tasks(wanted)).chain(none);
        std::iter::once(text.to_owned()).chain(numbers).collect()
    };
    let header =
        std::iter::once(factor.column.name.as_str()).chain(outcomes.iter().copied()).chain(["no value"]);
    Table {
        sentences: false,
        heading: format!("{} by {}", outcome.column.name, factor.column.name),
        header: header.map(str::to_owned).collect(),
        rows: counts(&factor.texts).into_keys().map(row).collect(),
    }
}

/// Number of tasks and mean of every quantity for each value of a text column.
fn groups(group: &Values, numbers: &[&Values]) -> Table {
    let header = [group.column.name.clone(), "tasks".into()].into_iter();
    let header = header.chain(numbers.iter().map(|one| format!("mean {}", one.column.title())));
    let row = |(text, count): (&str, usize)| {
        let mean = |one: &&Values| {
            let own = one.numbers.iter().zip(&group.texts).filter(|(_, own)| *own == text);
            number(statistics::Statistics::of(&own.map(|(number, _)| *number).collect::<Vec<_>>()).mean)
        };
        [text.to_owned(), count.to_string()].into_iter().chain(numbers.iter().map(mean)).collect()
    };
    Table {
        sentences: false,
        heading: format!("By {}", group.column.name),
        header: header.collect(),
        rows: counts(&group.texts).into_iter().map(row).collect(),
    }
}
