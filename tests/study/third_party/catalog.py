"""Which cases there are: effects at the ports of every system, `kind@port`, and what counts as the same effect."""

# One effect each.
SINGLES = {
    "servo": (
        "coulomb@tau_l viscous@tau_l stribeck@tau_l spring@tau_l endstop@tau_l cogging@tau_l coulomb@tau_m"
        " viscous@tau_m gain@tau_m delay@tau_m deadband@tau_m saturation@tau_m sensor_gain@w_l parameter@J_l load_friction@tau_m"
    ),
    "arm": (
        "coulomb@tau_1 coulomb@tau_2 viscous@tau_1 viscous@tau_2 stribeck@tau_2 spring@tau_1 spring@tau_2"
        " endstop@tau_2 cogging@tau_1 gain@tau_2 delay@tau_1 saturation@tau_1 deadband@tau_2 hysteresis@tau_2 load_friction@tau_1"
    ),
    "tanks": "gain@u saturation@u delay@u lag@u droop@u command_offset@u leakage@q_1 offset@q_2 sensor_gain@h_2 sensor_offset@h_1",
    "motor": (
        "coulomb@tau_load viscous@tau_load stribeck@tau_load quaddrag@tau_load offset@tau_load gain@V"
        " deadband@V saturation@V delay@V lag@V sensor_gain@i parameter@J resistance@V voltage_drop@V"
    ),
    "cylinder": (
        "coulomb@F_ext viscous@F_ext stribeck@F_ext spring@F_ext endstop@F_ext cogging@F_ext gain@u"
        " deadband@u delay@u hysteresis@u command_offset@u sensor_gain@x parameter@c_i"
    ),
    "furuta": (
        "coulomb@tau viscous@tau spring@tau endstop@tau cogging@tau coulomb@tau_p viscous@tau_p"
        " quaddrag@tau_p gain@tau delay@tau deadband@tau sensor_offset@alpha parameter@J_p"
    ),
}
PAIRS = {
    "servo": "coulomb@tau_l+deadband@tau_m spring@tau_l+viscous@tau_m",
    "arm": "coulomb@tau_1+coulomb@tau_2 spring@tau_2+coulomb@tau_1",
    "tanks": "gain@u+leakage@q_1 delay@u+sensor_gain@h_2",
    "motor": "viscous@tau_load+deadband@V offset@tau_load+gain@V",
    "cylinder": "coulomb@F_ext+deadband@u spring@F_ext+delay@u",
    "furuta": "spring@tau+coulomb@tau_p coulomb@tau+delay@tau",
}
OUTSIDE = {
    "servo": "cubic@tau_l speedbump@tau_m product@tau_l product@tau_m",
    "arm": "cross@tau_1 bump@tau_2",
    "tanks": "overflow@q_1 bump@q_2",
    "motor": "heat@tau_load heatgain@V speedbump@tau_load",
    "cylinder": "bump@F_ext product@F_ext",
    "furuta": "cubic@tau bump@tau_p wander@tau",
}
# An effect of the vocabulary and one that it has not, on exact machines.
BESIDE = {
    "servo": "coulomb@tau_l+bump@tau_l deadband@tau_m+bump@tau_l",
    "arm": "coulomb@tau_1+bump@tau_1 viscous@tau_1+bump@tau_2",
    "tanks": "delay@u+bump@q_1 lag@u+bump@q_2",
    "motor": "deadband@V+speedbump@tau_load voltage_drop@V+speedbump@tau_load",
    "cylinder": "coulomb@F_ext+bump@F_ext deadband@u+bump@F_ext",
    "furuta": "coulomb@tau_p+bump@tau_p delay@tau+bump@tau_p",
}
# Controls of every system, exact and messy.
CONTROLS = 2
# Small forces and torques of messy machines.
SMALL, SMALL_COMMAND = ("bump", "power", "product", "wander", "teeth"), ("kink", "command_cubic", "command_wander", "command_bump")
# The declared parameter that does the same.
SAME = {
    ("servo", "viscous@tau_l"): "b_l",
    ("servo", "viscous@tau_m"): "b_m",
    ("servo", "coulomb@tau_m"): "tau_c",
    ("arm", "viscous@tau_1"): "b_1",
    ("arm", "viscous@tau_2"): "b_2",
    ("tanks", "gain@u"): "k_p",
    ("motor", "viscous@tau_load"): "b",
    ("motor", "resistance@V"): "R",
    ("motor", "coulomb@tau_load"): "tau_c",
    ("cylinder", "viscous@F_ext"): "b",
    ("cylinder", "gain@u"): "q_n",
    ("furuta", "viscous@tau"): "b_a",
    ("furuta", "viscous@tau_p"): "b_p",
}
# Effects that data cannot tell from another one at the same port.
ALIKE = {
    "lag": ["act.mode", "mode"],
    "command_offset": ["bias"],
    "offset": ["bias", "leakage"],
    "cubic": ["cubic_spring"],
    "overflow": ["cart.endstop", "endstop"],
    "leakage": ["outlet"],
}
IDS = {
    "piston_friction": {k: f"pf.{k}" for k in ("viscous", "coulomb", "stribeck", "offset", "asymmetry")},
    "cart_friction": {k: f"cf.{k}" for k in ("viscous", "coulomb", "stribeck", "offset", "asymmetry", "poscoulomb")},
    "cart": {k: f"cart.{k}" for k in ("spring", "endstop", "cogging")},
    "pole": {k: f"pole.{k}" for k in ("viscous", "coulomb", "quaddrag")},
    "actuator": {k: f"act.{k}" for k in ("gain", "deadband", "saturation", "droop", "delay", "hysteresis", "mode")},
}
