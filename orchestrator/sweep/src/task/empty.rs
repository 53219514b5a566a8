//! Tasks that do nothing: what is left is the cost of planning, running and merging.

use std::path::PathBuf;

use super::{Outcome, Place, Task, Work};
use crate::Error;
use crate::table::{Cell, Column, Type};

/// Tasks that do nothing.
pub struct Empty;

impl Work for Empty {
    fn columns(&self) -> Vec<Column> {
        vec![Column::new("parity", Type::Integer)]
    }

    fn inputs(&self) -> Vec<PathBuf> {
        Vec::new()
    }

    fn check(&self, _: &Task) -> Result<(), Error> {
        Ok(())
    }

    fn run(&self, task: &Task, _: Place) -> Option<Outcome> {
        Some(Outcome::ok(vec![Cell::Integer(task.seed % 2)]))
    }
}
