#!/usr/bin/env python3
"""The program for Windows under Wine: same numbers as on Linux, all FMUs clean, the same answer of `refine`.

    python3 tests/windows/run.py target/windows target/release/airloop

The functions of the C library (tanh, sin) round the last digit otherwise, so that results differ by some 1e-15; more than
1e-12 of the largest value of a signal fails.
"""

import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TOLERANCE = 1e-12
WORDS = ("run", "examples/01_run/system.ssd", "--measured", "data/rig/v05/trial_07.csv")
MASTERS = ("gauss-seidel", "jacobi", "monolithic")


def main():
    built, program = (Path(path).resolve() for path in sys.argv[1:])
    wine = shutil.which("wine")
    if wine is None:
        sys.exit("wine is not on the PATH. On Debian: apt-get install wine64")
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        environment = {**os.environ, "WINEDEBUG": "-all", "WINEPREFIX": str(folder / "prefix"), "WINEPATH": windows(folder)}

        def on_windows(*words):
            return run([wine, built / "airloop.exe", *words], environment)

        if subprocess.run([wine, built / "airloop.exe", "--version"], env=environment, capture_output=True).returncode:
            subprocess.run(
                ["x86_64-w64-mingw32-gcc", "-shared", "-O2", "-o", folder / "bcryptprimitives.dll", Path(__file__).with_name("bcryptprimitives.c"), "-ladvapi32"],
                check=True,
            )
        print(on_windows("--version").strip())
        for master in MASTERS:
            words = [*WORDS, "--master", master, "-o"]
            on_windows(*words, folder / "wine")
            run([program, *words, folder / "linux"], os.environ)
            largest = difference(folder / "wine/result.csv", folder / "linux/result.csv")
            print(f"{master}: differs from Linux by {largest:.1e} of the largest value of a signal at most")
            if largest > TOLERANCE:
                sys.exit("too much")
        fmus = sorted((ROOT / "target/fmu").glob("*.fmu")) + sorted((ROOT / "target/fmu/fmi3").glob("*.fmu"))
        for fmu in fmus:
            on_windows("inspect", "--check", fmu)
        print(f"{len(fmus)} FMUs: no error found by inspect --check")
        answers = []
        for name, command in (("wine", on_windows), ("linux", lambda *words: run([program, *words], os.environ))):
            command("refine", "data/rig/v01", "-o", folder / f"refine-{name}")
            answers.append(json.loads((folder / f"refine-{name}" / "report.json").read_text()))
        named = [[one for one in answer["effects"] if one["selected"]] for answer in answers]
        print("refine data/rig/v01:", ", ".join(one["id"] for one in named[0]))
        if not same(*named):
            sys.exit(f"on Windows {named[0]}, on Linux {named[1]}")


def windows(folder):
    return "Z:" + str(folder).replace("/", "\\")


def run(command, environment):
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))} ended with {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout


def difference(one, other):
    tables = []
    for path in (one, other):
        rows = list(csv.reader(path.open()))
        tables.append((rows[0], [[float(cell) for cell in row] for row in rows[1:]]))
    (head, ours), (other_head, theirs) = tables
    if head != other_head or len(ours) != len(theirs):
        sys.exit(f"{one} and {other} have other rows or columns")
    largest = 0.0
    for ours, theirs in zip(zip(*ours), zip(*theirs)):
        scale = max(map(abs, theirs)) or 1.0
        largest = max(largest, max(abs(a - b) for a, b in zip(ours, theirs)) / scale)
    return largest


def same(ours, theirs):
    """Whether two answers agree, numbers to six digits."""
    if isinstance(ours, float) and isinstance(theirs, float):
        return abs(ours - theirs) <= 1e-6 * max(abs(ours), abs(theirs))
    if isinstance(ours, dict) and isinstance(theirs, dict):
        return ours.keys() == theirs.keys() and all(same(ours[key], theirs[key]) for key in ours)
    if isinstance(ours, (list, tuple)) and isinstance(theirs, (list, tuple)):
        return len(ours) == len(theirs) and all(map(same, ours, theirs))
    return ours == theirs


if __name__ == "__main__":
    main()
