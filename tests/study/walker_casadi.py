"""Half step of the compass gait over its FMU against CasADi with IPOPT: `make study-walker`.

    .venv/bin/python tests/study/walker_casadi.py [folder, default out/study] [AIRLOOP] [A|B|J ...] [INTERVALS, default 30,10,30 60,20,60]

The problem is written out by hand, another way than ours: four coordinates of the robot pinned on its standing foot,
accelerations and the force of the second foot as variables, the equation of motion imposed at every knot and midpoint
(Hermite-Simpson, separated). Nothing of the project's own code is used. Both start from a hip that glides on a line.
Variant J is the joint problem: the toes (eq. 12 in continuous time) stand between the commands and the walker.

CPU time, the least of three runs: ours of stage 1 is that of a command without the second stage (opening the FMUs, building, solving,
writing), IPOPT's that of its solve alone; the ratio is between these. The whole command for B plans the motion, then finds the commands of the toes and runs both closed chains: two stages,
to which J is compared. Then IPOPT starts once more from our plan and has to stay there. Writes walker.csv; prints it as a table.
Nothing fails here: read the ratios.
"""

import csv
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"

import casadi as ca  # noqa: E402  (the number of threads comes first)
import numpy as np  # noqa: E402
from scipy.linalg import logm  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "04_half_step"
PROBLEMS = {"A": "variant_a.toml", "B": "problem.toml", "J": "joint.toml"}
RUNS = 3
COLUMNS = [
    "variant", "intervals", "objective", "durations", "iterations", "stage_1_cpu_s", "command_cpu_s", "status", "ipopt_objective", "ipopt_durations",
    "ipopt_iterations", "ipopt_solve_cpu_s", "ipopt_status", "ratio", "ipopt_from_ours_objective", "ipopt_from_ours_iterations", "joint_over_two_stages",
]  # fmt: skip

# Parameters of the walker (README of the FMU).
M3, D, I3 = 6.0, 0.10, 0.10
MU, A, IU = 3.7, 0.35, 0.20
MT, C, IT = 0.8, 0.10, 0.005
IR, G = 0.05, 9.81
MASS = M3 + 2 * (MU + MT)
LARGEST = np.array([60.0, 1055.5751, 1055.5751])
STEP = 0.25
K3 = (M3 * D**2 + I3) / 4
STATIC = [np.array([0, 139.302, -7.848]) / LARGEST, np.array([0, -7.848, 139.302]) / LARGEST]
RATE_COST, POSTURE = 4e-4, 1e-3
# Eq. 12, one cylinder in parts of its largest force: s(k+1) = Ad s + Bd c, force = s_2 + 0.0503 c; then in continuous time.
AD, B0 = np.array([[1.0081, -0.024], [0.0447, 0.9502]]), np.array([0.6297, 0.0503])
BD = np.array([-0.6141, -0.046]) + AD @ B0
TOE = logm(np.block([[AD, BD[:, None]], [np.zeros((1, 2)), np.eye(1)]])).real[:2] / 1e-3
COMMAND_COST = 1e-9
# The objective is some 0.04.
SCALE = 100.0


def foot_jacobian(th, length, i):
    """d(foot i)/dq, 2 by 6, of q = [x, y, th1, th2, l1, l2]."""
    jacobian = ca.SX.zeros(2, 6)
    jacobian[0, 0] = jacobian[1, 1] = 1
    jacobian[0, 2 + i], jacobian[1, 2 + i] = length[i] * ca.cos(th[i]), length[i] * ca.sin(th[i])
    jacobian[0, 4 + i], jacobian[1, 4 + i] = ca.sin(th[i]), -ca.cos(th[i])
    return jacobian


def floating(q, rates):
    """H, C q' + G of the floating base; q = [x, y, th1, th2, l1, l2]."""
    th, length, w, dl = ca.vertsplit(q[2:4]), ca.vertsplit(q[4:6]), rates[2:4], rates[4:6]
    th3, w3 = (th[0] + th[1]) / 2, (w[0] + w[1]) / 2
    h, bias = ca.SX.zeros(6, 6), ca.SX.zeros(6)
    h[0, 0] = h[1, 1] = MASS
    bias[0], bias[1] = M3 * D * ca.sin(th3) * w3**2, MASS * G - M3 * D * ca.cos(th3) * w3**2
    for i in range(2):
        s = MU * A + MT * (length[i] - C)
        sine, cosine = ca.sin(th[i]), ca.cos(th[i])
        h[0, 2 + i], h[1, 2 + i] = s * cosine - M3 * D / 2 * ca.cos(th3), s * sine - M3 * D / 2 * ca.sin(th3)
        h[0, 4 + i], h[1, 4 + i] = MT * sine, -MT * cosine
        h[2 + i, 2 + i] = MU * A**2 + MT * (length[i] - C) ** 2 + IU + IT + K3 + IR
        h[4 + i, 4 + i] = MT
        for row in (0, 1):
            h[2 + i, row], h[4 + i, row] = h[row, 2 + i], h[row, 4 + i]
        bias[0] += -s * sine * w[i] ** 2 + 2 * MT * cosine * w[i] * dl[i]
        bias[1] += s * cosine * w[i] ** 2 + 2 * MT * sine * w[i] * dl[i]
        bias[2 + i] = 2 * MT * (length[i] - C) * dl[i] * w[i] + s * G * sine - M3 * D * G / 2 * ca.sin(th3)
        bias[4 + i] = -MT * (length[i] - C) * w[i] ** 2 - MT * G * cosine
    h[2, 3] = h[3, 2] = K3 - IR
    return h, bias


def lift(p, v, standing, at):
    """q and d q/d p of the six coordinates for p = [th1, th2, l1, l2] with the standing foot at (`at`, 0)."""
    th, length = p[standing], p[2 + standing]
    q = ca.vertcat(at - length * ca.sin(th), length * ca.cos(th), p)
    slopes = ca.jacobian(q, p)
    rates = slopes @ v
    return q, slopes, rates, ca.jtimes(rates, p, v)


def mechanics(standing, at):
    """Functions of (p, v, a, u, force of the other foot): equation of motion, forces and motion of both feet."""
    p, v, a, u, other = (ca.SX.sym(name, n) for name, n in [("p", 4), ("v", 4), ("a", 4), ("u", 3), ("f", 2)])
    q, slopes, rates, bend = lift(p, v, standing, at)
    h, bias = floating(q, rates)
    tau, f1, f2 = ca.vertsplit(ca.DM(LARGEST) * u)
    drive = ca.vertcat(0, 0, -tau, tau, f1, f2)
    swinging = 1 - standing
    second = foot_jacobian(ca.vertsplit(q[2:4]), ca.vertsplit(q[4:6]), swinging)
    inertial = h @ (slopes @ a + bend) + bias - drive - second.T @ other
    # Of the hip's rows: the sum of the forces on the feet.
    stance = inertial[:2]
    th, length = p[swinging], p[2 + swinging]
    foot = ca.vertcat(q[0] + length * ca.sin(th), q[1] - length * ca.cos(th))
    foot_v = ca.jtimes(foot, p, v)
    foot_a = ca.jtimes(foot_v, p, v) + ca.jtimes(foot, p, a)
    return ca.Function("mechanics", [p, v, a, u, other], [slopes.T @ inertial, stance, foot, foot_v, foot_a])


def impact():
    """Residual of the impact in which both feet hold and foot 1 gets no impulse.

    H (v+ - v-) = J_1^T L_1 + J_2^T L_2 without the directions in which foot 1 holds; L_1 vanishes with the part of L_2 across
    leg 2, since an impulse along the leg moves its toe alone: one condition, not two.
    """
    p, before, after, impulse = ca.SX.sym("p", 4), ca.SX.sym("b", 4), ca.SX.sym("a", 4), ca.SX.sym("l", 2)
    q, slopes, rates, _ = lift(p, before, 0, 0.0)
    h, _ = floating(q, rates)
    second = foot_jacobian(ca.vertsplit(q[2:4]), ca.vertsplit(q[4:6]), 1)
    jump = h @ slopes @ (after - before) - second.T @ impulse
    across = ca.cos(p[1]) * impulse[0] + ca.sin(p[1]) * impulse[1]
    return ca.Function("impact", [p, before, after, impulse], [ca.vertcat(slopes.T @ jump, second @ slopes @ after, across)])


def steady(force):
    """States and command of a cylinder that delivers a constant force."""
    state = np.linalg.solve(np.eye(2) - AD, BD)
    command = force / (state[1] + B0[1])
    return np.append(state * command, command)


def toes(z, rates):
    """d z/dt, forces and their rates of both cylinders; z = [s, c, s, c], rates those of the commands."""
    slopes, forces, changes = [], [], []
    for i in range(2):
        own, rate = z[3 * i : 3 * i + 3], rates[i]
        slope = ca.DM(TOE) @ own
        slopes.append(ca.vertcat(slope, rate))
        forces.append(own[1] + B0[1] * own[2])
        changes.append(slope[1] + B0[1] * rate)
    return ca.vertcat(*slopes), ca.vertcat(*forces), ca.vertcat(*changes)


class Builder:
    """Variables and constraints of a nonlinear program, with scales."""

    def __init__(self):
        self.variables, self.start, self.scales, self.bounds = [], [], [], ([], [])
        self.rows, self.row_bounds = [], ([], [])
        self.objective = 0

    def variable(self, start, lower, upper, scale=1.0):
        start = np.atleast_1d(np.asarray(start, dtype=float))
        scales = np.broadcast_to(scale, start.shape)
        symbol = ca.MX.sym("x", len(start))
        self.variables.append(symbol)
        self.start.extend(start / scales)
        self.scales.extend(scales)
        self.bounds[0].extend(np.broadcast_to(lower, start.shape) / scales)
        self.bounds[1].extend(np.broadcast_to(upper, start.shape) / scales)
        return symbol * ca.DM(np.array(scales))

    def constrain(self, expression, lower, upper, scale=1.0):
        count = expression.numel() if hasattr(expression, "numel") else 1
        self.rows.append(expression / scale)
        self.row_bounds[0].extend(np.broadcast_to(np.asarray(lower) / scale, count))
        self.row_bounds[1].extend(np.broadcast_to(np.asarray(upper) / scale, count))


FORCE = 100.0


class Phase:
    """Nodes (knots and midpoints) of one phase, s = 0, 1/(2N), ..., 1."""

    def __init__(self, b, variant, number, count, duration, limits, guess):
        self.b, self.count, self.variant, self.number = b, count, variant, number
        standing = 1 if number == 2 else 0
        self.f = mechanics(standing, STEP if standing else 0.0)
        self.swinging = 1 - standing
        self.duration = b.variable([duration], *limits)
        self.nodes = []
        for k in range(2 * count + 1):
            start = guess(number, k / (2 * count))
            torque = b.variable(start["u"] if variant != "J" else start["u"][:1], -1, 1, 0.1)
            rate = b.variable(start["r"] if variant != "J" else start["r"][:1], -500, 500) if variant != "A" else None
            node = {
                "p": b.variable(start["p"], [-0.6, -0.6, 0.9, 0.9], [0.6, 0.6, 1.05, 1.05], [0.3, 0.3, 0.1, 0.1]),
                "v": b.variable(start["v"], [-8, -8, -1, -1], [8, 8, 1, 1]),
                "a": b.variable(start["a"], -np.inf, np.inf, 10.0),
                "u": torque,
                "f": b.variable(start["f"], -np.inf, np.inf, FORCE) if number == 1 else ca.DM.zeros(2),
                "r": rate,
                "drive": torque,
                "drive_rate": rate,
            }
            if variant == "J":
                limits_of_toe = np.array([np.inf, np.inf, 1] * 2)
                node["z"] = b.variable(start["z"], -limits_of_toe, limits_of_toe, 0.1)
                node["dc"] = b.variable(start["dc"], -np.inf, np.inf)
                slopes, forces, changes = toes(node["z"], node["dc"])
                node.update({"dz": slopes, "u": ca.vertcat(torque, forces), "r": ca.vertcat(rate, changes)})
            node["out"] = self.f(node["p"], node["v"], node["a"], node["u"], node["f"])
            self.nodes.append(node)
        for k, node in enumerate(self.nodes):
            self.node(k, node)
        for k in range(count):
            self.interval(*self.nodes[2 * k : 2 * k + 3])

    def node(self, k, node):
        b, last = self.b, 2 * self.count
        motion, stance, foot, _, foot_a = node["out"]
        s = k / last
        b.constrain(motion, 0, 0, 10.0)
        p, v = node["p"], node["v"]
        b.constrain(p[1] - p[0], -0.8, 0.8)
        b.constrain(v[1] - v[0], -8, 8)
        if self.number == 1:
            b.constrain(foot_a, 0, 0, 10.0)
            self.cone(node["f"])
        if not (self.number == 1 and k == last and self.variant != "A"):
            self.cone(stance)
        if self.number != 1 and 0 < k < last:
            # In the first fifth of its swing foot 1 rises with the third power of time: 0.1 mm of room, as in ours.
            room = 0.02 if 0.2 <= s <= 0.8 else -1e-4 if self.number == 2 and s < 0.2 else 0.0
            b.constrain(foot[1], room, np.inf, 0.1)

    def cone(self, force):
        self.b.constrain(0.6 * force[1] - force[0], 0, np.inf, FORCE)
        self.b.constrain(0.6 * force[1] + force[0], 0, np.inf, FORCE)

    def interval(self, left, middle, right):
        b, h = self.b, self.duration / self.count
        pairs = [("p", "v"), ("v", "a")] + ([("drive", "drive_rate")] if self.variant != "A" else [])
        pairs += [("z", "dz")] if self.variant == "J" else []
        for x, rate in pairs:
            x0, x1, xm = left[x], right[x], middle[x]
            f0, f1, fm = left[rate], right[rate], middle[rate]
            b.constrain(xm - (x0 + x1) / 2 - h / 8 * (f0 - f1), 0, 0)
            b.constrain(x1 - x0 - h / 6 * (f0 + 4 * fm + f1), 0, 0)

        def density(node):
            running = ca.sumsqr(node["u"]) + POSTURE * ca.sumsqr((node["p"][2:4] - 1.02) / 0.05)
            running += RATE_COST * ca.sumsqr(node["r"]) if self.variant != "A" else 0
            return running + (COMMAND_COST * ca.sumsqr(node["dc"]) if self.variant == "J" else 0)

        b.objective += h / 6 * (density(left) + 4 * density(middle) + density(right))


def problem(variant, counts, guess):
    b = Builder()
    limits = [(0.15, 2.5), (0.05, 0.20), (0.15, 2.5)]
    phases = [Phase(b, variant, i, counts[i], guess.durations[i], limits[i], guess) for i in range(3)]
    first, last = phases[0].nodes[0], phases[2].nodes[-1]
    fix = lambda a, value: b.constrain(a - ca.DM(np.asarray(value, dtype=float)), 0, 0)  # noqa: E731
    fix(first["p"], [0, 0, 1.045, 1.0])
    fix(first["v"], np.zeros(4))
    fix(last["p"], [0, 0, 1.0, 1.045])
    fix(last["v"], np.zeros(4))
    landing, after = phases[0].nodes[-1], phases[1].nodes[0]
    _, _, foot, foot_v, _ = landing["out"]
    fix(foot, [STEP, 0])
    b.constrain(foot_v[1], -0.4, -0.1)
    impulse = b.variable([0.0, 1.0], -np.inf, np.inf)
    b.constrain(after["p"] - landing["p"], 0, 0)
    b.constrain(impact()(landing["p"], landing["v"], after["v"], impulse), 0, 0)
    phases[0].cone(FORCE * impulse)
    release, free = phases[1].nodes[-1], phases[2].nodes[0]
    b.constrain(free["p"] - release["p"], 0, 0)
    b.constrain(free["v"] - release["v"], 0, 0)
    if variant != "A":
        for name in ("drive", "z") if variant == "J" else ("drive",):
            b.constrain(after[name] - landing[name], 0, 0)
            b.constrain(free[name] - release[name], 0, 0)
        if variant == "J":
            fix(first["drive"], [0.0])
            fix(first["z"], np.concatenate([steady(force) for force in STATIC[0][1:]]))
        else:
            fix(first["u"], STATIC[0])
        fix(last["u"], STATIC[1])
        b.constrain(release["out"][1], 0, 0, FORCE)
    else:
        b.constrain(free["out"][4][1], 0, np.inf, 10.0)
    return b, phases


class Glide:
    """The hip glides on a line, the swinging foot moves on a line; no accelerations."""

    durations = [0.8, 0.15, 0.8]

    def __init__(self):
        self.begin = np.concatenate([[0], np.cumsum(self.durations)])

    def place(self, t):
        hip = np.array([STEP * t / self.begin[3], 1.03])
        feet = [np.array([0.0, 0.0]), np.array([STEP, 0.0])]
        if t < self.begin[1]:
            s = t / self.begin[1]
            feet[1] = (1 - s) * np.array([0, 0.045]) + s * feet[1]
        elif t > self.begin[2]:
            s = (t - self.begin[2]) / self.durations[2]
            feet[0] = s * np.array([STEP, 0.045])
        legs = [foot - hip for foot in feet]
        return np.array([np.arctan2(x, -y) for x, y in legs] + [np.hypot(x, y) for x, y in legs])

    def __call__(self, number, s):
        t = self.begin[number] + s * self.durations[number]
        step = 1e-4
        inside = np.clip(t, self.begin[number] + step, self.begin[number + 1] - step)
        v = (self.place(inside + step * 0.99) - self.place(inside - step * 0.99)) / (2 * 0.99 * step)
        share = [1.0, 0.5, 0.0][number] if number != 1 else 1 - s
        u = share * STATIC[0] + (1 - share) * STATIC[1]
        force = [0.0, MASS * G * s] if number == 1 else [0, 0]
        return {"p": self.place(t), "v": v, "a": np.zeros(4), "u": u, "f": force, "r": np.zeros(3),
                "z": np.concatenate([steady(share) for share in u[1:]]), "dc": np.zeros(2)}  # fmt: skip


class Plan:
    """A plan of `airloop optimize` at knots and midpoints; what it does not hold follows from it."""

    def __init__(self, folder, variant):
        summary = json.loads((folder / "summary.json").read_text())
        self.durations = summary["durations"]
        with open(folder / "trajectory.csv") as file:
            rows = list(csv.DictReader(file))
        self.phases = [[row for row in rows if int(row["phase"]) == i + 1] for i in range(3)]
        self.variant = variant
        self.f = [mechanics(int(i == 2), STEP if i == 2 else 0.0) for i in range(3)]

    def __call__(self, number, s):
        rows = self.phases[number]
        row = rows[round(s * (len(rows) - 1))]
        # Variant A is a single FMU, whose variables have no prefix.
        read = lambda names: np.array([float(row.get(n) or row[n.removeprefix("walker.")]) for n in names])  # noqa: E731
        p = read(["walker.th1", "walker.th2", "walker.l1", "walker.l2"])
        v = read(["walker.omega1", "walker.omega2", "walker.dl1", "walker.dl2"])
        if self.variant == "B":
            u, r = read(["forces.x[1]", "forces.x[2]", "forces.x[3]"]), read(["tau_rate", "F1_rate", "F2_rate"])
        elif self.variant == "J":
            u, r = read(["torque.x[1]", "toe1.y[1]", "toe2.y[1]"]), read(["tau_rate", "toe1.y[2]", "toe2.y[2]"])
        else:
            u, r = read(["walker.tau", "walker.F1", "walker.F2"]) / LARGEST, np.zeros(3)
        force = read(["walker.foot2.ft", "walker.foot2.fn"]) if number == 1 else np.zeros(2)
        # The equation of motion is linear in the accelerations.
        zero = np.array(self.f[number](p, v, np.zeros(4), u, force)[0])[:, 0]
        columns = [np.array(self.f[number](p, v, e, u, force)[0])[:, 0] - zero for e in np.eye(4)]
        a = np.linalg.solve(np.column_stack(columns), -zero)
        node = {"p": p, "v": v, "a": a, "u": u, "f": force, "r": r}
        if self.variant == "J":
            node["z"] = read([f"toe{i}.x[{j}]" for i in (1, 2) for j in (1, 2, 3)])
            node["dc"] = read(["c1_rate", "c2_rate"])
        return node


def solve(variant, counts, guess, warm=False):
    b, phases = problem(variant, counts, guess)
    x = ca.vertcat(*b.variables)
    nlp = {"x": x, "f": SCALE * b.objective, "g": ca.vertcat(*b.rows)}
    options = {"ipopt.print_level": 0, "print_time": False, "record_time": True, "ipopt.tol": 1e-8, "ipopt.max_iter": 1000, "expand": True}
    if warm:
        options.update({"ipopt.mu_init": 1e-6, "ipopt.bound_push": 1e-8, "ipopt.bound_frac": 1e-8, "ipopt.slack_bound_push": 1e-8,
                        "ipopt.slack_bound_frac": 1e-8})  # fmt: skip
    solver = ca.nlpsol("solver", "ipopt", nlp, options)
    found = solver(x0=b.start, lbx=b.bounds[0], ubx=b.bounds[1], lbg=b.row_bounds[0], ubg=b.row_bounds[1])
    stats = solver.stats()
    durations = ca.Function("durations", [x], [ca.vertcat(*[phase.duration for phase in phases])])(found["x"])
    return {
        "objective": float(found["f"]) / SCALE, "iterations": stats["iter_count"], "status": stats["return_status"],
        "cpu": stats["t_proc_total"], "durations": np.array(durations)[:, 0],
    }  # fmt: skip


def stage_one(problem, folder):
    """A copy of a problem file without the commands of the toes: the first stage alone."""
    text = problem.read_text()
    text = re.sub(r"(?ms)^\[feed_forward.*?(?=^\[(?!feed_forward))", "", text)
    system = re.search(r'(?m)^system = "(.*)"$', text).group(1)
    alone = folder / "stage_one.toml"
    alone.write_text(re.sub(r"(?ms)^\[variants\].*?(?=^\[)", "", text).replace(f'"{system}"', f'"{problem.parent / system}"'))
    return alone


def ours(airloop, problem, counts, folder):
    """Summary, and the least CPU time of three runs."""
    command = [airloop, "optimize", problem, "--intervals", ",".join(map(str, counts)), "-o", folder]
    times = []
    for _ in range(RUNS):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([*map(str, command), "--no-verification", "--no-plots", "--threads", "1", "--quiet"], check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return json.loads((folder / "summary.json").read_text()), min(times)


def text(durations):
    return " ".join(f"{duration:.4f}" for duration in durations)


def main():
    words = sys.argv[1:]
    meshes = [[int(n) for n in word.split(",")] for word in words if "," in word] or [[30, 10, 30], [60, 20, 60]]
    variants = [word for word in words if word in ("A", "B", "J")] or ["A", "B", "J"]
    places = [Path(word) for word in words if "," not in word and word not in ("A", "B", "J")]
    folder = next((place for place in places if not place.is_file()), ROOT / "out" / "study")
    airloop = next((place for place in places if place.is_file()), ROOT / "target" / "release" / "airloop")
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "walker.csv", "w", newline="") as file, tempfile.TemporaryDirectory() as scratch:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        two_stages = {}
        print("variant intervals  iterations  objective     durations              stage 1  all [CPU s]   IPOPT: iterations  objective     durations              CPU s  ratio  from ours: objective, iterations")
        for variant in variants:
            for counts in meshes:
                problem_file = EXAMPLE / PROBLEMS[variant]
                _, alone = ours(airloop, stage_one(problem_file, Path(scratch)), counts, Path(scratch) / "alone")
                summary, cpu = ours(airloop, problem_file, counts, Path(scratch) / "plan")
                peers = [solve(variant, counts, Glide()) for _ in range(RUNS)]
                peer = min(peers, key=lambda peer: peer["cpu"])
                again = solve(variant, counts, Plan(Path(scratch) / "plan", variant), warm=True)
                if variant == "B":
                    two_stages[tuple(counts)] = cpu
                share = cpu / two_stages[tuple(counts)] if variant == "J" and tuple(counts) in two_stages else None
                row = dict(zip(COLUMNS, [
                    variant, " ".join(map(str, counts)), summary["objective"], text(summary["durations"]), summary["iterations"], alone, cpu,
                    summary["status"], peer["objective"], text(peer["durations"]), peer["iterations"], peer["cpu"], peer["status"],
                    alone / peer["cpu"], again["objective"], again["iterations"], share,
                ], strict=True))  # fmt: skip
                writer.writerow(row)
                print(
                    f"{variant:7} {row['intervals']:10} {row['iterations']:10}  {row['objective']:.9f}   {row['durations']}  {alone:7.2f}  {cpu:6.2f}"
                    f"   {row['ipopt_iterations']:17}  {row['ipopt_objective']:.9f}   {row['ipopt_durations']}  {peer['cpu']:6.2f}"
                    f"  {row['ratio']:5.2f}  {again['objective']:.9f} {again['iterations']}  [{row['status']}; {row['ipopt_status']}]"
                    + (f"  {share:.2f} times the two stages" if share else ""),
                    flush=True,
                )
    print(f"written: {folder / 'walker.csv'}")


if __name__ == "__main__":
    main()
