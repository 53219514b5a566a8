"""Judges the answers of `airloop refine` on messy rigs: the cases of make_messy.py, and w01 to w07 of rig_messy.

    python score_messy.py AIRLOOP CASES OUT [--jobs 2] [--only REGEX] [--limit SECONDS]

Runs the program on every case that has no report yet; writes OUT/messy.csv and OUT/messy.md (a row per case) and prints a
summary. A case with an effect is right when the verdict is "effect" (exit code 0 or 12) and the true effect is the first
selected one; `other_effects` are the other selected ones, those that only correct a declared parameter stand under
`corrections`. `listed`: the true effect heads the list, selected or not. On a control nothing but corrections may be selected. Fields that a report lacks are shown as "-".
"""
import argparse
import concurrent.futures
import csv
import pathlib
import re
import tomllib

import numpy as np

from score import answer, key

CORRECTIONS = {"act.gain", "pf.viscous", "pf.coulomb", "cf.coulomb", "cf.offset", "pole.viscous", "cart.mass", "pole.length", "pole.payload"}
NONE = "-"


def label(effect):
    return effect["id"] + (f"({effect['signal']})" if effect.get("signal") else "")


def row_of(case, report, run):
    truth = tomllib.loads((case / "truth.toml").read_text())
    true = next(iter(truth.get("effects", [])), None)
    selected = [e for e in report.get("effects", []) if e.get("selected")]
    others = [e for e in selected if true is None or key(e) != key(true)]
    # A corrected parameter that no effect of the vocabulary changes has no id.
    corrections = {c["id"] or f"{c['component']}.{c['parameter']}" for c in report.get("corrections", [])} | {e["id"] for e in others if e["id"] in CORRECTIONS}
    row = dict(case=case.name, truth=label(true) if true else "none", verdict=report.get("verdict", "no report"), exit=run[2] if len(run) > 2 else NONE,
               selected=" ".join(map(label, selected)) or NONE, first=bool(true and selected and key(selected[0]) == key(true)),
               listed=bool(true and report.get("effects") and key(report["effects"][0]) == key(true)), right=False,
               other_effects=" ".join(label(e) for e in others if e["id"] not in CORRECTIONS) or NONE, corrections=" ".join(sorted(corrections)) or NONE,
               error=NONE, inside=NONE, share=NONE, true_share=truth.get("share", NONE), complete=report.get("complete", NONE),
               seconds=float(run[1]) if len(run) > 1 else NONE)
    if true is None:
        row["right"] = row["verdict"] != "no report" and row["other_effects"] == NONE
        return row
    row["right"] = row["first"] and row["verdict"] == "effect" and row["exit"] in ("0", "12", NONE)
    found = next((e for e in selected if key(e) == key(true)), {})
    row["share"] = found.get("share", NONE)
    name, value = next(iter(true["params"].items()))
    own = found.get("params", {}).get(name)
    if own:
        row["error"] = abs(own["value"] / value - 1)
        row["inside"] = bool(own.get("ci95") and own["ci95"][0] <= value <= own["ci95"][1])
    return row


def shown(value):
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def summary(rows):
    """One line for the cases with an effect, one for the controls."""
    effects, controls = [r for r in rows if r["truth"] != "none"], [r for r in rows if r["truth"] == "none"]
    count = lambda of, name: sum(r[name] is True for r in of)
    number = lambda of, name: [r[name] for r in of if r[name] != NONE]
    gaps = [abs(r["share"] - r["true_share"]) for r in effects if NONE not in (r["share"], r["true_share"])]
    errors, seconds = number(effects, "error"), number(rows, "seconds")
    lines = []
    if effects:
        lines.append(f"effects: first with verdict effect {count(effects, 'right')} of {len(effects)}; named first {count(effects, 'first')}; "
                     f"listed first, selected or not, {count(effects, 'listed')}; "
                     f"with false effects {len(number(effects, 'other_effects'))}; main parameter within 10 %: {sum(e <= 0.1 for e in errors)} of {len(errors)}, "
                     f"median error {shown(float(np.median(errors))) if errors else NONE}; share within 0.1: {sum(g <= 0.1 for g in gaps)} of {len(gaps)}")
    if controls:
        lines.append(f"controls: something other than corrections named on {sum(r['other_effects'] != NONE for r in controls)} of {len(controls)}")
    return lines + [f"wall time: median {np.median(seconds):.1f} s, largest {max(seconds):.1f} s"] if seconds else lines


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("cases", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--jobs", type=int, default=1, choices=(1, 2))
    parser.add_argument("--only", default="", help="regular expression on the names")
    parser.add_argument("--limit", type=float, default=600.0, help="wall time of a case [s]")
    args = parser.parse_args()

    def judged(case):
        target = args.out / case.name
        report = answer(args.program, case, target, args.limit) or {}
        seconds = target / "seconds.txt"
        row = row_of(case, report, seconds.read_text().split() if seconds.exists() else [])
        print(row["case"], row["verdict"], row["selected"], row["right"], shown(row["seconds"]), flush=True)
        return row

    cases = sorted(p.parent for p in args.cases.glob("*/truth.toml") if re.search(args.only, p.parent.name))
    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        rows = list(pool.map(judged, cases))
    with (args.out / "messy.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    lines = ["| " + " | ".join(rows[0]) + " |", "|" + "---|" * len(rows[0])]
    lines += ["| " + " | ".join(map(shown, row.values())) + " |" for row in rows]
    lines += [""] + summary(rows)
    (args.out / "messy.md").write_text("\n".join(lines) + "\n")
    print("\n".join(summary(rows)))


if __name__ == "__main__":
    main()
