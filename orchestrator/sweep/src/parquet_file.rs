//! Rows as a Parquet file: plain pages in row groups of a fixed length, so that equal rows are equal bytes.

use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use airloop_series::file;
use parquet::basic::{Encoding, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{Type as Schema, TypePtr};
use tempfile::NamedTempFile;

use crate::Error;
use crate::manifest::Manifest;
use crate::table::{Cell, Column, Type};

/// Rows of a row group.
const GROUP: usize = 1 << 16;

/// A file that is being written under a temporary name.
pub struct Writer {
    path: PathBuf,
    columns: Vec<Column>,
    inner: SerializedFileWriter<BufWriter<NamedTempFile>>,
    rows: Vec<Vec<Cell>>,
}

impl Writer {
    /// Begins a file with the columns of a manifest; its metadata say the plan and the unit of every column.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Parquet`].
    pub fn create(path: &Path, manifest: &Manifest) -> Result<Writer, Error> {
        let parquet = |source| Error::Parquet { path: path.into(), source };
        let fields = manifest.columns.iter().map(field).collect::<Result<Vec<_>, _>>().map_err(parquet)?;
        let schema = Schema::group_type_builder("sweep").with_fields(fields).build().map_err(parquet)?;
        let columns = serde_json::to_string(&manifest.columns).expect("names and units");
        let metadata = vec![
            KeyValue::new("airloop.digest".into(), manifest.digest.clone()),
            KeyValue::new("airloop.columns".into(), columns),
        ];
        let properties = WriterProperties::builder()
            .set_created_by(format!("airloop {}", manifest.program.version))
            .set_dictionary_enabled(false)
            .set_encoding(Encoding::PLAIN)
            .set_max_row_group_row_count(Some(GROUP))
            .set_key_value_metadata(Some(metadata))
            .build();
        let folder = path.parent().unwrap_or(Path::new("."));
        let out = BufWriter::new(file::temporary(folder).map_err(Error::io(path))?);
        let inner =
            SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties)).map_err(parquet)?;
        Ok(Writer { path: path.into(), columns: manifest.columns.clone(), inner, rows: Vec::new() })
    }

    /// Adds a row, whose cells are of the types of the columns.
    ///
    /// # Errors
    /// [`Error::Parquet`].
    pub fn push(&mut self, row: Vec<Cell>) -> Result<(), Error> {
        self.rows.push(row);
        if self.rows.len() == GROUP { self.write_group() } else { Ok(()) }
    }

    fn write_group(&mut self) -> Result<(), Error> {
        let path = self.path.clone();
        self.try_write_group().map_err(|source| Error::Parquet { path, source })?;
        self.rows.clear();
        Ok(())
    }

    fn try_write_group(&mut self) -> Result<(), ParquetError> {
        let mut group = self.inner.next_row_group()?;
        for (index, column) in self.columns.iter().enumerate() {
            let cells = self.rows.iter().map(|row| &row[index]);
            let there: Vec<i16> = cells.clone().map(|cell| i16::from(*cell != Cell::Empty)).collect();
            let out = group.next_column()?;
            let mut out = out.ok_or_else(|| ParquetError::General("a column is missing".into()))?;
            write(&mut out, column.kind, cells, &there)?;
            out.close()?;
        }
        group.close()?;
        Ok(())
    }

    /// Ends the file, which has no name yet.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Parquet`].
    pub fn finish(mut self) -> Result<Complete, Error> {
        if !self.rows.is_empty() {
            self.write_group()?;
        }
        let path = self.path;
        let out = self.inner.into_inner().map_err(|source| Error::Parquet { path: path.clone(), source })?;
        let written = out.into_inner().map_err(|error| Error::io(&path)(error.into_error()))?;
        Ok(Complete { path, written })
    }
}

/// A file that is complete under a temporary name.
pub struct Complete {
    path: PathBuf,
    written: NamedTempFile,
}

impl Complete {
    /// Gives it its name.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn persist(self) -> Result<(), Error> {
        file::persist(self.written, &self.path).map_err(Error::io(&self.path))
    }
}

fn write<'a>(
    out: &mut SerializedColumnWriter<'_>,
    kind: Type,
    cells: impl Iterator<Item = &'a Cell>,
    there: &[i16],
) -> Result<usize, ParquetError> {
    match kind {
        Type::Integer => {
            let values: Vec<i64> = cells.filter_map(integer).collect();
            out.typed::<Int64Type>().write_batch(&values, Some(there), None)
        }
        Type::Number => {
            let values: Vec<f64> = cells.filter_map(number).collect();
            out.typed::<DoubleType>().write_batch(&values, Some(there), None)
        }
        Type::Text => {
            let values: Vec<ByteArray> = cells.filter_map(text).collect();
            out.typed::<ByteArrayType>().write_batch(&values, Some(there), None)
        }
    }
}

fn integer(cell: &Cell) -> Option<i64> {
    match cell {
        // The schema says that the bits are those of a number without sign.
        Cell::Integer(value) => Some(value.cast_signed()),
        _ => None,
    }
}

fn number(cell: &Cell) -> Option<f64> {
    match cell {
        Cell::Number(value) => Some(*value),
        _ => None,
    }
}

fn text(cell: &Cell) -> Option<ByteArray> {
    match cell {
        Cell::Text(value) => Some(ByteArray::from(value.as_str())),
        _ => None,
    }
}

fn field(column: &Column) -> Result<TypePtr, ParquetError> {
    let (physical, logical) = match column.kind {
        Type::Integer => (Physical::INT64, Some(LogicalType::integer(64, false))),
        Type::Number => (Physical::DOUBLE, None),
        Type::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
    };
    let field = Schema::primitive_type_builder(&column.name, physical)
        .with_repetition(Repetition::OPTIONAL)
        .with_logical_type(logical);
    Ok(Arc::new(field.build()?))
}
