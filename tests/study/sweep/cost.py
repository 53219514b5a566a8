"""Cost of planning, running and merging tasks that do nothing, from 1e3 to 1e6 tasks.

    python tests/study/sweep/cost.py target/release/airloop
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path


def cost(program, *words):
    """Seconds and MB of a command."""
    done = subprocess.run(["/usr/bin/time", "-f", "cost %e %M", program, "sweep", *map(str, words), "--quiet"],
                          check=True, capture_output=True, text=True)
    seconds, kilobytes = re.search(r"cost ([\d.]+) (\d+)", done.stderr).groups()
    return float(seconds), int(kilobytes) / 1024


def main(program):
    print("| tasks | shards | plan [s] | run [s] | merge [s] | memory of the merge [MB] | files [MB] |")
    print("|---|---|---|---|---|---|---|")
    for tasks, shards in ((1000, 1), (10_000, 1), (100_000, 10), (1_000_000, 100), (1_000_000, 1000)):
        with tempfile.TemporaryDirectory(prefix="airloop-cost-") as name:
            folder = Path(name)
            (folder / "plan.toml").write_text(f'kind = "empty"\n[sample]\ncount = {tasks}\n')
            plan, _ = cost(program, "plan", folder / "plan.toml", "--shards", shards, "-o", folder / "out")
            run, _ = cost(program, "run", folder / "out", "--threads", 1)
            merge, memory = cost(program, "merge", folder / "out")
            size = sum(file.stat().st_size for file in (folder / "out").rglob("*")) / 1e6
        print(f"| {tasks:.0e} | {shards} | {plan:.2f} | {run:.2f} | {merge:.2f} | {memory:.0f} | {size:.0f} |")


if __name__ == "__main__":
    main(sys.argv[1])
