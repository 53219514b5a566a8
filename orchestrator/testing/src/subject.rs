//! The subject of the checker's mutants: `subject.c` as an FMU of FMI 2.0 and of 3.0, with variables of all kinds.

/// Sound description of FMI 2.0.
pub const FMI2: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="subject" guid="subject" generationDateAndTime="2026-01-31T12:00:00Z" variableNamingConvention="structured" numberOfEventIndicators="1">
  <ModelExchange modelIdentifier="m" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"/>
  <CoSimulation modelIdentifier="m" canHandleVariableCommunicationStepSize="true" canInterpolateInputs="true" maxOutputDerivativeOrder="1" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"/>
  <UnitDefinitions>
    <Unit name="m"><BaseUnit m="1"/><DisplayUnit name="mm" factor="1000"/></Unit>
    <Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>
    <Unit name="s"><BaseUnit s="1"/></Unit>
  </UnitDefinitions>
  <TypeDefinitions>
    <SimpleType name="Place"><Real unit="m" min="-100" max="100" nominal="1"/></SimpleType>
    <SimpleType name="Level"><Enumeration><Item name="low" value="1"/><Item name="high" value="2"/></Enumeration></SimpleType>
  </TypeDefinitions>
  <LogCategories><Category name="logStatusError"/></LogCategories>
  <DefaultExperiment startTime="0" stopTime="2" stepSize="0.01" tolerance="1e-6"/>
  <ModelVariables>
    <ScalarVariable name="time" valueReference="0" causality="independent"><Real unit="s"/></ScalarVariable>
    <ScalarVariable name="u" valueReference="1" causality="input"><Real start="0" min="-5" max="5"/></ScalarVariable>
    <ScalarVariable name="u_held" valueReference="2" causality="input" variability="discrete"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="x" valueReference="3" causality="local" initial="exact"><Real declaredType="Place" displayUnit="mm" start="1"/></ScalarVariable>
    <ScalarVariable name="v" valueReference="4" causality="local" initial="exact"><Real unit="m/s" start="0" nominal="1" reinit="true"/></ScalarVariable>
    <ScalarVariable name="der(x)" valueReference="5"><Real unit="m/s" derivative="4"/></ScalarVariable>
    <ScalarVariable name="der(v)" valueReference="6"><Real derivative="5"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="7" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="w" valueReference="8" causality="output"><Real unit="m/s"/></ScalarVariable>
    <ScalarVariable name="held" valueReference="9" causality="output" variability="discrete"><Real/></ScalarVariable>
    <ScalarVariable name="k" valueReference="10" causality="parameter" variability="fixed"><Real start="4" min="0" max="100"/></ScalarVariable>
    <ScalarVariable name="d" valueReference="11" causality="parameter" variability="fixed"><Real start="0.5"/></ScalarVariable>
    <ScalarVariable name="g" valueReference="12" causality="parameter" variability="tunable"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="doubled" valueReference="13" causality="calculatedParameter" variability="fixed"><Real/></ScalarVariable>
    <ScalarVariable name="m_in" valueReference="20" causality="input" variability="discrete"><Integer start="0" min="-10" max="10"/></ScalarVariable>
    <ScalarVariable name="mode" valueReference="21" causality="output" variability="discrete"><Integer/></ScalarVariable>
    <ScalarVariable name="beats" valueReference="22" causality="output" variability="discrete"><Integer/></ScalarVariable>
    <ScalarVariable name="level" valueReference="23" causality="parameter" variability="fixed"><Enumeration declaredType="Level" start="1"/></ScalarVariable>
    <ScalarVariable name="flag" valueReference="30" causality="input" variability="discrete"><Boolean start="false"/></ScalarVariable>
    <ScalarVariable name="on" valueReference="31" causality="output" variability="discrete"><Boolean/></ScalarVariable>
    <ScalarVariable name="above" valueReference="32" variability="discrete"><Boolean/></ScalarVariable>
    <ScalarVariable name="text" valueReference="40" causality="parameter" variability="fixed"><String start="start"/></ScalarVariable>
    <ScalarVariable name="note" valueReference="41" causality="output" variability="discrete"><String/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs>
      <Unknown index="8" dependencies="2 4" dependenciesKind="constant constant"/>
      <Unknown index="9" dependencies="5" dependenciesKind="constant"/>
      <Unknown index="10" dependencies="3"/>
      <Unknown index="16" dependencies="15"/>
      <Unknown index="17" dependencies=""/>
      <Unknown index="20" dependencies="19"/>
      <Unknown index="23" dependencies=""/>
    </Outputs>
    <Derivatives>
      <Unknown index="6" dependencies="5" dependenciesKind="constant"/>
      <Unknown index="7" dependencies="2 4 5" dependenciesKind="tunable fixed fixed"/>
    </Derivatives>
    <InitialUnknowns>
      <Unknown index="6" dependencies="5"/>
      <Unknown index="7" dependencies="2 4 5 11 12 13"/>
      <Unknown index="8" dependencies="2 4"/>
      <Unknown index="9" dependencies="5"/>
      <Unknown index="10" dependencies="3"/>
      <Unknown index="14" dependencies="11"/>
      <Unknown index="16" dependencies="15"/>
      <Unknown index="17" dependencies=""/>
      <Unknown index="20" dependencies="19"/>
      <Unknown index="23" dependencies="22"/>
    </InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"#;

/// Sound description of FMI 3.0.
pub const FMI3: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="subject" instantiationToken="subject" generationDateAndTime="2026-01-31T12:00:00Z" variableNamingConvention="structured">
  <ModelExchange modelIdentifier="m" canGetAndSetFMUState="true" canSerializeFMUState="true" providesDirectionalDerivatives="true"/>
  <CoSimulation modelIdentifier="m" canHandleVariableCommunicationStepSize="true" maxOutputDerivativeOrder="1" canGetAndSetFMUState="true" canSerializeFMUState="true" providesDirectionalDerivatives="true"/>
  <UnitDefinitions>
    <Unit name="m"><BaseUnit m="1"/><DisplayUnit name="mm" factor="1000"/></Unit>
    <Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>
    <Unit name="s"><BaseUnit s="1"/></Unit>
  </UnitDefinitions>
  <TypeDefinitions>
    <Float64Type name="Place" unit="m" min="-100" max="100" nominal="1"/>
    <EnumerationType name="Level"><Item name="low" value="1"/><Item name="high" value="2"/></EnumerationType>
  </TypeDefinitions>
  <LogCategories><Category name="logStatusError"/></LogCategories>
  <DefaultExperiment startTime="0" stopTime="2" stepSize="0.01" tolerance="1e-6"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous" unit="s"/>
    <Float64 name="u" valueReference="1" causality="input" start="0" min="-5" max="5"/>
    <Float64 name="u_held" valueReference="2" causality="input" variability="discrete" start="0"/>
    <Float64 name="x" valueReference="3" causality="local" initial="exact" declaredType="Place" displayUnit="mm" start="1"/>
    <Float64 name="v" valueReference="4" causality="local" initial="exact" unit="m/s" start="0" nominal="1" reinit="true"/>
    <Float64 name="der(x)" valueReference="5" unit="m/s" derivative="3"/>
    <Float64 name="der(v)" valueReference="6" derivative="4"/>
    <Float64 name="y" valueReference="7" causality="output"/>
    <Float64 name="w" valueReference="8" causality="output" unit="m/s"/>
    <Float64 name="held" valueReference="9" causality="output" variability="discrete"/>
    <Float64 name="k" valueReference="10" causality="parameter" variability="fixed" start="4" min="0" max="100"/>
    <Float64 name="d" valueReference="11" causality="parameter" variability="fixed" start="0.5"/>
    <Float64 name="g" valueReference="12" causality="parameter" variability="tunable" start="1"/>
    <Float64 name="doubled" valueReference="13" causality="calculatedParameter" variability="fixed"/>
    <Float64 name="indicator" valueReference="14"/>
    <Int32 name="m_in" valueReference="20" causality="input" start="0" min="-10" max="10"/>
    <Int32 name="mode" valueReference="21" causality="output"/>
    <Int32 name="beats" valueReference="22" causality="output"/>
    <Enumeration name="level" valueReference="23" causality="parameter" variability="fixed" declaredType="Level" start="1"/>
    <Boolean name="flag" valueReference="30" causality="input" start="false"/>
    <Boolean name="on" valueReference="31" causality="output"/>
    <Boolean name="above" valueReference="32"/>
    <String name="text" valueReference="40" causality="parameter" variability="fixed"><Start value="start"/></String>
    <String name="note" valueReference="41" causality="output"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="7" dependencies="1 3" dependenciesKind="constant constant"/>
    <Output valueReference="8" dependencies="4" dependenciesKind="constant"/>
    <Output valueReference="9" dependencies="2"/>
    <Output valueReference="21" dependencies="20"/>
    <Output valueReference="22" dependencies=""/>
    <Output valueReference="31" dependencies="30"/>
    <Output valueReference="41" dependencies=""/>
    <ContinuousStateDerivative valueReference="5" dependencies="4" dependenciesKind="constant"/>
    <ContinuousStateDerivative valueReference="6" dependencies="1 3 4" dependenciesKind="tunable fixed fixed"/>
    <InitialUnknown valueReference="5" dependencies="4"/>
    <InitialUnknown valueReference="6" dependencies="1 3 4 10 11 12"/>
    <InitialUnknown valueReference="7" dependencies="1 3"/>
    <InitialUnknown valueReference="8" dependencies="4"/>
    <InitialUnknown valueReference="9" dependencies="2"/>
    <InitialUnknown valueReference="13" dependencies="10"/>
    <InitialUnknown valueReference="21" dependencies="20"/>
    <InitialUnknown valueReference="22" dependencies=""/>
    <InitialUnknown valueReference="31" dependencies="30"/>
    <InitialUnknown valueReference="41" dependencies="40"/>
    <EventIndicator valueReference="14"/>
  </ModelStructure>
</fmiModelDescription>
"#;
