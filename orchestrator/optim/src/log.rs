//! The iteration table while it grows, and the caller's say in going on.

use std::ops::ControlFlow;

use super::outcome::Iteration;

/// Called after every iteration; `Break` ends the run with the last point.
pub type Monitor<'m> = dyn FnMut(&Iteration) -> ControlFlow<()> + 'm;

pub(super) struct Log<'m> {
    pub table: Vec<Iteration>,
    monitor: &'m mut Monitor<'m>,
}

impl<'m> Log<'m> {
    /// An empty table in memory that held another.
    pub fn new(monitor: &'m mut Monitor<'m>, mut table: Vec<Iteration>) -> Self {
        table.clear();
        Self { table, monitor }
    }

    /// Numbers and keeps a row; false when the caller wants to stop.
    pub fn push(&mut self, mut row: Iteration) -> bool {
        row.number = self.table.len();
        self.table.push(row);
        (self.monitor)(&row).is_continue()
    }
}
