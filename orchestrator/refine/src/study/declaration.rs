//! The file `study.toml`: system, records, places where effects may act, and what is known of parameters.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use airloop_series::declared;
use airloop_series::units::{self, Compatibility};
use schemars::{JsonSchema, Schema};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::json;
use toml::Spanned;

use super::ports::Duty;
use crate::Error;

/// JSON schema of a `study.toml`.
pub fn schema() -> String {
    airloop_series::schema::schema_of::<Declaration>()
}

/// One of the keys of a signal that name a column.
fn one_source() -> serde_json::Value {
    json!([{ "required": ["column"] }, { "required": ["derivative_of"] }, { "required": ["integral_of"] }])
}

/// A number between 0 and 1.
fn share() -> serde_json::Value {
    json!({ "type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1 })
}

/// The other word for estimation.
fn with_train(schema: &mut Schema) {
    if let Some(serde_json::Value::Array(words)) = schema.get_mut("oneOf") {
        words.push(json!({ "type": "string", "const": "train", "description": "The same as `estimation`." }));
    }
}

/// Contents of a `study.toml`: a system of FMUs, records made with it, and the places where effects may be missing.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Study for airloop refine (study.toml)")]
pub struct Declaration {
    /// Name of the study; the name of the folder without one.
    #[serde(default)]
    pub name: String,
    /// `.ssd`, `.ssp` or `.fmu`, relative to this file; `airloop:NAME` is an FMU of this project,
    /// `airloop:piston-with-friction` two in series.
    #[schemars(with = "String")]
    pub system: Spanned<String>,
    /// Step of the simulation and of the records \[s\]; the step of the records without it, or where it is
    /// shorter.
    #[serde(default)]
    #[schemars(with = "Option<f64>", extend("exclusiveMinimum" = 0))]
    pub step_s: Option<Spanned<f64>>,
    /// Whether poles and gains of identified linear models (state spaces) are fitted anew beside every effect; yes
    /// without it, unless `[[free]]` names what is free.
    #[serde(default)]
    pub fit_identified: Option<bool>,
    /// Values of parameters of the system, in their units; Enumerations by item or number.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, Value>")]
    pub parameters: BTreeMap<String, Spanned<Value>>,
    /// How well declared parameters are known: one standard deviation relative to the value; without it by unit:
    /// masses, lengths and others 0.01, friction 0.03, slopes of a friction law by speed 0.1.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, f64>", extend("additionalProperties" = share()))]
    pub tolerance: BTreeMap<String, Spanned<f64>>,
    /// Inputs of the system and the columns they are fed with.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, Signal>")]
    pub inputs: BTreeMap<String, Spanned<Signal>>,
    /// States and the columns that show them: for initial states, restarts of windows, and force residuals.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, Signal>")]
    pub states: BTreeMap<String, Spanned<Signal>>,
    /// Further signals made of columns that attachments may name.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, Signal>")]
    pub signals: BTreeMap<String, Spanned<Signal>>,
    /// Outputs and the columns they are compared with.
    #[schemars(with = "BTreeMap<String, Output>", extend("minProperties" = 1))]
    pub outputs: BTreeMap<String, Spanned<Output>>,
    /// Records: at least one for estimation and one for validation.
    #[schemars(with = "Vec<Segment>", length(min = 2))]
    pub segment: Vec<Spanned<Segment>>,
    /// Declared parameters that are fitted beside every effect.
    #[serde(default)]
    #[schemars(with = "Vec<FreeParameter>")]
    pub free: Vec<Spanned<FreeParameter>>,
    /// Places where effects may be missing; without any, all that the system has (`airloop refine --plan` lists them).
    #[serde(default)]
    #[schemars(with = "Vec<Attachment>")]
    pub attachment: Vec<Spanned<Attachment>>,
    /// How the error is measured: simulations that restart after a time, and the residual as a force.
    #[serde(default)]
    pub error: ErrorRule,
}

/// Value of a parameter: a number, a Boolean, or text (an item of an Enumeration).
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Value {
    /// Real, Integer, or value of an Enumeration.
    Number(f64),
    /// Boolean.
    Boolean(bool),
    /// String, or item of an Enumeration.
    Text(String),
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Value::Number(value) => write!(f, "{value}"),
            Value::Boolean(value) => write!(f, "{value}"),
            Value::Text(value) => f.write_str(value),
        }
    }
}

impl Value {
    /// The value as a number in the unit `wanted` of its parameter.
    ///
    /// # Errors
    /// A value that is no number, or a unit that does not fit, in words.
    pub fn real(&self, wanted: Option<&str>) -> Result<f64, String> {
        let text = match self {
            Value::Number(number) => return Ok(*number),
            Value::Boolean(value) => return Err(format!("it is a Real; `{value}` is no number")),
            Value::Text(text) => text,
        };
        let (number, unit) = units::parse_quantity(text)?;
        let Some(unit) = unit else { return Ok(number) };
        let known = |unit: &str| units::lookup(unit).ok_or_else(|| format!("unit `{unit}` is not known"));
        let Some(wanted) = wanted else {
            return Err(format!(
                "the FMU gives it no unit, so that `{text}` cannot be converted; write a number"
            ));
        };
        match units::compatible(&known(&unit)?, &known(wanted)?) {
            Compatibility::Equal => Ok(number),
            Compatibility::Convertible { factor, offset } => Ok(factor * number + offset),
            Compatibility::Incompatible => Err(format!("it is in {wanted}; `{text}` is none of that")),
        }
    }
}

/// A signal made of a column.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = one_source()))]
pub struct Signal {
    /// Column of the CSV files.
    #[serde(default)]
    pub column: Option<String>,
    /// Column whose derivative by time it is.
    #[serde(default)]
    pub derivative_of: Option<String>,
    /// Column whose integral over time it is, zero where the file begins.
    #[serde(default)]
    pub integral_of: Option<String>,
    /// Unit of the column; that of the system's signal without it.
    #[serde(default)]
    pub unit: Option<String>,
    /// Factor, for columns of the other sign.
    #[serde(default)]
    pub scale: Option<f64>,
    /// Number added behind `scale`, in the unit of the system's signal.
    #[serde(default)]
    pub offset: Option<f64>,
    /// Held between its samples (a sampled command) instead of interpolated.
    #[serde(default)]
    pub hold: bool,
    /// Corner of a zero-phase low-pass of order 4 \[Hz\].
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub low_pass_hz: Option<f64>,
    /// Points of a Savitzky-Golay derivative of order 2.
    #[serde(default)]
    #[schemars(range(min = 3))]
    pub savitzky_golay_points: Option<usize>,
}

impl Signal {
    /// Column that it is made of; none where that is not clear.
    pub fn source(&self) -> Option<&String> {
        let mut given = [&self.column, &self.derivative_of, &self.integral_of].into_iter().flatten();
        given.next().filter(|_| given.next().is_none())
    }
}

/// A measured output.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// Column of the CSV files that holds the measurement.
    pub column: String,
    /// Unit of the column; that of the system's signal without it.
    #[serde(default)]
    pub unit: Option<String>,
    /// Rms of the sensor noise in `unit`; estimated from the scatter from sample to sample without it.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub noise: Option<f64>,
    /// Factor, for columns of the other sign.
    #[serde(default)]
    pub scale: Option<f64>,
    /// `fit`: a constant offset of the sensor belongs to the declared model; a number: added behind `scale`, in the
    /// unit of the system's signal.
    #[serde(default)]
    pub offset: Option<Offset>,
}

/// An offset of an output.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "`offset` is a number or \"fit\"")]
pub enum Offset {
    /// Known.
    Known(f64),
    /// To be fitted.
    Fitted(Fitted),
}

impl Offset {
    /// The value that is known.
    pub fn known(self) -> Option<f64> {
        match self {
            Offset::Known(value) => Some(value),
            Offset::Fitted(_) => None,
        }
    }
}

/// The word `fit`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fitted {
    /// Fitted.
    Fit,
}

/// A span of a file.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Segment {
    /// CSV file, relative to this file.
    pub file: String,
    /// Use of the segment.
    pub role: Role,
    /// Where it begins in the file \[s\]; the beginning of the file without it. Delays, play and sampled components
    /// that follow inputs alone remember what the file shows before, as long as the segment at most; where there is
    /// nothing before, they have settled at the first value.
    #[serde(default)]
    pub from_s: Option<f64>,
    /// Where it ends in the file \[s\]; the end of the file without it.
    #[serde(default)]
    pub to_s: Option<f64>,
    /// Initial states: fitted, measured (the default), or values of states and of Real parameters.
    #[serde(default)]
    pub initial: Option<Initial>,
}

/// Use of a segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = with_train)]
pub enum Role {
    /// Parameters are fitted on it.
    #[serde(alias = "train")]
    Estimation,
    /// The error on it decides; nothing is fitted but initial states.
    Validation,
    /// Reported only: a repetition.
    Repeat,
    /// Reported only: standstill.
    Rest,
}

impl Role {
    /// Word of the role.
    pub fn word(self) -> &'static str {
        match self {
            Role::Estimation => "estimation",
            Role::Validation => "validation",
            Role::Repeat => "repeat",
            Role::Rest => "rest",
        }
    }
}

/// Initial states of a segment.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Initial {
    /// `fit` or `measured`.
    Word(InitialWord),
    /// Values of states; those not named have the start values of the system.
    Given(BTreeMap<String, f64>),
}

/// How initial states are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InitialWord {
    /// Fitted to the segment, whatever its role.
    Fit,
    /// Those of `[states]`.
    Measured,
}

/// A free parameter of the declared model.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FreeParameter {
    /// Parameter of the system.
    pub parameter: String,
    /// Least value, in the unit of the parameter.
    #[serde(default)]
    pub min: Option<f64>,
    /// Largest value, in the unit of the parameter.
    #[serde(default)]
    pub max: Option<f64>,
    /// Value to start from; that of the system without it.
    #[serde(default)]
    pub start: Option<f64>,
}

/// A place where effects may act: an input of the system or of a component, or the rate of a state.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Attachment {
    /// Input whose value a block changes: `value - f(v, x, p)` for forces, `f(value)` for commands; or the rate of a
    /// state, such as `der(h)`, to which it adds.
    pub input: String,
    /// Channels of the vocabulary that may be missing here; without any, all that such a port can lack.
    #[serde(default)]
    #[schemars(extend("items" = json!({ "enum": super::kinds::CHANNELS })))]
    pub channels: Vec<String>,
    /// Signal: velocity along the force.
    #[serde(default)]
    pub velocity: Option<String>,
    /// Signal: position along the force.
    #[serde(default)]
    pub position: Option<String>,
    /// Signal: pressure force \[N\].
    #[serde(default)]
    pub pressure_force: Option<String>,
    /// Signal: chamber pressure \[Pa\].
    #[serde(default)]
    pub pressure: Option<String>,
    /// Parameter of the system that is its Coulomb friction.
    #[serde(default)]
    pub coulomb: Option<String>,
    /// Parameter of the system that is its viscous friction.
    #[serde(default)]
    pub viscous: Option<String>,
    /// Parameter of the system that is a constant force.
    #[serde(default)]
    pub bias: Option<String>,
    /// Velocity over which friction changes its sign: `s(v) = tanh(v/vt)`; 1 mm/s, or 0.05 rad/s for the pole.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub vt: Option<f64>,
    /// Velocity at which friction changes its sign, `s(v) = tanh((v - v0)/vt)`; 0 without it.
    #[serde(default)]
    pub v0: Option<f64>,
    /// Ids of effects to look for; all of the channels without it. Kinds where there is no channel.
    #[serde(default)]
    pub effects: Option<Vec<String>>,
    /// Velocity of another body that the force at this port moves the other way, where no velocity is stated.
    #[serde(skip)]
    pub against: Option<String>,
    /// Signal: level that the level at this port drains into, where the structure of the system shows one.
    #[serde(skip)]
    pub drains_into: Option<String>,
    /// Part of this place in a search by the structure of the system, and the sign of its influence; none where
    /// channels are declared.
    #[serde(skip)]
    pub port: Option<Duty>,
}

impl Attachment {
    /// An attachment of which only the input is known.
    pub fn at(input: &str) -> Attachment {
        Attachment { input: input.to_owned(), ..Attachment::default() }
    }

    /// Signals that it names.
    pub fn signals(&self) -> impl Iterator<Item = &String> {
        [&self.velocity, &self.position, &self.pressure_force, &self.pressure].into_iter().flatten()
    }

    /// Velocity over which friction changes its sign.
    pub fn sign_velocity(&self) -> f64 {
        let pole = self.channels.iter().any(|channel| channel == "pole");
        self.vt.unwrap_or(if pole { 0.05 } else { 1e-3 })
    }
}

/// Which error is fitted and reported.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ErrorRule {
    /// Simulations restart from the measured states after this time \[s\], while states without a column go on; whole
    /// segments without it.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub windows_s: Option<f64>,
    /// The force residual is reported as well.
    #[serde(default)]
    pub force: Option<ForceRule>,
}

/// Force that is missing at an attachment for the model to follow the measured motion.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceRule {
    /// Input of the attachment.
    pub attachment: String,
    /// State whose derivative the force changes.
    pub velocity: String,
    /// Corner of the zero-phase low-pass of order 4 for all signals \[Hz\].
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub low_pass_hz: f64,
    /// Left out at both ends of a file \[s\].
    #[serde(default)]
    #[schemars(range(min = 0))]
    pub trim_s: f64,
    /// The whole file counts, not the segment alone.
    #[serde(default)]
    pub whole_file: bool,
}

/// A declaration with the file it comes from.
#[derive(Debug, Clone)]
pub struct File {
    /// File.
    pub path: PathBuf,
    /// Its text, for places in messages.
    pub text: String,
    /// Folder that relative paths start from.
    pub folder: PathBuf,
    /// Its contents.
    pub declaration: Declaration,
    /// Assumptions made, one sentence each.
    pub notes: Vec<String>,
    /// Effects of one's own that are looked for as well.
    pub effects: Vec<std::sync::Arc<crate::vocabulary::Own>>,
    /// Outputs in place of the measured ones.
    pub redrawn: Option<std::sync::Arc<super::redrawn::Redrawn>>,
}

impl File {
    /// Reads a `study.toml`.
    ///
    /// # Errors
    /// A file that cannot be read, or is no study: file, line, column and what is allowed.
    pub fn read(path: &Path) -> Result<File, Error> {
        let text = airloop_series::file::read_to_string(path)
            .map_err(|error| Error::Case { path: path.into(), problem: error.to_string() })?;
        let declaration = declared::read(&text).map_err(|problem| Error::Study {
            path: path.into(),
            place: place(&text, problem.at),
            problem: problem.words,
        })?;
        let folder = path.parent().map_or_else(PathBuf::new, Path::to_owned);
        Ok(File {
            path: path.into(),
            text,
            folder,
            declaration,
            notes: Vec::new(),
            effects: Vec::new(),
            redrawn: None,
        })
    }

    /// Draws the records again, see [`Redrawn::draw`](super::redrawn::Redrawn::draw).
    ///
    /// # Errors
    /// A study that cannot be simulated.
    pub fn redraw(&mut self, system: Option<&Path>, seed: u64) -> Result<(), Error> {
        let redrawn = super::redrawn::Redrawn::draw(self, system, seed)?;
        self.notes.push(redrawn.note.clone());
        self.redrawn = Some(std::sync::Arc::new(redrawn));
        Ok(())
    }

    /// Name of the study: as declared, or that of its folder.
    pub fn name(&self) -> String {
        if !self.declaration.name.is_empty() {
            return self.declaration.name.clone();
        }
        let folder = self.folder.canonicalize().unwrap_or_else(|_| self.folder.clone());
        folder.file_name().map_or_else(|| "study".into(), |name| name.to_string_lossy().into_owned())
    }

    /// An error at a value of the file.
    pub fn refuse<T>(&self, at: &Spanned<T>, problem: impl std::fmt::Display) -> Error {
        Error::Study {
            path: self.path.clone(),
            place: place(&self.text, at.span().start),
            problem: problem.to_string(),
        }
    }

    /// An error of the file as a whole.
    pub fn refuse_all(&self, problem: impl std::fmt::Display) -> Error {
        Error::Study { path: self.path.clone(), place: String::new(), problem: problem.to_string() }
    }
}

/// Reads a TOML file into the type that declares its keys; an error with its place.
pub(crate) fn read<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    declared::read(text).map_err(|problem| place(text, problem.at) + &problem.words)
}

/// `line L, column C: ` of a byte of a text.
fn place(text: &str, byte: usize) -> String {
    let before = &text.as_bytes()[..byte.min(text.len())];
    let line = before.iter().filter(|&&c| c == b'\n').count() + 1;
    let column = before.iter().rev().take_while(|&&c| c != b'\n').count() + 1;
    if text.is_empty() { String::new() } else { format!("line {line}, column {column}: ") }
}
