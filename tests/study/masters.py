"""Error of every master against the work it takes: `make study`.

    .venv/bin/python tests/study/masters.py [folder, default out/study]

The problem is that of tests/reference (pneumatic cart-pole, 20 N at 1 Hz, 3 s) with the command held for 1 ms, and for
the longer steps of 2 and 5 ms as long as the step. Every master runs over a row of communication steps through the
`airloop` binary. The error is the RMS error relative to the RMS of the reference [%], at rows 10 ms apart; the work is
the number of fmi2DoStep calls, for `monolithic` (which makes none) that of evaluations of the system.

Writes masters.csv (one row per run) and masters.svg and masters.png (error in x over FMU steps). A run that fails has
its first line of the error in column `problem`. Errors of some 2e-11 % are those of the reference.
"""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "reference"))

import make_held_reference as held  # noqa: E402  (needs the path above)

matplotlib.use("Agg")
matplotlib.rcParams["svg.hashsalt"] = "airloop"  # the same figure from the same numbers
import matplotlib.pyplot as plt  # noqa: E402

SYSTEM = ROOT / "examples" / "01_run" / "system.ssd"
STATES = ("x", "theta", "v", "omega")
ROW = 10.0  # ms between the rows of the stored references
SHORT = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1)  # ms
LONG = (2, 5)

# name: (options, communication steps in ms)
MASTERS = {
    "Gauss-Seidel": (["--master", "gauss-seidel"], SHORT + LONG),
    "Gauss-Seidel, extrapolation 1": (["--master", "gauss-seidel", "--extrapolation", "1"], SHORT),
    "Gauss-Seidel, extrapolation 2": (["--master", "gauss-seidel", "--extrapolation", "2"], SHORT),
    "Jacobi": (["--master", "jacobi"], SHORT),
    "Jacobi, extrapolation 1": (["--master", "jacobi", "--extrapolation", "1"], SHORT),
    "interface-Jacobian": (["--master", "interface-jacobian"], (0.5, 1) + LONG),
    "interface-Jacobian, held inputs": (["--master", "interface-jacobian", "--inputs", "held"], (0.1, 0.2, 0.5, 1) + LONG),
    "interface-Jacobian, no correction": (["--master", "interface-jacobian", "--corrections", "0"], (0.1, 0.2, 0.5, 1) + LONG),
}
TOLERANCES = ("1e-4", "1e-6", "1e-8", "1e-10")  # of monolithic, instead of steps
COLUMNS = ["master", "step_ms", "tolerance", "work", "work_unit", *(f"error_{name}_percent" for name in STATES), "problem"]


def command_file(folder, hold):
    path = folder / f"command_{hold}ms.csv"
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "u"])
        writer.writerows([f"{k * 1e-3:.3f}", repr(float(held.held_command(k, hold)))] for k in range(3001))
    return path


def references():
    """{hold in ms: {state: values each 10 ms}}"""
    plain = np.genfromtxt(ROOT / "tests" / "data" / "reference_cart_pole.csv", delimiter=",", names=True)
    longer = np.genfromtxt(held.DATA, delimiter=",", names=True)
    found = {1: {name: plain[name] for name in STATES}}
    for hold in held.HOLDS:
        found[hold] = {name: longer[f"{name}_{hold}ms"] for name in STATES}
    return found


def run(folder, step, inputs, truth, options):
    """Row of the table without the master's name."""
    binary = Path(os.environ.get("AIRLOOP", ROOT / "target" / "release" / "airloop"))
    words = [binary, "run", SYSTEM, "--stop", "3", "--step", f"{step}ms", "--input", inputs, "--interpolation", "hold"]
    output = folder / "run"
    done = subprocess.run([*map(str, words), *options, "--no-plots", "-q", "-o", str(output)], capture_output=True, text=True)
    if done.returncode:
        return {"problem": (done.stderr.strip().splitlines() or ["no message"])[0]}
    summary = json.loads((output / "summary.json").read_text())
    work, unit = summary["effort"]["fmu_steps"], "fmi2DoStep"
    if "integration" in summary:
        work, unit = summary["integration"]["evaluations"], "evaluations of the system"
    result = np.genfromtxt(output / "result.csv", delimiter=",", names=True, deletechars="")
    stride = round(ROW / step)
    row = {"work": work, "work_unit": unit}
    for name in STATES:
        error = np.sqrt(np.mean((result[name][::stride] - truth[name]) ** 2) / np.mean(truth[name] ** 2))
        row[f"error_{name}_percent"] = f"{100 * error:.4g}"
    return row


def table(folder):
    truth = references()
    inputs = {hold: command_file(folder, hold) for hold in truth}
    rows = []

    def add(master, step, options, **more):
        hold = max(1, round(step))
        rows.append({"master": master, "step_ms": step, **more, **run(folder, step, inputs[hold], truth[hold], options)})
        last = rows[-1]
        print(f"{master:34} {step:5} ms  {last.get('work', ''):>8}  x {last.get('error_x_percent', last.get('problem'))} %", flush=True)

    for master, (options, steps) in MASTERS.items():
        for step in steps:
            add(master, step, options)
    for tolerance in TOLERANCES:
        add("monolithic", 1, ["--master", "monolithic", "--tolerance", tolerance], tolerance=tolerance)
    return rows


def draw(rows, folder):
    figure, axes = plt.subplots(figsize=(9, 6), layout="constrained")
    for number, master in enumerate(dict.fromkeys(row["master"] for row in rows)):
        good = [row for row in rows if row["master"] == master and "work" in row]
        pairs = [(row["work"], float(row["error_x_percent"])) for row in good]
        # What rings grows without bound, which would squeeze all others into a corner.
        pairs = sorted((work, error) for work, error in pairs if 0 < error < 100)
        if pairs:
            style = "--" if master == "monolithic" else "-"
            label = f"{master} (evaluations of the system)" if master == "monolithic" else master
            axes.loglog(*zip(*pairs), style, marker="osv^Dd<>X"[number % 9], label=label)
    axes.axhline(0.01, color="0.6", linewidth=1)
    axes.set_xlabel("FMU steps (fmi2DoStep) for 3 s")
    axes.set_ylabel("RMS error in x relative to its RMS [%]")
    axes.set_title("Pneumatic cart-pole, 20 N at 1 Hz, against SciPy Radau")
    axes.grid(True, which="major", alpha=0.4)
    axes.legend(fontsize="small")
    figure.savefig(folder / "masters.svg", metadata={"Date": None})
    figure.savefig(folder / "masters.png", dpi=120)


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "out" / "study").resolve()
    folder.mkdir(parents=True, exist_ok=True)
    rows = table(folder)
    with open(folder / "masters.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, restval="")
        writer.writeheader()
        writer.writerows(rows)
    draw(rows, folder)
    for name in ("masters.csv", "masters.svg", "masters.png"):
        print(folder / name)


if __name__ == "__main__":
    main()
