//! Parameter sets: SSP `.ssv` files and the sets written inside a system description.

use std::path::{Path, PathBuf};

use super::xml::{self, Attributes, Element};
use super::{Error, ssp};
use airloop_series::units::Unit;

/// Namespace of parameter sets, the same in SSP 1.0 and 2.0.
pub const NAMESPACE: &str = "http://ssp-standard.org/SSP1/SystemStructureParameterValues";

/// A value with its type as written.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// `Real`, `Float64`, `Float32`.
    Real(f64),
    /// `Integer`, `Int8` ... `UInt64`.
    Integer(i64),
    /// `Boolean`.
    Boolean(bool),
    /// `String`.
    String(String),
    /// Name of the item of an enumeration.
    Enumeration(String),
}

/// A parameter and its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name as written, possibly `component.variable`.
    pub name: String,
    /// Value.
    pub value: Value,
    /// Unit of the value, if given.
    pub unit: Option<String>,
    /// Definition of that unit in the parameter set.
    pub definition: Option<Unit>,
    /// File that holds it.
    pub file: PathBuf,
    /// Line in that file.
    pub line: usize,
}

/// Reads a `.ssv` file.
///
/// # Errors
/// [`Error`] names file, line and element.
pub fn read(file: &Path) -> Result<Vec<Parameter>, Error> {
    read_as(file, file)
}

/// Reads `file`; messages call it `shown` (a file inside an archive).
pub(super) fn read_as(file: &Path, shown: &Path) -> Result<Vec<Parameter>, Error> {
    let root = xml::read(file, shown)?;
    parameter_set(&root, shown)
}

/// Parameters of a `ParameterSet` element.
pub(super) fn parameter_set(set: &Element, file: &Path) -> Result<Vec<Parameter>, Error> {
    if set.name != "ParameterSet" || set.namespace != NAMESPACE {
        return Err(Error::Xml {
            file: file.into(),
            line: set.line,
            problem: format!("expected <ParameterSet> of namespace {NAMESPACE}, found <{}>", set.name),
        });
    }
    let units = ssp::units(set, file)?;
    set.list("Parameters").map(|parameter| read_parameter(parameter, &units, file)).collect()
}

fn read_parameter(node: &Element, units: &[(String, Unit)], file: &Path) -> Result<Parameter, Error> {
    let name = node.required("name", file)?.to_owned();
    let typed = node
        .children
        .iter()
        .find(|child| child.namespace == NAMESPACE && child.name != "Annotations")
        .ok_or_else(|| Error::Xml {
            file: file.into(),
            line: node.line,
            problem: format!("parameter `{name}` has no value; add for example <ssv:Real value=\"1\"/>"),
        })?;
    let bad = |text: &str, allowed| Error::BadValue {
        file: file.into(),
        line: typed.line,
        what: format!("value of `{name}`"),
        value: text.into(),
        allowed,
    };
    let text = typed.attribute("value").ok_or_else(|| Error::MissingAttribute {
        file: file.into(),
        line: typed.line,
        element: typed.name.clone(),
        attribute: "value",
    })?;
    let value = match typed.name.as_str() {
        "Real" | "Float64" | "Float32" => match text.trim().parse::<f64>() {
            Ok(value) if value.is_finite() => Value::Real(value),
            _ => return Err(bad(text, "a finite number")),
        },
        "Integer" | "Int8" | "Int16" | "Int32" | "Int64" | "UInt8" | "UInt16" | "UInt32" | "UInt64" => {
            Value::Integer(text.trim().parse().map_err(|_| bad(text, "an integer of 64 bits"))?)
        }
        "Boolean" => match text.trim() {
            "true" | "1" => Value::Boolean(true),
            "false" | "0" => Value::Boolean(false),
            _ => return Err(bad(text, "true or false")),
        },
        "String" => Value::String(text.to_owned()),
        "Enumeration" => Value::Enumeration(text.to_owned()),
        other => {
            return Err(Error::Unsupported {
                file: file.into(),
                line: typed.line,
                feature: format!("the type {other} (parameter `{name}`)"),
                advice: "use Real, Integer, Boolean, String or Enumeration",
            });
        }
    };
    let unit = typed.attribute("unit").map(str::to_owned);
    let declared = units.iter().find(|(known, _)| Some(known) == unit.as_ref());
    let definition = declared.map(|(_, unit)| *unit);
    Ok(Parameter { name, value, unit, definition, file: file.into(), line: typed.line })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(parameters: &str) -> Result<Vec<Parameter>, Error> {
        let text = format!(
            "<ssv:ParameterSet xmlns:ssv=\"{NAMESPACE}\" version=\"1.0\" name=\"s\">\n<ssv:Parameters>\n{parameters}\n</ssv:Parameters></ssv:ParameterSet>"
        );
        parameter_set(&xml::parse(text.as_bytes(), Path::new("a.ssv")).unwrap(), Path::new("a.ssv"))
    }

    #[test]
    fn every_type_of_value_is_read() {
        let found = of(r#"<ssv:Parameter name="a"><ssv:Real value="1.5" unit="mm"/></ssv:Parameter>
            <ssv:Parameter name="b"><ssv:Integer value="-3"/></ssv:Parameter>
            <ssv:Parameter name="c"><ssv:Boolean value="true"/></ssv:Parameter>
            <ssv:Parameter name="d"><ssv:String value=""/></ssv:Parameter>
            <ssv:Parameter name="e"><ssv:Enumeration value="dopri5"/></ssv:Parameter>
            <ssv:Parameter name="f"><ssv:Float64 value="2"/></ssv:Parameter>"#)
        .unwrap();
        let values: Vec<&Value> = found.iter().map(|parameter| &parameter.value).collect();
        assert_eq!(values[0], &Value::Real(1.5));
        assert_eq!(found[0].unit.as_deref(), Some("mm"));
        assert_eq!(values[1], &Value::Integer(-3));
        assert_eq!(values[2], &Value::Boolean(true));
        assert_eq!(values[3], &Value::String(String::new()));
        assert_eq!(values[4], &Value::Enumeration("dopri5".into()));
        assert_eq!(values[5], &Value::Real(2.0));
    }

    #[test]
    fn values_that_are_none_are_refused_with_file_and_line() {
        let cases = [
            (r#"<ssv:Parameter name="a"><ssv:Real value="NaN"/></ssv:Parameter>"#, "`NaN` is not a finite"),
            (r#"<ssv:Parameter name="a"><ssv:Real/></ssv:Parameter>"#, "no attribute `value`"),
            (r#"<ssv:Parameter name="a"/>"#, "parameter `a` has no value"),
            (r#"<ssv:Parameter><ssv:Real value="1"/></ssv:Parameter>"#, "no attribute `name`"),
            (r#"<ssv:Parameter name="a"><ssv:Integer value="1.5"/></ssv:Parameter>"#, "integer of 64 bits"),
            (r#"<ssv:Parameter name="a"><ssv:Binary value="00"/></ssv:Parameter>"#, "type Binary"),
        ];
        for (text, expected) in cases {
            let message = of(text).unwrap_err().to_string();
            assert!(message.starts_with("a.ssv: line 3: ") && message.contains(expected), "{message}");
        }
    }
}
