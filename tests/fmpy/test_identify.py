"""`airloop identify`: acceptance numbers through the binary, on data made here; NumPy's least squares is the peer."""

import csv
import json

import numpy as np
import pytest

from command import start

TS = 1e-3
# Eq. 8 of the paper.
A1 = np.array([[-1.0144, 0.0216], [-0.0527, -0.9537]])
B0 = np.array([0.6619, 0.0764])
B1 = np.array([-0.6557, -0.0847])


def airloop(*arguments, code=0):
    result = start(*arguments)
    assert result.returncode == code, result.stdout + result.stderr
    return result


def chirp(amplitude, duration, low, high):
    t = np.arange(round(duration / TS)) * TS
    return amplitude * np.sin(2 * np.pi * (low * t + (high - low) * t**2 / (2 * duration)))


def stairs(seed, duration, limit=40.0):
    generator = np.random.default_rng(seed)
    levels, n = [], round(duration / TS)
    while len(levels) < n:
        levels += [generator.uniform(-limit, limit)] * int(generator.uniform(0.1, 0.6) / TS)
    return np.array(levels[:n])


def eq8(u, equation_noise=0.0, seed=0):
    """y(k) = -A1 y(k-1) + B0 u(k) + B1 u(k-1) + e(k), from rest; shape [n, 2]."""
    e = equation_noise * np.random.default_rng(seed).standard_normal((len(u), 2))
    y, before, u_before = np.zeros((len(u), 2)), np.zeros(2), 0.0
    for k, u_k in enumerate(u):
        before = -A1 @ before + B0 * u_k + B1 * u_before + e[k]
        u_before, y[k] = u_k, before
    return y


def write(path, u, y, ts=TS, names=("u", "F_hat", "F_p")):
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", *names])
        u = np.atleast_2d(np.asarray(u).T).T
        for k in range(len(y)):
            writer.writerow([f"{k * ts:.6g}" if ts < 1 else k * ts, *map(repr, map(float, u[k])), *map(repr, map(float, y[k]))])
    return path


ESTIMATION = [chirp(10, 6, 0.1, 12), chirp(20, 6, 0.1, 12), chirp(40, 6, 0.1, 12), stairs(1, 8)]
VALIDATION = [chirp(30, 5, 0.2, 10), stairs(2, 6)]


def records(folder, noise=lambda y, k: y, equation_noise=0.0):
    files = []
    for k, u in enumerate(ESTIMATION + VALIDATION):
        y = noise(eq8(u, equation_noise, seed=k), k)
        files.append(write(folder / f"r{k}.csv", u, y))
    return files[: len(ESTIMATION)], files[len(ESTIMATION) :]


def identify(folder, estimation, validation, *options, method="arx"):
    columns = ["--inputs", "u", "--outputs", "F_hat,F_p"]
    airloop("identify", method, *estimation, *columns, "--validate", *validation, *options, "-o", folder)
    return json.loads((folder / "summary.json").read_text())


def fit(measured, simulated):
    return 100 * (1 - np.linalg.norm(measured - simulated) / np.linalg.norm(measured - measured.mean()))


def test_noise_free_data_give_the_coefficients_back(tmp_path):
    found = identify(tmp_path / "out", *records(tmp_path), "--na", 1, "--nb", 2, "--nk", 0)
    coefficients = found["coefficients"]
    for name, expected in [("A1", A1), ("B0", B0.reshape(2, 1)), ("B1", B1.reshape(2, 1))]:
        assert np.max(np.abs(np.array(coefficients[name]) - expected)) <= 1e-9, name
    assert found["stable"] is True
    assert min(found["validation"]["fit_simulated"].values()) > 100 - 1e-6


def test_white_equation_noise_leaves_98_percent_on_fresh_clean_data(tmp_path):
    estimation, _ = records(tmp_path, equation_noise=0.5)
    clean = tmp_path / "clean"
    clean.mkdir()
    _, validation = records(clean)
    found = identify(tmp_path / "out", estimation, validation, "--na", 1, "--nb", 2)
    assert min(found["validation"]["fit_simulated"].values()) >= 98


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    """Records with 0.5 N of white measurement noise, and the fit of the true model on the validation part."""
    folder = tmp_path_factory.mktemp("noisy")
    noise = lambda y, k: y + 0.5 * np.random.default_rng(100 + k).standard_normal(y.shape)
    estimation, validation = records(folder, noise)
    best = []
    for k, u in enumerate(VALIDATION, len(ESTIMATION)):
        clean = eq8(u)
        best.append([fit(noise(clean, k)[:, i], clean[:, i]) for i in range(2)])
    return estimation, validation, np.mean(best, axis=0)


def test_output_error_comes_close_to_the_true_model_where_least_squares_does_not(noisy, tmp_path):
    estimation, validation, best = noisy
    plain = identify(tmp_path / "ls", estimation, validation, "--na", 1, "--nb", 2)
    refined = identify(tmp_path / "oe", estimation, validation, "--na", 1, "--nb", 2, "--method", "output-error")
    values = lambda found: np.array([found["validation"]["fit_simulated"][name] for name in ("F_hat", "F_p")])
    assert np.all(values(refined) >= best - 0.5), (values(refined), best)
    assert np.any(values(plain) < best - 0.5), (values(plain), best)


@pytest.mark.parametrize("na, nb, nk", [(1, 1, 0), (2, 3, 0), (3, 2, 1), (6, 6, 0)])
def test_least_squares_agrees_with_numpy(noisy, tmp_path, na, nb, nk):
    estimation, validation, _ = noisy
    found = identify(tmp_path / "out", estimation, validation, "--na", na, "--nb", nb, "--nk", nk)
    rows, targets = [], []
    for path in estimation:
        data = np.loadtxt(path, delimiter=",", skiprows=1)
        u, y = data[:, 1], data[:, 2:]
        first = max(na, nb + nk - 1)
        for k in range(first, len(u)):
            rows.append(np.concatenate([*(-y[k - i] for i in range(1, na + 1)), [u[k - nk - j] for j in range(nb)]]))
            targets.append(y[k])
    theta = np.linalg.lstsq(np.array(rows), np.array(targets), rcond=None)[0].T
    for i in range(na):
        assert np.allclose(found["coefficients"][f"A{i + 1}"], theta[:, 2 * i : 2 * i + 2], atol=1e-8)
    for j in range(nb):
        assert np.allclose(np.array(found["coefficients"][f"B{nk + j}"])[:, 0], theta[:, 2 * na + j], atol=1e-8)
