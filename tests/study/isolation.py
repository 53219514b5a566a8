"""Cost of worker processes: 20 FMUs that copy a number, in one process and in processes of their own, beside the bare round
trip between two processes measured in the same turns. Run: python tests/study/isolation.py AIRLOOP FMU OUT"""

import csv
import json
import os
import statistics
import subprocess
import sys
from pathlib import Path

COUNT = 20
STEPS = 1000
TURNS = 9
MASTERS = {"serial": "gauss-seidel", "parallel": "jacobi"}


def chain(folder, fmu):
    """u -> c0 -> c1 ... -> y; an .ssd."""
    connectors = '<ssd:Connectors><ssd:Connector name="u" kind="input"/><ssd:Connector name="y" kind="output"/></ssd:Connectors>'
    components = "".join(f'<ssd:Component name="c{k}" source="{fmu}">{connectors}</ssd:Component>' for k in range(COUNT))
    links = '<ssd:Connection startConnector="u" endElement="c0" endConnector="u"/>'
    for k in range(1, COUNT):
        links += f'<ssd:Connection startElement="c{k - 1}" startConnector="y" endElement="c{k}" endConnector="u"/>'
    links += f'<ssd:Connection startElement="c{COUNT - 1}" startConnector="y" endConnector="y"/>'
    path = folder / "chain.ssd"
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


def main():
    airloop, fmu, out = (Path(word).resolve() for word in sys.argv[1:4])
    out.mkdir(parents=True, exist_ok=True)
    source = Path(__file__).with_suffix(".c")
    subprocess.run([os.environ.get("CC", "cc"), "-O2", "-o", out / "round_trip", source], check=True)
    system = chain(out, fmu)
    rows = []
    for _ in range(TURNS):
        row = {"round trip": float(subprocess.run([out / "round_trip"], check=True, capture_output=True, text=True).stdout)}
        for name, master in MASTERS.items():
            row[f"{name}, direct"] = step(airloop, system, out / "run", "--master", master)
            row[f"{name}, isolated"] = step(airloop, system, out / "run", "--master", master, "--isolate")
        rows.append(row)
    with open(out / "isolation.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    print(f"{COUNT} FMUs, {STEPS} steps; us per FMU step, median (least, most) of {TURNS} turns; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    for name in rows[0]:
        values = [row[name] for row in rows]
        print(f"  {name:20} {statistics.median(values):8.2f} ({min(values):.2f}, {max(values):.2f})")
    for name in MASTERS:
        ratios = [(row[f"{name}, isolated"] - row[f"{name}, direct"]) / row["round trip"] for row in rows]
        print(f"  {name}: isolation costs {statistics.median(ratios):.2f} bare round trips per FMU step")


if __name__ == "__main__":
    main()
