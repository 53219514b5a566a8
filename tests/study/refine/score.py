"""Counts the right answers of `airloop refine` on the cases of make_cases.py.

    python score.py AIRLOOP CASES OUT

Runs the program on every case that has no report yet, writes OUT/confusion.csv and prints a table.
"""
import collections
import csv
import json
import pathlib
import subprocess
import sys
import tomllib


def key(effect):
    return effect["id"], effect.get("signal")


def judge(truth, report):
    """Whether the answer is right: the true effects and nothing else, `none`, or `unexplained` at the right channel."""
    if truth["verdict"] != "effect":
        right = report["verdict"] == truth["verdict"]
        if truth["verdict"] == "unexplained":
            right = right and report["unexplained"]["channel"] == truth["unexplained"]["channel"]
        return right
    true = {key(e) for e in truth["effects"]}
    selected = {key(e) for e in report["effects"] if e["selected"]}
    if truth["class"] == "few sensors":
        grouped = selected | {key(e) for e in report["effects"] if e["group"] is not None}
        return true <= grouped and len(selected) == len(true)
    return true == selected


def main():
    program, cases, out = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    out.mkdir(parents=True, exist_ok=True)
    counts, inside, rows = collections.defaultdict(lambda: [0, 0]), [0, 0], []
    for case in sorted(p.parent for p in cases.glob("*/truth.toml")):
        target = out / case.name
        if not (target / "report.json").exists():
            subprocess.run([program, "refine", case, "-o", target, "-q"], check=False)
        truth = tomllib.loads((case / "truth.toml").read_text())
        report = json.loads((target / "report.json").read_text())
        right = judge(truth, report)
        counts[truth["class"]][0] += right
        counts[truth["class"]][1] += 1
        for effect in truth.get("effects", []):
            for found in report["effects"]:
                if found["selected"] and key(found) == key(effect):
                    for name, value in effect["params"].items():
                        low, high = found["params"][name]["ci95"]
                        inside[0] += low <= value <= high
                        inside[1] += 1
        named = " ".join(e["id"] for e in report["effects"] if e["selected"])
        rows.append([case.name, truth["class"], report["verdict"], named, right])
    with (out / "confusion.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["case", "class", "verdict", "selected", "right"], *rows])
    for name, (right, all_) in counts.items():
        print(f"{name:20} {right:3} of {all_}")
    print(f"intervals hold the truth: {inside[0]} of {inside[1]}")
    print("\n".join(f"wrong: {row}" for row in rows if not row[-1]))


if __name__ == "__main__":
    main()
