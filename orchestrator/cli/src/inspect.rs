//! `airloop inspect`: what an FMU or a system is made of, as text or JSON, and what the checker finds.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::inspect_report;
use super::inspect_system;
use super::inspect_worker;
use super::output::print;
use super::run::stop_flag;
use super::table::table;
use airloop::Error;
use airloop_cosim::system::SystemGraph;
use airloop_fmi::check::{self, Finding, Severity};
use airloop_fmi::terminals::{Member, Terminal};
use airloop_fmi::{
    Causality, DependencyKind, Fmu, Initial, Interface, InterfaceKind, ModelDescription, Unknown,
    Variability, Variable, VariableKind,
};
use airloop_series::names::counted;

/// `airloop inspect`
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 success, 1 the file cannot be read or --check finds errors, 2 wrong usage, 130 interrupted (what was found is printed).\n\nExample: airloop inspect --check target/fmu/cart-pole.fmu"
)]
pub struct Args {
    /// .fmu, .ssd or .ssp file.
    pub file: PathBuf,
    /// Print JSON instead of tables. There, `variable` and `derivative` are positions in `variables`, counted from 0.
    #[arg(long)]
    pub json: bool,
    /// Check the FMU, or each FMU of the system, against the standard: archive and description, then by running its
    /// library in a process of its own. Errors make the exit code 1.
    #[arg(long)]
    pub check: bool,
    /// With --check: only archive and description; runs no third-party code.
    #[arg(long, requires = "check")]
    pub no_run: bool,
    /// With --check: time \[s\] that the library of an FMU may take in all before its process is ended.
    #[arg(long, requires = "check", value_name = "SECONDS", default_value_t = 60.0, value_parser = parse_limit)]
    pub time_limit: f64,
    /// With --check: write the findings also into this file, for CI: SARIF 2.1.0 (.sarif) or JUnit (.xml).
    #[arg(long, requires = "check", value_name = "FILE", value_parser = inspect_report::parse)]
    pub report: Option<PathBuf>,
    /// Runs the library and leaves its findings in this folder: the process that --check starts.
    #[arg(long, hide = true, requires = "check", value_name = "FOLDER")]
    pub worker: Option<PathBuf>,
}

fn parse_limit(text: &str) -> Result<f64, String> {
    let limit: f64 = text.parse().map_err(|_| "write a number of seconds".to_owned())?;
    if limit > 0.0 && limit <= 1e6 {
        Ok(limit)
    } else {
        Err("allowed are more than 0 s, at most 1e6 s".into())
    }
}

/// Prints what the file consists of, or what the checker finds in it.
///
/// # Errors
/// The file cannot be opened or is refused.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    if let Some(folder) = &args.worker {
        inspect_worker::work(&args.file, folder)?;
        return Ok(ExitCode::SUCCESS);
    }
    let is_fmu = args.file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("fmu"));
    // The graph owns the folder where the FMUs of a package are unpacked, which the checker reads.
    let graph = (!is_fmu).then(|| SystemGraph::open_to_read(&args.file)).transpose()?;
    let (fmus, text, mut value) = match &graph {
        None => {
            let fmu = Fmu::open(&args.file)?;
            let (text, value) = (describe(&fmu), json(&fmu));
            (vec![fmu], text, value)
        }
        Some(graph) => (fmus_of(graph), inspect_system::describe(graph), inspect_system::json(graph)),
    };
    if !args.check {
        print(&if args.json { format!("{value:#}\n") } else { text })?;
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(report) = &args.report {
        inspect_report::check(report, &args.file)?;
    }
    let mut checks = Vec::new();
    let stop = stop_flag();
    for fmu in &fmus {
        let limit = (!args.no_run).then(|| Duration::from_secs_f64(args.time_limit));
        checks.push((fmu.shown.clone(), check(fmu, limit, args.json, &stop)?));
        if stop.load(Ordering::Relaxed) {
            break;
        }
    }
    let mut findings = checks.iter().flat_map(|(_, findings)| findings);
    let failed = findings.any(|finding| finding.severity == Severity::Error);
    let all: Vec<_> = checks
        .iter()
        .map(|(fmu, findings)| serde_json::json!({ "fmu": fmu, "findings": findings }))
        .collect();
    if let Some(report) = &args.report {
        inspect_report::write(report, &checks)?;
    }
    if args.json {
        value["checks"] = all.into();
        print(&format!("{value:#}\n"))?;
    }
    if stop.load(Ordering::Relaxed) {
        return Ok(ExitCode::from(super::INTERRUPTED));
    }
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// The FMUs of a system, each once.
fn fmus_of(graph: &SystemGraph) -> Vec<Arc<Fmu>> {
    let mut fmus: Vec<Arc<Fmu>> = Vec::new();
    for component in &graph.components {
        if !fmus.iter().any(|fmu| Arc::ptr_eq(fmu, &component.fmu)) {
            fmus.push(Arc::clone(&component.fmu));
        }
    }
    fmus
}

/// Findings of the checker in one FMU, worst first; printed unless `silent`. The library runs for `limit` at most and
/// until `stop` is set, or not at all.
///
/// # Errors
/// The process that runs the library does not start.
pub fn check(
    fmu: &Arc<Fmu>,
    limit: Option<Duration>,
    silent: bool,
    stop: &AtomicBool,
) -> Result<Vec<Finding>, Error> {
    let show = |text: &str| if silent { Ok(()) } else { print(text) };
    show(&format!("{}\n", fmu.shown.display()))?;
    let mut findings = check::static_findings(fmu);
    show(&text(&findings))?;
    if let Some(limit) = limit {
        let dynamic = inspect_worker::findings(fmu, limit, stop)?;
        show(&text(&dynamic))?;
        findings.extend(dynamic);
    }
    findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    show(&summary(&findings, limit.is_none()))?;
    Ok(findings)
}

/// Findings as lines, worst first.
pub fn text(findings: &[Finding]) -> String {
    let mut sorted: Vec<&Finding> = findings.iter().collect();
    sorted.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    let line = |finding: &&Finding| {
        format!("{:<7} [{}] {}: {}\n", finding.severity, finding.rule, finding.element, finding.message)
    };
    sorted.iter().map(line).collect()
}

fn summary(findings: &[Finding], no_run: bool) -> String {
    let count = |severity, noun| {
        counted(findings.iter().filter(|finding| finding.severity == severity).count(), noun)
    };
    format!(
        "{}, {}, {}{}\n",
        count(Severity::Error, "error"),
        count(Severity::Warning, "warning"),
        count(Severity::Note, "note"),
        if no_run { " (the library was not run)" } else { "" }
    )
}

fn json(fmu: &Fmu) -> serde_json::Value {
    serde_json::json!({
        "file": fmu.shown,
        "platforms": fmu.platforms(),
        "model_description": fmu.description,
        "terminals": fmu.terminals().and_then(Result::ok).unwrap_or_default().terminals,
    })
}

/// The text that `airloop inspect` prints for an FMU.
pub fn describe(fmu: &Fmu) -> String {
    let description = &fmu.description;
    let mut text =
        format!("{} (FMI {}, {})\n", description.model_name, description.fmi_version, fmu.shown.display());
    if !description.description.is_empty() {
        text += &format!("{}\n", description.description);
    }
    let facts = [
        ("version", description.version.as_str()),
        ("author", &description.author),
        ("tool", &description.generation_tool),
        ("guid", &description.guid),
    ];
    for (name, value) in facts.into_iter().filter(|(_, value)| !value.is_empty()) {
        text += &format!("  {name:<20}{value}\n");
    }
    let platforms = fmu.platforms();
    let platforms = if platforms.is_empty() { "none".to_owned() } else { platforms.join(", ") };
    text += &format!("  {:<20}{platforms}\n", "platforms");
    text += &format!("  {:<20}{}\n", "default experiment", experiment(description));
    text += &format!("  {:<20}{}\n", "continuous states", description.derivatives.len());
    text += &format!("  {:<20}{}\n", "event indicators", description.number_of_event_indicators);
    for kind in [InterfaceKind::CoSimulation, InterfaceKind::ModelExchange] {
        if let Some(interface) = fmu.interface(kind) {
            text += &format!("\n{kind} (modelIdentifier {})\n", interface.model_identifier);
            let capabilities = capabilities(kind, interface);
            text += &capabilities.iter().map(|line| format!("  {line}\n")).collect::<String>();
        }
    }
    text += "\nVariables\n";
    let rows: Vec<Vec<String>> = description.variables.iter().map(variable).collect();
    let header =
        ["name", "causality", "variability", "initial", "type", "unit", "start", "range", "description"];
    text += &indented(&table(&header, &rows, &[]));
    if !description.unread.is_empty() {
        let named = description.unread.iter().map(|unread| format!("{} ({})", unread.name, unread.kind));
        text += &format!("\nVariables that are not carried\n  {}\n", named.collect::<Vec<_>>().join(", "));
    }
    text += &terminals(fmu);
    text += &unknowns(description, "Derivatives (<- what they depend on)", &description.derivatives, false);
    text += &unknowns(description, "Direct feed-through (output <- inputs)", &description.outputs, true);
    text
}

/// Terminals of the FMU with their variables; nothing if it has none.
fn terminals(fmu: &Fmu) -> String {
    let all = match fmu.terminals() {
        None => return String::new(),
        Some(Err(fault)) => return format!("\nTerminals\n  terminalsAndIcons.xml cannot be read: {fault}\n"),
        Some(Ok(all)) => all.terminals,
    };
    let row = |terminal: &Terminal| {
        let member = |member: &Member| match &member.name {
            Some(name) if *name != member.variable => format!("{name} = {}", member.variable),
            _ => member.variable.clone(),
        };
        let members = terminal.members.iter().map(member).collect::<Vec<_>>().join(", ");
        let kind = terminal.kind.clone().unwrap_or_default();
        vec![terminal.name.clone(), terminal.matching_rule.clone(), kind, members]
    };
    let rows: Vec<Vec<String>> = all.iter().map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    format!("\nTerminals\n{}", indented(&table(&["name", "matching rule", "kind", "variables"], &rows, &[])))
}

fn experiment(description: &ModelDescription) -> String {
    let experiment = &description.default_experiment;
    let parts = [
        ("start", experiment.start, " s"),
        ("stop", experiment.stop, " s"),
        ("step", experiment.step_size, " s"),
        ("tolerance", experiment.tolerance, ""),
    ];
    let parts: Vec<_> = parts
        .into_iter()
        .filter_map(|(name, value, unit)| value.map(|value| format!("{name} {}{unit}", number(value))))
        .collect();
    if parts.is_empty() { "none".to_owned() } else { parts.join(", ") }
}

/// A number with an exponent where it would be long without.
fn number(value: f64) -> String {
    let (plain, scientific) = (value.to_string(), format!("{value:e}"));
    if plain.len() > 7 && scientific.len() < plain.len() { scientific } else { plain }
}

/// Capabilities and needs of an interface.
fn capabilities(kind: InterfaceKind, interface: &Interface) -> Vec<String> {
    let common = [
        (interface.can_get_and_set_fmu_state, "saves and restores its state"),
        (interface.can_serialize_fmu_state, "serializes its state"),
        (interface.provides_directional_derivative, "provides directional derivatives"),
        (interface.needs_execution_tool, "needs an execution tool"),
        (interface.can_be_instantiated_only_once_per_process, "allows one instance per process"),
        (interface.can_not_use_memory_management_functions, "does not use the memory callbacks"),
    ];
    let own = match kind {
        InterfaceKind::CoSimulation => [
            (interface.can_handle_variable_communication_step_size, "accepts steps of different length"),
            (interface.can_interpolate_inputs, "interpolates inputs"),
            (interface.can_run_asynchronuously, "can run asynchronously"),
        ],
        InterfaceKind::ModelExchange => [
            (interface.completed_integrator_step_not_needed, "needs no fmi2CompletedIntegratorStep"),
            (false, ""),
            (false, ""),
        ],
    };
    let flags = own.into_iter().chain(common).filter(|(flag, _)| *flag).map(|(_, text)| text.to_owned());
    let order = interface.max_output_derivative_order;
    let order = (order > 0).then(|| format!("gives output derivatives up to order {order}"));
    flags.chain(order).collect()
}

fn variable(variable: &Variable) -> Vec<String> {
    let text = |value: &Option<String>| value.clone().unwrap_or_default();
    let range = |min: Option<String>, max: Option<String>| match (min, max) {
        (None, None) => String::new(),
        (min, max) => format!("{}..{}", min.unwrap_or_default(), max.unwrap_or_default()),
    };
    let integer = |value: &Option<i64>| value.map(|value| value.to_string());
    let real = |value: &Option<f64>| value.map(number);
    let (kind, unit, start, range) = match &variable.kind {
        VariableKind::Real(attributes) => (
            "Real".to_owned(),
            text(&attributes.unit),
            real(&attributes.start),
            range(real(&attributes.min), real(&attributes.max)),
        ),
        VariableKind::Integer { start, min, max, .. } => {
            ("Integer".to_owned(), String::new(), integer(start), range(integer(min), integer(max)))
        }
        VariableKind::Boolean { start } => {
            ("Boolean".to_owned(), String::new(), start.map(|start| start.to_string()), String::new())
        }
        VariableKind::String { start } => {
            let start = start.as_ref().map(|start| format!("{start:?}"));
            ("String".to_owned(), String::new(), start, String::new())
        }
        VariableKind::Enumeration { declared_type, start, min, max } => {
            (declared_type.clone(), String::new(), integer(start), range(integer(min), integer(max)))
        }
    };
    vec![
        variable.name.clone(),
        causality(variable.causality).to_owned(),
        variability(variable.variability).to_owned(),
        variable.initial.map_or("", initial).to_owned(),
        kind,
        unit,
        start.unwrap_or_default(),
        range,
        variable.description.clone(),
    ]
}

fn causality(causality: Causality) -> &'static str {
    match causality {
        Causality::Parameter => "parameter",
        Causality::CalculatedParameter => "calculatedParameter",
        Causality::Input => "input",
        Causality::Output => "output",
        Causality::Local => "local",
        Causality::Independent => "independent",
    }
}

fn variability(variability: Variability) -> &'static str {
    match variability {
        Variability::Constant => "constant",
        Variability::Fixed => "fixed",
        Variability::Tunable => "tunable",
        Variability::Discrete => "discrete",
        Variability::Continuous => "continuous",
    }
}

fn initial(initial: Initial) -> &'static str {
    match initial {
        Initial::Exact => "exact",
        Initial::Approx => "approx",
        Initial::Calculated => "calculated",
    }
}

/// A list of the model structure; `inputs_only` leaves out states and time.
fn unknowns(description: &ModelDescription, title: &str, list: &[Unknown], inputs_only: bool) -> String {
    if list.is_empty() {
        return String::new();
    }
    let rows: Vec<Vec<String>> = list
        .iter()
        .map(|unknown| {
            let dependencies = match &unknown.dependencies {
                None => "anything (not declared)".to_owned(),
                Some(dependencies) => {
                    let named = dependencies.iter().filter_map(|dependency| {
                        let known = &description.variables[dependency.variable];
                        let shown = !inputs_only || known.causality == Causality::Input;
                        shown.then(|| format!("{}{}", known.name, dependency_kind(dependency.kind)))
                    });
                    let named = named.collect::<Vec<_>>().join(", ");
                    if named.is_empty() { "nothing".to_owned() } else { named }
                }
            };
            vec![description.variables[unknown.variable].name.clone(), format!("<- {dependencies}")]
        })
        .collect();
    // The header line of the table stays empty: the title says it.
    let text = table(&["", ""], &rows, &[]);
    format!("\n{title}\n{}", indented(text.trim_start_matches('\n')))
}

fn dependency_kind(kind: DependencyKind) -> &'static str {
    match kind {
        DependencyKind::Dependent => "",
        DependencyKind::Constant => " (constant factor)",
        DependencyKind::Fixed => " (fixed factor)",
        DependencyKind::Tunable => " (tunable factor)",
        DependencyKind::Discrete => " (discrete factor)",
    }
}

fn indented(text: &str) -> String {
    text.lines().map(|line| format!("  {line}\n")).collect()
}
