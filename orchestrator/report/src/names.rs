//! Effects, channels and signals in the words of a reader who does not know the vocabulary.

/// Name of an effect as it follows "the model lacks"; an unknown id is its own name.
pub fn effect(id: &str) -> &str {
    match id {
        "act.gain" => "a gain error of the command path",
        "act.delay" => "an extra delay of the command",
        "act.deadband" => "a dead band in the command path",
        "act.saturation" => "a limit of the force",
        "act.hysteresis" => "play in the command path",
        "act.posgain" => "a gain that varies with the piston position",
        "act.area" => "an error of the effective piston area",
        "act.backpressure" => "pressure force that is lost with the piston speed",
        "act.droop" => "a supply pressure that falls during the run",
        "act.mode" => "a second-order mode of the actuator",
        "pf.viscous" => "another viscous friction of the piston",
        "pf.coulomb" => "Coulomb friction of the piston that is not declared",
        "pf.stribeck" => "a friction peak of the piston at low speed",
        "pf.presliding" => "presliding (hysteretic) friction of the piston",
        "pf.pressure" => "piston friction that grows with the pressure force",
        "pf.offset" => "a constant friction bias of the piston",
        "pf.asymmetry" => "direction-dependent friction of the piston",
        "cf.viscous" => "viscous friction of the cart",
        "cf.coulomb" => "Coulomb friction of the cart that is not declared",
        "cf.stribeck" => "a friction peak of the cart at low speed",
        "cf.presliding" => "presliding (hysteretic) friction of the cart",
        "cf.offset" => "a constant friction bias of the cart",
        "cf.asymmetry" => "direction-dependent friction of the cart",
        "cf.poscoulomb" => "cart friction that varies along the guide",
        "cart.mass" => "an extra mass on the cart",
        "cart.spring" => "a spring (cable or hose) that pulls the cart",
        "cart.endstop" => "an end stop inside the stroke",
        "cart.cogging" => "a periodic force along the guide",
        "cart.tilt" => "a slope of the guide, which is not level",
        "pole.viscous" => "another viscous friction of the pole's bearing",
        "pole.coulomb" => "dry friction of the pole's bearing",
        "pole.quaddrag" => "quadratic air drag of the pole",
        "pole.payload" => "an extra mass at the tip of the pole",
        "pole.length" => "another length of the pole",
        "sensor.offset" => "an offset of the sensor",
        "sensor.delay" => "a delay of the sensor",
        "sensor.lag" => "a lag of the sensor",
        "sensor.drift" => "a drift of the sensor with time",
        "sensor.nonlinearity" => "a curved characteristic of the sensor",
        "sensor.gain" => "a gain error of the sensor",
        "sensor.quantization" => "the resolution of the sensor",
        other => other,
    }
}

/// Kind of effect as it follows "the model lacks", before its port; an unknown kind is its own name.
pub fn kind(kind: &str) -> &str {
    match kind {
        "viscous" => "viscous friction",
        "coulomb" => "Coulomb (dry) friction",
        "stribeck" => "a friction peak at low speed",
        "presliding" => "presliding (hysteretic) friction",
        "pressure" => "friction that grows with the load",
        "offset" => "a constant offset",
        "asymmetry" => "friction that depends on the direction",
        "poscoulomb" => "Coulomb friction that varies along the way",
        "periodic_friction" => "friction that repeats along the way",
        "load_friction" => "friction in proportion to the load that passes",
        "resistance" => "a resistance in the way of the current",
        "voltage_drop" => "a voltage that is lost whatever the current (brushes, diodes)",
        "quaddrag" => "quadratic drag",
        "spring" => "a spring",
        "cubic_spring" => "a spring that stiffens with the cube of the way",
        "endstop" => "an end stop",
        "lower_endstop" => "an end stop at the lower end",
        "limits" => "a limit for each direction",
        "choked_flow" => "a leak of gas that may be choked",
        "leakage" => "leakage with the square root of the level",
        "linear_leakage" => "leakage in proportion to the level",
        "overflow" => "an overflow above a level",
        "caught_overflow" => "an overflow above a level, a part of which the next level gets",
        "drift" => "a drift with time",
        "lag" => "a first-order lag",
        "fill" => "a lag with different rates up and down (filling and emptying)",
        "rate_limit" => "a limited rate",
        "cogging" => "a term that is periodic along the way",
        "area" => "an error of the effective area",
        "gain" => "a gain error",
        "deadband" => "a dead band",
        "saturation" => "a limit",
        "quantization" => "values in steps (quantization)",
        "posgain" => "a gain that varies with the position",
        "droop" => "a value that falls during the run",
        "delay" => "a delay",
        "hysteresis" => "play (hysteresis)",
        "mode" => "a second-order mode",
        "parameter" => "a declared value that is off",
        other => other,
    }
}

/// An id or `id@port` as it follows "the model lacks".
pub fn named(name: &str) -> String {
    match name.split_once('@') {
        Some((id, port)) => format!("{} at {port}", kind(id.rsplit_once('.').map_or(id, |(_, kind)| kind))),
        None => effect(name).to_owned(),
    }
}

/// Channel and port of a place: a channel, `channel@port` or `@port`.
pub fn place(place: &str) -> (&str, Option<&str>) {
    place.split_once('@').map_or((place, None), |(channel, port)| (channel, Some(port)))
}

/// Location of a channel in words.
pub fn channel(name: &str) -> &str {
    match name {
        "actuator" => "the actuator",
        "piston_friction" => "the friction of the piston",
        "cart_friction" => "the friction of the cart",
        "cart" => "the forces on the cart",
        "pole" => "the pole",
        "sensor" => "the sensors",
        other => other,
    }
}

/// Name of a variable in words.
pub fn variable(name: &str) -> &str {
    match name {
        "u" => "command u",
        "F" => "force F",
        "x" => "position x",
        "xdot" => "speed xdot",
        "theta" => "angle theta",
        "thetadot" => "angular speed thetadot",
        other => other,
    }
}
