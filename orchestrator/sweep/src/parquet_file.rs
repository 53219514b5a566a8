//! Rows as a Parquet file: plain pages in row groups of a fixed length, so that equal rows are equal bytes.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use airloop_series::file;
use parquet::basic::{Encoding, LogicalType, Repetition, Type as Physical};
use parquet::column::reader::ColumnReader;
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::FileReader;
use parquet::file::serialized_reader::SerializedFileReader;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{Type as Schema, TypePtr};
use tempfile::NamedTempFile;

use crate::Error;
use crate::manifest::Manifest;
use crate::table::{Cell, Column, Type};

/// Entry of the metadata with the content of plan, program and inputs.
pub const METADATA: &str = "airloop.digest";

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
    /// Begins a file of a sweep; its metadata say the plan and the unit of every column.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Parquet`].
    pub fn create(path: &Path, columns: &[Column], manifest: &Manifest) -> Result<Writer, Error> {
        let parquet = |source| Error::Parquet { path: path.into(), source };
        let fields = columns.iter().map(field).collect::<Result<Vec<_>, _>>().map_err(parquet)?;
        let schema = Schema::group_type_builder("sweep").with_fields(fields).build().map_err(parquet)?;
        let described = serde_json::to_string(columns).expect("names and units");
        let metadata = vec![
            KeyValue::new(METADATA.into(), manifest.digest.clone()),
            KeyValue::new("airloop.columns".into(), described),
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
        Ok(Writer { path: path.into(), columns: columns.to_vec(), inner, rows: Vec::new() })
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
        written.as_file().sync_all().map_err(Error::io(&path))?;
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

/// Columns of numbers of one row group after the other, as [`Writer`] writes them.
pub struct Reader {
    path: PathBuf,
    columns: usize,
    inner: SerializedFileReader<File>,
}

impl Reader {
    /// Opens a file whose columns are one of whole numbers and `columns - 1` of numbers.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Parquet`].
    pub fn open(path: &Path, columns: usize) -> Result<Reader, Error> {
        let file = File::open(path).map_err(Error::io(path))?;
        let parquet = |source| Error::Parquet { path: path.into(), source };
        let inner = SerializedFileReader::new(file).map_err(parquet)?;
        let found = inner.metadata().file_metadata().schema_descr().num_columns();
        match found == columns {
            true => Ok(Reader { path: path.into(), columns, inner }),
            false => Err(Error::Damaged {
                path: path.into(),
                problem: format!("it has {found} columns, not {columns}"),
            }),
        }
    }

    /// Number of row groups.
    pub fn groups(&self) -> usize {
        self.inner.metadata().num_row_groups()
    }

    /// The whole numbers of a row group, and its numbers column by column.
    ///
    /// # Errors
    /// [`Error::Parquet`].
    pub fn group(&self, index: usize) -> Result<(Vec<u64>, Vec<Vec<f64>>), Error> {
        self.try_group(index).map_err(|source| Error::Parquet { path: self.path.clone(), source })
    }

    fn try_group(&self, index: usize) -> Result<(Vec<u64>, Vec<Vec<f64>>), ParquetError> {
        let group = self.inner.get_row_group(index)?;
        let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
        let whole: Vec<i64> = read::<Int64Type>(group.get_column_reader(0)?, rows)?;
        let numbers =
            (1..self.columns).map(|column| read::<DoubleType>(group.get_column_reader(column)?, rows));
        Ok((whole.into_iter().map(i64::cast_unsigned).collect(), numbers.collect::<Result<_, _>>()?))
    }
}

fn read<T: DataType>(column: ColumnReader, rows: usize) -> Result<Vec<T::T>, ParquetError> {
    let wrong = || ParquetError::General("a column is of another type".into());
    let mut column = T::get_column_reader(column).ok_or_else(wrong)?;
    let (mut there, mut values) = (Vec::new(), Vec::with_capacity(rows));
    column.read_records(rows, Some(&mut there), None, &mut values)?;
    match values.len() == rows {
        true => Ok(values),
        false => Err(ParquetError::General("values are missing".into())),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_bit_for_bit() {
        let place = tempfile::tempdir().unwrap();
        std::fs::write(place.path().join("plan.toml"), "kind = \"empty\"").unwrap();
        let manifest = Manifest::plan(&place.path().join("plan.toml")).unwrap();
        let columns = [Column::new("task", Type::Integer), Column::new("x", Type::Number)];
        let path = place.path().join("x.parquet");
        let mut writer = Writer::create(&path, &columns, &manifest).unwrap();
        let number = |row: usize| [0.1 + row as f64, -0.0, f64::NAN, 1e300, f64::NEG_INFINITY][row % 5];
        let rows = GROUP + 1000;
        for row in 0..rows {
            writer.push(vec![Cell::Integer(u64::MAX - row as u64), Cell::Number(number(row))]).unwrap();
        }
        writer.finish().unwrap().persist().unwrap();
        let reader = Reader::open(&path, 2).unwrap();
        let mut row = 0;
        for group in 0..reader.groups() {
            let (tasks, numbers) = reader.group(group).unwrap();
            for (task, found) in tasks.iter().zip(&numbers[0]) {
                assert_eq!((*task, found.to_bits()), (u64::MAX - row as u64, number(row).to_bits()));
                row += 1;
            }
        }
        assert_eq!((row, reader.groups()), (rows, 2));
        assert!(matches!(Reader::open(&path, 3), Err(Error::Damaged { .. })));
    }
}
