//! C names of FMI 3.0 for those of 2.0, for messages.

const NAMES: [(&str, &str); 35] = [
    ("fmi2Instantiate", "fmi3Instantiate"),
    ("fmi2SetupExperiment", "fmi3EnterInitializationMode"),
    ("fmi2EnterInitializationMode", "fmi3EnterInitializationMode"),
    ("fmi2ExitInitializationMode", "fmi3ExitInitializationMode"),
    ("fmi2GetReal", "fmi3GetFloat64"),
    ("fmi2SetReal", "fmi3SetFloat64"),
    ("fmi2GetInteger", "fmi3Get of an integer type"),
    ("fmi2SetInteger", "fmi3Set of an integer type"),
    ("fmi2GetBoolean", "fmi3GetBoolean"),
    ("fmi2SetBoolean", "fmi3SetBoolean"),
    ("fmi2GetString", "fmi3GetString"),
    ("fmi2SetString", "fmi3SetString"),
    ("fmi2GetFMUstate", "fmi3GetFMUState"),
    ("fmi2SetFMUstate", "fmi3SetFMUState"),
    ("fmi2FreeFMUstate", "fmi3FreeFMUState"),
    ("fmi2SerializedFMUstateSize", "fmi3SerializedFMUStateSize"),
    ("fmi2SerializeFMUstate", "fmi3SerializeFMUState"),
    ("fmi2DeSerializeFMUstate", "fmi3DeserializeFMUState"),
    ("fmi2GetRealOutputDerivatives", "fmi3GetOutputDerivatives"),
    ("fmi2NewDiscreteStates", "fmi3UpdateDiscreteStates"),
    ("fmi2GetDerivatives", "fmi3GetContinuousStateDerivatives"),
    ("fmi2GetDirectionalDerivative", "fmi3GetDirectionalDerivative"),
    ("fmi2DoStep", "fmi3DoStep"),
    ("fmi2Terminate", "fmi3Terminate"),
    ("fmi2Reset", "fmi3Reset"),
    ("fmi2FreeInstance", "fmi3FreeInstance"),
    ("fmi2SetDebugLogging", "fmi3SetDebugLogging"),
    ("fmi2EnterEventMode", "fmi3EnterEventMode"),
    ("fmi2EnterContinuousTimeMode", "fmi3EnterContinuousTimeMode"),
    ("fmi2CompletedIntegratorStep", "fmi3CompletedIntegratorStep"),
    ("fmi2SetTime", "fmi3SetTime"),
    ("fmi2SetContinuousStates", "fmi3SetContinuousStates"),
    ("fmi2GetContinuousStates", "fmi3GetContinuousStates"),
    ("fmi2GetEventIndicators", "fmi3GetEventIndicators"),
    ("fmi2GetNominalsOfContinuousStates", "fmi3GetNominalsOfContinuousStates"),
];

/// The function of FMI 3.0 that does what `function` of 2.0 does.
pub(crate) fn of(function: &'static str) -> &'static str {
    NAMES.iter().find(|(two, _)| *two == function).map_or(function, |(_, three)| three)
}

/// Terms of FMI 2.0 and their names in FMI 3.0, for texts about FMUs of FMI 2.0.
const WORDS: [(&str, &str); 7] = [
    ("FMI 2.0.4 section 2.2.8", "FMI 3.0 section 2.4.8"),
    ("ModelStructure/Outputs", "Output elements of ModelStructure"),
    ("ModelStructure/Derivatives", "ContinuousStateDerivative elements of ModelStructure"),
    ("ModelStructure/InitialUnknowns", "InitialUnknown elements of ModelStructure"),
    ("guid", "instantiationToken"),
    ("canSerializeFMUstate", "canSerializeFMUState"),
    ("canGetAndSetFMUstate", "canGetAndSetFMUState"),
];

/// A text about an FMU of FMI 2.0 as one about FMI 3.0.
pub(crate) fn in_text(text: &str) -> String {
    let mut text = text.to_owned();
    for (two, three) in WORDS {
        text = text.replace(two, three);
    }
    // Longer names first, since some begin with others.
    let mut names = NAMES;
    names.sort_by_key(|(two, _)| std::cmp::Reverse(two.len()));
    for (two, three) in names {
        text = text.replace(two, three);
    }
    text
}
