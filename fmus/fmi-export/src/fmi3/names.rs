//! Messages in the words of FMI 3.0.

/// Terms of FMI 2.0 and their names in FMI 3.0, longer texts first.
const WORDS: [(&str, &str); 13] = [
    ("fmi2GetRealOutputDerivatives", "fmi3GetOutputDerivatives"),
    ("fmi2SetupExperiment", "fmi3EnterInitializationMode"),
    ("fmi2NewDiscreteStates", "fmi3UpdateDiscreteStates"),
    ("fmi2GetDerivatives", "fmi3GetContinuousStateDerivatives"),
    ("fmi2GetInteger", "fmi3GetInt32"),
    ("fmi2SetInteger", "fmi3SetInt32"),
    ("fmi2GetReal", "fmi3GetFloat64"),
    ("fmi2SetReal", "fmi3SetFloat64"),
    ("DeSerializeFMUstate", "DeserializeFMUState"),
    ("FMUstate", "FMUState"),
    ("fmuResourceLocation", "resourcePath"),
    ("GUID", "instantiation token"),
    ("fmi2", "fmi3"),
];

/// A message written for FMI 2.0.
pub(crate) fn in_message(message: &str) -> String {
    WORDS.iter().fold(message.to_owned(), |text, (two, three)| text.replace(two, three))
}

#[cfg(test)]
mod tests {
    use super::in_message;

    #[test]
    fn functions_have_their_names_of_fmi_3() {
        let text =
            "fmi2GetReal: not allowed; fmi2GetRealOutputDerivatives, fmi2DeSerializeFMUstate, fmi2Terminate";
        assert_eq!(
            in_message(text),
            "fmi3GetFloat64: not allowed; fmi3GetOutputDerivatives, fmi3DeserializeFMUState, fmi3Terminate"
        );
    }
}
