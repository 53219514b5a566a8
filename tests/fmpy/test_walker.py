"""compass-gait through FMI: reference values, conservation, events.

Reference values: the half-step specification of this project (see examples/04_half_step). Energies and momenta are summed here over
the five masses, independently of the mass matrix of the model.
"""

import math

import fmpy
import numpy as np
import pytest

import raw

STATES = ["x", "y", "th1", "th2", "l1", "l2", "vx", "vy", "omega1", "omega2", "dl1", "dl2"]
ACCELERATIONS = ["ax", "ay", "alpha1", "alpha2", "ddl1", "ddl2"]
AFTER = [f"after.{name}" for name in STATES[6:]]
Q = [0.1, 1.0, 0.2, -0.3, 1.02, 0.97]
V = [0.5, -0.2, 1, -2, 0.3, -0.4]
U = {"tau": 5.0, "F1": 150.0, "F2": -10.0}
PINNED = {"events": 1, "flight": 2, "foot1": 3, "foot2": 4, "both": 5}
MAPS = {"none": 1, "foot1": 2, "foot2": 3, "both": 4}


class Walker:
    """One instance by names."""

    def __init__(self, instance):
        self.instance, self.fmu = instance, instance.fmu

    def set(self, **values):
        values = {name.replace("__", "."): value for name, value in values.items()}
        self.instance.set([self.fmu.variable(name) for name in values], list(values.values()))

    def get(self, *names):
        return np.array(self.instance.get([self.fmu.variable(name) for name in names]), dtype=float)

    def state(self):
        return self.get(*STATES)

    def start(self, state, inputs=None, **parameters):
        self.set(**dict(zip(STATES, map(float, state))), **(inputs or {}), **parameters)
        self.instance.initialize()


@pytest.fixture
def walker(shipped):
    instances = []

    def make(kind=raw.MODEL_EXCHANGE):
        instance = shipped("compass-gait").instantiate(kind)
        instance.__enter__()
        instances.append(instance)
        return Walker(instance)

    yield make
    for instance in instances:
        instance.free()


def bodies(s):
    """Mass, inertia, position, velocity, angular velocity of trunk, upper legs and toes."""
    x, y, th1, th2, l1, l2, vx, vy, w1, w2, r1, r2 = s
    th3, w3 = (th1 + th2) / 2, (w1 + w2) / 2
    parts = [(6.0, 0.1, (x - 0.1 * math.sin(th3), y + 0.1 * math.cos(th3)), (vx - 0.1 * math.cos(th3) * w3, vy - 0.1 * math.sin(th3) * w3), w3)]
    for th, length, w, rate in ((th1, l1, w1, r1), (th2, l2, w2, r2)):
        for mass, inertia, r, dr in ((3.7, 0.2, 0.35, 0.0), (0.8, 0.005, length - 0.1, rate)):
            position = (x + r * math.sin(th), y - r * math.cos(th))
            velocity = (
                vx + r * math.cos(th) * w + dr * math.sin(th),
                vy + r * math.sin(th) * w - dr * math.cos(th),
            )
            parts.append((mass, inertia, position, velocity, w))
    return parts


def momentum(s):
    return sum(np.array(v) * m for m, _, _, v, _ in bodies(s))


def angular_momentum(s, about):
    """Of everything but the rotor, whose spin th2' - th1' lies inside the hip and adds nothing to the total here."""
    return sum(
        inertia * w + m * ((p[0] - about[0]) * v[1] - (p[1] - about[1]) * v[0]) for m, inertia, p, v, w in bodies(s)
    )


def energy(s):
    kinetic = sum(0.5 * m * (v[0] ** 2 + v[1] ** 2) + 0.5 * i * w**2 for m, i, _, v, w in bodies(s))
    return kinetic + 0.5 * 0.05 * (s[9] - s[8]) ** 2 + sum(9.81 * m * p[1] for m, _, p, _, _ in bodies(s))


def center(s):
    return sum(np.array(p) * m for m, _, p, _, _ in bodies(s)) / 15.0


@pytest.mark.parametrize(
    "mode, names, expected",
    [
        (
            "flight",
            ACCELERATIONS,
            [-3.193005591913, 0.484724930526, -2.975327782779, 10.988675600899, 199.143868116647, -0.128671300751],
        ),
        ("foot1", ACCELERATIONS[2:], [2.550563865201, 11.197251399474, 2.108563307228, -0.227761752818]),
        ("foot1", ["foot1.ft", "foot1.fn"], [-24.029793344957, 155.946119371361]),
        ("foot2", ACCELERATIONS[2:], [-3.293014417601, 1.372815125575, 198.984909130526, 3.361481707048]),
    ],
)
def test_pinned_modes_have_the_reference_values(walker, mode, names, expected):
    w = walker()
    w.start(Q + V, U, contact_mode=PINNED[mode])
    np.testing.assert_allclose(w.get(*names), expected, rtol=1e-9, atol=1e-9)
    assert (np.array(w.instance.indicators()) > 0).all()


def before_impact():
    """Foot 1 at rest at the origin, foot 2 at (0.25, 0), rates of the reference."""
    length, (w1, w2, r1, r2) = 0.125 / math.sin(0.12), (-1.0, -0.4, 0.1, -0.1)
    s, c = math.sin(-0.12), math.cos(0.12)
    hip = [-length * s, length * c]
    rate = [-length * c * w1 - r1 * s, -length * s * w1 + r1 * c]
    return hip + [-0.12, 0.12, length, length] + rate + [w1, w2, r1, r2]


def test_impact_map_has_the_reference_values(walker):
    w = walker()
    w.start(before_impact(), contact_mode=PINNED["foot1"], impact_map=MAPS["foot2"])
    after = w.get(*AFTER)
    expected = [-1.0267664232028, -1.0130124824017, 0.1056744371485, -0.1500584264326]
    np.testing.assert_allclose(after[2:], expected, rtol=1e-9)
    np.testing.assert_allclose(w.get("after.foot2.Lt", "after.foot2.Ln"), [-0.8235004272466, -0.0581465174472], rtol=1e-9)
    state = np.array(before_impact())
    assert energy(np.concatenate([state[:6], after])) - energy(state) == pytest.approx(-0.2567924615944, rel=1e-9)
    assert w.get("energy")[0] == pytest.approx(energy(state), rel=1e-14)

    w = walker()
    w.start(before_impact(), contact_mode=PINNED["foot1"], impact_map=MAPS["both"])
    expected = [-1.0178670107401, -1.0127529881175, 0.1056903053891, -0.1499757824053]
    np.testing.assert_allclose(w.get(*AFTER[2:]), expected, rtol=1e-9)
    np.testing.assert_allclose(w.get("after.foot1.Lt", "after.foot1.Ln"), [0.0118917114119, -0.0014338946804], rtol=1e-9)
    np.testing.assert_allclose(w.get("after.foot2.Lt", "after.foot2.Ln"), [-0.8236731383501, -0.0581673428376], rtol=1e-9)


@pytest.mark.parametrize("feet", ["foot1", "foot2", "both"])
def test_impacts_change_momenta_by_their_impulses_alone(walker, feet):
    w = walker()
    w.start(Q + V, impact_map=MAPS[feet], contact_mode=PINNED["flight"])
    before, after = np.array(Q + V), np.concatenate([Q, w.get(*AFTER)])
    impulses = w.get("after.foot1.Lt", "after.foot1.Ln", "after.foot2.Lt", "after.foot2.Ln").reshape(2, 2)
    feet_at = w.get("foot1.x", "foot1.y", "foot2.x", "foot2.y").reshape(2, 2)
    np.testing.assert_allclose(momentum(after) - momentum(before), impulses.sum(axis=0), rtol=1e-10, atol=1e-10)
    for about in (*feet_at, (0.0, 0.0)):
        moment = sum((p[0] - about[0]) * i[1] - (p[1] - about[1]) * i[0] for p, i in zip(feet_at, impulses))
        change = angular_momentum(after, about) - angular_momentum(before, about)
        assert change == pytest.approx(moment, rel=1e-10, abs=1e-10)


def test_flight_conserves_energy_and_momentum(walker):
    w = walker(raw.CO_SIMULATION)
    start = np.array([0.0, 5.0, *Q[2:], *V])
    zero = {"tau": 0.0, "F1": 0.0, "F2": 0.0}
    # Legs swing and stretch freely, as long as their toes stay below the hip.
    w.start(start, zero, contact_mode=PINNED["flight"], solver__method=2, solver__tolerance=1e-12)
    for k in range(500):
        w.instance.must("DoStep", k * 1e-3, 1e-3, 0)
    end, t = w.state(), 0.5
    fall = np.array([0.0, -15.0 * 9.81 * t])
    assert energy(end) == pytest.approx(energy(start), rel=1e-10)
    np.testing.assert_allclose(momentum(end), momentum(start) + fall, rtol=1e-10, atol=1e-9)
    scale = abs(angular_momentum(start, center(start)))
    assert abs(angular_momentum(end, center(end)) - angular_momentum(start, center(start))) <= 1e-10 * scale
    np.testing.assert_allclose(w.get("foot1.ft", "foot1.fn"), 0.0)


def test_a_dropped_walker_lands_when_and_as_a_falling_body_does(walker):
    # Upright, nothing pushes: everything falls with g. Foot 1 is 5 mm below foot 2, at 80 mm.
    height, zero = 0.08, {"tau": 0.0, "F1": 0.0, "F2": 0.0}
    w = walker(raw.CO_SIMULATION)
    w.start([0, 1.045 + height, 0, 0, 1.045, 1.040] + [0] * 6, zero)
    t = math.sqrt(2 * height / 9.81)
    for k in range(130):
        w.instance.must("DoStep", k * 1e-3, 1e-3, 0)
    assert list(w.get("mode", "impact.count")) == [2, 1]
    assert w.get("impact.time")[0] == pytest.approx(t, abs=1e-13)
    # Along the leg the impulse sees the toe alone.
    np.testing.assert_allclose(w.get("impact.foot1.Lt", "impact.foot1.Ln"), [0, 0.8 * 9.81 * t], atol=1e-12)
    assert any("foot 1 came down" in text for _, _, _, text in w.instance.messages)
    for k in range(130, 145):
        w.instance.must("DoStep", k * 1e-3, 1e-3, 0)
    assert list(w.get("mode", "impact.count")) == [4, 2]
    assert w.get("impact.time")[0] == pytest.approx(math.sqrt(2 * (height + 0.005) / 9.81), abs=1e-12)
    np.testing.assert_allclose(w.get("foot1.fn", "foot2.fn"), 0.8 * 9.81, rtol=1e-9)


def test_lift_off_happens_when_the_force_is_gone(walker):
    # Upright on foot 1 with only the toe's weight on the ground; F1 falls by 100 N/s, so fn = mt g + F1 is 0 at F1 = -mt g.
    w = walker(raw.CO_SIMULATION)
    w.start([0, 1.045, 0, 0, 1.045, 1.0] + [0] * 6, {"tau": 0.0, "F1": 0.0, "F2": 0.0})
    derivative = (raw.c_double * 1)(-100.0)
    reference, order = (raw.c_uint * 1)(w.fmu.variable("F1").reference), (raw.c_int * 1)(1)
    for k in range(100):
        if w.get("mode")[0] == 1:
            break
        w.instance.must("SetRealInputDerivatives", reference, 1, order, derivative)
        w.instance.must("DoStep", k * 1e-3, 1e-3, 0)
    assert k == 79  # 0.8 * 9.81 / 100 = 0.07848 s
    assert w.get("foot1.y")[0] > 0 and w.get("foot1.vy")[0] > 0


def test_a_foot_lifts_off_where_an_input_jumps(walker):
    w = walker(raw.CO_SIMULATION)
    w.start([0, 1.045, 0, 0, 1.045, 1.0] + [0] * 6)
    w.instance.must("DoStep", 0.0, 1e-3, 0)
    w.set(F1=-100.0)
    w.instance.must("DoStep", 1e-3, 1e-3, 0)
    # From the first instant of the step: the toe of 0.8 kg under 100 N and its weight.
    assert w.get("mode")[0] == 1
    assert w.get("foot1.vy")[0] == pytest.approx((100 / 0.8 - 9.81) * 1e-3, rel=1e-3)


def test_a_foot_that_would_slide_ends_the_simulation_or_is_marked(walker):
    # The toe pushes along the leg, whose slope tan(0.7) = 0.84 is outside the cone of 0.6.
    lean = [math.sin(0.7), math.cos(0.7), -0.7, 0.0, 1.0, 0.6] + [0] * 6
    w = walker(raw.CO_SIMULATION)
    w.start(lean, {"tau": 0.0, "F1": 120.0, "F2": 0.0})
    assert w.instance.do_step(0.0, 1e-3) == raw.DISCARD
    assert w.instance.boolean_status() is True
    assert w.instance.real_status() == 0.0
    said = w.instance.messages[-1][3]
    assert "foot 1 would slide" in said and "mu_friction" in said and "no sliding is modeled" in said
    w = walker(raw.CO_SIMULATION)
    w.start(lean, {"tau": 0.0, "F1": 120.0, "F2": 0.0}, on_slide=2)
    w.instance.must("DoStep", 0.0, 1e-3, 0)
    assert list(w.get("foot1.slides", "mode")) == [1, 2]


def test_a_fall_ends_the_simulation_when_it_happens(walker):
    w = walker(raw.CO_SIMULATION)
    w.start([0, 1.045, 0, 0, 1.045, 1.0] + [0] * 6, {"tau": 0.0, "F1": 0.0, "F2": 0.0}, fall_height=0.9)
    for k in range(400):
        status = w.instance.do_step(k * 1e-3, 1e-3)
        if status != raw.OK:
            break
    # Nothing holds the hip: it falls freely, whatever the toes do below it.
    assert status == raw.DISCARD and w.instance.boolean_status() is True
    assert w.instance.real_status() == pytest.approx(math.sqrt(2 * 0.145 / 9.81), abs=1e-9)
    assert "fell" in w.instance.messages[-1][3] and "0.9 m" in w.instance.messages[-1][3]


def test_a_start_below_the_ground_is_refused_by_name(walker):
    w = walker()
    w.set(l1=1.06)
    w.instance.setup()
    w.instance.must("EnterInitializationMode")
    assert w.instance.call("ExitInitializationMode") == raw.ERROR
    assert "foot 1" in w.instance.messages[-1][3] and "below the ground" in w.instance.messages[-1][3]


def test_a_standing_foot_stays_where_it_is(walker):
    w = walker(raw.CO_SIMULATION)
    w.start([0, 1.045, 0, 0, 1.045, 1.0] + [0] * 6)
    for k in range(800):
        s = w.state()
        # Holds the legs upright while foot 2 swings forth and back and the hip moves up and down.
        tau = 40.0 * (0.1 * math.sin(6 * k * 1e-3) - s[3] + s[2]) - 3.0 * (s[9] - s[8])
        w.set(tau=tau, F1=139.302 + 400 * (1.02 - s[4]) - 60 * s[10], F2=-7.848 + 100 * (0.97 - s[5]) - 10 * s[11])
        w.instance.must("DoStep", k * 1e-3, 1e-3, 0)
    assert abs(w.get("th2")[0]) > 0.01
    # Runge-Kutta of order 4 with 1 ms: errors of some 1e-12 per swing.
    np.testing.assert_allclose(w.get("foot1.x", "foot1.y", "foot1.vx", "foot1.vy"), 0.0, atol=1e-10)


def test_model_exchange_finds_the_same_touch_down(shipped):
    fmu = shipped("compass-gait")
    start = {"y": 1.13, "l2": 1.04, "omega1": 0.4, "omega2": -0.3, "vx": 0.3, "tau": 2.0, "F1": -3.0, "F2": 1.0}
    results = [
        fmpy.simulate_fmu(
            str(fmu.folder),
            fmi_type=kind,
            stop_time=0.13,
            output_interval=1e-3,
            relative_tolerance=1e-11,
            solver="CVode",
            start_values=start | {"on_slide": 2, "solver.method": 2},
            output=["impact.time", "impact.count", "mode", *STATES],
        )
        for kind in ("CoSimulation", "ModelExchange")
    ]
    cs, me = (result[-1] for result in results)
    assert cs["impact.count"] >= 1 and cs["impact.count"] == me["impact.count"] and cs["mode"] == me["mode"]
    assert cs["impact.time"] == pytest.approx(me["impact.time"], abs=1e-8)
    np.testing.assert_allclose([cs[name] for name in STATES], [me[name] for name in STATES], atol=1e-6)


def test_directional_derivatives_in_every_mode_agree_with_differences(walker):
    for mode in ("flight", "foot1", "foot2", "both"):
        for impact in ("foot1", "both"):
            w = walker()
            w.start(Q + V, U, contact_mode=PINNED[mode], impact_map=MAPS[impact])
            w.instance.update_discrete_states()
            w.instance.must("EnterContinuousTimeMode")
            names = ACCELERATIONS + ["foot1.ft", "foot1.fn", "foot2.ft", "foot2.fn", "foot1.ay", "foot2.ax"] + AFTER
            names += ["after.foot1.Ln", "after.foot2.Lt", "energy"]
            unknowns = [w.fmu.variable(name) for name in names]
            knowns = [w.fmu.variable(name) for name in STATES + list(U)]
            seed = [math.sin(1 + 2 * i) for i in range(len(knowns))]
            exact = np.array(w.instance.directional_derivative(unknowns, knowns, seed))
            x, u = np.array(Q + V, dtype=float), np.array(list(U.values()))

            def at(h):
                w.instance.set_states(list(x + h * np.array(seed[:12])))
                w.set(**dict(zip(U, u + h * np.array(seed[12:]))))
                return w.get(*names)

            h = 1e-3
            difference = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
            np.testing.assert_allclose(exact, difference, rtol=1e-7, atol=1e-6)
