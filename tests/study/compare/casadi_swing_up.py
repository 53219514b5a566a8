"""The swing-up of example 03 by `airloop optimize` over the FMUs, and by CasADi with IPOPT over equations typed for it.

    .venv/bin/python tests/study/compare/casadi_swing_up.py [INTERVALS, default 100]

Both from the same guess, one thread, processor time, the best of three. airloop's holds everything from the start of the program to the files on the
disk; of CasADi's the imports are left out. `make study-swing-up` compares the solvers alone, over more meshes.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import pendulum as work

# Multiple shooting is left to `make study-swing-up`: CasADi sets it up for minutes.
KINDS = {"hs": "hermite-simpson", "trap": "trapezoidal"}


def ours(kind, intervals):
    """Objective, iterations and seconds."""
    best = None
    for _ in range(3):
        with tempfile.TemporaryDirectory() as folder:
            words = ["--transcription", KINDS[kind], "--intervals", intervals, "--threads", "1", "--no-verification", "--no-plots"]
            problem = work.ROOT / "examples" / "03_swing_up" / "problem.toml"
            command = [work.ROOT / "target" / "release" / "airloop", "optimize", problem, *words, "-q", "-o", folder]
            with work.Timer() as timer:
                subprocess.run(command, check=True)
            summary = json.loads((Path(folder) / "summary.json").read_text())
        assert summary["status"] == "solved", summary["message"]
        best = min(best or timer.seconds, timer.seconds)
    return summary["objective"], summary["iterations"], best


def theirs(kind, intervals):
    """Objective, iterations, seconds of the solve and of the set-up, of the faster form of the expressions."""
    script = work.ROOT / "tests" / "reference" / "swing_up_ipopt.py"
    printed = subprocess.run([sys.executable, script, kind, intervals], check=True, capture_output=True, text=True).stdout
    rows = [line.split() for line in printed.splitlines()[1:]]
    rows = [(float(row[4]), int(row[3]), float(row[5]) / 1e3, float(row[6]) / 1e3) for row in rows]
    return min(rows, key=lambda row: row[2] + row[3])


def main(intervals="100"):
    print("| transcription | airloop: objective | iterations | all [s] | CasADi, IPOPT: objective | iterations | set-up [s] | solve [s] |")
    print("|---|---|---|---|---|---|---|---|")
    for kind, name in KINDS.items():
        objective, iterations, seconds = ours(kind, intervals)
        peer, peer_iterations, solve, set_up = theirs(kind, intervals)
        print(f"| {name} | {objective:.4f} | {iterations} | {seconds:.2f} | {peer:.4f} | {peer_iterations} | {set_up:.2f} | {solve:.2f} |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
