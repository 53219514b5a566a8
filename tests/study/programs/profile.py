"""Solve rate and time on nonlinear programs, ours and IPOPT through CasADi: `make study-programs`.

    .venv/bin/python tests/study/programs/profile.py [folder, default out/study-programs] [NAME ...]

Both from the published starts, with the same tolerance (1e-8) and limit of iterations (3000), one thread, the least
time of five solves. Ours is `orchestrator/optim/benches/programs.rs`, by the interior point method and by SQP from the
same cold start. A program counts as solved where the solver says so, violations are below 1e-6; its end is worse than
another's where the objective is larger by 1e-6 (relative, above 1 in magnitude).

Writes programs.csv, one row per program; prints those that one solver did not solve or ended worse, and the profile:
in how many programs each was solved within 1, 2, 4 ... times the shorter time.
"""

import csv
import json
import math
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import casadi  # noqa: E402  (needs the path above)
import numpy as np  # noqa: E402
import read  # noqa: E402

ROOT = Path(__file__).resolve().parents[3]
OPTIONS = {
    "ipopt": {"max_iter": 3000, "print_level": 0, "sb": "yes", "tol": 1e-8},
    "print_time": False, "show_eval_warnings": False, "error_on_fail": False,
}  # fmt: skip
REPETITIONS = 5
MAX_VIOLATION = 1e-6
WORSE = 1e-6
SOLVERS = ("interior_point", "sqp", "ipopt")
FIELDS = ("status", "objective", "violation", "iterations", "functions", "ms")


def ours(words):
    """Rows of the bench by program."""
    command = ["cargo", "bench", "--quiet", "-p", "airloop-optim", "--bench", "programs", "--no-run", "--message-format=json"]
    output = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    messages = [json.loads(line) for line in output.splitlines() if line.startswith("{")]
    bench = next(m["executable"] for m in messages if m.get("executable") and m["target"]["name"] == "programs")
    lines = subprocess.run([bench, *words], check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    return {row["name"]: row for row in csv.DictReader(lines)}


def ipopt(program):
    """The end of IPOPT's run, as a row of the bench."""
    rows = casadi.vertcat(*program.rows)
    solver = casadi.nlpsol("solver", "ipopt", {"x": program.x, "f": program.objective, "g": rows}, OPTIONS)
    functions = casadi.Function("functions", [program.x], [program.objective, rows])
    shortest = math.inf
    for _ in range(REPETITIONS):
        begin = time.perf_counter()
        end = solver(
            x0=program.start, lbx=program.lower, ubx=program.upper, lbg=program.row_lower, ubg=program.row_upper
        )
        shortest = min(shortest, time.perf_counter() - begin)
    stats = solver.stats()
    x = np.array(end["x"]).ravel()
    objective, values = (np.array(part).ravel() for part in functions(x))
    gaps = [np.array(program.lower) - x, x - np.array(program.upper)]
    gaps += [np.array(program.row_lower) - values, values - np.array(program.row_upper)]
    return {
        "status": "Solved" if stats["return_status"] == "Solve_Succeeded" else stats["return_status"],
        "objective": float(objective[0]), "violation": max(0.0, *(gap.max() for gap in gaps if gap.size)),
        "iterations": stats["iter_count"], "functions": stats["n_call_nlp_f"], "ms": 1e3 * shortest,
    }  # fmt: skip


def solved(end):
    return end["status"] in ("Solved", "Acceptable", "Solved_To_Acceptable_Level") and float(end["violation"]) <= MAX_VIOLATION


def worse(end, other):
    a, b = float(end["objective"]), float(other["objective"])
    return a - b > WORSE * max(1.0, abs(b))


def main():
    folder = Path(next((word for word in sys.argv[1:] if "/" in word), ROOT / "out" / "study-programs"))
    names = [word for word in sys.argv[1:] if "/" not in word]
    folder.mkdir(parents=True, exist_ok=True)
    ends = {"interior_point": ours(names), "sqp": ours(["sqp", *names]), "ipopt": {}}
    programs = [program for program in read.programs() if not names or program.name in names]
    with open(folder / "programs.csv", "w", newline="") as file:
        writer = csv.writer(file)
        columns = [f"{solver}_{field}" for solver in SOLVERS for field in FIELDS]
        writer.writerow(["name", "variables", "constraints", "minimum", *columns])
        for program in programs:
            name = program.name
            ends["ipopt"][name] = ipopt(program)
            three = [ends[solver][name] for solver in SOLVERS]
            best = min([math.inf, *(float(end["objective"]) for end in three if solved(end))])
            for solver, end in zip(SOLVERS, three):
                if not solved(end) or worse(end, {"objective": best}):
                    known = program.minima[0]
                    print(f"{name:9} {solver:14} {end['status']:20} f = {float(end['objective']):<16.9g} best {best:<16.9g} known {known:.9g}")
            writer.writerow([name, len(program.start), len(program.rows), program.minima[0], *(end[field] for end in three for field in FIELDS)])
    count = len(programs)
    print(f"\n{count} programs         solved  known minimum  the best  worse  median ms  total ms   within 1, 2, 4, 8, 16 of the shortest time")
    for solver in SOLVERS:
        of = [ends[solver][program.name] for program in programs]
        good = [solved(end) for end in of]
        known = sum(g and not worse(end, {"objective": p.minima[0]}) for g, end, p in zip(good, of, programs))
        times = [float(end["ms"]) for end in of]
        best, within = 0, [0] * 5
        for program, end, g, own in zip(programs, of, good, times):
            all_good = [other for other in (ends[s][program.name] for s in SOLVERS) if solved(other)]
            best += g and not any(worse(end, other) for other in all_good)
            # SQP is not a solver of its own from afar: the times that count are those of the two interior point methods.
            pair = [float(ends[s][program.name]["ms"]) for s in ("interior_point", "ipopt") if solved(ends[s][program.name])]
            for k in range(5):
                within[k] += g and own <= 2**k * min(pair, default=math.inf)
        print(
            f"{solver:20} {sum(good):6}  {known:13}  {best:8}  {sum(good) - best:5}  {np.median(times):9.3f}  {sum(times):8.1f}   "
            + ", ".join(str(w) for w in within)
        )
    print(f"written: {folder / 'programs.csv'}")


if __name__ == "__main__":
    main()
