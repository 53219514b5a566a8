"""Runs `airloop refine` on the studies of make_laws.py, scores the laws against their truth, and compares with PySINDy on the residual
force of the same records.

A law is right when its rms difference from the truth over the states of the records is at most 2 % of the rms of the truth, or when it is
one that the list holds and effects in its place leave noise; a null is right when no law is named. States of a law are integrated
along the true motion. The error left is that on the validation records over the noise there, which is what the true law leaves of the
true machine.

    python score_laws.py AIRLOOP CASES REPORTS [--no-peers] [--only REGEX]
"""

import argparse
import collections
import json
import pathlib
import re
import resource
import statistics
import subprocess
import tomllib

import numpy as np

RIGHT = 0.02
FUNCTIONS = {
    name: getattr(np, name) for name in ("sin", "cos", "tan", "tanh", "exp", "sqrt", "abs", "sign")
} | {"ln": np.log, "max": np.maximum, "min": np.minimum, "pi": np.pi, "clamp": lambda x, a, b: np.minimum(np.maximum(x, a), b)}


def curve(x, *points):
    """The curve of a formula by its description: cubic pieces with the slopes of parabolas, straight beyond the ends."""
    from scipy.interpolate import CubicHermiteSpline

    places, heights = np.array(points[::2], float), np.array(points[1::2], float)
    slopes = np.empty_like(places)
    h, d = np.diff(places), np.diff(heights) / np.diff(places)
    slopes[1:-1] = (d[:-1] * h[1:] + d[1:] * h[:-1]) / (h[:-1] + h[1:])
    bends = (d[1:] - d[:-1]) / (h[:-1] + h[1:])
    slopes[0], slopes[-1] = d[0] - bends[0] * h[0], d[-1] + bends[-1] * h[-1]
    inside = CubicHermiteSpline(places, heights, slopes)(np.clip(x, places[0], places[-1]))
    return inside + np.where(x < places[0], slopes[0] * (x - places[0]), 0) + np.where(x > places[-1], slopes[-1] * (x - places[-1]), 0)


def value(text, names):
    """Value of a formula for the values of its names."""
    return eval(text.replace("^", "**"), {"__builtins__": {}}, {"curve": curve, **FUNCTIONS, **names})


def values(law, points):
    """Values of a law at the points (x, v, t) of records one after the other; states are integrated along the motion."""
    parameters = {name: p["start"][0] for name, p in law["parameters"].items()}
    columns = dict(zip("xvt", points[:, :3].T), f=0.0)
    states = law.get("states", {})
    if not states:
        return np.broadcast_to(value(law["formula"], columns | parameters), len(points))
    found, z = [], dict.fromkeys(states, 0.0)
    for before, here in zip([None, *points[:-1]], points):
        if before is None or here[2] < before[2]:
            z = dict.fromkeys(states, 0.0)
        else:
            count = 20
            for part in (np.arange(count) + 0.5) / count:
                at = dict(zip("xvt", before[:3] + part * (here[:3] - before[:3])), f=0.0)
                rates = {name: value(rate, at | z | parameters) for name, rate in states.items()}
                z = {name: z[name] + rates[name] * (here[2] - before[2]) / count for name in states}
        found.append(value(law["formula"], dict(zip("xvt", here[:3]), f=0.0) | z | parameters))
    return np.array(found)


def judge(report, folder, truth):
    points = np.array(truth["points"])
    file = folder / "system" / "law.toml"
    if report["verdict"] != "law" or not file.exists():
        return None
    difference = values(tomllib.loads(file.read_text()), points) - points[:, 3]
    return float(np.sqrt(np.mean(difference**2) / max(np.mean(points[:, 3] ** 2), 1e-300)))


def peer(truth):
    """PySINDy (STLSQ) on the true states with the residual force as it is, the best threshold of several by held-out error."""
    import pysindy

    points = np.array(truth["points"])
    x, y = points[:, :2] / np.abs(points[:, :2]).max(0), points[:, 3]
    if truth["messy"]:
        y = y + 0.1 * np.std(y) * np.random.default_rng(0).standard_normal(len(y))
    library = pysindy.ConcatLibrary([pysindy.PolynomialLibrary(degree=5), pysindy.FourierLibrary(n_frequencies=4)])
    features = library.fit(x).transform(x)
    half = len(x) * 3 // 5
    best = None
    for threshold in (1e-3, 1e-2, 3e-2, 1e-1, 3e-1):
        optimizer = pysindy.STLSQ(threshold=threshold * np.std(y), alpha=1e-6)
        optimizer.fit(np.asarray(features[:half]), y[:half, None])
        found = np.asarray(features) @ optimizer.coef_.ravel()
        error = np.mean((found[half:] - y[half:]) ** 2)
        if best is None or error < best[0]:
            best = (error, found)
    if best is None:
        return None
    return float(np.sqrt(np.mean((best[1] - points[:, 3]) ** 2) / max(np.mean(points[:, 3] ** 2), 1e-300)))


def cpu():
    """Seconds of processor time of all runs so far."""
    own = resource.getrusage(resource.RUSAGE_CHILDREN)
    return own.ru_utime + own.ru_stime


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("airloop")
    parser.add_argument("cases", type=pathlib.Path)
    parser.add_argument("reports", type=pathlib.Path)
    parser.add_argument("--no-peers", action="store_true")
    parser.add_argument("--only", default=".", help="regular expression on the names of the cases")
    parser.add_argument("--limit", type=float, default=900.0, help="seconds after which a case counts as failed")
    args = parser.parse_args()
    table, seconds, lefts = collections.defaultdict(list), [], []
    for case in sorted(args.cases.iterdir()):
        if not re.search(args.only, case.name):
            continue
        truth, out = json.loads((case / "truth.json").read_text()), args.reports / case.name
        out.mkdir(parents=True, exist_ok=True)
        used = cpu()
        try:
            command = [args.airloop, "refine", case, "-q", "-o", out]
            failure = subprocess.run(command, capture_output=True, text=True, timeout=args.limit).stderr.strip()[:200]
        except subprocess.TimeoutExpired:
            failure = "out of time"
        seconds.append(cpu() - used)
        if not (out / "report.json").exists():
            print(f"{case.name:36s} failed: {failure}", flush=True)
            table[truth["family"], truth["messy"]].append((False, None, None))
            continue
        report = json.loads((out / "report.json").read_text())
        error = judge(report, out, truth) if truth["family"] != "null" else None
        other = None if args.no_peers or truth["family"] == "null" else peer(truth)
        if truth["family"] == "null":
            right = report["verdict"] != "law"
        else:
            listed = report["verdict"] == "effect" and report["complete"]
            right = listed or report["verdict"] == "law" and error is not None and error <= RIGHT
        formula = (report["law"] or {}).get("formula") if report.get("law") else None
        named = ",".join(e["id"] for e in report["effects"] if e["selected"])
        (after,) = report["residual"]["validation"]["rms_after"].values()
        left = after / truth["floor"]
        if truth["family"] != "null":
            lefts.append(left)
        shown = "-" if error is None else f"{100 * error:.2f} %"
        print(f"{case.name:36s} {report['verdict']:12s} {'right' if right else '     '} {shown:>9s} left {left:5.2f} {seconds[-1]:6.1f} s  {formula or named}", flush=True)
        table[truth["family"], truth["messy"]].append((right, report["verdict"], None if other is None else other <= RIGHT))
    print(f"\n{'family':12s} {'':6s} {'right':>8s} {'PySINDy':>8s}  verdicts")
    for (family, messy), rows in sorted(table.items()):
        verdicts = collections.Counter(v for _, v, _ in rows)
        peers = [p for *_, p in rows if p is not None]
        print(f"{family:12s} {'messy' if messy else 'exact':6s} {sum(r for r, *_ in rows):4d}/{len(rows):<3d} {sum(peers):4d}/{len(peers):<3d}  {dict(verdicts)}")
    for kind, messy, null in [("exact", False, False), ("messy", True, False), ("nulls", None, True)]:
        rows = [r for (family, own), rows in table.items() if (family == "null") == null and messy in (None, own) for r, *_ in rows]
        print(f"{kind}: {sum(rows)} of {len(rows)} right")
    if lefts:
        print(f"error left over that of the true law: median {statistics.median(lefts):.2f}, worst {max(lefts):.2f}")
    print(f"CPU time: median {statistics.median(seconds):.1f} s, worst {max(seconds):.1f} s")


if __name__ == "__main__":
    main()
