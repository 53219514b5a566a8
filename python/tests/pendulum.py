"""Study of a pendulum of which three records are there: a, b and c."""


def study(parameters):
    """As a dictionary; `parameters` are those of the FMU that are declared."""
    return {
        "name": "pendulum",
        "system": "airloop:pendulum",
        "parameters": parameters,
        "outputs": {"theta": {"column": "angle", "unit": "rad", "noise": 1e-4}},
        "states": {
            "theta": {"column": "angle", "unit": "rad"},
            "omega": {"derivative_of": "angle", "savitzky_golay_points": 9},
        },
        "segment": [
            {"file": "a.csv", "role": "estimation", "initial": "fit"},
            {"file": "b.csv", "role": "estimation", "initial": "fit"},
            {"file": "c.csv", "role": "validation", "initial": "fit"},
        ],
        "attachment": [
            {"input": "tau_ext", "channels": ["pole"], "velocity": "omega", "position": "theta", "effects": ["pole.coulomb"]}
        ],
    }
