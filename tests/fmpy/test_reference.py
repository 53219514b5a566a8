"""Acceptance numbers of the models, through the FMI interface.

Answers come from elsewhere: the paper's coefficients typed again in `tests/reference/make_reference.py`, the check
values of the problem statement, SciPy's matrix logarithm, and the stored reference trajectory.
"""

import math
import random
import sys
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from scipy.linalg import expm, logm

import raw
import scenario

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "reference"))

import make_reference as reference  # noqa: E402  (needs the path above)

TS = 1e-3
SAMPLED, CONTINUOUS = 1, 2
SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"


def parameter_set(path):
    """{name: value} of a .ssv file."""
    root = etree.parse(str(path)).getroot()
    return {p.get("name"): float(p.find(f"{SSV}Real").get("value")) for p in root.iter(f"{SSV}Parameter")}


def coefficients(name):
    """(A1, B0, B1) of eq. 8 or eq. 12."""
    if name == "cart_pole":
        return reference.A1, reference.B0, reference.B1
    return (
        np.array([[-1.0081, 0.0240], [-0.0447, -0.9502]]),
        np.array([0.6297, 0.0503]),
        np.array([-0.6141, -0.0460]),
    )


@pytest.fixture
def actuator(shipped):
    return shipped("arx-actuator")


@pytest.fixture(params=["cart_pole", "toe"])
def identified(request, actuator):
    """(actuator, its parameters from the shipped set, A1, B0, B1)."""
    parameters = parameter_set(actuator.resources / f"{request.param}.ssv")
    return actuator, parameters, *coefficients(request.param)


def forces(fmu):
    return [fmu.variable("F_hat"), fmu.variable("F_act")]


def sampled_run(fmu, commands, parameters=()):
    """[F_hat, F_act](k) in Co-Simulation with a step of one sample."""
    with fmu.instantiate(raw.CO_SIMULATION) as slave:
        slave.setup()
        given = dict(parameters)
        slave.set([fmu.variable(n) for n in given], list(given.values()))
        slave.must("EnterInitializationMode")
        slave.must("ExitInitializationMode")
        rows = []
        for k, u in enumerate(commands):
            slave.set([fmu.variable("u")], [u])
            slave.must("DoStep", k * TS, TS, 0)
            rows.append(slave.get(forces(fmu)))
        return np.array(rows)


def recursion(commands, a1, b0, b1):
    """The same from the difference equation."""
    y, y_before, u_before = [], np.zeros(2), 0.0
    for u in commands:
        y_before = -a1 @ y_before + b0 * u + b1 * u_before
        u_before = u
        y.append(y_before)
    return np.array(y)


def test_step_response_and_dc_gain_of_eq_8(actuator):
    y = sampled_run(actuator, [1.0] * 4000)
    # swing-up check values, 8 digits.
    for k, value in {0: 0.0764, 10: 0.29220145, 50: 0.85012267, 100: 1.05908383}.items():
        assert y[k, 1] == pytest.approx(value, abs=1e-8), k
    assert y[-1] == pytest.approx([0.98884648, 0.94626802], abs=1e-8)


def test_dc_gains_and_poles_of_eq_12(actuator):
    parameters = parameter_set(actuator.resources / "toe.ssv")
    y = sampled_run(actuator, [1.0] * 4000, parameters)
    assert y[-1] == pytest.approx([1.00636, 0.98965], abs=5e-6)
    a, _ = continuous_matrices(actuator, parameters)
    poles = sorted(np.exp(np.linalg.eigvals(a) * TS), key=lambda p: p.imag)
    assert poles[1].real == pytest.approx(0.97915, abs=5e-6)
    assert poles[1].imag == pytest.approx(0.01532, abs=5e-6)


def test_sampled_actuator_is_the_recursion(identified):
    fmu, parameters, a1, b0, b1 = identified
    draw = random.Random(1)
    commands = [draw.uniform(-100, 100) for _ in range(500)]
    assert np.max(np.abs(sampled_run(fmu, commands, parameters) - recursion(commands, a1, b0, b1))) < 1e-11


def test_delay_and_higher_orders_follow_the_recursion(actuator):
    """na = 2, nb = 3, nk = 4, one output: a case that no parameter set covers."""
    a, b, delay = [-1.2, 0.4], [0.3, -0.1, 0.05], 4
    values = {"na": 2, "nb": 3, "nk": delay, "ny": 1, "A1[1,1]": a[0], "A2[1,1]": a[1]}
    values |= {f"B{i}[1]": x for i, x in enumerate(b)}
    draw = random.Random(2)
    u = [draw.uniform(-10, 10) for _ in range(200)]
    y = []
    for k in range(len(u)):
        past = sum(-a[i] * y[k - 1 - i] for i in range(2) if k - 1 - i >= 0)
        y.append(past + sum(b[i] * u[k - delay - i] for i in range(3) if k - delay - i >= 0))
    assert np.max(np.abs(sampled_run(actuator, u, values)[:, 0] - y)) < 1e-12


def test_samples_are_taken_at_their_times_whatever_the_communication_step(actuator):
    """Steps of 0.37 ms: between samples the held value, at each sample the recursion with the command of that time."""
    a1, b0, b1 = coefficients("cart_pole")
    h, n = 0.37e-3, 400
    command = lambda t: 30 * math.sin(40 * t)  # noqa: E731
    with actuator.instantiate(raw.CO_SIMULATION) as slave:
        slave.initialize()
        seen = []
        for k in range(n):
            slave.set([actuator.variable("u")], [command(k * h)])
            slave.must("DoStep", k * h, h, 0)
            seen.append(slave.get(forces(actuator)))
    # A sample inside a step sees the command set for that step; one at its end belongs to the next step.
    last = [math.ceil(round((k + 1) * h / TS, 9)) - 1 for k in range(n)]
    commands = []
    for j in range(last[-1] + 1):
        step = math.floor(round(j * TS / h, 9))
        commands.append(command(step * h))
    y = recursion(commands, a1, b0, b1)
    assert np.max(np.abs(np.array(seen) - y[last])) < 1e-11


def in_continuous_realization(fmu, parameters=()):
    instance = fmu.instantiate(raw.MODEL_EXCHANGE)
    scenario.start(instance, parameters={**dict(parameters), "realization": CONTINUOUS})
    instance.update_discrete_states()
    instance.must("EnterContinuousTimeMode")
    return instance


def continuous_matrices(fmu, parameters=()):
    """Ac, Bc as the derivatives of the FMU show them."""
    with in_continuous_realization(fmu, parameters) as model:
        n = len(fmu.states)

        def rate(z, u):
            model.set([fmu.variable("u")], [u])
            model.set_states(z + [0.0] * (n - len(z)))
            return model.derivatives()[:2]

        return np.array([rate([1.0, 0.0], 0.0), rate([0.0, 1.0], 0.0)]).T, np.array(rate([0.0, 0.0], 1.0))


def test_continuous_realization_is_the_matrix_logarithm(identified):
    fmu, parameters, a1, b0, b1 = identified
    ad, bd = -a1, -a1 @ b0 + b1
    ac = np.real(logm(ad)) / TS
    bc = ac @ np.linalg.solve(ad - np.eye(2), bd)
    got_a, got_b = continuous_matrices(fmu, parameters)
    assert np.max(np.abs(got_a - ac)) < 1e-7
    assert np.max(np.abs(got_b - bc)) < 1e-7
    assert np.max(np.abs(expm(got_a * TS) - ad)) < 1e-13


def test_continuous_realization_of_eq_8_has_the_stated_digits(actuator):
    ac, bc = continuous_matrices(actuator)
    assert ac == pytest.approx(np.array([[14.87318812, -21.94846328], [53.55018587, -46.80605823]]), abs=1e-7)
    assert bc == pytest.approx([14.22952987, 23.20704859], abs=1e-7)


def test_sampled_and_continuous_realization_agree_at_the_samples(identified):
    fmu, parameters, *_ = identified
    draw = random.Random(3)
    commands = [draw.uniform(-1, 1) for _ in range(300)]
    sampled = sampled_run(fmu, commands, parameters)
    seen = []
    with in_continuous_realization(fmu, parameters) as model:
        for k, u in enumerate(commands):
            model.must("SetTime", k * TS)
            model.set([fmu.variable("u")], [u])
            seen.append(model.get(forces(fmu)))
            # RK4 with 0.1 ms: poles of 26 rad/s leave an error of 1e-15 per step.
            for i in range(10):
                scenario._rk4(model, (k + i / 10) * TS, (k + (i + 1) / 10) * TS, model.states())
    assert np.max(np.abs(np.array(seen) - sampled)) < 1e-11


@pytest.mark.parametrize(
    "values",
    [{"nk": 1}, {"A1[1,1]": 0.5, "A1[1,2]": 0.0}, {"A1[1,1]": 0.0, "A1[2,1]": 0.0}],
    ids=["delay", "pole at -0.5", "pole at 0"],
)
def test_continuous_realization_is_refused_where_it_does_not_exist(actuator, values):
    with actuator.instantiate(raw.MODEL_EXCHANGE) as model:
        model.setup()
        given = {**values, "realization": CONTINUOUS}
        model.set([actuator.variable(n) for n in given], list(given.values()))
        status = model.call("EnterInitializationMode")
        if status == raw.OK:
            status = model.call("ExitInitializationMode")
        assert status == raw.ERROR
        assert any("realization" in text and "pole" in text for _, _, _, text in model.messages), model.messages


@pytest.mark.parametrize("u", [0.0, 12.0, -40.0, 400.0, -400.0])
def test_pressures_follow_eq_3_and_eq_5(actuator, u):
    s1, s2, supply = 3.1e-4, 2.6e-4, 0.5e6
    f_eq = 0.25e6 * (s1 + s2) / 2
    expected = [(f_eq + u / 2) / s1, (f_eq - u / 2) / s2]
    clipped = [min(max(p, 0.0), supply) for p in expected]
    names = ["p1", "p2", "saturated", "F_hat_measured", "F_eq_used"]
    with actuator.instantiate(raw.CO_SIMULATION) as slave:
        slave.setup()
        given = {"S1": s1, "S2": s2, "u": u, "p1_measured": 2.1e5, "p2_measured": 1.7e5}
        slave.set([actuator.variable(n) for n in given], list(given.values()))
        slave.must("EnterInitializationMode")
        slave.must("ExitInitializationMode")
        slave.must("DoStep", 0.0, TS, 0)
        p1, p2, saturated, f_hat, used = slave.get([actuator.variable(n) for n in names])
    assert [p1, p2] == pytest.approx(clipped, rel=1e-12)
    assert saturated is (expected != clipped)
    assert f_hat == pytest.approx(s1 * 2.1e5 - s2 * 1.7e5, rel=1e-12)
    assert used == pytest.approx(f_eq, rel=1e-12)


# -- the coupled system ------------------------------------------------------------------------------------------------

Y = [0.01, 0.5, 0.1, -1.0, 2.0, 3.0]  # x, theta, v, omega, z1, z2 of the check values
U = 10.0


@pytest.fixture
def chain(shipped, actuator):
    """Model Exchange instances in continuous time and f(y, u) through them."""
    friction, cart_pole = shipped("friction"), shipped("cart-pole")
    cart = parameter_set(friction.resources / "cart.ssv")
    models = [in_continuous_realization(actuator)]
    for fmu, parameters in ((friction, {}), (friction, cart), (cart_pole, {})):
        instance = fmu.instantiate(raw.MODEL_EXCHANGE)
        scenario.enter_model_exchange(instance, parameters=parameters)
        models.append(instance)
    act, piston, guide, body = models

    def evaluate(y, u, f_act=None):
        n = len(actuator.states)
        act.set_states(list(y[4:]) + [0.0] * (n - 2))
        act.set([actuator.variable("u")], [u])
        force = act.get([actuator.variable("F_act")])[0] if f_act is None else f_act
        body.set_states(list(y[:4]))
        for block in (piston, guide):
            block.set([friction.variable("F_in"), friction.variable("v")], [force, y[2]])
            force = block.get([friction.variable("F_out")])[0]
        body.set([cart_pole.variable(n) for n in ("F", "F_ext", "tau_ext")], [force, 0.0, 0.0])
        return np.array(body.derivatives() + act.derivatives()[:2])

    yield evaluate
    for instance in models:
        instance.free()


def test_right_hand_side_has_the_check_values(chain):
    expected = [0.1, -1.0, -13.581567750692567, 36.228912437166095, 106.19628514496608, 198.75268298783277]
    assert np.max(np.abs(chain(Y, U) - expected)) < 1e-10


def test_right_hand_side_equals_the_monolithic_equations_anywhere(chain):
    a, b = continuous_reference()
    draw = random.Random(4)
    for _ in range(50):
        y = [draw.uniform(-1, 1) * s for s in (0.2, 4, 1, 12, 60, 60)]
        u = draw.uniform(-100, 100)
        f_act = y[5] + reference.B0[1] * u
        expected = np.concatenate([reference.right_hand_side(np.array(y[:4]), f_act), a @ y[4:] + b * u])
        assert chain(y, u) == pytest.approx(expected, rel=1e-11, abs=1e-9)


def continuous_reference():
    ad = -reference.A1
    a = np.real(logm(ad)) / TS
    return a, a @ np.linalg.solve(ad - np.eye(2), ad @ reference.B0 + reference.B1)


def test_one_sample_has_the_check_values(chain, actuator):
    """Mechanics: one RK4 step of 1 ms under the held force. Actuator: one sample, in Co-Simulation."""
    f_act = Y[5] + reference.B0[1] * U
    y, h = np.array(Y), TS
    k1 = chain(y, U, f_act)
    k2 = chain(y + h / 2 * k1, U, f_act)
    k3 = chain(y + h / 2 * k2, U, f_act)
    k4 = chain(y + h * k3, U, f_act)
    mechanics = (y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))[:4]
    expected = [0.010093465519045938, 0.4990170011390437, 0.08718076362804318, -0.9670825179455242]
    assert np.max(np.abs(mechanics - expected)) < 1e-12
    with actuator.instantiate(raw.CO_SIMULATION) as slave:
        names = ["z[1]", "z[2]", "u"]
        slave.initialize(set_first=([actuator.variable(n) for n in names], [Y[4], Y[5], U]))
        slave.must("DoStep", 0.0, TS, 0)
        z = slave.get([actuator.variable(n) for n in names[:2]])
        assert slave.get([actuator.variable("F_act")])[0] == pytest.approx(f_act, abs=1e-14)
    assert z == pytest.approx([2.1048112000000003, 3.1969480999999997], abs=1e-12)


def test_holding_the_cart_takes_the_stated_command(chain):
    """At rest the frictions add up to -4.55536927 N, because of c3 and c5."""
    at_rest = chain([0.0] * 6, 0.0)
    hold = chain([0.0] * 6, 0.0, f_act=-4.55536927)
    assert at_rest[2] > 1.0
    assert abs(hold[2]) < 1e-7


def load_reference():
    table = np.genfromtxt(reference.DATA, delimiter=",", names=True)
    return table


def relative_rms_error(x, expected):
    """RMS of the error in percent of the RMS of the expected signal."""
    return 100 * math.sqrt(np.mean((x - expected) ** 2) / np.mean(expected**2))


def test_stored_reference_is_what_its_script_computes():
    stored = load_reference()
    n = 15  # rows of 10 ms
    _, states, forces_ = reference.trajectory(stop_time=n * 0.01)
    rows = slice(None, None, reference.STORED_EVERY)
    for i, name in enumerate(["x", "theta", "v", "omega"]):
        assert np.max(np.abs(states[rows, i] - stored[name][: n + 1])) < 1e-9, name
    assert np.max(np.abs(forces_[rows, 1] - stored["F_act"][: n + 1])) < 1e-9


def test_stored_reference_agrees_with_a_second_integrator():
    stored = load_reference()
    _, states, _ = reference.trajectory(one_sample=lambda s, f: reference.one_sample_rk4(s, f, 10))
    rows = slice(None, None, reference.STORED_EVERY)
    for i, name in enumerate(["x", "theta", "v", "omega"]):
        assert np.max(np.abs(states[rows, i] - stored[name])) < 1e-7, name


def couple(shipped, jacobi, stop=3.0):
    """x at every 10 ms of a hand-written master with a step of 1 ms, and the outputs after initialization."""
    fmus = {"actuator": "arx-actuator", "piston": "friction", "guide": "friction", "body": "cart-pole"}
    fmus = {name: shipped(file) for name, file in fmus.items()}
    cart = parameter_set(fmus["guide"].resources / "cart.ssv")
    links = [  # (from, output, to, input), in the order of direct feed-through
        ("actuator", "F_act", "piston", "F_in"),
        ("body", "v", "piston", "v"),
        ("piston", "F_out", "guide", "F_in"),
        ("body", "v", "guide", "v"),
        ("guide", "F_out", "body", "F"),
    ]
    slaves = {name: fmu.instantiate(raw.CO_SIMULATION, name=name) for name, fmu in fmus.items()}
    order = ["actuator", "piston", "guide", "body"]

    def pull(source, output):
        return slaves[source].get([fmus[source].variable(output)])

    def push(target, value, name):
        slaves[target].set([fmus[target].variable(name)], value)

    for name, slave in slaves.items():
        slave.setup()
        if name == "guide":
            slave.set([fmus[name].variable(n) for n in cart], list(cart.values()))
        slave.must("EnterInitializationMode")
    push("actuator", [float(reference.command(0))], "u")
    for source, output, target, name in links:  # outputs of the body are states: one pass is consistent
        push(target, pull(source, output), name)
    initial = {name: pull(name, o)[0] for name, o in (("actuator", "F_act"), ("piston", "F_out"), ("guide", "F_out"))}
    for slave in slaves.values():
        slave.must("ExitInitializationMode")
    n, x = round(stop / TS), [pull("body", "x")[0]]
    for k in range(n):
        push("actuator", [float(reference.command(k))], "u")
        if jacobi:
            for target, value, name in [(t, pull(s, o), i) for s, o, t, i in links]:
                push(target, value, name)
        for target in order:
            if not jacobi:
                for source, output, to, name in links:
                    if to == target:
                        push(target, pull(source, output), name)
            slaves[target].must("DoStep", k * TS, TS, 0)
        if (k + 1) % reference.STORED_EVERY == 0:
            x.append(pull("body", "x")[0])
    for slave in slaves.values():
        slave.free()
    return np.array(x), initial


@pytest.mark.parametrize("jacobi, expected", [(False, 0.083), (True, 0.184)], ids=["gauss-seidel", "jacobi"])
def test_coupling_error_at_1_ms(shipped, jacobi, expected):
    x, initial = couple(shipped, jacobi)
    assert initial == {"actuator": 0.0, "piston": 0.0, "guide": pytest.approx(4.55536927, abs=1e-8)}
    error = relative_rms_error(x, load_reference()["x"])
    print(f"RMS error in x: {error:.4f} %")
    assert error == pytest.approx(expected, abs=0.01)
