"""Swing-up over the coupled FMUs against CasADi with IPOPT and with fatrop: `make study-swing-up`.

    .venv/bin/python tests/study/swing_up.py [folder, default out/study] [INTERVALS ..., default 200]

All from the pump guess, one thread, CPU time, the best of three; IPOPT and ours in turns. Ours counts everything from the
files on: opening the FMUs, building the problem, solving it. Of the others only the solve counts, of IPOPT in the faster of two forms of the expressions;
their set-up is a column of its own. Then IPOPT starts once more from our optimum and has to stay there.

Writes swing_up.csv, one row per transcription and mesh; prints it as a table. Nothing fails here: read the ratios.
Then ours alone with ten times the first number of intervals: time and iterations per interval against those of that number.

After that re-solves of the swing-up with 50 intervals (hs), initial states 2 % off (`orchestrator/plan/benches/resolve.rs`),
over our FMUs and over the same without directional derivatives, as other tools export them: resolve.txt. `resolves` as
the only argument beside the folder leaves the rest out.
"""

import csv
import json
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "reference"))

import numpy as np  # noqa: E402
import swing_up_fatrop as second_peer  # noqa: E402  (needs the path above)
import swing_up_ipopt as peer  # noqa: E402

KINDS = ("hs", "trap", "ms", "sc")
ROUNDS = 3
MANY = 10
COLUMNS = [
    "kind", "intervals", "iterations", "objective", "load_ms", "build_ms", "solve_ms", "total_ms", "status",
    "ipopt_iterations", "ipopt_objective", "ipopt_solve_ms", "ipopt_setup_ms", "ratio", "ipopt_from_ours_relative_difference",
    "fatrop_iterations", "fatrop_objective", "fatrop_solve_ms", "fatrop_setup_ms", "fatrop_ratio",
    "fatrop_relative_difference",
]  # fmt: skip


def build(bench):
    """Path of a built bench."""
    command = ["cargo", "bench", "--quiet", "-p", "airloop-plan", "--bench", bench, "--no-run", "--message-format=json"]
    output = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    messages = [json.loads(line) for line in output.splitlines() if line.startswith("{")]
    return next(m["executable"] for m in messages if m.get("executable") and m["target"]["name"] == bench)


def ours(bench, kind, count, file):
    output = subprocess.run(
        [bench, kind, str(count), f"solution={file}"], check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    words = output.splitlines()[1].split(maxsplit=9)
    numbers = [float(word) for word in words[4:9]]
    return {
        "iterations": int(words[3]), "objective": numbers[0], "load_ms": numbers[1], "build_ms": numbers[2],
        "solve_ms": numbers[3], "total_ms": numbers[4], "status": words[9],
    }  # fmt: skip


def row(bench, kind, count, file):
    found, solved = None, None
    for _ in range(ROUNDS):
        now = ours(bench, kind, count, file)
        found = now if found is None or now["total_ms"] < found["total_ms"] else found
        # The graph of scalars of multiple shooting takes seconds to set up and is no faster.
        for expand in (False,) if kind == "ms" else (True, False):
            now = peer.solve(kind, count, expand, repetitions=1)
            solved = now if solved is None or now[2] < solved[2] else solved
    # One set-up for all rounds: it takes longer than they do. What is not solved has no time.
    staged = second_peer.solve(kind, count, repetitions=ROUNDS)
    if not staged[4]:
        staged = (staged[0], np.nan, np.nan, *staged[3:])
    start = np.loadtxt(file)
    _, again, *_ = peer.solve(kind, count, False, start, 1)
    return {
        "kind": kind, "intervals": count, **found, "ipopt_iterations": solved[0], "ipopt_objective": solved[1],
        "ipopt_solve_ms": 1e3 * solved[2], "ipopt_setup_ms": 1e3 * solved[3],
        "ratio": found["total_ms"] / (1e3 * solved[2]),
        "ipopt_from_ours_relative_difference": abs(again - found["objective"]) / again,
        "fatrop_iterations": staged[0], "fatrop_objective": staged[1],
        "fatrop_solve_ms": 1e3 * staged[2], "fatrop_setup_ms": 1e3 * staged[3],
        "fatrop_ratio": found["total_ms"] / (1e3 * staged[2]),
        "fatrop_relative_difference": abs(staged[1] - found["objective"]) / found["objective"],
    }  # fmt: skip


def many(bench, count, found):
    """Prints what an interval costs where there are ten times as many. `found`: the row of every kind with `count` intervals."""
    print("\nkind  count  iterations  from files to optimum, ms  per interval, us  ratio  per iteration, too")
    with tempfile.TemporaryDirectory() as scratch:
        for kind in KINDS:
            rounds = [ours(bench, kind, MANY * count, Path(scratch) / "solution.txt") for _ in range(ROUNDS)]
            costs = []
            for own in (found[kind], min(rounds, key=lambda one: one["total_ms"])):
                intervals = count if not costs else MANY * count
                cost = 1e3 * own["total_ms"] / intervals
                costs.append((cost, cost / own["iterations"]))
                ratios = [now / first for now, first in zip(costs[-1], costs[0])]
                print(
                    f"{kind:5} {intervals:5} {own['iterations']:11} {own['total_ms']:26.1f} {cost:17.1f} {ratios[0]:6.2f} {ratios[1]:19.2f}",
                    flush=True,
                )


def without_derivatives(scratch):
    """The problem file of example 03 over copies of its FMUs that offer no directional derivatives."""
    for name in ("01_run", "03_swing_up"):
        shutil.copytree(ROOT / "examples" / name, scratch / "examples" / name)
    system = scratch / "examples" / "01_run" / "system.ssd"
    (scratch / "target" / "fmu").mkdir(parents=True)
    for fmu in set(re.findall(r'source="\.\./\.\./target/fmu/([^"]+\.fmu)"', system.read_text())):
        source, target = (folder / "target" / "fmu" / fmu for folder in (ROOT, scratch))
        with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as new:
            for item in old.infolist():
                content = old.read(item)
                if item.filename == "modelDescription.xml":
                    content, found = re.subn(rb'providesDirectionalDerivative="true"', b'providesDirectionalDerivative="false"', content)
                    assert found, f"{fmu}: no derivatives to take away"
                new.writestr(item, content)
    return scratch / "examples" / "03_swing_up" / "problem.toml"


def resolves(folder):
    bench, text = build("resolve"), ""
    with tempfile.TemporaryDirectory() as scratch:
        for title, words in (
            ("re-solves over the FMUs", []),
            ("re-solves over the FMUs without directional derivatives", [without_derivatives(Path(scratch)), "draws=20"]),
        ):
            output = subprocess.run([bench, *map(str, words)], check=True, stdout=subprocess.PIPE, text=True).stdout
            text += f"{title}\n{output}\n"
            print(f"\n{title}\n{output}", end="", flush=True)
    (folder / "resolve.txt").write_text(text)


def main():
    words = [word for word in sys.argv[1:] if word != "resolves"]
    counts = [int(word) for word in words if word.isdigit()] or [200]
    folder = Path(next((word for word in words if not word.isdigit()), ROOT / "out" / "study"))
    folder.mkdir(parents=True, exist_ok=True)
    if "resolves" in sys.argv[1:]:
        resolves(folder)
        return
    bench, first = build("swing_up_fmus"), {}
    with open(folder / "swing_up.csv", "w", newline="") as file, tempfile.TemporaryDirectory() as scratch:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        print(
            "kind  count  iterations  objective          from files to optimum, ms   IPOPT's solve, ms  ratio  IPOPT from ours"
            "   fatrop's solve, ms  ratio  its objective from ours"
        )
        for kind in KINDS:
            for count in counts:
                now = row(bench, kind, count, Path(scratch) / "solution.txt")
                writer.writerow(now)
                first.setdefault(kind, now)
                print(
                    f"{kind:5} {count:5} {now['iterations']:11} {now['objective']:17.9f} {now['total_ms']:17.1f} "
                    f"{now['ipopt_solve_ms']:27.1f} {now['ratio']:6.2f}  {now['ipopt_from_ours_relative_difference']:.1e}"
                    f"{now['fatrop_solve_ms']:28.1f} {now['fatrop_ratio']:6.2f}  {now['fatrop_relative_difference']:.1e}",
                    flush=True,
                )
    many(bench, counts[0], first)
    resolves(folder)
    print(f"written: {folder / 'swing_up.csv'}, resolve.txt")


if __name__ == "__main__":
    main()
