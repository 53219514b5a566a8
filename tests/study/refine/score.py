"""Counts the right answers of `airloop refine` on the cases of make_cases.py.

    python score.py AIRLOOP CASES OUT [--left] [--bound]

Runs the program on every case that has no report yet, writes OUT/confusion.csv (a row per case), OUT/confusion.md
(classes, and which effect was taken for which) and prints the table. With --left, the answers are simulated again by
rig.py: error of windowed predictions on the validation records, after over before. With --bound, the widths of the 95 %
intervals are compared with the Cramer-Rao bound (bound.py). An answer that says that the records cannot tell the true
effect from the selected one counts as `in a group`.
"""
import argparse
import collections
import csv
import json
import os
import pathlib
import subprocess
import time
import tomllib

import numpy as np

from bound import bounds
from rig import DECLARED, simulate

UNITS = {"F_hat": 0.3, "F_p": 0.3, "x": 2e-3, "theta": 1e-2}


def key(effect):
    return effect["id"], effect.get("signal")


def judge(truth, report):
    """Right answer (the true effects and nothing else; `none`; `unexplained` at the right channel), first effect, channel."""
    selected = [e for e in report["effects"] if e["selected"]]
    found = {key(e) for e in selected}
    true = {key(e) for e in truth.get("effects", [])}
    if truth["verdict"] != "effect":
        right = report["verdict"] == truth["verdict"]
        where = truth["verdict"] == "none" or (report["unexplained"] or {}).get("channel") == truth["unexplained"]["channel"]
        return right and where, right, where
    named = found | ({key(e) for e in report["effects"] if e["group"] is not None} if truth["class"] == "few sensors" else set())
    first = bool(selected) and (key(selected[0]) in true or truth["class"] == "few sensors" and true <= named)
    channels = {e["channel"] for e in truth["effects"]}
    where = bool(selected) and (selected[0]["channel"] in channels or first)
    return true <= named and len(found) == len(true), first, where


def left(folder, report):
    """Error of windowed predictions with the answer over that of the declared model, on the validation records."""
    data = np.load(folder / "truth.npz") if (folder / "truth.npz").exists() else {}
    if "states" not in data:
        return None
    n = data["u"].shape[1]
    plant = {k: np.full(n, v) for k, v in DECLARED.items()}
    chosen = {e["id"]: {k: v["value"] for k, v in e["params"].items()} for e in report["effects"] if e["selected"] and not e["signal"]}
    lanes = [{}] * n + [chosen] * n
    both = lambda a: np.concatenate([a, a], axis=-1).astype(float)
    out = simulate(lanes, both(data["u"]).T, np.zeros(2 * n), np.zeros(2 * n), {k: np.tile(v, 2) for k, v in plant.items()},
                   np.zeros((len(data["u"]), 2 * n)), centring=0.0, restart=both(data["states"]))
    error = lambda part: np.sqrt(sum(np.mean(((out[k][:, part] - data[k]) / UNITS[k]) ** 2) for k in UNITS))
    return float(error(slice(n, None)) / error(slice(0, n)))


def answer(program, case, target, limit=None):
    """The report of a case, made unless there is one; seconds.txt: CPU and wall time, exit code (`-` when out of time)."""
    if not (target / "report.json").exists():
        target.mkdir(parents=True, exist_ok=True)
        begin = os.times().children_user, time.monotonic()
        try:
            code = subprocess.run([program, "refine", case, "-o", target, "-q"], check=False, timeout=limit).returncode
        except subprocess.TimeoutExpired:
            code = "-"
        (target / "seconds.txt").write_text(f"{os.times().children_user - begin[0]:.2f} {time.monotonic() - begin[1]:.2f} {code}\n")
    return json.loads((target / "report.json").read_text()) if (target / "report.json").exists() else None


def row_of(case, report, seconds, again, bound=None):
    truth = tomllib.loads((case / "truth.toml").read_text())
    exact, first, where = judge(truth, report)
    inside = parameters = 0
    widths = []
    grouped = {key(e) for e in report["effects"] if e["selected"] or e["group"] is not None}
    alike = truth["verdict"] == "effect" and not exact and {key(e) for e in truth["effects"]} <= grouped
    for effect in truth.get("effects", []):
        for found in report["effects"]:
            if found["selected"] and key(found) == key(effect):
                for name, value in effect["params"].items():
                    low, high = found["params"][name]["ci95"]
                    inside += low <= value <= high
                    parameters += 1
                    if bound and bound.get((effect["id"], name), 0.0) > 0.0:
                        widths.append((high - low) / (2 * 1.96 * bound[effect["id"], name]))
    name = lambda e: e["id"] + (f"({e['signal']})" if e.get("signal") else "")
    plain = truth["class"] not in ("parameters off", "first principles", "other cylinder", "other cylinder, control", "outside", "control")
    share = left(case, report) if again and plain and not any(e.get("signal") for e in truth["effects"]) else None
    return dict(case=case.name, cls=truth["class"], truth=" ".join(sorted(map(name, truth.get("effects", [])))) or truth["verdict"],
                verdict=report["verdict"], selected=" ".join(sorted(name(e) for e in report["effects"] if e["selected"])) or report["verdict"],
                channel=(report["unexplained"] or {}).get("channel", ""), exact=exact, first=first, where=where,
                alike=alike, inside=inside, parameters=parameters, widths=" ".join(f"{w:.2f}" for w in widths), left=share, seconds=round(seconds, 2))


def dimensions(cases, out):
    """Table of the fitted dimensions of cylinders that no case states: relative errors, and how many intervals hold the truth."""
    errors, inside = collections.defaultdict(list), collections.Counter()
    for case in cases:
        truth, report = tomllib.loads((case / "truth.toml").read_text()), out / case.name / "report.json"
        if not truth["class"].startswith("other cylinder") or not report.exists():
            continue
        for found in json.loads(report.read_text())["corrections"]:
            if found["component"] == "cylinder":
                name, (low, high) = found["parameter"], found["ci95"]
                errors[name].append(abs(found["value"] / truth[name] - 1.0))
                inside[name] += low <= truth[name] <= high
    if not errors:
        return []
    lines = ["", "| dimension | cases | error, median | largest | in 95 % intervals |", "|---|---|---|---|---|"]
    return lines + [f"| {name} | {len(own)} | {np.median(own):.2%} | {max(own):.2%} | {inside[name]} |" for name, own in errors.items()]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("cases", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--left", action="store_true")
    parser.add_argument("--bound", action="store_true")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    rows = []
    known = bounds(sorted(p.parent for p in args.cases.glob("*/truth.toml"))) if args.bound else {}
    for case in sorted(p.parent for p in args.cases.glob("*/truth.toml")):
        target = args.out / case.name
        report, seconds = answer(args.program, case, target), target / "seconds.txt"
        if report is None:
            print(f"{case.name}: no report")
            continue
        rows.append(row_of(case, report,
                           float(seconds.read_text().split()[0]) if seconds.exists() else 0.0,
                           args.left, known.get(case.name)))
    with (args.out / "confusion.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    lines = ["| class | cases | exact | first effect | channel | in a group | parameters in 95 % intervals | width over bound, median | left, median | CPU s, median | largest |",
             "|---|---|---|---|---|---|---|---|---|---|---|"]
    for cls in sorted({r["cls"] for r in rows}):
        own = [r for r in rows if r["cls"] == cls]
        count = lambda name: sum(r[name] for r in own)
        shares = [r["left"] for r in own if r["left"] is not None]
        times = [r["seconds"] for r in own]
        widths = [float(w) for r in own for w in r["widths"].split()]
        lines.append(f"| {cls} | {len(own)} | {count('exact')} | {count('first')} | {count('where')} | {count('alike')} | {count('inside')} of {count('parameters')} | "
                     f"{f'{np.median(widths):.2f}' if widths else ''} | "
                     f"{f'{np.median(shares):.4f}' if shares else ''} | {np.median(times):.1f} | {max(times):.1f} |")
    confused = collections.Counter((r["truth"], r["selected"], r["channel"]) for r in rows if not r["exact"])
    lines += ["", "| truth | answer | channel of what is unexplained | cases |", "|---|---|---|---|"]
    lines += [f"| {truth} | {answer} | {where} | {n} |" for (truth, answer, where), n in sorted(confused.items())]
    lines += dimensions(sorted(p.parent for p in args.cases.glob("*/truth.toml")), args.out)
    (args.out / "confusion.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
