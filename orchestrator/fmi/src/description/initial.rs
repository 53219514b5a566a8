//! Values of `initial` that go with a causality and a variability (FMI 2.0.5 section 2.2.7).

use super::{Causality, Initial, Variability};

/// The values of `initial` that are allowed for a variable, the default first.
///
/// `Some` and empty: `initial` must not be given (inputs, the independent variable). `None`: the standard does not
/// allow this causality with this variability.
pub fn allowed_initials(causality: Causality, variability: Variability) -> Option<&'static [Initial]> {
    use Causality::{CalculatedParameter, Independent, Input, Local, Output, Parameter};
    use Initial::{Approx, Calculated, Exact};
    use Variability::{Constant, Continuous, Discrete, Fixed, Tunable};
    match (causality, variability) {
        (Output | Local, Constant) | (Parameter, Fixed | Tunable) => Some(&[Exact]),
        (CalculatedParameter | Local, Fixed | Tunable) => Some(&[Calculated, Approx]),
        (Output | Local, Discrete | Continuous) => Some(&[Calculated, Exact, Approx]),
        (Input, Discrete | Continuous) | (Independent, Continuous) => Some(&[]),
        _ => None,
    }
}
