//! Reading `modelDescription.xml`: root, interfaces, units, types, experiment. Variables and structure have their own
//! files.

use super::attributes::Range;
use super::{
    DefaultExperiment, DescriptionError, DisplayUnit, Interface, LogCategory, ModelDescription,
    NamingConvention, UnitDefinition, fmi3, structure, variables,
};
use crate::xml::{self, Element};
use airloop_series::units::{Exponents, Unit};

/// More event indicators than this are taken for a mistake; each takes memory in every importer.
const MAX_EVENT_INDICATORS: usize = 1_000_000;

impl ModelDescription {
    /// Reads the bytes of a `modelDescription.xml`.
    ///
    /// # Errors
    /// The first defect that makes the FMU unusable, with line and element. Defects that leave it usable are findings
    /// of `airloop inspect --check`.
    pub fn parse(xml: &[u8]) -> Result<ModelDescription, DescriptionError> {
        ModelDescription::parse_resized(xml, &[])
    }

    /// Same as [`Self::parse`] with other values of structural parameters than the file gives, by name (FMI 3.0).
    ///
    /// # Errors
    /// Same as [`Self::parse`].
    pub(crate) fn parse_resized(
        xml: &[u8],
        structure: &[(String, i64)],
    ) -> Result<ModelDescription, DescriptionError> {
        let root = xml::parse(xml).map_err(|error| DescriptionError {
            line: error.line,
            element: "the XML".to_owned(),
            message: match error.is_encoding {
                true => format!("{}: FMI 2.0 asks for UTF-8 (section 2.2)", error.message),
                false => error.message,
            },
        })?;
        if root.name != "fmiModelDescription" {
            return Err(root.error("the root element must be fmiModelDescription"));
        }
        if is_fmi3(&root)? {
            return fmi3::read(&root, structure);
        }
        let types = variables::types(&root)?;
        let (variables, index) = variables::read(&root, &types)?;
        let structure = |name| structure::read(&root, name, variables.len());
        let (outputs, derivatives) = (structure("Outputs")?, structure("Derivatives")?);
        let initial_unknowns = structure("InitialUnknowns")?;
        let event_indicators = root.integer("numberOfEventIndicators")?;
        if let Some(count) = event_indicators.filter(|&count: &usize| count > MAX_EVENT_INDICATORS) {
            let allowed = format_args!("at most {MAX_EVENT_INDICATORS}, the limit of this importer");
            return Err(root.bad("numberOfEventIndicators", &count.to_string(), allowed));
        }
        let description = ModelDescription {
            guid: root.required("guid")?.to_owned(),
            number_of_event_indicators: event_indicators.unwrap_or(0),
            states_number_of_event_indicators: event_indicators.is_some(),
            co_simulation: root.child("CoSimulation").map(interface).transpose()?,
            model_exchange: root.child("ModelExchange").map(interface).transpose()?,
            types,
            variables,
            outputs,
            derivatives,
            initial_unknowns,
            index,
            ..shared(&root)?
        };
        if description.co_simulation.is_none() && description.model_exchange.is_none() {
            return Err(root.error("there is neither a CoSimulation nor a ModelExchange element"));
        }
        Ok(description)
    }
}

/// Whether the file is of FMI 3.0 or one of its minor versions, rather than 2.0.
fn is_fmi3(root: &Element) -> Result<bool, DescriptionError> {
    match root.required("fmiVersion")? {
        "2.0" => Ok(false),
        // Minor versions add elements and attributes only (FMI 3.0 section 2.6).
        "3.0" => Ok(true),
        other if other.strip_prefix("3.").is_some_and(|minor| !minor.contains('-')) => Ok(true),
        other => Err(root.error(format!(
            "this is an FMU of FMI {other}; only FMI 2.0 and 3.0 can be imported: export it as one of them"
        ))),
    }
}

/// Attributes of the description shared by both versions; all else is empty.
pub(super) fn shared(root: &Element) -> Result<ModelDescription, DescriptionError> {
    let conventions = [("flat", NamingConvention::Flat), ("structured", NamingConvention::Structured)];
    Ok(ModelDescription {
        fmi_version: root.required("fmiVersion")?.to_owned(),
        model_name: root.text("modelName"),
        guid: String::new(),
        description: root.text("description"),
        author: root.text("author"),
        version: root.text("version"),
        generation_tool: root.text("generationTool"),
        variable_naming_convention: root.word("variableNamingConvention", &conventions)?.unwrap_or_default(),
        number_of_event_indicators: 0,
        states_number_of_event_indicators: true,
        co_simulation: None,
        model_exchange: None,
        units: units(root)?,
        types: Vec::new(),
        log_categories: log_categories(root)?,
        default_experiment: default_experiment(root)?,
        variables: Vec::new(),
        outputs: Vec::new(),
        derivatives: Vec::new(),
        initial_unknowns: Vec::new(),
        unread: Vec::new(),
        index: std::collections::HashMap::new(),
        layout: None,
    })
}

/// The capabilities of an interface that both versions call alike; the others are absent.
pub(super) fn shared_capabilities(element: &Element) -> Result<Interface, DescriptionError> {
    let model_identifier = element.required("modelIdentifier")?;
    if model_identifier.contains(['/', '\\']) {
        return Err(element.bad(
            "modelIdentifier",
            model_identifier,
            "the name of a library, without folders",
        ));
    }
    Ok(Interface {
        model_identifier: model_identifier.to_owned(),
        needs_execution_tool: element.flag("needsExecutionTool")?,
        can_handle_variable_communication_step_size: element
            .flag("canHandleVariableCommunicationStepSize")?,
        max_output_derivative_order: element.integer("maxOutputDerivativeOrder")?.unwrap_or(0),
        can_be_instantiated_only_once_per_process: element.flag("canBeInstantiatedOnlyOncePerProcess")?,
        ..Interface::default()
    })
}

fn interface(element: &Element) -> Result<Interface, DescriptionError> {
    Ok(Interface {
        can_interpolate_inputs: element.flag("canInterpolateInputs")?,
        can_run_asynchronuously: element.flag("canRunAsynchronuously")?,
        can_not_use_memory_management_functions: element.flag("canNotUseMemoryManagementFunctions")?,
        can_get_and_set_fmu_state: element.flag("canGetAndSetFMUstate")?,
        can_serialize_fmu_state: element.flag("canSerializeFMUstate")?,
        provides_directional_derivative: element.flag("providesDirectionalDerivative")?,
        completed_integrator_step_not_needed: element.flag("completedIntegratorStepNotNeeded")?,
        ..shared_capabilities(element)?
    })
}

fn units(root: &Element) -> Result<Vec<UnitDefinition>, DescriptionError> {
    let Some(definitions) = root.child("UnitDefinitions") else { return Ok(Vec::new()) };
    definitions.children("Unit").map(unit).collect()
}

fn unit(element: &Element) -> Result<UnitDefinition, DescriptionError> {
    let exponent = |base: &Element, name| Ok::<_, DescriptionError>(base.integer(name)?.unwrap_or(0));
    let factor = |element: &Element| match element.real("factor", Range::Finite)? {
        Some(0.0) => Err(element.bad("factor", "0", "a number other than zero")),
        factor => Ok(factor.unwrap_or(1.0)),
    };
    let offset =
        |element: &Element| Ok::<_, DescriptionError>(element.real("offset", Range::Finite)?.unwrap_or(0.0));
    let base = element.child("BaseUnit").map(|base| {
        let exponents = Exponents {
            kg: exponent(base, "kg")?,
            m: exponent(base, "m")?,
            s: exponent(base, "s")?,
            A: exponent(base, "A")?,
            K: exponent(base, "K")?,
            mol: exponent(base, "mol")?,
            cd: exponent(base, "cd")?,
            rad: exponent(base, "rad")?,
        };
        Ok(Unit { exponents, factor: factor(base)?, offset: offset(base)? })
    });
    let display_unit = |element: &Element| {
        let name = element.required("name")?.to_owned();
        Ok(DisplayUnit { name, factor: factor(element)?, offset: offset(element)? })
    };
    Ok(UnitDefinition {
        name: element.required("name")?.to_owned(),
        base: base.transpose()?,
        display_units: element.children("DisplayUnit").map(display_unit).collect::<Result<_, _>>()?,
    })
}

fn log_categories(root: &Element) -> Result<Vec<LogCategory>, DescriptionError> {
    let Some(categories) = root.child("LogCategories") else { return Ok(Vec::new()) };
    let read = |element: &Element| {
        Ok(LogCategory {
            name: element.required("name")?.to_owned(),
            description: element.text("description"),
        })
    };
    categories.children("Category").map(read).collect()
}

fn default_experiment(root: &Element) -> Result<DefaultExperiment, DescriptionError> {
    let Some(element) = root.child("DefaultExperiment") else { return Ok(DefaultExperiment::default()) };
    let time = |name| element.real(name, Range::Finite);
    Ok(DefaultExperiment {
        start: time("startTime")?,
        stop: time("stopTime")?,
        tolerance: time("tolerance")?,
        step_size: time("stepSize")?,
    })
}
