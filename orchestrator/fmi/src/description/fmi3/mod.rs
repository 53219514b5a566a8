//! Reading the model description of FMI 3.0 into the same data as that of 2.0.
//!
//! Arrays become one variable per element, named `x[1]` or `x[2,1]`, row by row; what the FMU knows of them is kept in
//! the layout. Floats become Reals, integers of any width Integers of 64 bits, Binaries texts of hexadecimal digits.
//! Variables of the type Clock are listed as unread. Terminals and icons are read by
//! [`terminals`](crate::terminals).

use super::attributes::Range;
use super::read::{shared, shared_capabilities};
use super::{DescriptionError, Interface, ModelDescription, UnreadVariable};
use crate::xml::Element;

mod structure;
mod types;
mod variables;

/// A description may flatten to at most this many scalars.
const MAX_SCALARS: usize = 1_000_000;

/// Reads the root element, with other values of the structural parameters than the file gives.
pub(super) fn read(
    root: &Element,
    structure: &[(String, i64)],
) -> Result<ModelDescription, DescriptionError> {
    let (co_simulation, model_exchange) = interfaces(root)?;
    let types = types::read(root)?;
    let read = variables::read(root, &types, structure)?;
    refuse_clocks(root, &read.unread)?;
    let list = |name| structure::read(root, name, &read);
    let (outputs, derivatives) = (list("Output")?, list("ContinuousStateDerivative")?);
    let initial_unknowns = list("InitialUnknown")?;
    let event_indicators = list("EventIndicator")?.len();
    Ok(ModelDescription {
        guid: root.required("instantiationToken")?.to_owned(),
        number_of_event_indicators: event_indicators,
        co_simulation,
        model_exchange,
        types,
        variables: read.variables,
        outputs,
        derivatives,
        initial_unknowns,
        unread: read.unread,
        index: read.index,
        layout: Some(read.layout),
        ..shared(root)?
    })
}

type Interfaces = (Option<Interface>, Option<Interface>);

fn interfaces(root: &Element) -> Result<Interfaces, DescriptionError> {
    let co_simulation = root.child("CoSimulation").map(interface).transpose()?;
    let model_exchange = root.child("ModelExchange").map(interface).transpose()?;
    if co_simulation.is_none() && model_exchange.is_none() {
        return Err(match root.child("ScheduledExecution") {
            Some(_) => root.error(
                "the only interface is ScheduledExecution, which is not supported; export the FMU for CoSimulation or \
                 ModelExchange",
            ),
            None => root.error("there is neither a CoSimulation nor a ModelExchange element"),
        });
    }
    Ok((co_simulation, model_exchange))
}

fn interface(element: &Element) -> Result<Interface, DescriptionError> {
    Ok(Interface {
        fixed_internal_step_size: element.real("fixedInternalStepSize", Range::Finite)?,
        can_get_and_set_fmu_state: element.flag("canGetAndSetFMUState")?,
        can_serialize_fmu_state: element.flag("canSerializeFMUState")?,
        provides_directional_derivative: element.flag("providesDirectionalDerivatives")?,
        completed_integrator_step_not_needed: element.boolean("needsCompletedIntegratorStep")? == Some(false),
        ..shared_capabilities(element)?
    })
}

/// Clocks that the importer has to tick are part of the behavior; those that only the FMU ticks can be left alone.
fn refuse_clocks(root: &Element, unread: &[UnreadVariable]) -> Result<(), DescriptionError> {
    let ticked = unread.iter().find(|variable| variable.kind == "Clock" && variable.is_input);
    let Some(clock) = ticked else { return Ok(()) };
    let variables = root.child("ModelVariables");
    let element = variables
        .and_then(|list| list.children("Clock").find(|found| found.attribute("name") == Some(&clock.name)));
    Err(element.unwrap_or(root).error(
        "an input clock has to be ticked by the importer, which is not supported; export the FMU without input clocks",
    ))
}
