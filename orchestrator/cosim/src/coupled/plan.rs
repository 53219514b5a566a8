//! All that is known of a coupled system before the first evaluation; further instances share it.

use super::anatomy::{Anatomy, Block, Origin};
use super::program::{Maker, Place, Program};
use super::{Error, Options, choices, learn, names, start};
use crate::system::SystemGraph;
use crate::system::graph::{Component, Conversion};
use airloop_dynamics::{Entry, Size, Structure};
use airloop_fmi::Model;

/// Data that all instances of one dynamics share.
#[derive(Debug)]
pub(super) struct Plan {
    pub graph: SystemGraph,
    pub time: f64,
    pub size: Size,
    pub structure: Structure,
    pub program: Program,
    /// Value of the rate of each state.
    pub rates: Vec<usize>,
    pub outputs: Vec<(Place, Conversion)>,
    pub names: Vec<String>,
    pub units: Vec<Option<String>>,
    pub nominals: Vec<f64>,
    pub start: Vec<f64>,
    /// `component.variable` of each value.
    pub value_names: Vec<String>,
    /// `component.variable` of each argument of each component.
    pub argument_names: Vec<Vec<String>>,
    pub notes: Vec<String>,
}

impl Plan {
    /// Everything that is known beforehand, the first instances, and the number of arguments of each component.
    pub fn make(graph: &SystemGraph, options: &Options) -> Result<(Plan, Vec<Model>, Vec<usize>), Error> {
        if let Some(one) = graph.loops.first() {
            return Err(Error::AlgebraicLoop { path: graph.loop_names(one) });
        }
        let mut graph = graph.clone();
        let mut notes = choices::continuous_forms(&mut graph);
        let inputs = names::inputs(&graph, options.inputs.as_deref())?;
        notes.extend(choices::held_inputs(&graph, &inputs));
        let mut models = start::instances(&graph, options.time)?;
        let anatomy = Anatomy::new(&graph, &inputs, options)?;
        notes.extend(anatomy.notes.iter().cloned());
        let (locals, learned, intact) = learn::learn(&graph, &anatomy, &mut models, options.time)?;
        notes.extend(learned);
        let idle = learn::idle_states(&anatomy, &locals);
        let (states, state_names) = choices::states(&graph, &anatomy, &idle, options)?;
        let left_out: Vec<_> = idle.into_iter().filter(|state| !states.contains(state)).collect();
        notes.extend(learn::idle_note(&graph, &left_out));
        notes.extend(choices::unseen_events(&graph));

        let size = Size { states: states.len(), inputs: inputs.len(), outputs: options.outputs.len() };
        let column = |component: usize, state: usize| states.iter().position(|&s| s == (component, state));
        let columns = anatomy.blocks.iter().enumerate();
        let columns = columns
            .map(|(component, block)| (0..block.states).map(|state| column(component, state)).collect());
        let maker = Maker {
            anatomy: &anatomy,
            locals: &locals,
            columns: columns.collect(),
            states: size.states,
            width: size.arguments(),
        };
        let value_names: Vec<String> = anatomy
            .values
            .iter()
            .map(|value| graph.components[value.component].path_of(value.variable))
            .collect();
        let program = maker.make().map_err(|waiting| Error::AlgebraicLoop {
            path: waiting.into_iter().map(|value| value_names[value].clone()).collect(),
        })?;
        let rates: Vec<usize> =
            states.iter().map(|&(component, state)| anatomy.blocks[component].values.start + state).collect();
        let place = |((origin, conversion), owner): (&(Origin, Conversion), &usize)| match *origin {
            Origin::State(state) => {
                let column = column(*owner, state).expect("a state that is shown is not left out");
                (Place::Column(column), *conversion)
            }
            Origin::Input(input, inner) => (Place::Column(size.states + input), inner.then(*conversion)),
            Origin::Value(value, inner) => (Place::Value(value), inner.then(*conversion)),
        };
        let outputs: Vec<(Place, Conversion)> =
            anatomy.outputs.iter().zip(&anatomy.owners).map(place).collect();
        let mut plan = Plan {
            structure: Structure::dense(size),
            time: options.time,
            size,
            program,
            rates,
            names: Vec::new(),
            units: Vec::new(),
            nominals: Vec::new(),
            start: states.iter().map(|&(component, state)| locals[component].anchor[state]).collect(),
            outputs,
            value_names,
            argument_names: argument_names(&graph, &anatomy),
            notes,
            graph,
        };
        plan.structure = plan.structure();
        plan.describe(&anatomy, &states, state_names, &inputs, options);
        if !intact {
            models = start::instances(&plan.graph, plan.time)?;
        }
        let widths = anatomy.blocks.iter().map(|block| block.arguments.len()).collect();
        Ok((plan, models, widths))
    }

    /// Structure of the derivatives, from the patterns of the values.
    fn structure(&self) -> Structure {
        let unit = |column: usize| {
            (0..self.size.arguments())
                .map(|other| if other == column { Entry::Constant } else { Entry::Zero })
                .collect::<Vec<Entry>>()
        };
        let of = |place: Place| match place {
            Place::Column(column) => unit(column),
            Place::Value(value) => self.program.patterns[value].clone(),
            Place::Fixed(_) => vec![Entry::Zero; self.size.arguments()],
        };
        let rates = self.rates.iter().map(|&value| Place::Value(value));
        let rows = rates.chain(self.outputs.iter().map(|&(place, _)| place)).flat_map(of);
        Structure::new(self.size, rows.collect())
    }

    /// Names, units, magnitudes and start values.
    fn describe(
        &mut self,
        anatomy: &Anatomy,
        states: &[(usize, usize)],
        state_names: Vec<String>,
        inputs: &[usize],
        options: &Options,
    ) {
        let graph = &self.graph;
        self.units = states.iter().map(|&(c, state)| names::state_unit(graph, c, state)).collect();
        self.nominals = states.iter().map(|&(c, state)| anatomy.blocks[c].arguments[state].nominal).collect();
        for (position, &input) in inputs.iter().enumerate() {
            self.units.push(graph.inputs[input].unit.clone());
            let mut fed = anatomy.blocks.iter().flat_map(|block| &block.arguments);
            let nominal = fed.find_map(|argument| match argument.origin {
                Origin::Input(own, conversion) if own == position => {
                    Some((argument.nominal / conversion.factor).abs())
                }
                _ => None,
            });
            self.nominals.push(nominal.unwrap_or(1.0));
        }
        for (name, &(place, conversion)) in options.outputs.iter().zip(&self.outputs) {
            self.units.push(names::output_unit(graph, name));
            let nominal = match place {
                Place::Column(column) => self.nominals[column],
                Place::Value(value) => anatomy.values[value].nominal,
                Place::Fixed(_) => 1.0,
            };
            self.nominals.push((nominal * conversion.factor).abs());
        }
        self.names = state_names;
        self.names.extend(inputs.iter().map(|&input| graph.inputs[input].name.clone()));
        self.names.extend(options.outputs.iter().cloned());
    }
}

fn argument_names(graph: &SystemGraph, anatomy: &Anatomy) -> Vec<Vec<String>> {
    let of = |(component, block): (&Component, &Block)| {
        block.arguments.iter().map(|argument| component.path_of(argument.variable)).collect()
    };
    graph.components.iter().zip(&anatomy.blocks).map(of).collect()
}
