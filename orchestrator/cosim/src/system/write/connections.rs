//! Attributes that a connection needs so that a reader arrives at the conversion of the graph.

use crate::system::graph::{Conversion, Source, SystemGraph, unit_of};
use crate::system::validate::{UnitTable, conversion};
use airloop_series::units::{self, Unit};

/// Attributes and transformation of a connection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Said {
    /// `suppressUnitConversion`.
    pub suppress: bool,
    /// Factor and offset of a `LinearTransformation`.
    pub transformation: Option<Conversion>,
}

/// A unit by name, with its definition if there is one.
pub(super) type Named<'a> = (&'a str, Option<Unit>);

/// The units of both ends of a connection.
pub(super) type Ends<'a> = (Option<Named<'a>>, Option<Named<'a>>);

/// Attributes of a connection whose ends have the units of any of the `readings`.
///
/// Tools may disagree on the order of unit conversion and transformation and on the last bits of a conversion; so a
/// transformation between ends with units is written as one that replaces the conversion. `converts`: the reader
/// converts units.
pub(super) fn said(wanted: Conversion, readings: &[Ends], converts: bool) -> Said {
    let by_units = |(start, end): &Ends| match (start, end) {
        (Some(start), Some(end)) => conversion(*start, *end).ok(),
        _ => Some(Conversion::IDENTITY),
    };
    let left_to_units = converts || wanted == Conversion::IDENTITY;
    if left_to_units && readings.iter().all(|ends| by_units(ends) == Some(wanted)) {
        return Said { suppress: false, transformation: None };
    }
    Said {
        suppress: readings.iter().any(|(start, end)| start.is_some() && end.is_some()),
        transformation: Some(wanted).filter(|wanted| *wanted != Conversion::IDENTITY),
    }
}

/// Unit of a variable as a reader finds it who knows the `declared` units.
pub(super) fn of_variable<'a>(
    graph: &'a SystemGraph,
    declared: &[(String, Unit)],
    component: usize,
    variable: usize,
) -> Option<Named<'a>> {
    let description = &graph.components[component].fmu.description;
    let name = unit_of(&description.variables[variable])?;
    Some((name, UnitTable { declared }.of_variable(name, description)))
}

/// Unit of a connector of the system.
pub(super) fn of_system<'a>(unit: Option<&'a str>, declared: &[(String, Unit)]) -> Option<Named<'a>> {
    let name = unit?;
    let own = declared.iter().find(|(known, _)| known == name).map(|(_, unit)| *unit);
    Some((name, own.or_else(|| units::lookup(name))))
}

/// Unit of a source.
pub(super) fn of_source<'a>(
    graph: &'a SystemGraph,
    declared: &[(String, Unit)],
    source: Source,
) -> Option<Named<'a>> {
    match source {
        Source::Input(index) => of_system(graph.inputs[index].unit.as_deref(), declared),
        Source::Output { component, variable } => of_variable(graph, declared, component, variable),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str) -> Option<Named<'_>> {
        Some((name, units::lookup(name)))
    }

    #[test]
    fn only_what_the_units_do_not_give_is_written() {
        let milli = Conversion { factor: 1e-3, offset: 0.0 };
        let twice = Conversion { factor: 2.0, offset: -1.0 };
        let said = |wanted, start, end| {
            let said = super::said(wanted, &[(start, end)], true);
            (said.suppress, said.transformation)
        };
        assert_eq!(said(milli, named("mN"), named("N")), (false, None));
        assert_eq!(said(Conversion::IDENTITY, named("N"), named("N")), (false, None));
        assert_eq!(said(Conversion::IDENTITY, None, named("N")), (false, None));
        assert_eq!(said(twice, named("N"), None), (false, Some(twice)));
        assert_eq!(said(twice, named("mN"), named("N")), (true, Some(twice)));
        assert_eq!(said(Conversion::IDENTITY, named("mN"), named("N")), (true, None));
        assert_eq!(said(Conversion::IDENTITY, named("N.m"), named("N")), (true, None));
    }

    #[test]
    fn a_reader_that_knows_no_units_gets_every_conversion() {
        let milli = Conversion { factor: 1e-3, offset: 0.0 };
        let ends = [(named("mN"), named("N"))];
        assert_eq!(said(milli, &ends, false), Said { suppress: true, transformation: Some(milli) });
        let ends = [(named("N"), named("N"))];
        assert_eq!(said(Conversion::IDENTITY, &ends, false), Said { suppress: false, transformation: None });
    }

    #[test]
    fn a_conversion_that_depends_on_whose_units_count_is_written_out() {
        let double = Conversion { factor: 2.0, offset: 0.0 };
        let half = Unit { factor: 0.5, ..units::lookup("N").unwrap() };
        let readings = [(named("N"), named("N")), (named("N"), Some(("N", Some(half))))];
        assert_eq!(said(double, &readings, true), Said { suppress: true, transformation: Some(double) });
    }
}
