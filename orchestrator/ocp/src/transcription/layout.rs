//! Layout of the variables of a phase: nodes one after another, each `(T, x, u)` followed by the variables in the
//! middle of its interval; T only where the duration is free. Where inputs are held over intervals the last node has
//! none.

use std::ops::Range;

#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    /// First variable of the phase.
    pub first: usize,
    pub intervals: usize,
    /// 1 where the duration is a variable of every node.
    pub free: usize,
    pub states: usize,
    pub inputs: usize,
    /// Variables in the middle of an interval.
    pub middle: usize,
    /// Inputs are held over intervals.
    pub held: bool,
}

impl Layout {
    /// Variables of a node, the arguments of the functions there.
    pub fn node_width(&self) -> usize {
        self.free + self.states + self.inputs
    }

    pub fn stride(&self) -> usize {
        self.node_width() + self.middle
    }

    fn last_width(&self) -> usize {
        self.free + self.states + if self.held { 0 } else { self.inputs }
    }

    pub fn variables(&self) -> usize {
        self.intervals * self.stride() + self.last_width()
    }

    /// Variable that is argument `a` of the functions at node `k`.
    pub fn point(&self, k: usize, a: usize) -> usize {
        let borrowed = self.held && k == self.intervals && a >= self.free + self.states;
        self.first + (k - usize::from(borrowed)) * self.stride() + a
    }

    /// Variable that is argument `a` in the middle of interval `k`, where it is one.
    pub fn midpoint(&self, k: usize, a: usize) -> Option<usize> {
        let inputs = self.free + self.states;
        let begin = self.first + k * self.stride() + self.node_width();
        if a < self.free || (self.held && a >= inputs) {
            Some(self.point(k, a))
        } else if self.middle == self.states + self.inputs {
            Some(begin + a - self.free)
        } else if self.middle == self.inputs && a >= inputs {
            Some(begin + a - inputs)
        } else {
            None
        }
    }

    /// Variables of interval `k`: its left node, its middle, its right node.
    pub fn interval(&self, k: usize) -> Range<usize> {
        let begin = self.first + k * self.stride();
        begin
            ..begin
                + self.stride()
                + if k + 1 == self.intervals { self.last_width() } else { self.node_width() }
    }

    /// Stage of variable `i` of the phase, from 0. With held inputs the last node shares the stage of the last
    /// interval, whose input is its own.
    pub fn stage(&self, i: usize) -> usize {
        (i / self.stride()).min(self.stages() - 1)
    }

    pub fn stages(&self) -> usize {
        if self.held { self.intervals } else { self.intervals + 1 }
    }

    pub fn node_stage(&self, k: usize) -> usize {
        k.min(self.stages() - 1)
    }
}
