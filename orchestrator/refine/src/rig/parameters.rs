//! All numbers a simulation of the rig depends on besides the declared model: parameters of the candidate effects and
//! relative corrections of the declared parameters. One flat vector, so that the engine can fit any of them.
//!
//! A neutral value switches an effect off exactly. `CYLINDER` is no number to fit: 1 puts the pneumatic cylinder in
//! place of the declared actuator.

/// One entry of the parameter vector.
#[derive(Debug, Clone, Copy)]
pub struct Definition {
    /// `effect.parameter`, or `declared.parameter` for relative corrections.
    pub name: &'static str,
    /// Unit of the value.
    pub unit: &'static str,
    /// Value that switches the effect off.
    pub neutral: f64,
    /// Bounds of the value: sign and passivity rules are here.
    pub bounds: (f64, f64),
    /// A small but noticeable value: length of the difference steps is 1/100 of it.
    pub scale: f64,
}

macro_rules! parameters {
    ($($constant:ident $name:literal $unit:literal $neutral:expr, $lower:expr, $upper:expr, $scale:expr;)*) => {
        #[allow(non_camel_case_types, clippy::upper_case_acronyms, reason = "names of indices")]
        enum Index { $($constant),* }
        $(#[doc = concat!("Index of `", $name, "` \\[", $unit, "\\].")] pub const $constant: usize = Index::$constant as usize;)*
        /// Every entry of the parameter vector, in order.
        pub const TABLE: &[Definition] = &[
            $(Definition { name: $name, unit: $unit, neutral: $neutral, bounds: ($lower, $upper), scale: $scale }),*
        ];
    };
}

const INF: f64 = f64::INFINITY;

parameters! {
    GAIN "act.gain.gain" "1" 0.0, -0.9, 2.0, 0.02;
    DELAY "act.delay.delay" "s" 0.0, 0.0, 0.05, 1e-3;
    DEADBAND "act.deadband.width" "N" 0.0, 0.0, 30.0, 0.3;
    LIMIT "act.saturation.limit" "N" INF, 0.5, INF, 1.0;
    HYSTERESIS "act.hysteresis.width" "N" 0.0, 0.0, 30.0, 0.3;
    POSGAIN "act.posgain.slope" "1/m" 0.0, -8.0, 8.0, 0.3;
    BACKPRESSURE "act.backpressure.coef" "N s/m" 0.0, 0.0, 300.0, 1.0;
    DROOP_DEPTH "act.droop.depth" "1" 0.0, 0.0, 0.95, 0.03;
    DROOP_TAU "act.droop.tau" "s" 1.0, 0.05, 30.0, 0.3;
    MODE_FREQ "act.mode.freq" "Hz" INF, 1.0, 400.0, 3.0;
    MODE_ZETA "act.mode.zeta" "1" 0.7, 0.02, 3.0, 0.1;
    PF_VISCOUS "pf.viscous.coef" "N s/m" 0.0, -INF, 500.0, 1.0;
    PF_COULOMB "pf.coulomb.force" "N" 0.0, -INF, 50.0, 0.2;
    PF_STRIBECK "pf.stribeck.force" "N" 0.0, 0.0, 50.0, 0.3;
    PF_STRIBECK_VS "pf.stribeck.vs" "m/s" 0.05, 0.003, 0.4, 0.02;
    PF_PRESLIDING "pf.presliding.disp" "m" 0.0, 3e-5, 0.05, 2e-4;
    PF_PRESSURE "pf.pressure.coef" "1" 0.0, 0.0, 1.0, 0.01;
    PF_OFFSET "pf.offset.value" "N" 0.0, -20.0, 20.0, 0.1;
    PF_ASYM_FORCE "pf.asymmetry.force" "N" 0.0, -INF, 50.0, 0.2;
    PF_ASYM_COEF "pf.asymmetry.coef" "N s/m" 0.0, -INF, 200.0, 1.0;
    CF_VISCOUS "cf.viscous.coef" "N s/m" 0.0, 0.0, 500.0, 1.0;
    CF_COULOMB "cf.coulomb.force" "N" 0.0, -INF, 50.0, 0.2;
    CF_STRIBECK "cf.stribeck.force" "N" 0.0, 0.0, 50.0, 0.3;
    CF_STRIBECK_VS "cf.stribeck.vs" "m/s" 0.05, 0.003, 0.4, 0.02;
    CF_PRESLIDING "cf.presliding.disp" "m" 0.0, 3e-5, 0.05, 2e-4;
    CF_OFFSET "cf.offset.value" "N" 0.0, -20.0, 20.0, 0.1;
    CF_ASYM_FORCE "cf.asymmetry.force" "N" 0.0, -INF, 50.0, 0.2;
    CF_ASYM_COEF "cf.asymmetry.coef" "N s/m" 0.0, -100.0, 200.0, 1.0;
    CF_POSCOULOMB "cf.poscoulomb.slope" "N/m" 0.0, -200.0, 200.0, 2.0;
    MASS "cart.mass.mass" "kg" 0.0, 0.0, 3.0, 0.01;
    SPRING "cart.spring.stiffness" "N/m" 0.0, 0.0, 1000.0, 1.0;
    SPRING_FORCE "cart.spring.force" "N" 0.0, -50.0, 50.0, 0.1;
    STOP_POS "cart.endstop.pos" "m" INF, -0.2, 0.2, 0.005;
    STOP_STIFFNESS "cart.endstop.stiffness" "N/m" 0.0, 0.0, 1e5, 20.0;
    STOP_DAMPING "cart.endstop.damping" "N s/m" 0.0, 0.0, 1000.0, 2.0;
    COG_SIN "cart.cogging.sin" "N" 0.0, -20.0, 20.0, 0.1;
    COG_COS "cart.cogging.cos" "N" 0.0, -20.0, 20.0, 0.1;
    COG_PERIOD "cart.cogging.period" "m" 0.03, 0.003, 0.2, 0.001;
    TILT "cart.tilt.angle" "rad" 0.0, -0.3, 0.3, 0.003;
    POLE_VISCOUS "pole.viscous.coef" "N m s/rad" 0.0, -INF, 0.1, 1e-4;
    POLE_COULOMB "pole.coulomb.torque" "N m" 0.0, 0.0, 0.2, 3e-4;
    POLE_DRAG "pole.quaddrag.coef" "N m s^2/rad^2" 0.0, 0.0, 0.02, 3e-5;
    PAYLOAD "pole.payload.mass" "kg" 0.0, 0.0, 0.3, 1e-3;
    LENGTH "pole.length.delta" "m" 0.0, -0.1, 0.1, 1e-3;
    OFFSET_F_HAT "sensor.offset.F_hat" "N" 0.0, -20.0, 20.0, 0.1;
    OFFSET_F_P "sensor.offset.F_p" "N" 0.0, -20.0, 20.0, 0.1;
    OFFSET_X "sensor.offset.x" "m" 0.0, -0.1, 0.1, 1e-3;
    OFFSET_THETA "sensor.offset.theta" "rad" 0.0, -0.5, 0.5, 2e-3;
    OFFSET_V "sensor.offset.v" "m/s" 0.0, -0.1, 0.1, 1e-3;
    SENSOR_DELAY_F_HAT "sensor.delay.F_hat" "s" 0.0, 0.0, 0.05, 1e-3;
    SENSOR_DELAY_F_P "sensor.delay.F_p" "s" 0.0, 0.0, 0.05, 1e-3;
    SENSOR_DELAY_X "sensor.delay.x" "s" 0.0, 0.0, 0.05, 1e-3;
    SENSOR_DELAY_THETA "sensor.delay.theta" "s" 0.0, 0.0, 0.05, 1e-3;
    SENSOR_DELAY_V "sensor.delay.v" "s" 0.0, 0.0, 0.05, 1e-3;
    SENSOR_GAIN_F_HAT "sensor.gain.F_hat" "1" 0.0, -0.5, 1.0, 0.01;
    SENSOR_GAIN_F_P "sensor.gain.F_p" "1" 0.0, -0.5, 1.0, 0.01;
    SENSOR_GAIN_X "sensor.gain.x" "1" 0.0, -0.5, 1.0, 0.01;
    SENSOR_GAIN_THETA "sensor.gain.theta" "1" 0.0, -0.5, 1.0, 0.01;
    SENSOR_GAIN_V "sensor.gain.v" "1" 0.0, -0.5, 1.0, 0.01;
    CYLINDER "actuator.cylinder" "1" 0.0, 0.0, 1.0, 1.0;
    D_ACT_GAIN "declared.actuator.gain" "1" 0.0, -0.5, 1.0, 0.01;
    D_ACT_DECAY "declared.actuator.decay" "1" 0.0, -0.01, 0.01, 1e-4;
    D_ACT_TURN "declared.actuator.turn" "1" 0.0, -0.01, 0.01, 1e-4;
    D_PF_C1 "declared.piston_friction.c1" "1" 0.0, -0.5, 1.0, 0.01;
    D_PF_C2 "declared.piston_friction.c2" "1" 0.0, -0.5, 1.0, 0.01;
    D_PF_C4 "declared.piston_friction.c4" "1" 0.0, -0.5, 1.0, 0.01;
    D_CF_C1 "declared.cart_friction.c1" "1" 0.0, -0.5, 1.0, 0.01;
    D_CF_C2 "declared.cart_friction.c2" "1" 0.0, -0.5, 1.0, 0.01;
    D_CF_C3 "declared.cart_friction.c3" "1" 0.0, -0.5, 1.0, 0.01;
    D_CF_C5 "declared.cart_friction.c5" "1" 0.0, -0.5, 1.0, 0.01;
    D_M_C "declared.m_c" "1" 0.0, -0.5, 1.0, 0.01;
    D_M_P "declared.m_p" "1" 0.0, -0.5, 1.0, 0.01;
    D_L "declared.l" "1" 0.0, -0.5, 1.0, 0.003;
    D_B_P "declared.b_p" "1" 0.0, -0.9, 3.0, 0.03;
    D_CYL_BORE "declared.cylinder.bore" "1" 0.0, -0.5, 1.0, 0.01;
    D_CYL_ROD "declared.cylinder.rod" "1" 0.0, -0.5, 0.5, 0.01;
    D_CYL_STROKE "declared.cylinder.stroke" "1" 0.0, -0.5, 1.0, 0.01;
    D_CYL_DEAD "declared.cylinder.dead" "1" 0.0, -0.8, 3.0, 0.03;
    D_CYL_PSUP "declared.cylinder.psup" "1" 0.0, -0.5, 1.0, 0.01;
    D_CYL_AVMAX "declared.cylinder.Avmax" "1" 0.0, -0.8, 3.0, 0.01;
    D_CYL_KP "declared.cylinder.Kp" "1" 0.0, -0.8, 3.0, 0.01;
    D_CYL_VHYS "declared.cylinder.vhys" "1" 0.0, -0.9, 3.0, 0.03;
    D_CYL_VT "declared.cylinder.Vt" "1" 0.0, -0.8, 3.0, 0.01;
    D_CYL_AT "declared.cylinder.At" "1" 0.0, -0.8, 3.0, 0.01;
    D_CYL_TDELAY "declared.cylinder.tdelay" "1" 0.0, -0.9, 3.0, 0.01;
    D_CYL_ETA "declared.cylinder.eta" "1" 0.0, -0.3, 0.1, 0.01;
}

/// The parameter vector of the declared model: every entry neutral.
pub fn neutral() -> Vec<f64> {
    TABLE.iter().map(|definition| definition.neutral).collect()
}
