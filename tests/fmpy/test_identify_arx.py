"""`airloop identify arx` against NumPy's least squares on the same rows, and its FMUs in FMPy."""

import json

import fmpy
import numpy as np
import pytest

from command import airloop


def stairs(rng, n, inputs, hold=7):
    return np.repeat(rng.uniform(-1, 1, (n // hold + 1, inputs)), hold, axis=0)[:n]


def equation(u, a, b, noise):
    """y(k) = - A1 y(k-1) - .. + B0 u(k) + B1 u(k-1) + .. + e(k) with zeros before the start."""
    y = np.zeros((len(u), len(b[0])))
    for k in range(len(u)):
        y[k] = noise[k]
        for lag, matrix in enumerate(a, 1):
            if k >= lag:
                y[k] -= matrix @ y[k - lag]
        for lag, matrix in enumerate(b):
            if k >= lag:
                y[k] += matrix @ u[k - lag]
    return y


def save(path, u, y, step):
    names = [f"u{j + 1}" for j in range(u.shape[1])] + [f"y{i + 1}" for i in range(y.shape[1])]
    rows = [",".join(["time"] + names)]
    for k, values in enumerate(np.hstack([u, y]).tolist()):
        rows.append(",".join([f"{k * step:.6f}"] + [repr(value) for value in values]))
    path.write_text("\n".join(rows) + "\n")


def least_squares(records, na, nb, nk, output, rows_from):
    """Coefficients of one output by numpy.linalg.lstsq: {("A", lag, l): value, ("B", lag, j): value}."""
    names, x, t = [], [], []
    n_y, n_u = records[0][1].shape[1], records[0][0].shape[1]
    names += [("A", lag, l) for l in range(n_y) for lag in range(1, na[output][l] + 1)]
    names += [("B", lag, j) for j in range(n_u) for lag in range(nk[output][j], nk[output][j] + nb[output][j])]
    for u, y in records:
        rows = np.arange(rows_from, len(u))
        x.append(np.column_stack([-y[rows - lag, c] if kind == "A" else u[rows - lag, c] for kind, lag, c in names]))
        t.append(y[rows, output])
    values = np.linalg.lstsq(np.vstack(x), np.concatenate(t), rcond=None)[0]
    return dict(zip(names, values))


def text(orders):
    return ";".join(",".join(map(str, row)) for row in orders)


def identify(folder, files, channels, *options):
    inputs, outputs = (",".join(f"{c}{k + 1}" for k in range(n)) for c, n in zip("uy", channels))
    airloop("identify", "arx", *files, "--inputs", inputs, "--outputs", outputs, *options, "-o", folder)
    return json.loads((folder / "summary.json").read_text())


CASES = {
    "several records": (dict(na=[[2, 2], [2, 2]], nb=[[2], [2]], nk=[[0], [0]]), 1.0),
    "orders by channel": (dict(na=[[2, 0], [1, 3]], nb=[[2], [4]], nk=[[1], [0]]), 1.0),
    "slow input": (dict(na=[[2, 2], [2, 2]], nb=[[3], [3]], nk=[[0], [0]]), 1e-3),
}


@pytest.mark.parametrize("orders, roughness", CASES.values(), ids=CASES)
def test_coefficients_are_those_of_numpy(tmp_path, orders, roughness):
    rng = np.random.default_rng(5)
    a = [np.array([[-1.4, 0.05], [-0.1, -1.1]]), np.array([[0.6, 0.0], [0.05, 0.3]])]
    b = [np.array([[0.5], [0.1]]), np.array([[0.3], [-0.4]])]
    records, files = [], []
    for index, n in enumerate((900, 5000, 1300)):
        t = np.arange(n)[:, None] * 1e-3
        # The rougher part keeps the smooth one from being a polynomial: condition numbers up to 1e6.
        u = np.sin(2 * np.pi * (0.5 + 0.4 * t) * t) + roughness * stairs(rng, n, 1)
        y = equation(u, a, b, 0.01 * rng.standard_normal((n, 2)))
        records.append((u, y))
        files.append(tmp_path / f"{index}.csv")
        save(files[-1], u, y, 1e-3)
    options = [word for name, value in orders.items() for word in (f"--{name}", text(value))]
    summary = identify(tmp_path / "out", files, (1, 2), *options)
    lags = max(max(map(max, orders["na"])), max(k + n - 1 for ks, ns in zip(orders["nk"], orders["nb"]) for k, n in zip(ks, ns)))
    for output in range(2):
        for (kind, lag, channel), value in least_squares(records, **orders, output=output, rows_from=lags).items():
            found = summary["coefficients"][f"{kind}{lag}"][output][channel]
            assert found == pytest.approx(value, rel=1e-10, abs=1e-10), (kind, lag, output, channel)


def test_mean_is_the_operating_point(tmp_path):
    rng = np.random.default_rng(6)
    u = 5 + stairs(rng, 3000, 1)
    y = 100 + equation(u - 5, [np.array([[-0.9]])], [np.array([[0.0]]), np.array([[0.4]])], 0.01 * rng.standard_normal((3000, 1)))
    save(tmp_path / "r.csv", u, y, 0.08)
    summary = identify(tmp_path / "out", [tmp_path / "r.csv"], (1, 1), "--nb", "1", "--nk", "1", "--detrend", "mean")
    centered = [(u - u.mean(axis=0), y - y.mean(axis=0))]
    expected = least_squares(centered, [[1]], [[1]], [[1]], 0, 1)
    assert summary["coefficients"]["A1"][0][0] == pytest.approx(expected["A", 1, 0], abs=1e-10)
    assert summary["coefficients"]["B1"][0][0] == pytest.approx(expected["B", 1, 0], abs=1e-10)
    assert summary["coefficients"]["output_offset"] == pytest.approx([y.mean()], rel=1e-12)


FMUS = {
    # na, nb, nk, channels, operating point, FMU
    "actuator": (1, 2, 0, (1, 2), 0.0, "arx-actuator"),
    "delayed actuator": (2, 2, 5, (1, 1), 0.0, "arx-actuator"),
    "operating point": (2, 2, 3, (1, 2), 7.0, "linear-state-space"),
    "several inputs": (2, 3, 0, (3, 4), 0.0, "linear-state-space"),
    "long": (6, 2, 1, (1, 2), 0.0, "linear-state-space"),
}


@pytest.mark.parametrize("case", FMUS.values(), ids=FMUS)
def test_the_fmu_simulates_to_the_same_fit(tmp_path, case):
    na, nb, nk, (n_u, n_y), point, kind = case
    rng = np.random.default_rng(7)
    a = [np.eye(n_y) * -0.9 + 0.05 * np.ones((n_y, n_y))]
    b = [np.zeros((n_y, n_u))] * nk + [rng.uniform(-1, 1, (n_y, n_u)) for _ in range(2)]
    records = []
    for name in ("r.csv", "check.csv"):
        u = stairs(rng, 2500, n_u)
        u[:20] = 0
        y = equation(u, a, b, 0.02 * rng.standard_normal((2500, n_y)))
        y[:20] = 0
        records.append((u + point, y + point))
        save(tmp_path / name, *records[-1], 0.01)
    options = ["--na", na, "--nb", nb, "--nk", nk, "--validate", tmp_path / "check.csv", "--fmu", "mine"]
    if point:
        options += ["--detrend", "mean"]
    summary = identify(tmp_path / "out", [tmp_path / "r.csv"], (n_u, n_y), *map(str, options))
    path = tmp_path / "out" / "mine.fmu"
    description = fmpy.read_model_description(path)
    assert description.coSimulation.modelIdentifier.replace("_", "-") == kind
    u, y = records[1]
    inputs = ["u"] if kind == "arx-actuator" else [f"u[{j + 1}]" for j in range(n_u)]
    outputs = ["F_hat", "F_act"] if kind == "arx-actuator" else [f"y[{i + 1}]" for i in range(n_y)]
    time = np.arange(len(u)) * 0.01
    signals = np.array([(t, *row) for t, row in zip(time, u)], dtype=[(name, float) for name in ["time", *inputs]])
    result = fmpy.simulate_fmu(path, stop_time=time[-1] + 0.01, step_size=0.01, output_interval=0.01, input=signals, output=outputs[:n_y])
    lags = max(na, nb + nk - 1)
    for i in range(n_y):
        # A sampled output is held over the step that begins at its sample.
        simulated = result[outputs[i]][1 : len(u) + 1]
        measured = y[lags:, i]
        fit = 100 * (1 - np.linalg.norm(measured - simulated[lags:]) / np.linalg.norm(measured - measured.mean()))
        # The record starts at rest only on average: noise and the mean move the start a little.
        assert fit == pytest.approx(summary["validation"]["fit_simulated"][f"y{i + 1}"], abs=0.05), i


def lag_of_two_rates(command, step, gain=0.8, up=0.085, down=0.13, delay=8):
    """A lag that fills and empties at rates of its own, behind a delay: no linear structure says that."""
    late = np.concatenate([np.full(delay, command[0]), command])[: len(command)]
    shown = np.empty(len(command))
    shown[0] = gain * command[0]
    for k in range(len(command) - 1):
        wanted = gain * late[k]
        shown[k + 1] = wanted + (shown[k] - wanted) * np.exp(-step / (up if wanted > shown[k] else down))
    return shown


def test_output_error_hides_no_offset_of_each_record_in_a_slow_pole(tmp_path):
    rng, n, step = np.random.default_rng(3), 2000, 0.005
    t = step * np.arange(n)
    phase = 2 * np.pi * (0.1 * t + 0.195 * t * t)
    commands = [stairs(rng, n, 1, hold)[:, 0] * 3.5 + 4.5 for hold in (120, 60)] + [4.5 + 3 * np.sin(phase)]
    commands += [4.5 + 2 * np.sign(np.sin(2 * np.pi * 0.7 * t)) + np.sign(np.sin(2 * np.pi * 1.9 * t))]
    commands += [stairs(rng, n, 1, 100)[:, 0] * 3.5 + 4.5]
    files = []
    for k, command in enumerate(commands):
        shown = lag_of_two_rates(command, step) + 0.008 * rng.standard_normal(n)
        files.append(tmp_path / f"r{k}.csv")
        save(files[-1], command[:, None], shown[:, None], step)
    orders = ["--na", "4", "--nb", "4", "--nk", "9", "--validate", files[-1]]
    fits = {
        method: identify(tmp_path / method, files[:-1], (1, 1), *orders, "--method", method)
        for method in ("least-squares", "output-error")
    }
    estimation, validation = (
        {method: fit[role]["mean_fit_simulated"] for method, fit in fits.items()} for role in ("estimation", "validation")
    )
    assert estimation["output-error"] > estimation["least-squares"] - 1.0, estimation
    assert validation["output-error"] > validation["least-squares"] - 1.0, validation
