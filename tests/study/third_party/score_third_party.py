"""Judges the answers of `airloop refine` on the cases of make_third_party.py.

    python score_third_party.py AIRLOOP CASES OUT [--flavor study|plain] [--only REGEX] [--sample N] [--limit SECONDS] [--jobs 1] [--done] [--again]

Runs the program on every case that has no answer yet (all with --again), writes OUT/FLAVOR.csv (a row per case) and
prints that table and counts per class. Rules:

* An effect is the true one when its kind and its port are. The id of an attachment's channel (`cf.coulomb`) is accepted
  with a `port`, or without one when only one attachment has that channel; `kind@port` always; so are a declared
  parameter that does the same, and forms that data cannot tell apart (`parameter`, `alike` in truth.json). `kind`:
  right kind, port not said. Members of one group count as one effect, which is right when any of them is.
* single, pair: `first` when the first selected effect is a true one at its port; `exact` when the verdict is "effect"
  (exit code 0 or 12) and all true effects and nothing else are selected. Corrections of declared parameters
  (`corrections`) are not counted.
* control: right when nothing is selected, and the verdict is "none", on messy machines "none" or "unexplained".
* beside: `exact` when the verdict is "effect", the listed effect and nothing else is selected, and the law is at the port of the other.
* outside: right when the verdict is "unexplained" or "law", and nothing wrong is selected.
* error: of the main parameter of the first true effect, relative. system: whether the amended system was written, and
  whether `airloop run --study` runs it.
"""

import argparse
import collections
import concurrent.futures
import csv
import json
import pathlib
import re
import resource
import signal
import subprocess
import time

import numpy as np

from systems import SYSTEMS

NONE = "-"
plain = lambda text: re.sub(r"[^a-z]", "", (text or "").lower())


def where(effect, system):
    """Input, output or parameter that an effect names; None where it names no variable of the system."""
    text = effect.get("signal") or effect.get("port") or (effect["id"].split("@")[1] if "@" in effect["id"] else "")
    name = re.split(r"[.:/ >]+", text.strip())[-1] if text else ""
    known = {*system.states, *system.inputs, *system.parameters}
    return name if name in known else None


def kind_of(effect):
    return plain(effect.get("kind") or effect["id"].split("@")[0].split(".")[-1])


def match(effect, true, system):
    """`yes`: the true effect at its port; `kind`: the right kind, but the port is not told; `no`."""
    port = where(effect, system)
    if true["parameter"] and port == true["parameter"] or (effect.get("parameter") or "").split(".")[-1] == true["parameter"]:
        return "yes"
    names = {plain(true["kind"]), *(plain(a) for a in true["alike"] if "." not in a)}
    ids = {true["id"], *(a for a in true["alike"] if "." in a)} - {None}
    if effect["id"] not in ids and kind_of(effect) not in names:
        return "no"
    if port is not None:
        return "yes" if port == true["port"] else "no"
    prefix = effect["id"].split(".")[0] + "."
    channel = {"pf.": "piston_friction", "cf.": "cart_friction", "cart.": "cart", "pole.": "pole", "act.": "actuator"}.get(prefix)
    ports = [name for name, own in system.ports.items() if channel in own.channels]
    if len(ports) == 1:
        return "yes" if ports[0] == true["port"] else "no"
    return "kind" if channel and true["port"] in ports else "no"


def label(effect):
    port = effect.get("signal") or effect.get("port") or ""
    return effect["id"] + (f"@{port}" if port and "@" not in effect["id"] else "")


def row_of(case, truth, report, run, flavor):
    system, verdict = SYSTEMS[truth["system"]], truth["verdict"][flavor]
    effects = report.get("effects") or []
    selected = [e for e in effects if e.get("selected")]

    # Members of one group are one effect.
    def hit(e, true):
        own = [e] + [o for o in effects if e.get("group") is not None and o.get("group") == e["group"] and o is not e]
        found = [match(o, true, system) for o in own]
        return "yes" if "yes" in found else "kind" if "kind" in found else "no"

    trues = [true for true in truth["effects"] if truth["class"] != "beside" or true["listed"]]
    hits = [[hit(e, true) for true in trues] for e in selected]
    said, code = report.get("verdict", run["failed"]), run["code"]
    true_ports = {t["port"] for t in truth["effects"]}
    unexplained = report.get("unexplained") or {}
    law = report.get("law") or {}
    row = dict(
        case=case.name,
        kind=truth["kind"],
        cls=truth["class"],
        truth=" ".join(f"{t['kind']}@{t['port']}" for t in truth["effects"]) or "none",
        verdict=said,
        exit=code,
        selected=" ".join(map(label, selected)) or NONE,
        first=NONE,
        exact=NONE,
        right=False,
        other_effects=NONE,
        corrections=" ".join(c.get("parameter") or c.get("id") for c in report.get("corrections") or []) or NONE,
        error=NONE,
        share=NONE,
        true_share=truth["share"],
        complete=report.get("complete", NONE),
        where=unexplained.get("port") or law.get("port") or unexplained.get("channel") or NONE,
        system=run.get("system", NONE),
        cpu=run["cpu"],
        wall=run["wall"],
    )
    other_effects = [label(e) for e, own in zip(selected, hits) if "yes" not in own and "kind" not in own]
    row["other_effects"] = " ".join(other_effects) or NONE
    if truth["class"] in ("single", "pair", "beside"):
        row["first"] = hits[0][int(np.argmax([{"yes": 2, "kind": 1, "no": 0}[h] for h in hits[0]]))] if hits else "no"
        found = [any(own[k] == "yes" for own in hits) for k in range(len(trues))]
        row["exact"] = said == "effect" and code in (0, 12) and all(found) and not other_effects
        if truth["class"] == "beside":
            row["exact"] &= law.get("port") in {true["port"] for true in truth["effects"] if not true["listed"]}
        row["right"] = row["exact"]
        if verdict == "unexplained":
            # No channel of the attachments has such an effect: to say so is right, to name it as well.
            row["right"] |= said in ("unexplained", "law") and not other_effects
            row["first"] = row["first"] if row["first"] == "yes" else NONE
        pick = [(e, t) for e, own in zip(selected, hits) for h, t in zip(own, trues) if h != "no"]
        if pick:
            effect, true = pick[0]
            value = effect.get("params", {}).get(true["main"], {}).get("value")
            row["share"], row["true_share"] = effect.get("share", NONE), true["share"]
            if value is not None and true["params"][true["main"]]["value"]:
                row["error"] = abs(value / true["params"][true["main"]]["value"] - 1)
    elif truth["class"] == "control":
        row["right"] = not selected and said in (("none", "unexplained") if truth["kind"] == "messy" else ("none",))
    else:
        wrong = [own for own in hits if "yes" not in own]
        # Only a form that is alike, at the right port, is a right name; today's name of the kind itself does not exist.
        row["right"] = said in ("unexplained", "law") and not wrong or said == "effect" and bool(selected) and not wrong
        row["first"] = "port" if row["where"].split(".")[-1] in true_ports else NONE
    return row


def runs_amended(program, study, out, limit):
    """Whether the amended system was written, and whether it simulates the records of the study."""
    found = sorted((out / "system").glob("*.ss[dp]"))
    if not found:
        return "none"
    try:
        command = [program, "run", str(found[0]), "--study", str(study), "-o", str(out / "run")]
        result = subprocess.run(command, capture_output=True, text=True, timeout=20 * limit)
    except subprocess.TimeoutExpired:
        return "slow"
    (out / "run.txt").write_text(result.stderr)
    return "runs" if result.returncode == 0 else "fails"


def answer(args, case, truth):
    """Report and how the run went; runs the program where there is no answer."""
    out = args.out / args.flavor / case.name
    kept = out / "run.json"
    if args.again or not kept.exists():
        out.mkdir(parents=True, exist_ok=True)
        for old in ("report.json", "run.json"):
            (out / old).unlink(missing_ok=True)
        begin, before, failed, code = time.time(), resource.getrusage(resource.RUSAGE_CHILDREN), "no report", NONE
        try:
            # A limit of CPU time: the answers do not depend on what else the machine does.
            limit = lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(args.limit), int(args.limit) + 5))
            result = subprocess.run(
                [args.program, "refine", str(case / f"{args.flavor}.toml"), "-q", "-o", str(out), "--threads", str(args.threads)],
                capture_output=True,
                text=True,
                timeout=20 * args.limit,
                preexec_fn=limit,
            )
            code = result.returncode
            if code == -signal.SIGXCPU:
                failed = "time-out"
            (out / "stderr.txt").write_text(result.stderr)
        except subprocess.TimeoutExpired:
            failed = "time-out"
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        run = dict(code=code, failed=failed, wall=round(time.time() - begin, 1), cpu=round(cpu, 1) if args.jobs == 1 else NONE)
        if truth["verdict"]["plain"] == "effect":
            run["system"] = runs_amended(args.program, case / f"{args.flavor}.toml", out, args.limit)
        kept.write_text(json.dumps(run))
    report = out / "report.json"
    return json.loads(report.read_text()) if report.exists() else {}, json.loads(kept.read_text())


def shown(value):
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def summary(rows):
    """A line per kind and class."""
    lines = []
    for kind in ("exact", "messy"):
        for cls in ("single", "pair", "beside", "control", "outside"):
            own = [r for r in rows if (r["kind"], r["cls"]) == (kind, cls)]
            if not own:
                continue
            right, n = sum(r["right"] is True for r in own), len(own)
            if cls in ("single", "pair", "beside"):
                first, n = collections.Counter(r["first"] for r in own), sum(r["first"] != NONE for r in own)
                errors = [r["error"] for r in own if r["error"] != NONE]
                systems = collections.Counter(r["system"] for r in own)
                noise = f"; leaves noise {sum(r['complete'] is True for r in own)} of {len(own)}" if cls == "beside" else ""
                gaps = [abs(r["share"] - r["true_share"]) for r in own if isinstance(r["share"], float)]
                lines.append(
                    f"{kind} {cls}: right effect first {first['yes']} of {n} (and {first['kind']} without port); exact set {sum(r['exact'] is True for r in own)} of {n}{noise}; "
                    f"right (\"unexplained\" where no channel has the effect) {right} of {len(own)}; with other effects {sum(r['other_effects'] != NONE for r in own)}; main parameter within 10 %: {sum(e <= 0.1 for e in errors)} of {len(errors)}, "
                    f"median {shown(float(np.median(errors))) if errors else NONE}; share within 0.1: {sum(g <= 0.1 for g in gaps)} of {len(gaps)}; "
                    f"amended system: {', '.join(f'{k} {v}' for k, v in sorted(systems.items()))}"
                )
            else:
                lines.append(
                    f"{kind} {cls}: right {right} of {n}; something wrong named on {sum(r['other_effects'] != NONE for r in own)}; verdicts: "
                    + ", ".join(f"{k} {v}" for k, v in sorted(collections.Counter(str(r["verdict"]) for r in own).items()))
                )
    wall, cpu = [float(r["wall"]) for r in rows], [float(r["cpu"]) for r in rows if r["cpu"] != NONE]
    if cpu:
        lines.append(f"CPU time: median {np.median(cpu):.1f} s, largest {max(cpu):.1f} s")
    return lines + [f"wall time: median {np.median(wall):.1f} s, largest {max(wall):.1f} s"]


def sampled(cases, count):
    """About `count` cases, the same number of each system, kind and class where there are so many."""
    if not count or count >= len(cases):
        return cases
    groups = collections.defaultdict(list)
    for case in cases:
        truth = json.loads((case / "truth.json").read_text())
        groups[truth["kind"], truth["class"] if truth["class"] != "single" else f"single {truth['system']}"].append(case)
    rng, chosen = np.random.default_rng(0), []
    order = [[own[i] for i in rng.permutation(len(own))] for own in groups.values()]
    while len(chosen) < count:
        for own in order:
            if own and len(chosen) < count:
                chosen.append(own.pop())
    return chosen


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("cases", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--flavor", choices=("study", "plain"), default="study")
    parser.add_argument("--only", default="", help="regular expression on the names")
    parser.add_argument("--sample", type=int, default=0, help="number of cases, spread over systems and classes")
    parser.add_argument("--limit", type=float, default=300.0, help="CPU time of a case [s]")
    parser.add_argument("--jobs", type=int, default=1, choices=(1, 2))
    parser.add_argument("--threads", type=int, default=1, choices=(1, 2))
    parser.add_argument("--done", action="store_true", help="only cases that have an answer")
    parser.add_argument("--again", action="store_true", help="run the program on cases that have an answer, too")
    args = parser.parse_args()
    args.program = str(pathlib.Path(args.program).resolve())

    def judged(case):
        truth = json.loads((case / "truth.json").read_text())
        report, run = answer(args, case, truth)
        row = row_of(case, truth, report, run, args.flavor)
        print(*(shown(row[k]) for k in ("case", "verdict", "selected", "first", "right", "wall")), sep=" | ", flush=True)
        return row

    cases = sampled(sorted(p.parent for p in args.cases.glob("*/truth.json") if re.search(args.only, p.parent.name)), args.sample)
    cases = [case for case in cases if not args.done or (args.out / args.flavor / case.name / "run.json").exists()]
    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        rows = sorted(pool.map(judged, cases), key=lambda row: row["case"])
    with (args.out / f"{args.flavor}.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    lines = (
        ["| " + " | ".join(rows[0]) + " |", "|" + "---|" * len(rows[0])]
        + ["| " + " | ".join(map(shown, row.values())) + " |" for row in rows]
        + [""]
        + summary(rows)
    )
    (args.out / f"{args.flavor}.md").write_text("\n".join(lines) + "\n")
    print("\n".join(summary(rows)))


if __name__ == "__main__":
    main()
