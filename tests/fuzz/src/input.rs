//! An input before it is a file: what its kind of mutation can take apart.

use std::io::{Cursor, Write};

use zip::write::SimpleFileOptions;

/// How a text is taken apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Elements and attributes.
    Xml,
    /// Tables, keys and values.
    Toml,
    /// Rows and cells.
    Csv,
    /// Words and numbers.
    Words,
}

/// An input.
#[derive(Debug, Clone)]
pub enum Input {
    /// One file.
    Plain(Form, Vec<u8>),
    /// An archive of files by name.
    Archive(Vec<(String, Vec<u8>)>),
}

impl Input {
    /// The bytes of the file.
    pub fn bytes(&self) -> Vec<u8> {
        match self {
            Input::Plain(_, bytes) => bytes.clone(),
            Input::Archive(entries) => pack(entries),
        }
    }
}

/// An archive; entries that the format cannot have are left out.
pub fn pack(entries: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in entries {
        let began = match name.ends_with('/') {
            true => writer.add_directory(name.as_str(), SimpleFileOptions::default()),
            false => writer.start_file(name.as_str(), SimpleFileOptions::default()),
        };
        if began.is_ok() && !name.ends_with('/') {
            // Writing to memory.
            let _ = writer.write_all(bytes);
        }
    }
    writer.finish().map(Cursor::into_inner).unwrap_or_default()
}
