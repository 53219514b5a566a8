//! CSV row by row, for tables that are longer than the memory. The format is that of [`super::csv`].

use std::io::{Result, Write};

/// Writes the header: `time`, then the names.
///
/// # Errors
/// Those of `out`.
pub fn write_header<'a>(out: &mut impl Write, names: impl IntoIterator<Item = &'a str>) -> Result<()> {
    out.write_all(b"time")?;
    for name in names {
        if name.contains([',', '"', '\n']) {
            write!(out, ",\"{}\"", name.replace('"', "\"\""))?;
        } else {
            write!(out, ",{name}")?;
        }
    }
    out.write_all(b"\n")
}

/// Writes a row; numbers are in the shortest form that reads back bit for bit.
///
/// # Errors
/// Those of `out`.
pub fn write_row(out: &mut impl Write, time: f64, values: impl IntoIterator<Item = f64>) -> Result<()> {
    write!(out, "{time}")?;
    for value in values {
        write_number(value, out)?;
    }
    out.write_all(b"\n")
}

/// The shortest text that reads back to the same value, without long runs of zeros.
fn write_number(value: f64, out: &mut impl Write) -> std::io::Result<()> {
    let size = value.abs();
    if size != 0.0 && !(1e-5..1e16).contains(&size) {
        write!(out, ",{value:e}")
    } else {
        write!(out, ",{value}")
    }
}
