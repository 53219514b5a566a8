"""A sweep that is killed at random times and continued has the rows of one that was not: no task is lost or doubled.

    python tests/study/sweep/kills.py target/release/airloop TRIALS
"""

import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
TASKS, SHARDS = 500, 25
PLAN = f"""\
kind = "simulate"
system = "{ROOT / "examples/01_run/system.ssd"}"
[run]
stop = 0.5
[sample]
method = "sobol"
count = {TASKS}
[[factors]]
name = "cart_pole.m_p"
from = 0.1
to = 0.5
[[quantities]]
name = "theta_final"
signal = "theta"
of = "final"
"""


def main(program, trials):
    def sweep(*words):
        return subprocess.run([program, "sweep", *map(str, words)], check=True, capture_output=True)

    with tempfile.TemporaryDirectory(prefix="airloop-kills-") as name:
        folder = Path(name)
        (folder / "plan.toml").write_text(PLAN)
        sweep("plan", folder / "plan.toml", "--shards", SHARDS, "-o", folder / "whole")
        began = time.monotonic()
        sweep("run", folder / "whole")
        whole = time.monotonic() - began
        sweep("merge", folder / "whole")
        kills = 0
        for trial in range(trials):
            chance = random.Random(trial)
            killed = folder / f"killed{trial}"
            sweep("plan", folder / "plan.toml", "--shards", SHARDS, "-o", killed)
            for _ in range(20):
                threads = chance.choice("12")
                process = subprocess.Popen([program, "sweep", "run", str(killed), "--quiet", "--threads", threads])
                try:
                    process.wait(chance.uniform(0.05, 0.6) * whole)
                    break
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
                    kills += 1
            sweep("run", killed)
            sweep("merge", killed)
            tasks = [int(line.split(",", 1)[0]) for line in (killed / "results.csv").read_text().splitlines()[1:]]
            assert tasks == list(range(TASKS)), f"trial {trial}: {len(tasks)} rows"
            for file in ("results.csv", "results.parquet"):
                assert (killed / file).read_bytes() == (folder / "whole" / file).read_bytes(), f"trial {trial}: {file}"
        print(f"{trials} trials of {TASKS} tasks, {kills} kills: all rows, the same bytes ({whole:.1f} s unkilled)")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
