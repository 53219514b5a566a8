"""Directional derivatives against central differences, and the declared dependencies against both."""

import math

import pytest

import raw
import scenario

SEEDS = 3

# (1 - 0.9/z)(1 - 0.6/z)(1 - 0.4/z)(1 - 0.2/z): real poles in (0, 1), so that the continuous realization exists.
_POLYNOMIAL = [-2.1, 1.52, -0.444, 0.0432]

# Parameters under which every declared dependency shows, for FMUs whose start values hide some.
MOST_GENERAL = {
    # Formulas in which every variable of the port and every state occurs.
    "expression-effect": {
        "states": "a b c",
        "formula": "sin(x)*v + 0.3*f*x + a*b + c*x",
        **{f"rate[{i}]": f"0.1*(sin(x + {i}) + 0.1*v*f + a*b + c*(a + v))" for i in (1, 2, 3)},
    },
    "arx-actuator": {
        "na": 4,
        "nb": 5,
        "ny": 2,
        "realization": 2,
        **{
            f"A{i}[{j},{k}]": (_POLYNOMIAL[i - 1] if j == k else 0.0) + 1e-3 * math.sin(i + 2 * j + 3 * k)
            for i in (1, 2, 3, 4)
            for j in (1, 2)
            for k in (1, 2)
        },
        **{f"B{i}[{j}]": 0.1 * math.cos(i + 2 * j) for i in range(5) for j in (1, 2)},
    },
    "linear-state-space": {
        "n_x": 12,
        "n_u": 4,
        "n_y": 4,
        "realization": 2,
        **{
            f"A[{i},{j}]": (0.9 - 0.05 * i if i == j else 0.0) + 1e-2 * math.sin(i + 2 * j)
            for i in range(1, 13)
            for j in range(1, 13)
        },
        **{f"B[{i},{j}]": math.cos(i + 3 * j) for i in range(1, 13) for j in range(1, 5)},
        **{f"C[{i},{j}]": math.cos(2 * i + j) for i in range(1, 5) for j in range(1, 13)},
        **{f"D[{i},{j}]": math.cos(i + j) for i in range(1, 5) for j in range(1, 5)},
    },
    "force-effect": {
        "viscous_coef": 3.0,
        "coulomb_force": 2.0,
        "pressure_coef": 0.1,
        "poscoulomb_slope": 4.0,
        "stribeck_force": 1.0,
        "stribeck_vs": 0.1,
        "asymmetry_force": 0.5,
        "presliding_disp": 0.01,
        "c1": 2.0,
        "c2": 5.0,
        "area_coef": 1e-5,
        "spring_stiffness": 20.0,
        "endstop_pos": -10.0,
        "endstop_stiffness": 30.0,
        "endstop_damping": 2.0,
        "cogging_amp": 0.7,
        "cogging_period": 0.2,
        "tilt_weight": 5.0,
        "tilt_angle": 0.02,
    },
    "port-effect": {
        "viscous_coef": 3.0,
        "coulomb_level": 2.0,
        "load_coef": 0.1,
        "poscoulomb_slope": 4.0,
        "stribeck_level": 1.0,
        "stribeck_vs": 0.1,
        "asymmetry_level": 0.5,
        "presliding_disp": 0.01,
        "presliding_level": 2.0,
        "vt": 0.2,
        "v0": 0.03,
        "drag_coef": 0.4,
        "spring_stiffness": 20.0,
        "cubic_stiffness": 3.0,
        "endstop_pos": -10.0,
        "endstop_stiffness": 30.0,
        "endstop_damping": 2.0,
        "cogging_amp": 0.7,
        "cogging_period": 0.2,
        "area_coef": 1e-5,
        "gain": 0.1,
        "posgain_slope": 0.5,
        "lag_up": 0.3,
        "lag_down": 0.2,
    },
    "torque-effect": {
        "viscous_coef": 0.2,
        "coulomb_torque": 0.3,
        "coulomb_rate": 0.5,
        "quaddrag_coef": 0.1,
        "tilt_moment": 0.4,
        "tilt_angle": 0.1,
    },
    "sensor-effect": {"gain": 0.1},
    "rigid-mass": {"b": 2.0},
    # Without a delay the port's pressure acts on the chamber at once.
    "pneumatic-cylinder": {"tdelay": 0.0},
    "compass-gait": {"contact_mode": 5, "impact_map": 4},
}

# Parameters under which every point near the start values is a start, too.
ANY_START = {"compass-gait": {"contact_mode": 2}}

# (unknown, known) pairs that are declared and have no slope in continuous time: the command acts at samples only, the
# controllers' integrators are switched by their own value.
WITHOUT_SLOPE = {
    # With a lag nothing passes directly, without a mode nothing moves it.
    "port-effect": {
        ("y", "u"),
        ("y", "mode"),
        *((rate, known) for rate in ("der(mode)", "der(mode_rate)") for known in ("u", "x", "lag", "mode", "mode_rate")),
    },
    "pneumatic-cylinder": {("der(c1)", "u"), ("der(c2)", "u"), ("der(q1)", "q1"), ("der(q2)", "q2")},
}


def continuous_knowns(fmu):
    return [*fmu.states, *(v for v in fmu.of("input") if v.is_real and v.variability == "continuous")]


def continuous_unknowns(fmu):
    outputs = [v for v in fmu.of("output") if v.is_real and v.variability == "continuous"]
    names = {v.name for v in fmu.states}
    return [*fmu.derivatives, *(v for v in outputs if v.name not in names)]


def central_difference(evaluate, point, seed):
    """Directional derivative of `evaluate` at `point` along `seed` (in nominal values): fourth order, about 1e-9."""
    h = 2e-4  # small against the sharpest friction: tanh(64 v)
    moved = [evaluate([x + k * h * s for x, s in zip(point, seed)]) for k in (-2, -1, 1, 2)]
    return [(a - 8 * b + 8 * c - d) / (12 * h) for a, b, c, d in zip(*moved)]


def seeds(knowns):
    """Each known alone, then mixtures; in nominal values, so that a step moves pressures and lengths alike."""
    nominal = [v.number("nominal") or 1.0 for v in knowns]
    for k in range(len(knowns)):
        yield [x if i == k else 0.0 for i, x in enumerate(nominal)]
    for draw in range(SEEDS):
        yield [x * math.sin(1.3 * draw + 2.1 * i + 0.5) for i, x in enumerate(nominal)]


def assert_same(unknowns, exact, difference, scale):
    for v, a, b, s in zip(unknowns, exact, difference, scale):
        assert abs(a - b) <= 1e-6 * max(abs(a), abs(b), s), f"{v.name}: {a!r}, differences {b!r}"


def value_scale(values):
    """Rounding in a value of size V shows as V * 1e-16 / h in its differences."""
    return [max(1e-3, 1e-6 * abs(v)) for v in values]


@pytest.fixture(autouse=True)
def _provides(fmu):
    for kind in (raw.CO_SIMULATION, raw.MODEL_EXCHANGE):
        assert fmu.flag(kind, "providesDirectionalDerivative")


@pytest.fixture(params=["start values", "most general"])
def in_continuous_time(fmu, request):
    """A Model Exchange instance some way into a run, and its evaluation at (states, inputs)."""
    parameters = {}
    if request.param == "most general":
        if fmu.name not in MOST_GENERAL:
            pytest.skip("the start values are as general as any")
        parameters = MOST_GENERAL[fmu.name]
    if not continuous_knowns(fmu) or not continuous_unknowns(fmu):
        pytest.skip("no continuous unknowns or knowns")
    step = fmu.step_size
    with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
        info = scenario.enter_model_exchange(instance, parameters=parameters)
        time = 0.0
        for k in range(3):
            if k:
                info = scenario.event(instance, k * step)
            info, time = scenario._integrate(instance, time, (k + 1) * step, step / 4, info)
        n = len(fmu.states)

        def evaluate(point):
            instance.set_states(point[:n])
            instance.set(continuous_knowns(fmu)[n:], point[n:])
            return instance.get(continuous_unknowns(fmu))

        yield instance, evaluate, instance.states() + instance.get(continuous_knowns(fmu)[n:])


def test_model_exchange_derivatives_equal_central_differences(fmu, in_continuous_time):
    instance, evaluate, point = in_continuous_time
    knowns, unknowns = continuous_knowns(fmu), continuous_unknowns(fmu)
    scale = value_scale(evaluate(point))
    for seed in seeds(knowns):
        difference = central_difference(evaluate, point, seed)
        evaluate(point)
        assert_same(unknowns, instance.directional_derivative(unknowns, knowns, seed), difference, scale)


def test_requests_need_not_be_square_nor_in_order(fmu, in_continuous_time):
    instance, evaluate, point = in_continuous_time
    evaluate(point)
    knowns, unknowns = continuous_knowns(fmu), continuous_unknowns(fmu)
    seed = [math.cos(i) for i in range(len(knowns))]
    full = instance.directional_derivative(unknowns, knowns, seed)
    turned = instance.directional_derivative(unknowns[::-1], knowns[::-1], seed[::-1])
    assert turned[::-1] == pytest.approx(full, rel=1e-12, abs=1e-12)
    for i, v in enumerate(unknowns):
        assert instance.directional_derivative([v], knowns, seed) == pytest.approx([full[i]], rel=1e-12, abs=1e-12)
    columns = [instance.directional_derivative(unknowns, [v], [1.0]) for v in knowns]
    summed = [sum(s * c[i] for s, c in zip(seed, columns)) for i in range(len(unknowns))]
    assert summed == pytest.approx(full, rel=1e-9, abs=1e-9)


def test_asking_for_derivatives_changes_nothing(fmu, in_continuous_time):
    instance, evaluate, point = in_continuous_time
    before = evaluate(point)
    all_before = raw.bits(instance.get(fmu.readable))
    knowns = continuous_knowns(fmu)
    instance.directional_derivative(continuous_unknowns(fmu), knowns, [1.0] * len(knowns))
    assert raw.bits(instance.get(fmu.readable)) == all_before
    assert raw.bits(evaluate(point)) == raw.bits(before)


def initial_pairs(fmu):
    """Real InitialUnknowns and the Real knowns of initialization that can be moved."""
    unknowns = [v for v, _, _ in fmu.unknowns("InitialUnknowns") if v.is_real]
    knowns = [v for v in fmu.variables if v.is_real and (v.causality == "input" or v.initial == "exact")]
    return unknowns, [v for v in knowns if v.variability != "constant" and not v.name.startswith("solver.")]


@pytest.mark.parametrize("kind", [raw.CO_SIMULATION, raw.MODEL_EXCHANGE], ids=["cs", "me"])
def test_initialization_derivatives_equal_central_differences(fmu, kind):
    """In initialization mode every input, parameter and start value is a known, in both interfaces."""
    unknowns, knowns = initial_pairs(fmu)
    if not unknowns or not knowns:
        pytest.skip("no Real unknowns or knowns of initialization")
    with fmu.instantiate(kind) as instance:
        instance.setup()
        scenario.set_parameters(instance, ANY_START.get(fmu.name, {}))
        scenario.set_inputs(instance, 0.3)
        instance.must("EnterInitializationMode")
        # Some way off zero, where a start value of zero could hide a dependency.
        point = [_moved(v, x) for v, x in zip(knowns, instance.get(knowns))]
        instance.set(knowns, point)

        def evaluate(at):
            instance.set(knowns, at)
            return instance.get(unknowns)

        for k, v in enumerate(knowns):
            seed = [1.0 if i == k else 0.0 for i in range(len(knowns))]
            h = 1e-4 * max(abs(point[k]), 1e-2)
            low, high = v.number("min"), v.number("max")
            if (low is not None and point[k] - 2 * h < low) or (high is not None and point[k] + 2 * h > high):
                continue
            moved = [evaluate([x + m * h * s for x, s in zip(point, seed)]) for m in (-2, -1, 1, 2)]
            difference = [(a - 8 * b + 8 * c - d) / (12 * h) for a, b, c, d in zip(*moved)]
            values = evaluate(point)
            exact = instance.directional_derivative(unknowns, [v], [1.0])
            # Differences of a value V carry about V * 1e-16 / h; a V near zero may be a difference of nominal values.
            scale = [max(1e-6, max(abs(x), u.number("nominal") or 0.0) * 1e-9 / h) for x, u in zip(values, unknowns)]
            for u, a, b, s in zip(unknowns, exact, difference, scale):
                assert abs(a - b) <= 1e-6 * max(abs(a), abs(b), s), f"d {u.name} / d {v.name}: {a!r}, differences {b!r}"


def _moved(v, value):
    if v.causality == "parameter":
        return value
    return value + 0.05 * (v.number("nominal") or 1.0) * math.sin(v.index)


def test_co_simulation_derivatives_after_a_step_equal_those_of_model_exchange(fmu):
    """At the same states and inputs; outputs held by a sample are left out, they do not react before the next one."""
    knowns = [v for v in fmu.of("input") if v.is_real and v.variability == "continuous"]
    unknowns = [v for v in continuous_unknowns(fmu) if v.causality == "output"]
    if not knowns or not unknowns:
        pytest.skip("no continuous inputs or outputs")
    step = fmu.step_size
    with fmu.instantiate(raw.CO_SIMULATION) as slave, fmu.instantiate(raw.MODEL_EXCHANGE) as model:
        scenario.start(slave)
        slave.must("DoStep", 0.0, step, 0)
        scenario.enter_model_exchange(model)
        model.must("SetTime", step)
        if fmu.states:
            model.set_states(slave.get(fmu.states))
        for seed in seeds(knowns):
            expected = model.directional_derivative(unknowns, knowns, seed)
            assert slave.directional_derivative(unknowns, knowns, seed) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_continuous_unknowns_react_to_exactly_their_declared_dependencies(fmu, in_continuous_time, request):
    """Toward undeclared knowns the derivative is zero at every point tried; each declared one shows at some point."""
    instance, evaluate, point = in_continuous_time
    knowns = continuous_knowns(fmu)
    declared = {v.name: set(d.name for d in deps) for tag in ("Outputs", "Derivatives") for v, deps, _ in fmu.unknowns(tag)}
    seen = {v.name: set() for v in continuous_unknowns(fmu)}
    for draw in range(12):
        move = [0.3 * (v.number("nominal") or 1.0) for v in knowns]
        at = [x + d * math.sin(1.7 * draw + 0.9 * i) for i, (x, d) in enumerate(zip(point, move))]
        evaluate(at)
        for known in knowns:
            column = instance.directional_derivative(continuous_unknowns(fmu), [known], [1.0])
            for v, d in zip(continuous_unknowns(fmu), column):
                if d != 0.0:
                    seen[v.name].add(known.name)
                    assert known.name in declared[v.name], f"{v.name} reacts to {known.name}, which is not declared"
    if fmu.name in MOST_GENERAL and request.node.callspec.params["in_continuous_time"] != "most general":
        return
    names = {v.name for v in knowns}
    hidden = WITHOUT_SLOPE.get(fmu.name, set())
    for name, dependencies in seen.items():
        assert {d for d in declared[name] & names if (name, d) not in hidden} == dependencies, name


def test_initial_unknowns_react_to_their_declared_dependencies_only(fmu):
    """Each Real known of initialization is moved; whatever changes must declare it."""
    unknowns = fmu.unknowns("InitialUnknowns")
    _, knowns = initial_pairs(fmu)
    knowns += [v for v in fmu.of("input") if v.type in ("Boolean", "Integer", "String")]
    if not unknowns or not knowns:
        pytest.skip("no unknowns or knowns of initialization")
    variables = [v for v, _, _ in unknowns]
    declared = {v.name: {d.name for d in deps} for v, deps, _ in unknowns}
    with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
        instance.setup()
        scenario.set_parameters(instance, ANY_START.get(fmu.name, {}))
        instance.must("EnterInitializationMode")
        for known in knowns:
            before = instance.get(variables)
            (value,) = instance.get([known])
            other = _other(known, value)
            if other is None:
                continue
            instance.set([known], [other])
            for v, a, b in zip(variables, before, instance.get(variables)):
                assert raw.bits([a]) == raw.bits([b]) or known.name in declared[v.name], f"{v.name} <- {known.name}"
            instance.set([known], [value])


def _other(v, value):
    if v.type == "Boolean":
        return not value
    if v.type == "String":
        return value + " more"
    if v.type != "Real":
        return value + 1
    moved = value * 1.03 + 0.01 * (v.number("nominal") or 1.0)
    low, high = v.number("min"), v.number("max")
    if high is not None and moved > high:
        moved = value - 0.03 * (high - (low or 0.0))
    return moved
