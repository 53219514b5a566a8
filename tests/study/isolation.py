"""Cost of worker processes: chains of 20 FMUs that copy a number, without workers, in one worker (20 components of one FMU) and
in 20 workers (20 copies of the FMU), compared with bare round trips between processes that are measured in the same turns; then
10,000 starts of a worker. Run: python tests/study/isolation.py AIRLOOP FMU OUT [STARTS]"""

import csv
import json
import os
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

COUNT = 20
STEPS = 1000
TURNS = 9
MASTERS = {"serial": "gauss-seidel", "parallel": "jacobi"}


def chain(folder, name, fmus):
    """u -> c0 -> c1 ... -> y; an .ssd."""
    connectors = '<ssd:Connectors><ssd:Connector name="u" kind="input"/><ssd:Connector name="y" kind="output"/></ssd:Connectors>'
    components = "".join(f'<ssd:Component name="c{k}" source="{fmu}">{connectors}</ssd:Component>' for k, fmu in enumerate(fmus))
    links = '<ssd:Connection startConnector="u" endElement="c0" endConnector="u"/>'
    for k in range(1, COUNT):
        links += f'<ssd:Connection startElement="c{k - 1}" startConnector="y" endElement="c{k}" endConnector="u"/>'
    links += f'<ssd:Connection startElement="c{COUNT - 1}" startConnector="y" endConnector="y"/>'
    path = folder / f"{name}.ssd"
    path.write_text(
        '<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" version="1.0" name="chain">'
        f'<ssd:System name="chain">{connectors}<ssd:Elements>{components}</ssd:Elements><ssd:Connections>{links}</ssd:Connections>'
        "</ssd:System></ssd:SystemStructureDescription>"
    )
    return path


def step(airloop, system, out, *words):
    """Time of one FMU step [us]."""
    command = [airloop, "run", system, "--stop", str(STEPS * 1e-3), "--step", "1ms", "--output-step", "1", "--no-plots", "-q", "-o", out]
    subprocess.run([*map(str, command), *words], check=True, capture_output=True)
    return 1e6 * json.loads((out / "summary.json").read_text())["timings"]["simulation_s"] / STEPS / COUNT


def round_trip(program, looks, processes):
    """Bare round trip [us] to processes that are asked in turn, with `looks` before a futex."""
    return float(subprocess.run([program, str(looks), str(processes)], check=True, capture_output=True, text=True).stdout)


def measure(airloop, fmu, out):
    program = out / "round_trip"
    subprocess.run([os.environ.get("CC", "cc"), "-O2", "-o", program, Path(__file__).with_suffix(".c")], check=True)
    copies = [out / f"copy_{k}.fmu" for k in range(COUNT)]
    for copy in copies:
        shutil.copy(fmu, copy)
    one, many = chain(out, "one", [fmu] * COUNT), chain(out, "many", copies)
    rows = []
    for _ in range(TURNS):
        row = {"round trip, looking": round_trip(program, 4000, 1), "round trip, futex": round_trip(program, 0, 1)}
        row["round trip, futex, 20 in turn"] = round_trip(program, 0, COUNT)
        for name, master in MASTERS.items():
            row[f"{name}, direct"] = step(airloop, one, out / "run", "--master", master)
            row[f"{name}, one worker"] = step(airloop, one, out / "run", "--master", master, "--isolate")
            row[f"{name}, 20 workers"] = step(airloop, many, out / "run", "--master", master, "--isolate")
        rows.append(row)
    with open(out / "isolation.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    print(f"{COUNT} FMUs, {STEPS} steps; us per FMU step, median (least, most) of {TURNS} turns; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    for name in rows[0]:
        values = [row[name] for row in rows]
        print(f"  {name:30} {statistics.median(values):8.2f} ({min(values):.2f}, {max(values):.2f})")
    for name in MASTERS:
        over = [row[f"{name}, one worker"] - row[f"{name}, direct"] for row in rows]
        print(f"  {name}, one worker: {statistics.median(over):.2f} us per FMU step over direct")
        for bare in ["round trip, futex", "round trip, futex, 20 in turn"]:
            ratios = [(row[f"{name}, 20 workers"] - row[f"{name}, direct"]) / row[bare] for row in rows]
            print(f"  {name}, 20 workers: isolation costs {statistics.median(ratios):.2f} times `{bare}` per FMU step")


def children_of(process):
    return Path(f"/proc/{process}/task/{process}/children").read_text().split()


def start_workers(airloop, fmu, out, starts):
    """`starts` workers, one after the other, in one process that is watched from outside: a sweep on one thread."""
    plan = out / "starts.toml"
    plan.write_text(
        f'kind = "simulate"\nsystem = "{fmu}"\n[run]\nstop = 0.01\nstep = 0.01\n[sample]\ncount = {starts}\n'
        '[[quantities]]\nname = "y"\nsignal = "y"\nof = "final"\n'
    )
    sweep, temporary = out / "starts", out / "tmp"
    for folder in (sweep, temporary):
        shutil.rmtree(folder, ignore_errors=True)
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary)}
    subprocess.run([airloop, "sweep", "plan", plan, "-o", sweep, "-q"], check=True)
    command = [airloop, "sweep", "run", sweep, "--threads", "1", "-q", "--isolate"]
    began = time.monotonic()
    process = subprocess.Popen(list(map(str, command)), env=environment)
    seen = []
    while process.poll() is None:
        time.sleep(0.5)
        try:
            status = Path(f"/proc/{process.pid}/status").read_text()
            memory = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS"))
            names = list(Path(f"/proc/{process.pid}/fd").iterdir())
            shared = sum("airloop-worker" in line for line in Path(f"/proc/{process.pid}/maps").read_text().splitlines())
            states = [Path(f"/proc/{child}/stat").read_text().rsplit(")", 1)[1].split()[0] for child in children_of(process.pid)]
            seen.append((len(names), shared, states.count("Z"), memory, len(list(temporary.iterdir()))))
        except (OSError, StopIteration):
            continue  # it ended between two looks
    took = time.monotonic() - began
    assert process.returncode == 0, process.returncode
    # The first looks see a process that still begins.
    early, late = seen[len(seen) // 10 : len(seen) // 5], seen[-len(seen) // 10 :]
    print(f"{starts} starts of a worker in {took:.0f} s, {1e3 * took / starts:.1f} ms each; most in the second tenth and in the last tenth of the time:")
    for place, name in enumerate(["descriptors", "mappings of shared memory", "zombies", "memory [kB]", "temporary folders"]):
        before, after = (max(look[place] for look in looks) for looks in (early, late))
        print(f"  {name:27} {before:8} {after:8}")
        grows = after - before > (0.02 * before if name.startswith("memory") else 2)
        assert not grows, f"{name} grow"
    assert not list(temporary.iterdir()), "folders of workers are left"


def main():
    airloop, fmu, out = (Path(word).resolve() for word in sys.argv[1:4])
    out.mkdir(parents=True, exist_ok=True)
    measure(airloop, fmu, out)
    start_workers(airloop, fmu, out, int(sys.argv[4]) if len(sys.argv) > 4 else 10_000)


if __name__ == "__main__":
    main()
