//! Programs from text, one statement a line; `tests/study/programs/read.py` reads the same for CasADi.
//!
//! | line | meaning |
//! |------|---------|
//! | `program NAME` | begins a program |
//! | `start 1, 2, 3` | the start, and so the number of variables |
//! | `variables N`, `start x[3] = 1` | the same for many variables, which begin at 0 |
//! | `bound x2 = 0, inf`, `bound all = 0, inf` | bounds of a variable, of all |
//! | `let a = x1 + x2` | an abbreviation |
//! | `minimize F` | a term of the objective; several lines add up |
//! | `zero C`, `positive C`, `within 1, 2 of C` | constraint C = 0, C >= 0, 1 <= C <= 2 |
//! | `minimum F, F` | values of the known minima, the best one first |
//! | `for i = 1..9, j = i + 1..10: LINE` | the line for all values, which it may use |
//! | `# ...` | a remark |
//!
//! Variables are `x1` or `x[i + 1]`, from 1; formulas are those of `airloop-expression`.

use airloop_expression::Expression;

use crate::element::Element;
use crate::program::Program;

/// Abbreviations, or loop variables, with the text that stands for them.
type Names = Vec<(String, String)>;

/// All programs of the collections.
pub fn all() -> Vec<Program> {
    [include_str!("hock_schittkowski.txt"), include_str!("cutest.txt"), include_str!("schittkowski.txt")]
        .into_iter()
        .flat_map(read)
        .collect()
}

/// Programs of a text, which is right: what is not ends with the line.
pub fn read(text: &str) -> Vec<Program> {
    let mut programs: Vec<Program> = Vec::new();
    let mut lets = Names::new();
    for line in
        text.lines().map(|line| line.split('#').next().unwrap_or("").trim()).filter(|line| !line.is_empty())
    {
        let (turns, line) = match line.strip_prefix("for ") {
            Some(rest) => {
                let (head, line) = rest.split_once(':').expect(line);
                (loops(head, &Names::new()), line.trim())
            }
            None => (vec![Names::new()], line),
        };
        let (word, rest) = line.split_once(' ').expect(line);
        if word == "program" {
            programs.push(Program::new(rest.trim()));
            lets.clear();
            continue;
        }
        let program = programs.last_mut().expect("the first line is `program`");
        turns.iter().for_each(|turn| statement(program, &mut lets, turn, word, rest));
    }
    programs
}

fn statement(program: &mut Program, lets: &mut Names, turn: &Names, word: &str, rest: &str) {
    let numbers = |text: &str| -> Vec<f64> { text.split(',').map(|text| number(text, turn)).collect() };
    let halves = |sign: &str| rest.split_once(sign).expect(rest);
    let mut row = |low: f64, high: f64, text: &str| {
        program.rows.push(element(text, lets, turn));
        program.row_bounds.lower.push(low);
        program.row_bounds.upper.push(high);
    };
    match word {
        "variables" => program.resize(rest.trim().parse().expect(rest)),
        "start" if rest.contains('=') => {
            let (name, value) = halves("=");
            program.start[variable(name, turn)] = number(value, turn);
        }
        "start" => {
            let values = numbers(rest);
            program.resize(values.len());
            program.start = values;
        }
        "bound" => {
            let (name, values) = halves("=");
            let values = numbers(values);
            let all = 0..program.start.len();
            let places =
                if name.trim() == "all" { all } else { variable(name, turn)..variable(name, turn) + 1 };
            program.bounds.lower[places.clone()].fill(values[0]);
            program.bounds.upper[places].fill(values[1]);
        }
        "let" => {
            let (name, text) = halves("=");
            lets.push((name.trim().to_owned(), text.to_owned()));
        }
        "minimize" => program.objective.push(element(rest, lets, turn)),
        "zero" => row(0.0, 0.0, rest),
        "positive" => row(0.0, f64::INFINITY, rest),
        "within" => {
            let (limits, text) = halves(" of ");
            let limits = numbers(limits);
            row(limits[0], limits[1], text);
        }
        "minimum" => program.minima = numbers(rest),
        _ => panic!("`{word}` is no word of a program"),
    }
}

/// Values of the variables of a loop, in order.
fn loops(head: &str, outer: &Names) -> Vec<Names> {
    let (this, rest) = head.split_once(',').map_or((head, None), |(this, rest)| (this, Some(rest)));
    let (name, span) = this.split_once('=').expect(head);
    let (first, last) = span.split_once("..").expect(head);
    let mut all = Vec::new();
    for k in number(first, outer) as i64..=number(last, outer) as i64 {
        let mut inner = outer.clone();
        inner.push((name.trim().to_owned(), k.to_string()));
        match rest {
            Some(rest) => all.extend(loops(rest, &inner)),
            None => all.push(inner),
        }
    }
    all
}

fn number(text: &str, turn: &Names) -> f64 {
    match text.trim() {
        "inf" => f64::INFINITY,
        "-inf" => f64::NEG_INFINITY,
        text => Expression::parse(&expand(text, turn, turn, &mut Vec::new()), &[]).expect(text).value(&[]),
    }
}

/// Place of a variable, from 0.
fn variable(text: &str, turn: &Names) -> usize {
    let mut own = Vec::new();
    expand(text.trim(), turn, turn, &mut own);
    own[0]
}

fn element(text: &str, lets: &Names, turn: &Names) -> Element {
    let names: Names = turn.iter().chain(lets).cloned().collect();
    let mut own = Vec::new();
    let text = expand(text, &names, turn, &mut own);
    let own_names: Vec<String> = own.iter().map(|at| format!("x{}", at + 1)).collect();
    let own_names: Vec<&str> = own_names.iter().map(String::as_str).collect();
    let formula = Expression::parse(&text, &own_names).unwrap_or_else(|error| panic!("{text}: {error}"));
    Element::new(formula, own)
}

/// The text with numbers for loop variables and brackets for abbreviations; `own` gathers the variables in it.
fn expand(text: &str, names: &Names, turn: &Names, own: &mut Vec<usize>) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let (token, after) = rest.split_at(token(rest, first));
        rest = after;
        let place = if token == "x" && rest.starts_with('[') {
            let (index, after) = rest[1..].split_once(']').expect(text);
            rest = after;
            Some(number(index, turn) as usize)
        } else {
            token.strip_prefix('x').and_then(|digits| digits.parse().ok())
        };
        if let Some(place) = place {
            if !own.contains(&(place - 1)) {
                own.push(place - 1);
            }
            out.push_str(&format!("x{place}"));
        } else if let Some((_, value)) = names.iter().find(|(name, _)| name == token) {
            let value = expand(value, names, turn, own);
            out.push_str(&format!("({value})"));
        } else {
            out.push_str(token);
        }
    }
    out
}

/// Length of the number, the name or the sign at the beginning.
fn token(text: &str, first: char) -> usize {
    let end = |wanted: fn(char) -> bool| text.find(|c| !wanted(c)).unwrap_or(text.len());
    if first.is_ascii_digit() || first == '.' {
        let digits = end(|c| c.is_ascii_digit() || c == '.');
        let exponent = text[digits..].strip_prefix('e').map(|rest| rest.trim_start_matches('-'));
        let Some(rest) = exponent.filter(|rest| rest.starts_with(|c: char| c.is_ascii_digit())) else {
            return digits;
        };
        let left = rest.trim_start_matches(|c: char| c.is_ascii_digit());
        text.len() - left.len()
    } else if first.is_alphabetic() {
        end(|c| c.is_alphanumeric() || c == '_')
    } else {
        first.len_utf8()
    }
}
