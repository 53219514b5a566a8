"""The rig's coupled cases as studies over FMUs against `airloop refine CASE`: same verdict, kinds of effects and parameters?

    python rig_over_fmus.py AIRLOOP CASES OUT [--only REGEX] [--plain]

CASES: folders with a `case.toml` and records of coupled runs; the system is that of examples/01_run with the parameters of
the case's declared model. A study names inputs,
outputs with the noise of their sensors, and records, and attachments that name the channels (--plain: nothing says where to
look). Prints a row per case and way; kinds of effects are compared, since a study without channels names them by port; a
parameter agrees when the intervals of both ways meet.
"""

import argparse
import json
import pathlib
import re
import resource
import subprocess
import sys
import time
import tomllib

ROOT = pathlib.Path(__file__).parents[3]
SYSTEM = ROOT / "examples" / "01_run" / "system.ssd"
# Effects of the vocabulary that are values of declared parameters of that system.
PARAMETERS = {"parameter@cart_pole.l": "length"}
# Where the channels of the vocabulary are in that system.
ATTACHMENTS = """
[[attachment]]
input = "u"
channels = ["actuator"]
[[attachment]]
input = "piston_friction.F_in"
channels = ["piston_friction"]
velocity = "v"
position = "x"
pressure_force = "F_hat"
coulomb = "piston_friction.c1"
viscous = "piston_friction.c4"
bias = "piston_friction.c5"
vt = {piston[0]}
v0 = {piston[1]}
[[attachment]]
input = "cart_friction.F_in"
channels = ["cart_friction"]
velocity = "v"
position = "x"
coulomb = "cart_friction.c1"
viscous = "cart_friction.c4"
bias = "cart_friction.c5"
vt = {cart[0]}
v0 = {cart[1]}
[[attachment]]
input = "cart_pole.F_ext"
channels = ["cart"]
velocity = "v"
position = "x"
[[attachment]]
input = "cart_pole.tau_ext"
channels = ["pole"]
velocity = "omega"
position = "theta"
viscous = "cart_pole.b_p"
"""


def parameters(model):
    """`[parameters]` of a study: the declared model of a case in place of that of examples/01_run."""
    actuator = model["actuator"]
    values = {f"actuator.A1[{i + 1},{j + 1}]": own for i, row in enumerate(actuator["A1"]) for j, own in enumerate(row)}
    values |= {f"actuator.{name}[{i + 1}]": own for name in ("B0", "B1") for i, own in enumerate(actuator[name])}
    for body in ("piston_friction", "cart_friction"):
        values |= {f"{body}.{name}": own for name, own in model[body].items()}
    values |= {f"cart_pole.{name}": model["cart_pole"][name] for name in ("m_c", "m_p", "l", "g", "b_p")}
    return "[parameters]\n" + "".join(f'"{name}" = {own}\n' for name, own in values.items())


def study(folder, case, plain):
    """Text of a study over the system of examples/01_run."""
    outputs = "".join(
        f'{name} = {{ column = "{name}", unit = "{own["unit"]}", noise = {own["noise_rms"]} }}\n'
        for name, own in case["sensors"].items()
        if name != "u"
    )
    segments = "".join(
        f'[[segment]]\nfile = "{folder / own["name"]}"\nrole = "{own["role"]}"\ninitial = "fit"\n' for own in case["files"]
    )
    inputs = 'u = { column = "u", unit = "N", hold = true }\n'
    model = case["model"]
    friction = {name: model[f"{name}_friction"] for name in ("piston", "cart")}
    speeds = {name: (1 / own["c2"], own.get("c3", 0.0)) for name, own in friction.items()}
    where = "" if plain else ATTACHMENTS.format(**speeds)
    return f'system = "{SYSTEM}"\nstep_s = 0.001\n{parameters(model)}[inputs]\n{inputs}[outputs]\n{outputs}{segments}{where}'


def refine(binary, what, out):
    """Report of a run, with its CPU time and wall time."""
    used = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    cpu, wall = used(), time.time()
    ran = subprocess.run([binary, "refine", what, "-o", out], capture_output=True, text=True)
    path = out / "report.json"
    if not path.exists():
        sys.exit(f"{what}: exit code {ran.returncode}\n{ran.stderr}")
    return json.loads(path.read_text()), used() - cpu, time.time() - wall


def named(found):
    """Kind of each selected effect -> (where, its parameters)."""
    chosen = {}
    for effect in found["effects"]:
        if effect["selected"]:
            kind = PARAMETERS.get(effect["id"], effect["id"].split("@")[0].split(".")[-1])
            chosen[kind] = (effect["id"], effect["params"])
    return chosen


def apart(a, b):
    """Parameters of which the intervals of both ways do not meet; names may differ where the ports do."""
    meet = lambda p, q: max(p["ci95"][0], q["ci95"][0]) <= min(p["ci95"][1], q["ci95"][1])
    return [name for name in a if name in b and not meet(a[name], b[name])]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("airloop", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("cases", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--only", default=".")
    parser.add_argument("--plain", action="store_true")
    given = parser.parse_args()
    same = total = 0
    for folder in sorted(path.parent.resolve() for path in given.cases.glob("*/case.toml")):
        case = tomllib.loads((folder / "case.toml").read_text())
        if any(own["experiment"] != "coupled" for own in case["files"]) or not re.search(given.only, folder.name):
            continue
        out = given.out / folder.name
        out.mkdir(parents=True, exist_ok=True)
        path = out / "study.toml"
        path.write_text(study(folder, case, given.plain))
        reports = []
        for way, what in [("case", folder), ("fmus", path)]:
            found, cpu, wall = refine(given.airloop, what, out / way)
            reports.append((found["verdict"], named(found)))
            shown = ", ".join(
                where + "".join(f' {name} {own["value"]:.6g}' for name, own in params.items())
                for where, params in reports[-1][1].values()
            )
            print(f"{folder.name} {way:5} {found['verdict']:12} complete {found.get('complete')}  {shown or '-'}  "
                  f"cpu {cpu:.0f} s, wall {wall:.0f} s", flush=True)
        (verdict, one), (other_verdict, other) = reports
        right = verdict == other_verdict and set(one) == set(other)
        differ = [name for kind in one if right for name in apart(one[kind][1], other[kind][1])]
        total += 1
        same += right and not differ
        print(f"{folder.name} {'same' if right and not differ else 'NOT THE SAME'} {' '.join(differ)}", flush=True)
    print(f"{same} of {total} cases the same")


if __name__ == "__main__":
    main()
