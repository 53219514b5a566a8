"""Trials of the swing-up with the regulator and with model predictive control, as a table.

    python tests/study/nmpc.py AIRLOOP OUT [COUNT]

The plan of example 03 at 4, 8 and 12 times its perturbation, and a plan with tighter bounds of stroke and force, which both
are active. `held` and `bounds` are the criteria of the example's `stabilize.toml`.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "03_swing_up"
SCALES = [4, 8, 12]
STROKE, FORCE = 80, 50  # [mm], [N]; the plan of the example needs more of both
TIGHT_SCALES = [2, 4]


def airloop(binary, *arguments):
    subprocess.run([binary, *map(str, arguments)], check=True, cwd=ROOT)


def tighter(out):
    """Problem and settings with the tighter bounds."""
    problem = (EXAMPLE / "problem.toml").read_text()
    problem = problem.replace("../01_run/system.ssd", str(ROOT / "examples" / "01_run" / "system.ssd"))
    settings = (EXAMPLE / "stabilize.toml").read_text()
    problem = re.sub(r"150 mm", f"{STROKE} mm", problem)
    problem = problem.replace("157.07963267948966", str(FORCE))
    settings = re.sub(r"150 mm", f"{STROKE} mm", settings).replace("151 mm", f"{STROKE + 1} mm")
    settings = settings.replace("158.07963267948966", str(FORCE + 1))
    files = out / "tight_problem.toml", out / "tight_settings.toml"
    for file, text in zip(files, (problem, settings)):
        file.write_text(text)
    return files


def main():
    binary, out = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
    count = int(sys.argv[3]) if len(sys.argv) > 3 else 200
    out.mkdir(parents=True, exist_ok=True)
    cases = [("as in the example", EXAMPLE / "problem.toml", EXAMPLE / "stabilize.toml", SCALES)]
    cases.append((f"{STROKE} mm, {FORCE} N", *tighter(out), TIGHT_SCALES))
    rows = ["| bounds | perturbation | controller | reach | held | bounds kept |", "|---|---|---|---|---|---|"]
    for number, (name, problem, settings, scales) in enumerate(cases):
        plan = out / f"plan_{number}"
        grid = ["--transcription", "multiple-shooting", "--intervals", 400, "--no-plots", "-q"]
        airloop(binary, "optimize", problem, *grid, "-o", plan)
        for scale in scales:
            for controller, flags in [("regulator", []), ("predictive", ["--nmpc"])]:
                closed = out / f"{controller}_{number}"
                airloop(binary, "stabilize", *flags, plan, settings, "--no-plots", "-q", "-o", closed)
                folder = out / f"trials_{controller}_{number}_{scale}"
                airloop(binary, "trials", closed, "--count", count, "--scale", scale, "--no-plots", "-q", "-o", folder)
                summary = json.loads((folder / "summary.json").read_text())
                kept = {criterion["name"]: criterion["closed_loop"] for criterion in summary["criteria"]}
                numbers = " | ".join(str(kept[key]) for key in ("reach", "held", "bounds"))
                rows.append(f"| {name} | {scale} times | {controller} | {numbers} |")
                print(rows[-1], flush=True)
    (out / "nmpc.md").write_text("\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
