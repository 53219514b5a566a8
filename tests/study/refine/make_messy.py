"""Makes messy cases for the study of `airloop refine`: rigs that no model of the vocabulary fits to the sensor noise.

    python make_messy.py DIR [--seed S] [--count 30] [--controls 20] [--only REGEX]

Declared values are off and small terms of other forms act at several ports (messy.py), each at 3 to 6 % of the strength
of a case of its own. `m_` cases have one effect on top (rod fixed: `m_r_`, sweeps: `m_w_`) that takes away 60 to 98 % of
the validation error when it is put into the declared model with its true parameters; `n_` cases are controls. What
remains is 0.1 to 0.5 of the units; other cases are drawn again. truth.toml: `share` as in report-fields.md, from noise-free records, and the errors before and after in units.
"""
import argparse
import pathlib
import re

import numpy as np

from make_cases import STRENGTH, UNITS, calibrate, files_of, measured, prepare, rms, run, sensed, specification, strengths, sweep_case, write
from effects import EFFECTS, draw, scaled
from messy import off, small_terms
from rig import DECLARED, simulate

SHARE = (0.6, 0.98)
REMAINING = (0.1, 0.5)
SMALL = (0.03, 0.06)
USUAL = float(np.mean(STRENGTH))
PREFIX = {"cartpole": "", "actuator": "r_", "friction": "w_"}
# A small term that these commands hardly excite does not grow beyond so many times its typical amplitude.
LARGEST = 3.0
# Drawn again so often, then another effect takes the place.
TRIES = 6


def singles():
    """Effects that have a case of their own: (effect, signal, kind). In a sweep the motion is what the model is given, so only the force counts."""
    found = [(*c["effects"][0][::2], c["kind"]) for c in specification(np.random.default_rng(0)) if c["cls"] == "single"]
    return [s for s in found if not (s[2] == "friction" and s[1] in ("x", "v"))]


def drawn(name, kind, chosen, rng):
    """A case before anything is scaled. `chosen`: effect and signal, or None."""
    effects = [(chosen[0], draw(rng, EFFECTS[chosen[0]]), chosen[1])] if chosen else []
    c = dict(name=name, kind=kind, cls="messy" if chosen else "messy_control", effects=effects, strengths=list(rng.uniform(*STRENGTH, len(effects))))
    prepare(c, rng)
    c["plant"], c["small"] = off(rng, DECLARED), small_terms(rng, kind)
    c["small_strengths"] = USUAL * rng.uniform(*SMALL, len(c["small"]))
    return c


def scale_small(cases):
    """Amplitudes of the small terms; what they do is proportional to them."""
    parts = [{**c, "part": part} for c in cases for part in c["small"]]
    targets = np.concatenate([c["small_strengths"] for c in cases])
    if cases[0]["kind"] == "friction":
        reached = [rms(sweep_case(p, [p["part"]])["F_p"] - sweep_case(p, [])["F_p"]) / UNITS["F_p"] for p in parts]
    else:
        reached = strengths(parts, lambda p: [p["part"]], (0, 2, 4))
    for p, target, own in zip(parts, targets, reached):
        p["part"][1]["amp"] *= min(target / own, LARGEST)


def scale_sweeps(cases):
    for c in cases:
        (effect, params, signal), factor = c["effects"][0], 1.0
        without = sweep_case(c, [])["F_p"]
        for _ in range(4):
            c["effects"] = [(effect, scaled(effect, params, factor), signal)]
            reached = rms(sensed(sweep_case(c, c["effects"]), c["effects"])["F_p"] - without) / UNITS["F_p"]
            factor *= np.clip(c["strengths"][0] / max(reached, 1e-3), 0.3, 3.0)


def error(truth, model):
    """Root mean square over signals of the error in units of 0.3 N, 2 mm and 10 mrad."""
    return rms([rms((truth[k] - model[k]) / UNITS[k]) for k in truth])


def declared_runs(cases, out, trials, count, effects_of):
    """Windowed predictions of the declared model with `effects_of` on some trials, from the true states."""
    columns = [count * i + j for i in range(len(cases)) for j in trials]
    n = len(columns)
    lanes = [{e: p for e, p, s in effects_of(c) if s is None} for c in cases for _ in trials]
    return simulate(lanes, out["u"][:, columns].T, np.zeros(n), np.zeros(n), {k: np.full(n, v) for k, v in DECLARED.items()},
                    np.zeros((len(out["u"]), n)), centring=0.0, restart=out["states"][..., columns], fixed=cases[0]["kind"] == "actuator")


def records(cases):
    """Noise-free records of every case, and its errors of the declared model without and with the true effect."""
    kind = cases[0]["kind"]
    trials = [j for j, file in enumerate(files_of(cases[0])) if not file[1]]
    if kind == "friction":
        for c in cases:
            true, plain = sensed(sweep_case(c, c["effects"] + c["small"]), c["effects"]), {**c, "plant": DECLARED}
            models = sweep_case(plain, []), sensed(sweep_case(plain, c["effects"]), c["effects"])
            validation = lambda data: {"F_p": data["F_p"][:, trials]}
            yield c, true, *(error(validation(true), validation(m)) for m in models)
        return
    names = ["F_hat", "F_p"] + (["x", "theta"] if kind == "cartpole" else [])
    count = len(cases[0]["ff"])
    out, _ = run(cases, lambda c: c["effects"] + c["small"], list(range(count)))
    models = [declared_runs(cases, out, trials, count, of) for of in (lambda c: [], lambda c: c["effects"])]
    for i, c in enumerate(cases):
        true = sensed({k: out[k][:, count * i:count * (i + 1)] for k in ["u", *names]}, c["effects"])
        own = [{k: m[k][:, len(trials) * i:len(trials) * (i + 1)] for k in names} for m in models]
        validation = {k: true[k][:, trials] for k in names}
        yield c, true, error(validation, own[0]), error(validation, sensed(own[1], c["effects"]))


def make(folder, cases):
    """Scales, simulates and writes those cases of one kind that are as a messy rig is; returns the names of the others."""
    scale_small(cases)
    with_effect = [c for c in cases if c["effects"]]
    if with_effect:
        (scale_sweeps if cases[0]["kind"] == "friction" else calibrate)(with_effect)
    rejected = []
    for c, data, before, after in records(cases):
        share = 1 - after / before
        if not REMAINING[0] <= after <= REMAINING[1] or c["effects"] and not SHARE[0] <= share <= SHARE[1]:
            rejected.append(c["name"])
            continue
        c["figures"] = {"error_before": round(before, 3)} | ({"error_after": round(after, 3), "share": round(share, 4)} if c["effects"] else {})
        write(folder, c, files_of(c), measured(c, data))
        print(c["name"], c["figures"], flush=True)
    return rejected


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--controls", type=int, default=20)
    parser.add_argument("--only", default="", help="regular expression on the names")
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    pool = singles()
    order = [pool[i] for _ in range(1 + args.count // len(pool)) for i in rng.permutation(len(pool))]
    named = lambda i, s: f"m_{PREFIX[s[2]]}{s[0]}{'_' + s[1] if s[1] else ''}{f'_{i // len(pool)}' if i >= len(pool) else ''}"
    waiting = {named(i, s): (s[2], s[:2]) for i, s in enumerate(order)}
    spare = list(waiting)[args.count:]
    kinds = ["cartpole", "cartpole", "cartpole", "actuator", "friction"]
    controls = {f"n_{kinds[i % 5]}_{i:02d}": (kinds[i % 5], None) for i in range(args.controls)}
    todo, tried = list(waiting)[:args.count] + list(controls), {}
    everything = waiting | controls
    while todo:
        rejected = []
        for kind in PREFIX:
            cases = [drawn(name, kind, everything[name][1], rng) for name in todo if everything[name][0] == kind and re.search(args.only, name)]
            for start in range(0, len(cases), 40):
                rejected += make(args.folder, cases[start:start + 40])
        for name in rejected:
            tried[name] = tried.get(name, 0) + 1
        given_up = [name for name in rejected if tried[name] == TRIES]
        print("drawn again:", *rejected, "; given up:", *given_up, flush=True)
        todo = [name for name in rejected if name not in given_up] + [spare.pop(0) for _ in given_up[:len(spare)]]


if __name__ == "__main__":
    main()
