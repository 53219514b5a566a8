//! FMUs that misbehave as the environment variable HOSTILE says: `hostile.c` by FMI 2.0, `hostile3.c` by FMI 3.0.

use std::path::Path;

use crate::c_fmu;

/// Version of FMI.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0.
    Two,
    /// FMI 3.0.
    Three,
}

impl Version {
    /// Its model description, with all that the library offers.
    pub fn description(self) -> &'static str {
        match self {
            Version::Two => TWO,
            Version::Three => THREE,
        }
    }

    /// Writes the FMU.
    pub fn write(self, path: &Path) {
        let (source, platform) = match self {
            Version::Two => ("hostile.c", c_fmu::PLATFORM),
            Version::Three => ("hostile3.c", "x86_64-linux"),
        };
        let library = path.with_extension("so");
        c_fmu::compile(source, &library, &["-pthread"]);
        c_fmu::pack_for(path, self.description(), Some(("m", &library)), platform);
        std::fs::remove_file(library).unwrap();
    }
}

const TWO: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g" numberOfEventIndicators="1">
  <ModelExchange modelIdentifier="m" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"/>
  <CoSimulation modelIdentifier="m" canHandleVariableCommunicationStepSize="true" canInterpolateInputs="true"
    maxOutputDerivativeOrder="1" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="x" valueReference="1" causality="local" initial="exact"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="der(x)" valueReference="2"><Real derivative="2"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="3" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="s" valueReference="0" causality="output" variability="discrete"><String/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="4" dependencies="2"/><Unknown index="5" dependencies=""/></Outputs>
    <Derivatives><Unknown index="3" dependencies="1 2"/></Derivatives>
    <InitialUnknowns><Unknown index="3" dependencies="1 2"/><Unknown index="4" dependencies="2"/><Unknown index="5" dependencies=""/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"#;

const THREE: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="g">
  <ModelExchange modelIdentifier="m" canGetAndSetFMUState="true" canSerializeFMUState="true" providesDirectionalDerivatives="true"/>
  <CoSimulation modelIdentifier="m" canHandleVariableCommunicationStepSize="true" maxOutputDerivativeOrder="1"
    canGetAndSetFMUState="true" canSerializeFMUState="true" providesDirectionalDerivatives="true"
    providesIntermediateUpdate="true" canReturnEarlyAfterIntermediateUpdate="true"/>
  <ModelVariables>
    <Float64 name="u" valueReference="0" causality="input" start="0"/>
    <Float64 name="x" valueReference="1" causality="local" initial="exact" start="1"/>
    <Float64 name="der(x)" valueReference="2" causality="local" derivative="1"/>
    <Float64 name="y" valueReference="3" causality="output"/>
    <Float64 name="indicator" valueReference="4"/>
    <Float64 name="time" valueReference="5" causality="independent"/>
    <String name="s" valueReference="6" causality="output"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="3" dependencies="1"/><Output valueReference="6" dependencies=""/>
    <ContinuousStateDerivative valueReference="2" dependencies="0 1"/>
    <InitialUnknown valueReference="2" dependencies="0 1"/><InitialUnknown valueReference="3" dependencies="1"/>
    <InitialUnknown valueReference="6" dependencies=""/>
    <EventIndicator valueReference="4"/>
  </ModelStructure>
</fmiModelDescription>
"#;
