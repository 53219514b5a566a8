"""`airloop identify state-space` against the Kalman filter of the true system, and its FMU in FMPy."""

import json

import fmpy
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from command import airloop
from test_identify_arx import save

# Two inputs, two outputs: an oscillator and two lags, with direct term.
A = np.array([[0.8, 0.4, 0.0, 0.1], [-0.4, 0.8, 0.0, 0.0], [0.1, 0.0, 0.6, 0.2], [0.0, 0.0, 0.0, -0.3]])
B = np.array([[1.0, 0.2], [0.3, -0.5], [0.0, 1.0], [0.7, 0.4]])
C = np.array([[1.0, 0.0, 0.5, 0.2], [0.0, 3.0, -1.0, 1.0]])
D = np.array([[0.5, 0.0], [-0.2, 0.1]])
POINT = np.array([3.0, -1.0]), np.array([10.0, 0.5])


def simulate(u, x, w=None):
    y = np.zeros((len(u), 2))
    for k in range(len(u)):
        y[k] = C @ x + D @ u[k]
        x = A @ x + B @ u[k] + (0 if w is None else w[k])
    return y


def identify(folder, files, *options):
    airloop("identify", "state-space", *files, "--inputs", "u1,u2", "--outputs", "y1,y2", *options, "-o", folder)
    return json.loads((folder / "summary.json").read_text())


def fits(measured, modeled):
    error = np.linalg.norm(measured - modeled, axis=0)
    return 100 * (1 - error / np.linalg.norm(measured - measured.mean(0), axis=0))


def test_the_fmu_simulates_to_the_same_fit(tmp_path):
    rng = np.random.default_rng(3)
    for name in ("a.csv", "check.csv"):
        u = rng.uniform(-1, 1, (900, 2))
        y = simulate(u, rng.uniform(-1, 1, 4)) + 0.3 * rng.standard_normal((900, 2))
        u, y = u + POINT[0], y + POINT[1]
        save(tmp_path / name, u, y, 0.02)
    files = ["--validate", tmp_path / "check.csv", "--detrend", "mean", "--order", 4, "--fmu", "mine"]
    summary = identify(tmp_path / "out", [tmp_path / "a.csv"], *files)
    path = tmp_path / "out" / "mine.fmu"
    assert fmpy.read_model_description(path).modelName == "mine"
    time = np.arange(len(u)) * 0.02
    names = ["time", "u[1]", "u[2]"]
    signals = np.array([(t, *row) for t, row in zip(time, u)], dtype=[(name, float) for name in names])
    start = summary["diagnostics"]["initial_states"]["validation"][0]
    result = fmpy.simulate_fmu(
        path,
        stop_time=time[-1] + 0.02,
        step_size=0.02,
        output_interval=0.02,
        input=signals,
        output=["y[1]", "y[2]"],
        start_values={f"x[{i + 1}]": value for i, value in enumerate(start)},
    )
    # A sampled output is held over the step that begins at its sample.
    simulated = np.column_stack([result["y[1]"], result["y[2]"]])[1 : len(u) + 1]
    expected = summary["validation"]["fit_simulated"]
    assert fits(y, simulated) == pytest.approx([expected["y1"], expected["y2"]], abs=1e-6)


def test_the_prediction_is_as_good_as_that_of_the_kalman_filter_of_the_true_system(tmp_path):
    rng = np.random.default_rng(4)
    q, r = 0.04 * np.eye(4), 0.09 * np.eye(2)
    for name in ("a.csv", "check.csv"):
        u = rng.uniform(-1, 1, (4000, 2))
        w = rng.multivariate_normal(np.zeros(4), q, 4000)
        y = simulate(u, np.zeros(4), w) + rng.multivariate_normal(np.zeros(2), r, 4000)
        save(tmp_path / name, u, y, 0.02)
    files = ["--validate", tmp_path / "check.csv", "--order", 4]
    summary = identify(tmp_path / "out", [tmp_path / "a.csv"], *files)
    p = solve_discrete_are(A.T, C.T, q, r)
    gain = A @ p @ C.T @ np.linalg.inv(C @ p @ C.T + r)
    x, predicted = np.zeros(4), np.zeros_like(y)
    for k in range(len(u)):
        predicted[k] = C @ x + D @ u[k]
        x = A @ x + B @ u[k] + gain @ (y[k] - predicted[k])
    best = fits(y, predicted)
    found = summary["validation"]["fit_one_step"]
    # 0.3 points: the estimate has its own variance.
    assert found["y1"] > best[0] - 0.3 and found["y2"] > best[1] - 0.3
