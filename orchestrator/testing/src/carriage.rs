//! The FMU of a carriage (`carriage.c`), made where a test needs it, and records of one with dry friction.

use std::fmt::Write as _;
use std::path::Path;

use crate::c_fmu;

const DESCRIPTION: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="carriage" guid="carriage" numberOfEventIndicators="0">
<ModelExchange modelIdentifier="carriage"/>
<UnitDefinitions><Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit><Unit name="m"><BaseUnit m="1"/></Unit>
<Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit></UnitDefinitions>
<ModelVariables>
<ScalarVariable name="drive" valueReference="0" causality="input" variability="continuous"><Real start="0" unit="N"/></ScalarVariable>
<ScalarVariable name="place" valueReference="1" causality="output" variability="continuous" initial="exact"><Real start="0" unit="m"/></ScalarVariable>
<ScalarVariable name="speed" valueReference="2" causality="output" variability="continuous" initial="exact"><Real start="0" unit="m/s"/></ScalarVariable>
<ScalarVariable name="der(place)" valueReference="3" causality="local" variability="continuous" initial="calculated"><Real derivative="2"/></ScalarVariable>
<ScalarVariable name="der(speed)" valueReference="4" causality="local" variability="continuous" initial="calculated"><Real derivative="3"/></ScalarVariable>
<ScalarVariable name="weight" valueReference="5" causality="parameter" variability="fixed" initial="exact"><Real start="1" min="0.001"/></ScalarVariable>
<ScalarVariable name="drag" valueReference="6" causality="parameter" variability="fixed" initial="exact"><Real start="0" min="0"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="2" dependencies=""/><Unknown index="3" dependencies=""/></Outputs>
<Derivatives><Unknown index="4" dependencies="3"/><Unknown index="5" dependencies="1 3"/></Derivatives></ModelStructure>
</fmiModelDescription>
"#;

/// Writes `carriage.fmu` into a folder.
pub fn fmu(folder: &Path) {
    let library = folder.join("carriage.so");
    c_fmu::compile("carriage.c", &library, &[]);
    c_fmu::pack(&folder.join("carriage.fmu"), DESCRIPTION, Some(("carriage", &library)));
}

/// Mass \[kg\], viscous friction \[N s/m\] and dry friction \[N\] of the carriage in the records.
pub const TRUTH: (f64, f64, f64) = (4.0, 6.0, 3.0);

/// A record of 8 s at 500 Hz: force, position and speed with noise of 10 um, 0.2 mm/s; `phase` makes it another one.
pub fn record(path: &Path, dry: f64, phase: f64) {
    let (mass, drag, _) = TRUTH;
    let mut bits = 0x9e37_79b9_7f4a_7c15u64 ^ phase.to_bits();
    let mut noise = || {
        // Sum of twelve uniform numbers less six: nearly normal with variance one.
        let uniform = |bits: &mut u64| {
            *bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (*bits >> 11) as f64 / (1u64 << 53) as f64
        };
        (0..12).map(|_| uniform(&mut bits)).sum::<f64>() - 6.0
    };
    let (mut x, mut v, step, inner) = (0.0, 0.0, 0.002, 40);
    let mut text = "time,force,position,speed\n".to_owned();
    for k in 0..4000 {
        let t = f64::from(k) * step;
        let force = 14.0 * (1.9 * t + phase).sin() + 9.0 * (5.3 * t + 2.0 * phase).sin();
        let _ = writeln!(text, "{t:.3},{force:.6},{:.8},{:.7}", x + 1e-5 * noise(), v + 2e-4 * noise());
        for _ in 0..inner {
            // Leapfrog with the force held over the sample.
            let h = step / f64::from(inner);
            v += h * (force - drag * v - dry * (v / 1e-3f64).tanh()) / mass;
            x += h * v;
        }
    }
    std::fs::write(path, text).unwrap();
}
