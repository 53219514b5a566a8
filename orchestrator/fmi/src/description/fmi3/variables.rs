//! `ModelVariables` of FMI 3.0: every scalar and every element of an array becomes a variable.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::ops::Range;
use std::sync::Arc;

use super::super::layout::{BaseType, Layout, Resize, Slot, Whole};
use super::super::{
    Causality, DescriptionError, Initial, TypeDefinition, UnreadVariable, Variability, Variable,
    VariableKind, kinds, roles,
};
use super::{MAX_SCALARS, types};
use crate::xml::Element;

/// Value references below this are kept as they are, so that what is shown is what the file says.
const KEPT_REFERENCES: u32 = 1 << 16;

/// The variables, and how to find them.
pub(super) struct Read {
    pub(super) variables: Vec<Variable>,
    pub(super) unread: Vec<UnreadVariable>,
    pub(super) index: HashMap<String, usize>,
    pub(super) layout: Layout,
    places: HashMap<u32, Range<usize>>,
}

impl Read {
    /// Positions of the elements of the variable with a value reference of the file; none if it is unread, `None` if
    /// there is no such variable.
    pub(super) fn positions(&self, reference: u32) -> Option<Range<usize>> {
        self.places.get(&reference).cloned()
    }
}

/// A variable of the file before it is taken apart.
struct Declared<'a> {
    element: &'a Element,
    base: BaseType,
    reference: u32,
    shape: Vec<usize>,
    structural: bool,
}

impl Declared<'_> {
    fn elements(&self) -> usize {
        self.shape.iter().product()
    }
}

/// All variables, with other values of structural parameters than the file gives.
pub(super) fn read(
    root: &Element,
    types: &[TypeDefinition],
    structure: &[(String, i64)],
) -> Result<Read, DescriptionError> {
    let list =
        root.child("ModelVariables").ok_or_else(|| root.error("the element ModelVariables is missing"))?;
    let known: HashMap<&str, &TypeDefinition> = types.iter().map(|t| (t.name.as_str(), t)).collect();
    let sizes = sizes(list, structure)?;
    let mut declared = Vec::new();
    let mut unread = Vec::new();
    let mut places = HashMap::new();
    for element in &list.children {
        let reference = match element.name.as_str() {
            "Annotations" => continue,
            _ => element.value_reference()?,
        };
        if places.insert(reference, 0..0).is_some() {
            return Err(element.error(format!("another variable has the valueReference {reference}")));
        }
        let Some(base) = BaseType::of(&element.name) else {
            if element.name != "Clock" {
                return Err(element.error("FMI 3.0 knows no variable of this type"));
            }
            unread.push(UnreadVariable {
                name: element.required("name")?.to_owned(),
                kind: element.name.clone(),
                is_input: element.attribute("causality") == Some("input"),
            });
            continue;
        };
        let shape = shape(element, &sizes)?;
        let structural = element.attribute("causality") == Some("structuralParameter");
        declared.push(Declared { element, base, reference, shape, structural });
    }
    let largest = places.keys().copied().max().unwrap_or(0);
    let mut flat = Flat {
        variables: Vec::new(),
        index: HashMap::new(),
        slots: if largest < KEPT_REFERENCES { vec![None; largest as usize + 1] } else { Vec::new() },
        kept: largest < KEPT_REFERENCES,
    };
    let (mut wholes, mut resizes) = (Vec::with_capacity(declared.len()), Vec::new());
    for one in &declared {
        places.insert(one.reference, flat.add(one, wholes.len(), &known)?);
        let value = structure.iter().find(|(name, _)| one.element.attribute("name") == Some(name));
        if let Some(&(_, value)) = value.filter(|_| one.structural) {
            resizes.push(Resize { whole: wholes.len(), value });
            let position = places[&one.reference].start;
            if let Some(VariableKind::Integer { start, .. }) =
                flat.variables.get_mut(position).map(|variable| &mut variable.kind)
            {
                *start = Some(value);
            }
        }
        wholes.push(Whole {
            reference: one.reference,
            base: one.base,
            elements: one.elements(),
            structural: one.structural,
            sizes_arrays: sizes.get(&one.reference).is_some_and(|size| size.is_used),
            is_held: matches!(
                one.element.attribute("causality"),
                Some("input" | "parameter" | "structuralParameter")
            ),
        });
    }
    let Flat { mut variables, index, slots, .. } = flat;
    derivatives(&declared, &places, &mut variables)?;
    let layout = Layout { wholes: Arc::new(wholes), slots: Arc::new(slots), resizes };
    Ok(Read { variables, unread, index, layout, places })
}

/// A variable that may be the length of a dimension.
struct Size {
    value: usize,
    is_used: bool,
}

/// Values of structural parameters and constants that dimensions can refer to, by value reference.
fn sizes(list: &Element, structure: &[(String, i64)]) -> Result<HashMap<u32, Size>, DescriptionError> {
    let mut used = std::collections::HashSet::new();
    for element in &list.children {
        for dimension in element.children("Dimension") {
            used.extend(dimension.integer::<u32>("valueReference")?);
        }
    }
    let mut sizes = HashMap::new();
    for element in list.children.iter().filter(|element| element.attribute("valueReference").is_some()) {
        let reference = element.value_reference()?;
        let integer = BaseType::of(&element.name).is_some_and(|base| base.range().is_some());
        if !integer || (!used.contains(&reference) && element.children("Dimension").next().is_some()) {
            continue;
        }
        let is_used = used.contains(&reference);
        let other = structure.iter().find(|(name, _)| element.attribute("name") == Some(name));
        let value = match other {
            Some(&(_, value)) => usize::try_from(value).ok(),
            None if is_used => element.integer("start")?,
            None => None,
        };
        if let Some(value) = value {
            sizes.insert(reference, Size { value, is_used });
        }
    }
    Ok(sizes)
}

/// Lengths of the dimensions of a variable; empty for a scalar.
fn shape(element: &Element, sizes: &HashMap<u32, Size>) -> Result<Vec<usize>, DescriptionError> {
    let mut shape = Vec::new();
    for dimension in element.children("Dimension") {
        let length = match (dimension.integer("start")?, dimension.integer::<u32>("valueReference")?) {
            (Some(length), None) => length,
            (None, Some(reference)) => {
                sizes
                    .get(&reference)
                    .ok_or_else(|| {
                        element.error(format!(
                            "a Dimension refers to valueReference {reference}, which is no integer with a start value"
                        ))
                    })?
                    .value
            }
            _ => return Err(element.error("a Dimension needs either start or valueReference")),
        };
        shape.push(length);
    }
    let elements = shape.iter().try_fold(1_usize, |product, &length| product.checked_mul(length));
    if elements.is_none_or(|elements| elements > MAX_SCALARS) {
        let message = format!("the array has more than {MAX_SCALARS} elements, the limit of this importer");
        return Err(element.error(message));
    }
    Ok(shape)
}

/// The variables so far.
struct Flat {
    variables: Vec<Variable>,
    index: HashMap<String, usize>,
    slots: Vec<Option<Slot>>,
    kept: bool,
}

impl Flat {
    /// Adds the elements of a variable and of its aliases; yields the positions of the former.
    fn add(
        &mut self,
        declared: &Declared<'_>,
        whole: usize,
        types: &HashMap<&str, &TypeDefinition>,
    ) -> Result<Range<usize>, DescriptionError> {
        let element = declared.element;
        let first = self.variables.len();
        if self.slots.len() + declared.elements() > MAX_SCALARS {
            let message = format!(
                "the arrays have more than {MAX_SCALARS} elements in all, the limit of this importer"
            );
            return Err(element.error(message));
        }
        let model = variable(declared, types)?;
        let starts = starts(declared)?;
        let mut references = Vec::with_capacity(declared.elements());
        for number in 0..declared.elements() {
            let slot = Some(Slot { whole, element: number });
            let reference = if self.kept && number == 0 {
                self.slots[declared.reference as usize] = slot;
                declared.reference
            } else {
                self.slots.push(slot);
                (self.slots.len() - 1) as u32
            };
            references.push(reference);
        }
        for (number, &value_reference) in references.iter().enumerate() {
            let mut kind = model.kind.clone();
            // One value stands for all elements; a resized array has values only as far as the file goes.
            let text = if starts.len() == 1 { starts.first() } else { starts.get(number) };
            if let Some(text) = text {
                set_start(&mut kind, text, declared)?;
            }
            let name = model.name.clone() + &index_text(number, &declared.shape);
            self.push(element, Variable { name, value_reference, kind, ..model.clone() })?;
        }
        let positions = first..self.variables.len();
        for alias in element.children("Alias") {
            self.add_alias(alias, declared, positions.clone())?;
        }
        Ok(positions)
    }

    /// Another name of the variables at `positions`: it can be read, with a display unit of its own.
    fn add_alias(
        &mut self,
        alias: &Element,
        declared: &Declared<'_>,
        positions: Range<usize>,
    ) -> Result<(), DescriptionError> {
        for (number, position) in positions.enumerate() {
            let of = &self.variables[position];
            let variability = match of.causality {
                // What the importer sets may change at any time for who only reads it.
                Causality::Parameter | Causality::CalculatedParameter => Variability::Tunable,
                _ => of.variability,
            };
            let is_constant = variability == Variability::Constant;
            let mut kind = of.kind.clone();
            if !is_constant {
                kind.clear_start();
            }
            if let VariableKind::Real(real) = &mut kind {
                (real.reinit, real.derivative) = (false, None);
                real.display_unit =
                    alias.attribute("displayUnit").map(str::to_owned).or(real.display_unit.take());
            }
            let one = Variable {
                name: alias.required("name")?.to_owned() + &index_text(number, &declared.shape),
                value_reference: of.value_reference,
                description: alias.text("description"),
                causality: Causality::Local,
                variability,
                initial: Some(if is_constant { Initial::Exact } else { Initial::Calculated }),
                declared_initial: None,
                kind,
                can_handle_multiple_set: None,
                line: alias.line,
            };
            self.push(alias, one)?;
        }
        Ok(())
    }

    fn push(&mut self, element: &Element, variable: Variable) -> Result<(), DescriptionError> {
        match self.index.entry(variable.name.clone()) {
            Entry::Occupied(earlier) => {
                let line = self.variables[*earlier.get()].line;
                let name = &variable.name;
                Err(element.error(format!("a variable called {name} stands in line {line} already")))
            }
            Entry::Vacant(place) => {
                place.insert(self.variables.len());
                self.variables.push(variable);
                Ok(())
            }
        }
    }
}

/// Index of an element of an array, from 1 and row by row: `[2,1]`; nothing for a scalar.
fn index_text(mut number: usize, shape: &[usize]) -> String {
    if shape.is_empty() {
        return String::new();
    }
    let mut indices = vec![String::new(); shape.len()];
    for (index, &length) in indices.iter_mut().zip(shape).rev() {
        *index = (number % length + 1).to_string();
        number /= length;
    }
    format!("[{}]", indices.join(","))
}

/// Attributes shared by all elements of a variable; the kind has no start value yet.
fn variable(
    declared: &Declared<'_>,
    types: &HashMap<&str, &TypeDefinition>,
) -> Result<Variable, DescriptionError> {
    let Declared { element, base, .. } = *declared;
    let name = element.required("name")?.to_owned();
    let definition = kinds::declared(element, element, base.carried_as(&element.name), types)?;
    let enumeration = match element.name.as_str() {
        "Enumeration" => Some(kinds::enumeration(element, definition)?),
        _ => None,
    };
    let causality = roles::causality(element, true)?;
    let default_variability = match causality {
        Causality::Parameter | Causality::CalculatedParameter => Variability::Fixed,
        _ if base.is_float() => Variability::Continuous,
        _ => Variability::Discrete,
    };
    let variability = roles::variability(element)?.unwrap_or(default_variability);
    // FMI 3.0 allows initial="exact" at inputs, where it says what holds anyway.
    let declared_initial = roles::declared_initial(element)?.filter(|_| causality != Causality::Input);
    Ok(Variable {
        name,
        value_reference: 0,
        description: element.text("description"),
        causality,
        variability,
        initial: roles::initial(causality, variability, declared_initial),
        declared_initial,
        kind: types::kind(element, base, enumeration, definition)?,
        can_handle_multiple_set: element.boolean("canHandleMultipleSetPerTimeInstant")?,
        line: element.line,
    })
}

/// Start values as texts: none, one for all elements, or one for each.
fn starts(declared: &Declared<'_>) -> Result<Vec<String>, DescriptionError> {
    let element = declared.element;
    if declared.base.is_text() {
        let value = |start: &Element| {
            let value = start.attribute("value").map(str::to_owned);
            value.ok_or_else(|| start.error("the attribute value is missing"))
        };
        return element.children("Start").map(value).collect();
    }
    Ok(element.attribute("start").unwrap_or_default().split_whitespace().map(str::to_owned).collect())
}

fn set_start(kind: &mut VariableKind, text: &str, declared: &Declared<'_>) -> Result<(), DescriptionError> {
    let bad = |allowed: &str| declared.element.bad("start", text, allowed);
    let whole = || -> Result<Option<i64>, DescriptionError> {
        let value: i128 = text.parse().map_err(|_| bad("a whole number"))?;
        let (min, max) = declared.base.range().unwrap_or((i128::MIN, i128::MAX));
        if value < min || value > max {
            return Err(bad("a number of the type"));
        }
        // The FMU has the value itself; here it cannot be carried.
        Ok(i64::try_from(value).ok())
    };
    match kind {
        VariableKind::Real(real) => {
            let value = match declared.base {
                BaseType::Float32 => text.parse().ok().map(|value: f32| f64::from(value)),
                _ => text.parse().ok(),
            };
            real.start = Some(value.filter(|value| value.is_finite()).ok_or_else(|| bad("a finite number"))?);
        }
        VariableKind::Integer { start, .. } | VariableKind::Enumeration { start, .. } => *start = whole()?,
        VariableKind::Boolean { start } => {
            *start = Some(match text {
                "true" | "1" => true,
                "false" | "0" => false,
                _ => return Err(bad("true or false")),
            });
        }
        VariableKind::String { start } if declared.base == BaseType::Binary => {
            let is_bytes =
                text.len().is_multiple_of(2) && text.bytes().all(|digit| digit.is_ascii_hexdigit());
            if !is_bytes {
                return Err(bad("bytes as pairs of hexadecimal digits"));
            }
            *start = Some(text.to_ascii_lowercase());
        }
        VariableKind::String { start } => *start = Some(text.to_owned()),
    }
    Ok(())
}

/// Resolves `derivative`, which names the state by value reference, element by element.
fn derivatives(
    declared: &[Declared<'_>],
    places: &HashMap<u32, Range<usize>>,
    variables: &mut [Variable],
) -> Result<(), DescriptionError> {
    for one in declared.iter().filter(|one| one.base.is_float()) {
        let Some(reference) = one.element.integer::<u32>("derivative")? else { continue };
        let state = places.get(&reference).ok_or_else(|| {
            one.element.bad("derivative", &reference.to_string(), "the value reference of a variable")
        })?;
        let own = places[&one.reference].clone();
        if state.len() != own.len() {
            return Err(one.element.error(format!(
                "it has {} elements and the variable of which it is the derivative {}",
                own.len(),
                state.len()
            )));
        }
        for (position, state) in own.zip(state.clone()) {
            if let VariableKind::Real(real) = &mut variables[position].kind {
                real.derivative = Some(state);
            }
        }
    }
    Ok(())
}
