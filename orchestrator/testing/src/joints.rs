//! The FMU of an arm of two joints (`joints.c`), made where a test needs it, and its motion with dry friction.

use std::path::Path;

use crate::c_fmu;

const DESCRIPTION: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="joints" guid="joints" numberOfEventIndicators="0">
<ModelExchange modelIdentifier="joints"/>
<UnitDefinitions><Unit name="N.m"><BaseUnit kg="1" m="2" s="-2"/></Unit><Unit name="rad"><BaseUnit rad="1"/></Unit>
<Unit name="rad/s"><BaseUnit rad="1" s="-1"/></Unit></UnitDefinitions>
<ModelVariables>
<ScalarVariable name="tau_1" valueReference="0" causality="input" variability="continuous"><Real start="0" unit="N.m"/></ScalarVariable>
<ScalarVariable name="tau_2" valueReference="1" causality="input" variability="continuous"><Real start="0" unit="N.m"/></ScalarVariable>
<ScalarVariable name="q_1" valueReference="2" causality="output" variability="continuous" initial="exact"><Real start="0" unit="rad"/></ScalarVariable>
<ScalarVariable name="q_2" valueReference="3" causality="output" variability="continuous" initial="exact"><Real start="0" unit="rad"/></ScalarVariable>
<ScalarVariable name="w_2" valueReference="5" causality="output" variability="continuous" initial="exact"><Real start="0" unit="rad/s"/></ScalarVariable>
<ScalarVariable name="w_1" valueReference="4" causality="output" variability="continuous" initial="exact"><Real start="0" unit="rad/s"/></ScalarVariable>
<ScalarVariable name="der(q_1)" valueReference="6" causality="local" variability="continuous" initial="calculated"><Real derivative="3"/></ScalarVariable>
<ScalarVariable name="der(q_2)" valueReference="7" causality="local" variability="continuous" initial="calculated"><Real derivative="4"/></ScalarVariable>
<ScalarVariable name="der(w_1)" valueReference="8" causality="local" variability="continuous" initial="calculated"><Real derivative="6"/></ScalarVariable>
<ScalarVariable name="der(w_2)" valueReference="9" causality="local" variability="continuous" initial="calculated"><Real derivative="5"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="3"/><Unknown index="4"/><Unknown index="5"/><Unknown index="6"/></Outputs>
<Derivatives><Unknown index="7"/><Unknown index="8"/><Unknown index="9"/><Unknown index="10"/></Derivatives></ModelStructure>
</fmiModelDescription>
"#;

/// Writes `joints.fmu` into a folder.
pub fn fmu(folder: &Path) {
    let library = folder.join("joints.so");
    c_fmu::compile("joints.c", &library, &[]);
    c_fmu::pack(&folder.join("joints.fmu"), DESCRIPTION, Some(("joints", &library)));
}

/// State (`q_1`, `q_2`, `w_1`, `w_2`) after a step `h` \[s\] of classical Runge-Kutta under torques \[N m\], with dry
/// friction of `dry` \[N m\] that changes its sign over `vt` \[rad/s\].
pub fn step(s: [f64; 4], torque: [f64; 2], dry: [f64; 2], vt: f64, h: f64) -> [f64; 4] {
    let rate = |s: [f64; 4]| {
        let [q1, q2, w1, w2] = s;
        let load = |i: usize, w: f64| torque[i] - dry[i] * (w / vt).tanh();
        let a = load(0, w1) - 0.3 * w1 - 2.0 * q1.sin();
        let b = load(1, w2) - 0.1 * w2 - 0.8 * (q1 + q2).sin();
        // Mass matrix [[0.30, 0.08], [0.08, 0.05]] kg m2.
        let det = 0.30 * 0.05 - 0.08 * 0.08;
        [w1, w2, (0.05 * a - 0.08 * b) / det, (0.30 * b - 0.08 * a) / det]
    };
    let ahead = |k: [f64; 4], part: f64| std::array::from_fn(|i| s[i] + part * h * k[i]);
    let k1 = rate(s);
    let k2 = rate(ahead(k1, 0.5));
    let k3 = rate(ahead(k2, 0.5));
    let k4 = rate(ahead(k3, 1.0));
    std::array::from_fn(|i| s[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
}
