"""What moving a setting of the search does: effects missed against effects named wrongly, on cases of make_messy.py.

    python thresholds.py AIRLOOP CASES OUT [--only REGEX] [--settings NAME ...]

Runs the program with the settings as they are, and with one at a time at a smaller and a larger value. Writes OUT/thresholds.csv and
OUT/thresholds.md: for every value, on how many rigs the dominant effect comes first, on how many of them something else is named beside
it, on how many controls something other than a correction is named. The default cases are force sweeps and rigs with a fixed rod, which
take seconds; others take minutes for all settings.
"""

import argparse
import csv
import pathlib
import re

from score import answer
from score_messy import NONE, row_of

# A smaller and a larger value than the default of each setting.
VALUES = {
    "min_gain": (5, 80),
    "min_held_out_share": (0.1, 0.4),
    "min_share_alone": (0.05, 0.5),
    "min_share_of_correction": (0.25, 0.8),
    "max_tolerances": (1.5, 6),
    "tie_share": (0.005, 0.08),
    "tie_of_predictions": (0.1, 0.4),
    "tie_share_of_rest": (0.1, 0.4),
    "min_share_of_rival": (0.25, 0.75),
    "min_form_share": (0.8, 0.97),
    "min_share_of_rest": (0.5, 0.9),
    "min_validated_share": (0.01, 0.3),
}
QUICK = "^(m_w_|m_r_|n_friction|n_actuator)"


def program(airloop, folder, setting, value):
    """The program with one setting changed."""
    if setting is None:
        return airloop
    path = folder / f"airloop_{setting}_{value}"
    path.write_text(f'#!/bin/sh\nexec {airloop} "$@" --set {setting}={value}\n')
    path.chmod(0o755)
    return path


def count(rows):
    """Counts of the rows of a value."""
    effects, controls = ([row for row in rows if (row["truth"] == "none") is none] for none in (False, True))
    named = lambda of: sum(row["other_effects"] != NONE for row in of)  # noqa: E731
    return {
        "dominant effect first": sum(row["right"] is True for row in effects),
        "of": len(effects),
        "with others": named(effects),
        "controls named": named(controls),
        "of controls": len(controls),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("cases", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--only", default=QUICK, help="regular expression on the names")
    parser.add_argument("--settings", nargs="*", default=list(VALUES))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    cases = sorted(path.parent for path in args.cases.glob("*/truth.toml") if re.search(args.only, path.parent.name))
    table = []
    for setting, value in [(None, None)] + [(name, value) for name in args.settings for value in VALUES[name]]:
        own, folder = program(args.program.resolve(), args.out, setting, value), args.out / f"{setting or 'default'}_{value or ''}"
        rows = []
        for case in cases:
            report = answer(own, case, folder / case.name, 600.0) or {}
            rows.append(row_of(case, report, (folder / case.name / "seconds.txt").read_text().split()))
        table.append(dict(setting=setting or "as they are", value=value or "") | count(rows))
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
