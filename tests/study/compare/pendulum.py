"""The work that the comparisons share: the pendulum of example 06, whose declared model has viscous damping only.

    I theta'' = -m g l sin(theta) - b theta' - what is missing

Records and segments are those of examples/06_study/study.toml. The truth (make_records.py there) lacks dry friction of
4e-4 N.m and air drag of 3e-5 N.m.s2; an encoder measures the angle with an offset of 3 mrad.
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
STUDY = ROOT / "examples" / "06_study"
M, L, G = 0.15, 0.15, 9.81
TRUTH = {"coulomb": 4.0e-4, "quadratic drag": 3.0e-5}
# White noise of 0.2 mrad, and the rounding of an encoder with steps of 0.5 mrad.
NOISE = np.hypot(2e-4, 5e-4 / np.sqrt(12))
STEP = 0.01


def segments():
    """Angles of the estimation record and of the two for validation, sampled at 10 ms."""
    swing, tail = (np.loadtxt(STUDY / name, delimiter=",", skiprows=1)[:, 1] for name in ("swing.csv", "tail.csv"))
    cut = round(14.0 / STEP)
    return [swing[: cut + 1]], [swing[cut:], tail]


class Timer:
    """Processor time of this process and its children, in a ``with`` block."""

    def __enter__(self):
        self.began = self._now()
        return self

    def __exit__(self, *_):
        self.seconds = self._now() - self.began

    @staticmethod
    def _now():
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        return time.process_time() + children.ru_utime + children.ru_stime


def refine():
    """The report of `airloop refine` on one thread, and its processor time."""
    program = ROOT / "target" / "release" / "airloop"
    with tempfile.TemporaryDirectory() as folder, Timer() as timer:
        done = subprocess.run([program, "refine", STUDY, "--threads", "1", "-q", "-o", folder], cwd=ROOT)
        if done.returncode not in (0, 10, 11, 12, 13):
            sys.exit("airloop refine failed")
        report = json.loads((Path(folder) / "report.json").read_text())
    return report, timer.seconds


def print_refine():
    """The row of airloop in the tables of the comparisons."""
    report, seconds = refine()
    for effect in report["effects"]:
        if effect["selected"]:
            values = ", ".join(f"{name} = {p['value']:.3g} {p['unit']}" for name, p in effect["params"].items())
            print(f"airloop refine: {effect['id']}: {values}")
    rms = report["residual"]["validation"]
    before, after = (1e3 * list(rms[name].values())[0] for name in ("rms_before", "rms_after"))
    print(f"airloop refine: verdict {report['verdict']}, rms on validation {before:.2f} mrad before, {after:.2f} mrad after, "
          f"{seconds:.1f} s of processor time")
