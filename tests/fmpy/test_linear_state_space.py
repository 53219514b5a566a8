"""`linear-state-space` as identification packages it: derived with the matrices of a model, against SciPy."""

import fmpy
import numpy as np
import pytest
from scipy.linalg import logm
from scipy.signal import dlsim

import raw
import scenario
from fmu import Fmu
from test_derived import derive

TS = 2e-3
NX, NU, NY = 12, 4, 4


def system():
    """A stable system with all of its states, inputs and outputs; poles in the right half plane."""
    draw = np.random.default_rng(5)
    a = draw.normal(size=(NX, NX))
    a = 0.75 * np.eye(NX) + 0.2 * a / np.max(np.abs(np.linalg.eigvals(a)))
    return a, draw.normal(size=(NX, NU)), draw.normal(size=(NY, NX)), draw.normal(size=(NY, NU))


def start_values(a, b, c, d, x0, u0, y0):
    values = {"n_x": NX, "n_u": NU, "n_y": NY, "sample_time": TS}
    for name, matrix in (("A", a), ("B", b), ("C", c), ("D", d)):
        values |= {f"{name}[{i + 1},{j + 1}]": repr(float(x)) for (i, j), x in np.ndenumerate(matrix)}
    for name, vector in (("x", x0), ("u_offset", u0), ("y_offset", y0)):
        values |= {f"{name}[{i + 1}]": repr(float(x)) for i, x in enumerate(vector)}
    return values


@pytest.fixture(scope="module")
def model(shipped, tmp_path_factory):
    folder = tmp_path_factory.mktemp("model")
    draw = np.random.default_rng(6)
    x0, u0, y0 = draw.normal(size=NX), draw.normal(size=NU), draw.normal(size=NY)
    values = start_values(*system(), x0, u0, y0)
    path = derive(shipped("linear-state-space"), folder / "model.fmu", values, description="Twelve states")
    return Fmu(path, folder / "unpacked"), x0, u0, y0


def inputs(n):
    return np.random.default_rng(7).normal(size=(n, NU))


def run(fmu, u, kind=raw.CO_SIMULATION, parameters=()):
    ins, outs = fmu.of("input"), fmu.of("output")
    rows = []
    with fmu.instantiate(kind) as instance:
        instance.setup()
        given = dict(parameters)
        instance.set([fmu.variable(n) for n in given], list(given.values()))
        instance.must("EnterInitializationMode")
        instance.must("ExitInitializationMode")
        for k, row in enumerate(u):
            instance.set(ins, list(row))
            instance.must("DoStep", k * TS, TS, 0)
            rows.append(instance.get(outs))
    return np.array(rows)


def test_it_is_the_discrete_system_of_scipy(model):
    fmu, x0, u0, y0 = model
    u = inputs(400)
    _, expected, _ = dlsim((*system(), TS), u - u0, x0=x0)
    assert np.max(np.abs(run(fmu, u) - y0 - expected)) < 1e-11 * np.max(np.abs(expected))


def test_delays_shift_each_input_by_its_samples(model):
    fmu, x0, u0, y0 = model
    u, delays = inputs(200), [0, 3, 64, 1]
    w = np.zeros_like(u)
    for i, nk in enumerate(delays):
        w[nk:, i] = (u - u0)[: len(u) - nk, i]
    _, expected, _ = dlsim((*system(), TS), w, x0=x0)
    found = run(fmu, u, parameters={f"nk[{i + 1}]": nk for i, nk in enumerate(delays)})
    assert np.max(np.abs(found - y0 - expected)) < 1e-11 * np.max(np.abs(expected))


def test_continuous_realization_has_the_matrices_of_scipy(model):
    """Derivatives at a point, against the logarithm of SciPy."""
    fmu, x0, u0, _ = model
    a, b, _, _ = system()
    block = np.zeros((NX + NU, NX + NU))
    block[:NX] = np.hstack([a, b])
    block[NX:, NX:] = np.eye(NU)
    log = np.real(logm(block)) / TS
    u = inputs(1)[0]
    with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
        scenario.enter_model_exchange(instance, parameters={"realization": 2})
        instance.set(fmu.of("input"), list(u))
        expected = log[:NX] @ np.concatenate([x0, u - u0])
        assert instance.derivatives() == pytest.approx(list(expected), rel=1e-9, abs=1e-9 * np.max(np.abs(expected)))


def test_fmpy_simulates_it(model):
    fmu, *_ = model
    for interface in ("CoSimulation", "ModelExchange"):
        result = fmpy.simulate_fmu(str(fmu.path), fmi_type=interface, stop_time=0.2, output_interval=TS)
        assert np.isfinite(result["y[4]"]).all() and np.ptp(result["y[4]"]) > 0
