//! The order of all work at one point, made once: what is computed here, which calls go into which component, and how
//! derivatives combine.

use super::anatomy::{Anatomy, Origin};
use super::calls::{Column, Reader};
use super::learn::{Coefficient, Local};
use crate::system::graph::Conversion;
use airloop_dynamics::Entry;

/// Place of a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Place {
    /// State or input of the dynamics, by column of the Jacobian.
    Column(usize),
    /// Value of a component.
    Value(usize),
    /// A state that is left out.
    Fixed(f64),
}

/// Factor of a derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Factor {
    Constant(f64),
    /// Varying entry, and the factor of the connection.
    Entry(usize, f64),
}

/// `value = offset + sum of factor * place`.
#[derive(Debug, Clone)]
pub(super) struct Affine {
    pub value: usize,
    pub offset: f64,
    pub terms: Vec<(f64, Place)>,
}

/// A visit to a component: arguments that are new are set, values are read.
#[derive(Debug, Clone)]
pub(super) struct Call {
    pub component: usize,
    /// States, where they are to be set: as many as the component has.
    pub states: Vec<Place>,
    pub references: Vec<u32>,
    /// Position among the arguments, and source.
    pub inputs: Vec<(usize, Place, Conversion)>,
    pub reader: Reader,
}

/// One step of an evaluation.
#[derive(Debug, Clone)]
pub(super) enum Step {
    Affine(Affine),
    Call(Call),
}

/// Derivatives of a value by columns: sum of factor times unit row or row of another value.
#[derive(Debug, Clone)]
pub(super) struct Row {
    pub value: usize,
    pub terms: Vec<(Factor, Place)>,
}

/// Second derivatives with a first argument in common: it is moved, and the columns are differentiated again.
#[derive(Debug, Clone)]
pub(super) struct Bend {
    /// The first is that of the argument that is moved.
    pub columns: Vec<Column>,
    /// The first derivatives run straight along the argument: one side is enough.
    pub straight: bool,
}

/// Derivatives to be taken in one component.
#[derive(Debug, Clone, Default)]
pub(super) struct Slopes {
    pub component: usize,
    pub states: usize,
    /// First derivatives; targets are entries.
    pub columns: Vec<Column>,
    /// Second derivatives; targets are curvatures.
    pub bends: Vec<Bend>,
    /// Values and pairs of arguments of the curvatures.
    pub curvatures: Vec<Curvature>,
    /// Sources of the arguments.
    pub arguments: Vec<(Conversion, Place)>,
}

/// A second derivative of a value by two arguments, of which the first is moved.
#[derive(Debug, Clone, Copy)]
pub(super) struct Curvature {
    pub value: usize,
    pub first: usize,
    pub second: usize,
    /// Entry of the first derivative by the second argument.
    pub entry: usize,
}

/// See the module.
#[derive(Debug, Clone, Default)]
pub(super) struct Program {
    pub steps: Vec<Step>,
    /// Rows of the derivatives in an order in which each needs earlier ones only.
    pub rows: Vec<Row>,
    /// Those among them that are the same everywhere, at the beginning.
    pub constant_rows: usize,
    pub slopes: Vec<Slopes>,
    /// Number of varying entries.
    pub entries: usize,
    /// Number of curvatures of the component with most.
    pub curvatures: usize,
    /// Length of the buffers of calls.
    pub width: usize,
    /// Known kind of every value's derivatives, `[values][columns]`.
    pub patterns: Vec<Vec<Entry>>,
}

/// Data from which the program is made.
pub(super) struct Maker<'a> {
    pub anatomy: &'a Anatomy,
    pub locals: &'a [Local],
    /// Column of each state of each component; `None` for one left out.
    pub columns: Vec<Vec<Option<usize>>>,
    /// Number of states.
    pub states: usize,
    /// Number of states and inputs.
    pub width: usize,
}

impl Maker<'_> {
    /// The program, or the values that wait for each other.
    pub fn make(&self) -> Result<Program, Vec<usize>> {
        let mut program =
            Program { patterns: vec![Vec::new(); self.anatomy.values.len()], ..Program::default() };
        let mut entry_of = vec![Vec::new(); self.anatomy.values.len()];
        for component in 0..self.anatomy.blocks.len() {
            self.slopes(component, &mut program, &mut entry_of);
        }
        let mut done: Vec<bool> = (0..self.anatomy.values.len()).map(|value| self.is_idle(value)).collect();
        let mut set: Vec<Vec<bool>> =
            self.anatomy.blocks.iter().map(|block| vec![false; block.arguments.len()]).collect();
        loop {
            let before = program.rows.len();
            for value in 0..done.len() {
                if !done[value] && self.is_affine(value) && self.is_ready(value, &done) {
                    done[value] = true;
                    program.steps.push(Step::Affine(self.affine(value)));
                    self.add_row(value, &entry_of, &mut program);
                }
            }
            if program.rows.len() > before {
                continue;
            }
            let Some((component, values)) = self.next_call(&done) else { break };
            let call = self.call(component, &values, &done, &mut set[component]);
            program.width = program.width.max(call.reader.width()).max(call.inputs.len());
            program.steps.push(Step::Call(call));
            for value in values {
                done[value] = true;
                self.add_row(value, &entry_of, &mut program);
            }
        }
        // Constant rows depend on constant rows only; the order within each part stays.
        let patterns = &program.patterns;
        let varies = |row: &Row| patterns[row.value].contains(&Entry::Varying);
        program.rows.sort_by_key(varies);
        program.constant_rows = program.rows.iter().filter(|row| !varies(row)).count();
        let waiting: Vec<usize> = (0..done.len()).filter(|&value| !done[value]).collect();
        if waiting.is_empty() { Ok(program) } else { Err(waiting) }
    }

    /// Whether a value is the rate of a state that is left out.
    fn is_idle(&self, value: usize) -> bool {
        let value = &self.anatomy.values[value];
        value.rate.is_some_and(|state| self.columns[value.component][state].is_none())
    }

    fn local(&self, value: usize) -> (&Local, usize) {
        let component = self.anatomy.values[value].component;
        (&self.locals[component], value - self.anatomy.blocks[component].values.start)
    }

    fn is_affine(&self, value: usize) -> bool {
        let (local, row) = self.local(value);
        local.is_affine(row)
    }

    /// Place and conversion of an argument.
    fn source(&self, component: usize, argument: usize) -> (Place, Conversion) {
        match self.anatomy.blocks[component].arguments[argument].origin {
            Origin::State(state) => {
                let anchor = self.locals[component].anchor[argument];
                (
                    self.columns[component][state].map_or(Place::Fixed(anchor), Place::Column),
                    Conversion::IDENTITY,
                )
            }
            Origin::Input(input, conversion) => (Place::Column(self.states + input), conversion),
            Origin::Value(value, conversion) => (Place::Value(value), conversion),
        }
    }

    fn is_ready(&self, value: usize, done: &[bool]) -> bool {
        let component = self.anatomy.values[value].component;
        let (local, row) = self.local(value);
        local.row(row).iter().enumerate().all(|(argument, coefficient)| {
            match (coefficient, self.source(component, argument).0) {
                (Coefficient::Zero, _) => true,
                (_, Place::Value(source)) => done[source],
                _ => true,
            }
        })
    }

    /// The component that is called next: one in which all that is left can be read, if there is one.
    fn next_call(&self, done: &[bool]) -> Option<(usize, Vec<usize>)> {
        let mut partly = None;
        for (component, block) in self.anatomy.blocks.iter().enumerate() {
            let left: Vec<usize> =
                block.values.clone().filter(|&value| !done[value] && !self.is_affine(value)).collect();
            let ready: Vec<usize> =
                left.iter().copied().filter(|&value| self.is_ready(value, done)).collect();
            if !ready.is_empty() && ready.len() == left.len() {
                return Some((component, ready));
            }
            if !ready.is_empty() && partly.is_none() {
                partly = Some((component, ready));
            }
        }
        partly
    }

    fn call(&self, component: usize, values: &[usize], done: &[bool], set: &mut [bool]) -> Call {
        let block = &self.anatomy.blocks[component];
        let mut call = Call {
            component,
            states: Vec::new(),
            references: Vec::new(),
            inputs: Vec::new(),
            reader: Reader::new(self.anatomy, values.iter().copied()),
        };
        for (argument, set) in set.iter_mut().enumerate() {
            let (place, conversion) = self.source(component, argument);
            let known = !matches!(place, Place::Value(source) if !done[source]);
            if *set || !known {
                continue;
            }
            *set = true;
            match argument < block.states {
                true => call.states.push(place),
                false => {
                    call.references.push(block.arguments[argument].reference);
                    call.inputs.push((argument, place, conversion));
                }
            }
        }
        call
    }

    fn affine(&self, value: usize) -> Affine {
        let component = self.anatomy.values[value].component;
        let (local, row) = self.local(value);
        let mut affine = Affine { value, offset: local.offsets[row], terms: Vec::new() };
        for (argument, coefficient) in local.row(row).iter().enumerate() {
            let Coefficient::Constant(factor) = coefficient else { continue };
            let (place, conversion) = self.source(component, argument);
            affine.offset += factor * conversion.offset;
            match place {
                Place::Fixed(fixed) => affine.offset += factor * fixed,
                place => affine.terms.push((factor * conversion.factor, place)),
            }
        }
        affine
    }

    fn add_row(&self, value: usize, entry_of: &[Vec<(usize, usize)>], program: &mut Program) {
        let component = self.anatomy.values[value].component;
        let (local, row) = self.local(value);
        let mut terms = Vec::new();
        let mut pattern = vec![Entry::Zero; self.width];
        let mut raise = |column: usize, entry: Entry| {
            pattern[column] = match (pattern[column], entry) {
                (Entry::Varying, _) | (_, Entry::Varying) => Entry::Varying,
                (Entry::Constant, _) | (_, Entry::Constant) => Entry::Constant,
                _ => Entry::Zero,
            };
        };
        for (argument, coefficient) in local.row(row).iter().enumerate() {
            let (place, conversion) = self.source(component, argument);
            let factor = match *coefficient {
                Coefficient::Zero => continue,
                Coefficient::Constant(factor) => Factor::Constant(factor * conversion.factor),
                Coefficient::Varying => {
                    let entry = entry_of[value].iter().find(|(own, _)| *own == argument);
                    Factor::Entry(entry.expect("varying entries are numbered").1, conversion.factor)
                }
            };
            let kind = match factor {
                Factor::Constant(_) => Entry::Constant,
                Factor::Entry(..) => Entry::Varying,
            };
            match place {
                Place::Column(column) => raise(column, kind),
                Place::Value(source) => {
                    for (column, entry) in program.patterns[source].iter().enumerate() {
                        match entry {
                            Entry::Zero => {}
                            Entry::Constant => raise(column, kind),
                            Entry::Varying => raise(column, Entry::Varying),
                        }
                    }
                }
                Place::Fixed(_) => continue,
            }
            terms.push((factor, place));
        }
        program.patterns[value] = pattern;
        program.rows.push(Row { value, terms });
    }

    /// First and second derivatives of a component; `entry_of` learns the numbers of varying entries per value, as
    /// (argument, entry).
    fn slopes(&self, component: usize, program: &mut Program, entry_of: &mut [Vec<(usize, usize)>]) {
        let (block, local) = (&self.anatomy.blocks[component], &self.locals[component]);
        let varying = |value: usize, argument: usize| {
            local.coefficient(value - block.values.start, argument) == Coefficient::Varying
        };
        let mut slopes = Slopes { component, states: block.states, ..Slopes::default() };
        for argument in 0..block.arguments.len() {
            let (place, conversion) = self.source(component, argument);
            slopes.arguments.push((conversion, place));
            let values: Vec<usize> = block.values.clone().filter(|&value| varying(value, argument)).collect();
            if values.is_empty() {
                continue;
            }
            let column = Column::new(self.anatomy, component, argument, &values, program.entries);
            for (value, entry) in Column::values(self.anatomy, &values).into_iter().zip(program.entries..) {
                entry_of[value].push((argument, entry));
            }
            program.entries += values.len();
            program.width = program.width.max(column.width());
            slopes.columns.push(column);
        }
        // Straight arguments are moved first, with all others as partners: what is left for both sides is little.
        let mut order: Vec<usize> = (0..block.arguments.len()).collect();
        order.sort_by_key(|&argument| !local.straight[argument]);
        for (place, &first) in order.iter().enumerate() {
            let mut bend = Bend { columns: Vec::new(), straight: local.straight[first] };
            // The moved argument itself stays the first of the columns.
            let partners = order[place..].iter().filter(|&&at| at == first || !local.is_flat(first, at));
            for &second in partners {
                let both = |&value: &usize| varying(value, first) && varying(value, second);
                let values: Vec<usize> = block.values.clone().filter(both).collect();
                if values.is_empty() {
                    continue;
                }
                let begin = slopes.curvatures.len();
                bend.columns.push(Column::new(self.anatomy, component, second, &values, begin));
                for value in Column::values(self.anatomy, &values) {
                    let numbered = entry_of[value].iter().find(|(own, _)| *own == second);
                    let entry = numbered.expect("varying entries are numbered").1;
                    slopes.curvatures.push(Curvature { value, first, second, entry });
                }
            }
            if !bend.columns.is_empty() {
                slopes.bends.push(bend);
            }
        }
        program.curvatures = program.curvatures.max(slopes.curvatures.len());
        if !slopes.columns.is_empty() {
            program.slopes.push(slopes);
        }
    }
}
