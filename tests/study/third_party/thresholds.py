"""What moving a setting of the search does: effects missed against effects named wrongly, on cases of make_third_party.py.

    python thresholds.py AIRLOOP CASES OUT [--only REGEX] [--sample N] [--seconds S] [--settings NAME ...]

Runs the program on a sample of the messy cases with the settings as they are, keeps those that take at most S seconds of CPU time, and
runs these again with one setting at a time at a smaller and a larger value. Writes OUT/thresholds.csv and OUT/thresholds.md: for every
value, on how many machines that lack one effect it comes first, and on how many of all machines something wrong is named.
"""

import argparse
import csv
import json
import pathlib
import re
import types

from score_third_party import NONE, answer, row_of, sampled

# A smaller and a larger value than the default of each setting.
VALUES = {
    "min_gain": (5, 80),
    "min_held_out_share": (0.1, 0.4),
    "min_share_alone": (0.1, 0.4),
    "min_share_of_correction": (0.25, 0.8),
    "max_tolerances": (1.5, 5),
    "tie_share": (0.005, 0.08),
    "min_form_share": (0.8, 0.97),
    "min_share_of_rest": (0.5, 0.9),
    "min_validated_share": (0.01, 0.2),
}


def program(airloop, folder, setting, value):
    """The program with one setting changed."""
    if setting is None:
        return airloop
    path = folder / f"airloop_{setting}_{value}"
    path.write_text(f'#!/bin/sh\nif [ "$1" = refine ]; then exec {airloop} "$@" --set {setting}={value}; fi\nexec {airloop} "$@"\n')
    path.chmod(0o755)
    return path


def count(rows):
    """Counts of a table: right effect first, machines with one effect, wrong names, all machines, unexplained."""
    single = [row for row in rows if row["cls"] == "single" and row["first"] != NONE]
    wrong = [row for row in rows if row["other_effects"] != NONE]
    false = [row for row in rows if row["cls"] in ("control", "outside") and not row["right"]]
    return {
        "right effect first": sum(row["first"] == "yes" for row in single),
        "of": len(single),
        "something wrong beside or instead": len({row["case"] for row in wrong}),
        "of all": len(rows),
        "controls and outside wrong": len(false),
        "of those": sum(row["cls"] in ("control", "outside") for row in rows),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("cases", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--only", default="_m_", help="regular expression on the names")
    parser.add_argument("--sample", type=int, default=60)
    parser.add_argument("--seconds", type=float, default=6.0, help="longest CPU time of a case that counts")
    parser.add_argument("--settings", nargs="*", default=list(VALUES))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    airloop = args.program.resolve()
    cases = sorted(path.parent for path in args.cases.glob("*/truth.json") if re.search(args.only, path.parent.name))
    cases = sampled(cases, args.sample)

    def rows(setting, value, cases):
        own = types.SimpleNamespace(program=str(program(airloop, args.out, setting, value)), out=args.out / f"{setting}_{value}")
        own.__dict__.update(flavor="plain", again=False, limit=args.seconds if setting is None else 10 * args.seconds, jobs=1, threads=1)
        found = []
        for case in cases:
            truth = json.loads((case / "truth.json").read_text())
            report, run = answer(own, case, truth)
            if report:
                found.append(row_of(case, truth, report, run, "plain"))
        return found

    usual = rows(None, None, cases)
    kept = [case for case in cases if case.name in {row["case"] for row in usual}]
    table = [dict(setting="as they are", value="") | count(usual)]
    print(*table[-1].values(), flush=True)
    for setting in args.settings:
        for value in VALUES[setting]:
            table.append(dict(setting=setting, value=value) | count(rows(setting, value, kept)))
            print(*table[-1].values(), flush=True)
    with (args.out / "thresholds.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, table[0])
        writer.writeheader()
        writer.writerows(table)
    lines = ["| " + " | ".join(table[0]) + " |", "|" + "---|" * len(table[0])]
    lines += ["| " + " | ".join(str(value) for value in row.values()) + " |" for row in table]
    (args.out / "thresholds.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
