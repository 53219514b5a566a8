//! Inputs of the rig's system at which its channels act.

/// Input at which a channel acts; none for sensors.
pub fn of_channel(channel: &str) -> Option<&'static str> {
    Some(match channel {
        "actuator" => "actuator.u",
        "piston_friction" => "piston_friction.F_out",
        "cart_friction" | "cart" => "cart_pole.F",
        "pole" => "cart_pole.tau_ext",
        _ => return None,
    })
}

/// Input at which that acts which a signal shows and those in front of it do not; with the rod fixed (`fixed`), the
/// load cell shows the actuator alone.
pub fn shown_by(signal: &str, fixed: bool) -> Option<&'static str> {
    of_channel(match signal {
        "F_hat" => "actuator",
        "F_p" if fixed => "actuator",
        "F_p" => "piston_friction",
        "x" => "cart",
        "theta" => "pole",
        _ => return None,
    })
}
