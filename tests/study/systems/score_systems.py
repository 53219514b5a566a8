"""Counts the right answers of `airloop refine` on the sets of make_systems.py.

    python score_systems.py AIRLOOP SETS OUT [--only WORD,WORD]

Runs the program on every set that has no report yet, writes OUT/table.csv (a row per set) and prints it with the counts.
"""
import argparse
import collections
import csv
import json
import pathlib
import resource
import subprocess
import time
import tomllib


def right(truth, report):
    named = {e["id"] for e in report["effects"] if e["selected"]}
    beside = {e["id"] for e in report["effects"] if e["group"] is not None}
    if truth["verdict"] != "effect":
        where = truth["verdict"] == "none" or (report["unexplained"] or {}).get("channel") == truth["channel"]
        # A law is an explanation of one's own making.
        same = report["verdict"] == truth["verdict"] or (truth["verdict"], report["verdict"]) == ("unexplained", "law")
        return same and where
    true = set(truth["effects"])
    return report["verdict"] == "effect" and (named == true or len(named) == len(true) and true <= named | beside)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("airloop", type=pathlib.Path)
    parser.add_argument("sets", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    words = [word for word in arguments.only.split(",") if word]
    counts, rows = collections.Counter(), []
    for folder in sorted(arguments.sets.iterdir()):
        if words and not any(word in folder.name for word in words):
            continue
        out = arguments.out / folder.name
        seconds, code = float("nan"), ""
        if not (out / "report.json").exists():
            before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.time()
            result = subprocess.run([arguments.airloop, "refine", folder, "-q", "-o", out], capture_output=True, text=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            code = result.returncode
            if code not in (0, 10, 11, 12, 13):
                print(f"{folder.name}: {result.stderr.strip()}")
                counts[folder.name.split("_")[0], "failed"] += 1
                continue
        truth = tomllib.loads((folder / "truth.toml").read_text())
        report = json.loads((out / "report.json").read_text())
        ok = right(truth, report)
        family = folder.name.split("_")[0]
        counts[family, "right" if ok else "wrong"] += 1
        counts[f"{truth['verdict']} sets", "right" if ok else "wrong"] += 1
        validation = report["residual"]["validation"]
        signal = max(validation["rms_before"], key=lambda s: validation["rms_before"][s] / report["noise_floor"][s])
        floor = report["noise_floor"][signal]
        named = [e["id"] + ("*" if e["group"] is not None else "") for e in report["effects"] if e["selected"]]
        unexplained = report["unexplained"] or {}
        rows.append([folder.name, "yes" if ok else "NO", code, report["verdict"], " ".join(named), " ".join([unexplained.get("channel", ""), *unexplained.get("variables", [])]),
                     f"{validation['rms_before'][signal] / floor:.2f}", f"{validation['rms_after'][signal] / floor:.2f}", f"{seconds:.1f}"])
        print("  ".join(f"{str(cell):<{w}}" for cell, w in zip(rows[-1], [26, 3, 3, 11, 44, 28, 8, 8, 6])), flush=True)
    arguments.out.mkdir(parents=True, exist_ok=True)
    with open(arguments.out / "table.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["set", "right", "exit code", "verdict", "named", "unexplained", "times noise before", "after", "CPU seconds"])
        writer.writerows(rows)
    for (family, what), count in sorted(counts.items()):
        print(f"{family:<20} {what:<6} {count}")


if __name__ == "__main__":
    main()
