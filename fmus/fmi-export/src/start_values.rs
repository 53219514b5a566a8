//! `resources/start_values.toml`: start values of a derived FMU, for the library as it was compiled.
//!
//! A derived FMU has the library of its template, another GUID and other start values, so that a model with
//! identified parameters is packaged without a compiler. The file is the subset of TOML that this takes:
//!
//! ```toml
//! base = "{GUID of the library}"
//! guid = "{GUID of this FMU}"
//!
//! [start]
//! "A1[1,1]" = -1.0081
//! realization = 2
//! ```
//!
//! One `key = value` per line; values are integers, floats, `true`, `false` and strings in double quotes. The reader
//! is written by hand: the export crate sits in every FMU library and depends on nothing.

use crate::table::{Kind, Table, Variable};
use crate::values::Values;
use std::io::ErrorKind;
use std::path::Path;

/// Name of the file in the resources folder.
pub const FILE: &str = "start_values.toml";

/// Content of the file.
#[derive(Debug, PartialEq)]
pub(crate) struct StartValues {
    /// GUID of the library that the file was made for.
    pub base: String,
    /// GUID of the derived FMU.
    pub guid: String,
    entries: Vec<Entry>,
}

#[derive(Debug, PartialEq)]
struct Entry {
    line: usize,
    name: String,
    value: Literal,
}

#[derive(Debug, PartialEq)]
enum Literal {
    Integer(i64),
    Real(f64),
    Boolean(bool),
    Text(String),
}

impl std::fmt::Display for Literal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Integer(x) => write!(f, "{x}"),
            Self::Real(x) => write!(f, "{x:?}"),
            Self::Boolean(x) => write!(f, "{x}"),
            Self::Text(x) => write!(f, "{x:?}"),
        }
    }
}

impl StartValues {
    /// Reads the file of a resources folder; none where there is no such file.
    ///
    /// # Errors
    /// A file that cannot be read or is malformed: file, line, what was found and what is allowed.
    pub fn read(folder: Option<&Path>) -> Result<Option<Self>, String> {
        let Some(folder) = folder else { return Ok(None) };
        match std::fs::read_to_string(folder.join(FILE)) {
            Ok(text) => Self::parse(&text).map(Some).map_err(|(line, what)| message(line, &what)),
            // A location that is a file or nothing at all has no start values; that is for the model to judge.
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => Ok(None),
            Err(error) => Err(format!("resources/{FILE} cannot be read: {error}")),
        }
    }

    fn parse(text: &str) -> Result<Self, (usize, String)> {
        let (mut base, mut guid, mut entries) = (None, None, Vec::<Entry>::new());
        let mut in_start = false;
        for (line, text) in (1..).zip(text.lines()) {
            let fail = |what: String| Err((line, what));
            let text = text.trim();
            if text.is_empty() || text.starts_with('#') {
                continue;
            }
            if text == "[start]" && !in_start {
                in_start = true;
                continue;
            }
            let (name, value) = match assignment(text) {
                Ok(pair) => pair,
                Err(what) => return fail(what),
            };
            if in_start {
                if let Some(earlier) = entries.iter().find(|e| e.name == name) {
                    return fail(format!("`{name}` has a value in line {} already", earlier.line));
                }
                entries.push(Entry { line, name, value });
                continue;
            }
            let slot = match name.as_str() {
                "base" => &mut base,
                "guid" => &mut guid,
                _ => return fail(format!("`{name}` before [start]; allowed there: base, guid")),
            };
            match value {
                Literal::Text(text) if slot.is_none() => *slot = Some(text),
                Literal::Text(_) => return fail(format!("`{name}` is given twice")),
                other => return fail(format!("`{name}` = {other} is not a string")),
            }
        }
        match (base, guid) {
            (Some(base), Some(guid)) => Ok(Self { base, guid, entries }),
            (None, _) => Err((1, "`base`, the GUID of the library, is missing".into())),
            (_, None) => Err((1, "`guid`, the GUID of this FMU, is missing".into())),
        }
    }

    /// Puts the values into `values`.
    ///
    /// # Errors
    /// A name that the model does not have, a variable without start value, a value of another type or out of range.
    pub fn apply(&self, table: &Table, values: &mut Values<f64>) -> Result<(), String> {
        for entry in &self.entries {
            let fail = |what: String| Err(message(entry.line, &what));
            let name = &entry.name;
            let Some(variable) = table.by_name(name) else {
                return fail(format!("the model has no variable `{name}`"));
            };
            if variable.is_computed() {
                return fail(format!("`{name}` is computed by the model and has no start value"));
            }
            if let Err(allowed) = set(variable, &entry.value, table, values) {
                return fail(format!("`{name}` = {}; allowed: {allowed}", entry.value));
            }
        }
        Ok(())
    }
}

fn message(line: usize, what: &str) -> String {
    format!("resources/{FILE}, line {line}: {what}")
}

/// Sets one variable, or says what it takes.
fn set(v: &Variable, value: &Literal, table: &Table, values: &mut Values<f64>) -> Result<(), String> {
    match (&v.kind, value) {
        (Kind::Real { handle, min, max, .. }, Literal::Integer(_) | Literal::Real(_)) => {
            let x = match value {
                Literal::Real(x) => *x,
                Literal::Integer(i) => *i as f64,
                _ => f64::NAN,
            };
            let (low, high) = (min.unwrap_or(f64::MIN), max.unwrap_or(f64::MAX));
            if !(low..=high).contains(&x) {
                return Err(format!("a Real in {low:?}..{high:?}"));
            }
            values[*handle] = x;
        }
        (Kind::Integer { handle, min, max, .. }, Literal::Integer(i)) => {
            let (low, high) = (min.unwrap_or(i32::MIN), max.unwrap_or(i32::MAX));
            let fits = i32::try_from(*i).ok().filter(|i| (low..=high).contains(i));
            values[*handle] = fits.ok_or_else(|| format!("an Integer in {low}..{high}"))?;
        }
        (Kind::Enumeration { handle, enumeration, .. }, Literal::Integer(i)) => {
            let items = table.enumerations()[*enumeration].items;
            let fits = i32::try_from(*i).ok().filter(|i| (1..=items.len() as i32).contains(i));
            values[*handle] = fits.ok_or_else(|| format!("an item number in 1..{}", items.len()))?;
        }
        (Kind::Boolean { handle, .. }, Literal::Boolean(b)) => values[*handle] = *b,
        (Kind::Text { handle, .. }, Literal::Text(text)) => values[*handle].clone_from(text),
        (Kind::Real { .. }, _) => return Err("a Real".into()),
        (Kind::Integer { .. }, _) => return Err("an Integer".into()),
        (Kind::Enumeration { .. }, _) => return Err("the number of an item".into()),
        (Kind::Boolean { .. }, _) => return Err("true or false".into()),
        (Kind::Text { .. }, _) => return Err("a string in double quotes".into()),
    }
    Ok(())
}

/// `key = value`, with a comment behind it or not.
fn assignment(line: &str) -> Result<(String, Literal), String> {
    let (name, rest) = if line.starts_with('"') {
        string(line)?
    } else {
        let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        let end = line.find(|c| !bare(c)).unwrap_or(line.len());
        (line[..end].to_owned(), &line[end..])
    };
    let rest = rest.trim_start().strip_prefix('=').filter(|_| !name.is_empty());
    let rest = rest.ok_or_else(|| {
        format!(
            "`{line}` is not of the form name = value; a name with brackets or dots stands in double quotes"
        )
    })?;
    let rest = rest.trim_start();
    let (value, rest) = if rest.starts_with('"') {
        let (text, rest) = string(rest)?;
        (Literal::Text(text), rest)
    } else {
        let end = rest.find(|c: char| c.is_whitespace() || c == '#').unwrap_or(rest.len());
        (literal(&rest[..end])?, &rest[end..])
    };
    match rest.trim_start() {
        "" => Ok((name, value)),
        comment if comment.starts_with('#') => Ok((name, value)),
        other => Err(format!("`{other}` behind the value of `{name}`; one name = value per line")),
    }
}

fn literal(text: &str) -> Result<Literal, String> {
    let is_number = text.starts_with(|c: char| c.is_ascii_digit() || c == '+' || c == '-');
    match text {
        "true" => Ok(Literal::Boolean(true)),
        "false" => Ok(Literal::Boolean(false)),
        _ if is_number && !text.contains(['i', 'n']) => text
            .parse()
            .map(Literal::Integer)
            .ok()
            .or_else(|| text.parse().ok().filter(|x: &f64| x.is_finite()).map(Literal::Real))
            .ok_or_else(|| format!("`{text}` is not a finite number")),
        _ => Err(format!("`{text}` is not a finite number, true, false or a string in double quotes")),
    }
}

/// A string in double quotes at the start of `text`, and what follows it.
fn string(text: &str) -> Result<(String, &str), String> {
    let unclosed = || format!("`{text}` has no closing double quote in its line");
    let mut content = String::new();
    let mut rest = text.strip_prefix('"').ok_or_else(unclosed)?;
    loop {
        let c = rest.chars().next().ok_or_else(unclosed)?;
        rest = &rest[c.len_utf8()..];
        if c == '"' {
            return Ok((content, rest));
        }
        if c != '\\' {
            content.push(c);
            continue;
        }
        let escape = rest.chars().next().ok_or_else(unclosed)?;
        rest = &rest[escape.len_utf8()..];
        content.push(match escape {
            '"' | '\\' => escape,
            'n' => '\n',
            't' => '\t',
            'r' => '\r',
            'b' => '\u{8}',
            'f' => '\u{c}',
            'u' | 'U' => {
                let digits = if escape == 'u' { 4 } else { 8 };
                let code = rest.get(..digits).and_then(|hex| u32::from_str_radix(hex, 16).ok());
                rest = rest.get(digits..).unwrap_or_default();
                let c = code.and_then(char::from_u32);
                c.ok_or_else(|| format!("\\{escape} is not followed by {digits} digits of a character"))?
            }
            other => return Err(format!("\\{other} is not an escape; a backslash is written \\\\")),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "# made by a test\nbase = \"{b}\"\nguid=\"{g}\" # ours\n\n[start]\n";

    fn parse(body: &str) -> Result<StartValues, (usize, String)> {
        StartValues::parse(&format!("{HEAD}{body}"))
    }

    #[test]
    fn every_kind_of_value_is_read() {
        let file = parse("k = 3\n\"a.b[1]\" = -2.5e-3\nflag = true # on\ntext = \"\\\"ä\\u00df\\\\\\n\"\n");
        let file = file.expect("well-formed");
        assert_eq!((file.base.as_str(), file.guid.as_str()), ("{b}", "{g}"));
        let expected = [
            ("k", Literal::Integer(3)),
            ("a.b[1]", Literal::Real(-2.5e-3)),
            ("flag", Literal::Boolean(true)),
            ("text", Literal::Text("\"äß\\\n".into())),
        ];
        let found: Vec<(&str, &Literal)> = file.entries.iter().map(|e| (e.name.as_str(), &e.value)).collect();
        assert_eq!(found, expected.iter().map(|(n, v)| (*n, v)).collect::<Vec<_>>());
    }

    #[test]
    fn malformed_lines_are_named_with_what_is_wrong() {
        for (body, line, expected) in [
            ("x[1] = 2\n", 6, "double quotes"),
            ("x = 1\ny = \n", 7, "not a finite number"),
            ("x = nan\n", 6, "`nan` is not"),
            ("x = -inf\n", 6, "`-inf` is not"),
            ("x = 1e999\n", 6, "`1e999` is not a finite number"),
            ("x = 1 2\n", 6, "`2` behind the value"),
            ("x = 1\nx = 2\n", 7, "line 6 already"),
            ("x = \"a\n", 6, "no closing double quote"),
            ("x = \"\\q\"\n", 6, "not an escape"),
            ("= 2\n", 6, "name = value"),
            ("[start]\n", 6, "name = value"),
        ] {
            let (at, what) = parse(body).expect_err(body);
            assert!(at == line && what.contains(expected), "{body}: line {at}: {what}");
        }
        for (text, expected) in [
            ("guid = \"g\"\n", "`base`"),
            ("base = \"b\"\n[start]\n", "`guid`"),
            ("base = 1\n", "not a string"),
            ("other = \"b\"\n", "before [start]"),
        ] {
            let (_, what) = StartValues::parse(text).expect_err(text);
            assert!(what.contains(expected), "{text}: {what}");
        }
    }
}
