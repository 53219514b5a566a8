"""`airloop refine` on a vessel behind a valve whose dead band nobody declared, with declared values that are off and noise that is not
white. The records are made here, by other code and with other values than the FMU has."""

import json

import numpy as np
import pytest

from held import simulated
from test_study import amended_has_printed_errors, named, refine
from third_party_fmu import System, build

EQUATIONS = """const double flow = u > 0.0 ? k_v * u * (p_s - p) : k_v * u * (p - p_a);
der_p = R_s * T_g / V_0 * (flow + w_x - c_l * (p - p_a));
"""
K_V, P_S, P_A, R_S, T_G, V_0, C_L = 4e-9, 7e5, 1e5, 287.0, 293.0, 2e-3, 2e-9
PARAMETERS = {
    "k_v": (K_V, "kg/(s.V.Pa)"),
    "p_s": (P_S, "Pa"),
    "p_a": (P_A, "Pa"),
    "R_s": (R_S, "J/(kg.K)"),
    "T_g": (T_G, "K"),
    "V_0": (V_0, "m3"),
    "c_l": (C_L, "kg/(s.Pa)"),
}
VESSEL = System(
    "vessel",
    0.01,
    1.0,
    1,
    states={"p": ("Pa", 1e5, "")},
    inputs={"u": ("V", 5.0), "w_x": ("kg/s", 0.0)},
    parameters={name: (*own, 0.01) for name, own in PARAMETERS.items()},
    measured={},
    ports={},
    excite=None,
    start={"p": 1e5},
    short=False,
)
STEP, SAMPLES, FINE = 0.01, 2001, 5
# The seal: flow [kg/s] and width [Pa].
LEAK, LEAK_WIDTH = 3e-4, 4e4
STUDY = """system = "vessel.fmu"

[inputs]
u = { column = "u", hold = true }

[outputs]
p = { column = "p" }
"""


def pressure(commands, width, off, leak_at=None):
    """Pressure [Pa] of the true vessel: a dead band of `width`, k_v, V_0, c_l that are `off`, relative, and a seal that leaks around the
    pressure `leak_at`."""
    k_v, volume, leak = K_V * (1 + off[0]), V_0 * (1 + off[1]), C_L * (1 + off[2])

    def rate(p, u):
        passed = u - min(max(u, -width), width)
        flow = k_v * passed * (P_S - p if passed > 0 else p - P_A)
        if leak_at is not None:
            flow -= LEAK * np.exp(-(((p - leak_at) / LEAK_WIDTH) ** 2))
        return R_S * T_G / volume * (flow - leak * (p - P_A))

    return simulated(rate, 1e5, commands, STEP, FINE)


def stairs(rng, low, high):
    u, k = np.empty(SAMPLES), 0
    while k < SAMPLES:
        steps = int(rng.uniform(0.25, 0.75) / STEP) + 1
        u[k : k + steps] = rng.uniform(low, high)
        k += steps
    return u


def filtered(rng, rms, pole):
    y = rng.normal(size=SAMPLES)
    y[1:] *= np.sqrt(1 - pole**2)
    for k in range(1, SAMPLES):
        y[k] += pole * y[k - 1]
    return rms * y


def study(folder, *, width, off, pole, seed, validation=(-4.0, 4.0), estimation=(-4.0, 4.0), leak_at=None, lost=()):
    rng = np.random.default_rng(seed)
    build(VESSEL, EQUATIONS, folder)
    text = STUDY
    for k, (low, high) in enumerate([estimation] * 3 + [validation]):
        u = stairs(rng, low, high)
        p = pressure(u, width, off, leak_at) + filtered(rng, 400.0, pole)
        columns = np.array([STEP * np.arange(SAMPLES), u, p]).T
        for begin, end in lost:
            columns = columns[(columns[:, 0] < begin) | (columns[:, 0] > end)]
        np.savetxt(folder / f"r{k}.csv", columns, delimiter=",", header="time,u,p", comments="", fmt="%.9g")
        role = "validation" if k == 3 else "estimation"
        text += f'\n[[segment]]\nfile = "r{k}.csv"\nrole = "{role}"\ninitial = "fit"\n'
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


def answered(path, out, code):
    result = refine(path, out)
    assert result.returncode == code, result.stdout + result.stderr
    return json.loads((out / "report.json").read_text()), result.stdout


@pytest.mark.parametrize("pole", [0.0, 0.5])
def test_declared_values_that_are_off_are_corrected_beside_an_effect_and_filtered_noise_is_noise(tmp_path, pole):
    path = study(tmp_path, width=0.5, off=(0.01, -0.015, 0.02), pole=pole, seed=2)
    found, _ = answered(path, tmp_path / "out", 0)
    assert named(found) == ["deadband@u"] and found["complete"] and found["corrections"]
    width = found["effects"][0]["params"]["width"]
    low, high = width["ci95"]
    # Intervals of 95 %; twice as wide ones hold the truth in all but one of ten thousand.
    assert abs(width["value"] - 0.5) < high - low < 0.01
    after = found["residual"]["validation"]["rms_after"]["p"]
    assert after == pytest.approx(400.0, rel=0.06)
    assert found["remaining"]["signals"]["p"]["floors"] == pytest.approx(1.0, abs=0.1)
    # Only the filter of the sensor makes the noise more than its scatter.
    assert any("noise that is not white" in note for note in found["notes"]) == (pole > 0)
    assert not any("still missing" in note for note in found["notes"])


@pytest.mark.parametrize("pole", [0.3, 0.7])
def test_nothing_is_missing_where_a_true_model_leaves_filtered_noise(tmp_path, pole):
    path = study(tmp_path, width=0.0, off=(0.0, 0.0, 0.0), pole=pole, seed=17)
    found, _ = answered(path, tmp_path / "out", 10)
    assert named(found) == [] and found["complete"] and found["unexplained"] is None
    assert found["residual"]["validation"]["rms_after"]["p"] == pytest.approx(400.0, rel=0.06)


def test_of_effects_that_do_the_same_validation_records_may_refuse_one(tmp_path):
    # Estimation records never cross the dead band, where it is an offset; the validation record does.
    path = study(tmp_path, width=0.5, off=(0.01, -0.015, 0.02), pole=0.0, seed=3, estimation=(0.7, 5.0))
    found, _ = answered(path, tmp_path / "out", 0)
    assert named(found) == ["deadband@u"]
    assert found["effects"][0]["params"]["width"]["value"] == pytest.approx(0.5, rel=0.05)
    assert any("cannot tell `deadband@u` from `offset@u`" in note for note in found["notes"])


def test_a_law_is_found_behind_noise_that_is_not_white(tmp_path):
    path = study(tmp_path, width=0.0, off=(0.0, 0.0, 0.0), pole=0.7, seed=5, leak_at=3.0e5)
    found, _ = answered(path, tmp_path / "out", 13)
    law = found["law"]
    assert law["port"] == "w_x" and law["formula"] == "a*exp(-((x - m)/w)^2)"
    for name, value in [("a", LEAK), ("m", 3.0e5), ("w", LEAK_WIDTH)]:
        assert law["params"][name]["value"] == pytest.approx(value, rel=0.03)
    assert found["complete"] and law["share"] > 0.97


@pytest.mark.slow
def test_a_law_is_found_beside_an_effect(tmp_path):
    path = study(tmp_path, width=0.5, off=(0.01, -0.015, 0.02), pole=0.0, seed=8, leak_at=3.0e5)
    found, text = answered(path, tmp_path / "out", 0)
    assert found["verdict"] == "effect" and named(found) == ["deadband@u"]
    width = found["effects"][0]["params"]["width"]
    low, high = width["ci95"]
    assert abs(width["value"] - 0.5) < high - low < 0.03
    law = found["law"]
    assert law["port"] == "w_x" and law["formula"] == "a*exp(-((x - m)/w)^2)"
    for name, value in [("a", LEAK), ("m", 3.0e5), ("w", LEAK_WIDTH)]:
        assert law["params"][name]["value"] == pytest.approx(value, rel=0.05)
    # Both stand in the sentence, in the error that is printed, and in the amended system.
    assert "a dead band at u" in text and "and a law at w_x, over p (x): a*exp(-((x - m)/w)^2)" in text
    assert found["complete"] and found["share"] > 0.97 and 0.02 < law["share"] < found["share"]
    amended_has_printed_errors(path, tmp_path / "out", found)


@pytest.mark.parametrize("width, expected, code", [(0.0, [], 10), (0.5, ["deadband@u"], 0)])
def test_a_record_goes_on_as_another_one_behind_rows_that_are_missing(tmp_path, width, expected, code):
    # The command goes on where nothing is recorded, and the vessel fills.
    lost = [(4.0, 4.4), (11.0, 11.5)]
    path = study(tmp_path, width=width, off=(0.0, 0.0, 0.0), pole=0.0, seed=23, lost=lost)
    found, _ = answered(path, tmp_path / "out", code)
    assert named(found) == expected and found["complete"]
    assert any("r0.csv: rows are missing in 2 places" in note for note in found["notes"]), found["notes"]
    assert found["remaining"]["signals"]["p"]["floors"] == pytest.approx(1.0, abs=0.1)
    if expected:
        assert found["effects"][0]["params"]["width"]["value"] == pytest.approx(0.5, rel=0.02)
        amended_has_printed_errors(path, tmp_path / "out", found)
