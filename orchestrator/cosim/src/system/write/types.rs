//! Units and enumerations that a description declares, and the types of its connectors.

use super::xml::Xml;
use crate::system::graph::{Component, DataType, Source, SystemGraph, unit_of};
use crate::system::validate::UnitTable;
use airloop_fmi::{ModelDescription, VariableKind};
use airloop_series::units::{Compatibility, Unit, compatible, lookup};

/// Units by name, in the order of their first use.
#[derive(Debug, Default)]
pub(super) struct Units {
    pub declared: Vec<(String, Unit)>,
}

impl Units {
    /// Units of all connectors. Where FMUs disagree about a name, the first definition is declared.
    pub fn of(graph: &SystemGraph, used: &[Vec<usize>]) -> Units {
        let mut units = Units::default();
        let table = UnitTable { declared: &graph.units };
        for (component, variables) in graph.components.iter().zip(used) {
            let description = &component.fmu.description;
            for name in variables.iter().filter_map(|&index| unit_of(&description.variables[index])) {
                units.add(name, table.of_variable(name, description));
            }
        }
        // What the system itself says wins over what its FMUs say.
        let inputs = graph.inputs.iter().map(|input| &input.unit);
        for name in inputs.chain(graph.outputs.iter().map(|output| &output.unit)).flatten() {
            let own = graph.units.iter().find(|(known, _)| known == name).map(|(_, unit)| *unit);
            units.add(name, own.or_else(|| lookup(name)));
        }
        units
    }

    /// Adds a unit whose definition is known, unless the name is there.
    pub fn add(&mut self, name: &str, unit: Option<Unit>) {
        if let Some(unit) = unit.filter(|_| self.find(name).is_none()) {
            self.declared.push((name.to_owned(), unit));
        }
    }

    pub fn find(&self, name: &str) -> Option<Unit> {
        self.declared.iter().find(|(known, _)| known == name).map(|(_, unit)| *unit)
    }

    /// Writes `<list>` with all units, nothing if there are none.
    pub fn write(&self, xml: &mut Xml, list: &'static str) {
        if self.declared.is_empty() {
            return;
        }
        xml.open(list, &[]);
        for (name, unit) in &self.declared {
            xml.open("ssc:Unit", &[("name", name)]);
            let mut attributes: Vec<(&str, String)> = unit
                .exponents
                .symbols()
                .iter()
                .filter(|(_, exponent)| *exponent != 0)
                .map(|(symbol, exponent)| (*symbol, exponent.to_string()))
                .collect();
            if unit.factor != 1.0 {
                attributes.push(("factor", format!("{:?}", unit.factor)));
            }
            if unit.offset != 0.0 {
                attributes.push(("offset", format!("{:?}", unit.offset)));
            }
            let attributes: Vec<(&str, &str)> =
                attributes.iter().map(|(key, value)| (*key, value.as_str())).collect();
            xml.empty("ssc:BaseUnit", &attributes);
            xml.close();
        }
        xml.close();
    }
}

/// Enumerations by name with their items, in the order of their first use.
#[derive(Debug, Default)]
pub(super) struct Enumerations {
    declared: Vec<(String, Vec<(String, i64)>)>,
}

impl Enumerations {
    /// Name under which the type of a variable is declared; two FMUs may give one name to different items.
    fn name(&mut self, component: &Component, declared_type: &str) -> String {
        let items = items(&component.fmu.description, declared_type);
        let names = [declared_type.to_owned(), format!("{}.{declared_type}", component.name)];
        for name in &names {
            match self.declared.iter().find(|(known, _)| known == name) {
                Some((_, known)) if known == items => return name.clone(),
                Some(_) => {}
                None => {
                    self.declared.push((name.clone(), items.to_vec()));
                    return name.clone();
                }
            }
        }
        let [_, own] = names;
        own
    }

    /// Writes `<ssd:Enumerations>`, nothing if there are none.
    pub fn write(&self, xml: &mut Xml) {
        // The schema wants at least one item.
        let mut filled = self.declared.iter().filter(|(_, items)| !items.is_empty()).peekable();
        if filled.peek().is_none() {
            return;
        }
        xml.open("ssd:Enumerations", &[]);
        for (name, items) in filled {
            xml.open("ssc:Enumeration", &[("name", name)]);
            for (item, value) in items {
                xml.empty("ssc:Item", &[("name", item), ("value", &value.to_string())]);
            }
            xml.close();
        }
        xml.close();
    }
}

/// Items of an enumeration of an FMU.
pub(super) fn items<'a>(description: &'a ModelDescription, declared_type: &str) -> &'a [(String, i64)] {
    description.types.iter().find(|known| known.name == declared_type).map_or(&[], |known| &known.items)
}

/// Writes a connector of a component.
pub(super) fn component_connector(
    xml: &mut Xml,
    graph: &SystemGraph,
    (units, enumerations): (&Units, &mut Enumerations),
    (component, variable, kind): (usize, usize, &str),
) {
    let owner = &graph.components[component];
    let description = &owner.fmu.description;
    let own = &description.variables[variable];
    // A unit is named where the description and the FMU mean the same by it; else the FMU's own applies.
    let unit = unit_of(own).filter(|name| {
        let meant = UnitTable { declared: &graph.units }.of_variable(name, description);
        let same = |a: &Unit, b: &Unit| compatible(a, b) == Compatibility::Equal;
        meant.zip(units.find(name)).is_some_and(|(a, b)| same(&a, &b))
    });
    let enumeration = match &own.kind {
        VariableKind::Enumeration { declared_type, .. } => enumerations.name(owner, declared_type),
        _ => String::new(),
    };
    connector(xml, (&own.name, kind), DataType::of(own), unit, &enumeration);
}

/// Writes a connector of the system; an enumeration is that of the variable behind it.
pub(super) fn system_connector(
    xml: &mut Xml,
    graph: &SystemGraph,
    enumerations: &mut Enumerations,
    (name, kind): (&str, &str),
    (data_type, unit): (DataType, Option<&str>),
    behind: Option<Source>,
) {
    let mut enumeration = name.to_owned();
    if let (DataType::Enumeration, Some(Source::Output { component, variable })) = (data_type, behind) {
        let owner = &graph.components[component];
        if let VariableKind::Enumeration { declared_type, .. } =
            &owner.fmu.description.variables[variable].kind
        {
            enumeration = enumerations.name(owner, declared_type);
        }
    }
    connector(xml, (name, kind), data_type, unit, &enumeration);
}

fn connector(
    xml: &mut Xml,
    (name, kind): (&str, &str),
    data_type: DataType,
    unit: Option<&str>,
    enumeration: &str,
) {
    xml.open("ssd:Connector", &[("name", name), ("kind", kind)]);
    match (data_type, unit) {
        (DataType::Real, Some(unit)) => xml.empty("ssc:Real", &[("unit", unit)]),
        (DataType::Real, None) => xml.empty("ssc:Real", &[]),
        (DataType::Integer, _) => xml.empty("ssc:Integer", &[]),
        (DataType::Boolean, _) => xml.empty("ssc:Boolean", &[]),
        (DataType::String, _) => xml.empty("ssc:String", &[]),
        (DataType::Enumeration, _) => xml.empty("ssc:Enumeration", &[("name", enumeration)]),
    }
    xml.close();
}
