"""Runs `airloop refine` on the studies of make_machines.py and scores what it names against their truth.

A cubic spring is right when its coefficient, of the effect `cubic_spring` or of a law whose least-squares cubic it is, lies within 2 %
of the truth or within twice its Cramer-Rao bound; the oscillator when every test part is left with 1.0 mV or less; the tanks when an
overflow or a law leaves 0.55 V or less and takes a fifth of the error (with exact records: when the threshold lies within 3 % of the truth); a machine that lacks nothing
when no law and no effect is named.

    python score_machines.py AIRLOOP CASES REPORTS [--only REGEX]
"""

import argparse
import collections
import json
import pathlib
import re
import statistics
import subprocess
import tomllib

import numpy as np

from score_laws import cpu, value

MAX_ERROR = 0.02
MAX_OSCILLATOR = 1.0e-3
MAX_TANKS = 0.55
MAX_THRESHOLD_ERROR = 0.03
# Of the errors of the tanks after and before.
MAX_RATIO = 0.8


def named(report):
    """Words on what was named."""
    law = report.get("law")
    effects = [e for e in report["effects"] if e["selected"]]
    if law:
        return f"law@{law['port']}: {law['formula']} " + " ".join(f"{k}={p['value']:.5g}" for k, p in law["params"].items())
    return "; ".join(e["id"] + " " + " ".join(f"{k}={p['value']:.5g}" for k, p in e["params"].items()) for e in effects)


def cubic(report, folder):
    """Coefficient of the cubic of what was named, and its part beyond cubic, linear and constant."""
    for effect in report["effects"]:
        if effect["selected"] and effect["id"].startswith("cubic_spring"):
            return effect["params"]["stiffness"]["value"], 0.0
    law, file = report.get("law"), folder / "system" / "law.toml"
    if not law or not file.exists() or "curve" in law["formula"]:
        return None
    data = tomllib.loads(file.read_text())
    largest = max(np.abs(np.loadtxt(r, delimiter=",", skiprows=1)[:, 2]).max() for r in (folder / "case").glob("r*.csv"))
    x = np.linspace(-largest, largest, 401)
    own = {name: p["start"][0] for name, p in data["parameters"].items()}
    y = value(data["formula"], {"x": x, "v": 0.0, "t": 0.0, "f": 0.0} | own) + 0 * x
    basis = np.array([x**3, x**2, x, np.ones_like(x)]).T
    found, *_ = np.linalg.lstsq(basis, y, rcond=None)
    return float(found[0]) * (-1 if data.get("port") == "signal" else 1), float(np.std(y - basis @ found) / np.std(y))


def validation(report):
    own = report["residual"]["validation"]
    name = next(iter(own["rms_before"]))
    return own["rms_before"][name], own["rms_after"].get(name, float("nan"))


def threshold(report):
    """Parameters that say from which level on something acts."""
    law = report.get("law")
    params = dict(law["params"]) if law else {}
    for effect in report["effects"]:
        params |= effect["params"] if effect["selected"] else {}
    return [p["value"] for name, p in params.items() if name in ("level", "pos") or re.fullmatch(r"m\d?b?", name)]


def right(truth, report, folder):
    """Whether the answer is right, and a word on it."""
    law, family = truth["law"], truth["family"]
    before, after = validation(report)
    if law is None:
        return not any(e["selected"] for e in report["effects"]) and report["verdict"] != "law", f"{before:.4g} -> {after:.4g}"
    if family == "spring":
        found = cubic(report, folder)
        if found is None:
            return False, f"{before:.3g} -> {after:.3g}"
        error, beyond = abs(found[0] / law["c"] - 1), found[1]
        limit = max(MAX_ERROR, 2 * law["deviation"] / law["c"])
        return error <= limit and beyond <= MAX_ERROR, f"{100 * error:.2f} % of {100 * limit:.2f} %"
    if family == "oscillator":
        return report["verdict"] in ("law", "effect") and after <= MAX_OSCILLATOR, f"{1e3 * before:.2f} -> {1e3 * after:.3f} mV"
    if truth["exact"]:
        places = threshold(report)
        error = min((abs(place / law["level"] - 1) for place in places), default=np.inf)
        return error <= MAX_THRESHOLD_ERROR, f"threshold {100 * error:.1f} % off, {before:.4f} -> {after:.4f} V"
    return report["verdict"] in ("law", "effect") and after <= min(MAX_TANKS, MAX_RATIO * before), f"{before:.3f} -> {after:.3f} V"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("airloop")
    parser.add_argument("cases", type=pathlib.Path)
    parser.add_argument("reports", type=pathlib.Path)
    parser.add_argument("--only", default=".")
    parser.add_argument("--limit", type=float, default=900.0, help="seconds after which a case counts as failed")
    args = parser.parse_args()
    table, seconds = collections.defaultdict(list), []
    for case in sorted(args.cases.iterdir()):
        if not re.search(args.only, case.name) or not (case / "truth.json").exists():
            continue
        truth, out = json.loads((case / "truth.json").read_text()), args.reports / case.name
        out.mkdir(parents=True, exist_ok=True)
        if not (out / "case").exists():
            (out / "case").symlink_to(case.resolve())
        used = cpu()
        try:
            run = subprocess.run([args.airloop, "refine", case, "-q", "-o", out], capture_output=True, text=True, timeout=args.limit)
            failure = run.stderr.strip()[:200]
        except subprocess.TimeoutExpired:
            failure = "out of time"
        seconds.append(cpu() - used)
        kind = truth["family"] + ("" if truth["law"] else " none")
        if not (out / "report.json").exists():
            print(f"{case.name:22s} failed: {failure}", flush=True)
            table[kind].append(False)
            continue
        report = json.loads((out / "report.json").read_text())
        good, words = right(truth, report, out)
        table[kind].append(good)
        print(f"{case.name:22s} {report['verdict']:11s} {'right' if good else '     '} {words:32s} {seconds[-1]:6.1f} s  {named(report)}", flush=True)
    print()
    for kind, rows in sorted(table.items()):
        print(f"{kind:18s} {sum(rows)}/{len(rows)}")
    if seconds:
        print(f"CPU time: median {statistics.median(seconds):.1f} s, worst {max(seconds):.1f} s")


if __name__ == "__main__":
    main()
