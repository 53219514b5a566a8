"""Trials of the stabilized swing-up as sweeps of 1, 2 and 3 shards on 1 and 2 threads: the same bytes, the rows of
`airloop trials`, and what the engine adds to the bare loop.

    python tests/study/sweep/trials.py target/release/airloop [TASKS, default 10000]
"""

import csv
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
EXAMPLE = ROOT / "examples/03_swing_up"


def seconds(*command):
    """Processor time of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def rows(path, names):
    with open(path) as file:
        return [[row[name] for name in names] for row in csv.DictReader(file)]


def main(program, tasks=10_000):
    # Half of the trials with feedback, half without.
    count = int(tasks) // 2
    with tempfile.TemporaryDirectory(prefix="airloop-trials-") as name:
        folder = Path(name)
        options = ["--transcription", "multiple-shooting", "--intervals", 100, "--no-verification", "--no-plots"]
        seconds(program, "optimize", EXAMPLE / "problem.toml", *options, "-o", folder / "plan")
        seconds(program, "stabilize", folder / "plan", EXAMPLE / "stabilize.toml", "-o", folder / "held")
        alone = ["--count", count, "--seed", 1, "--threads", 1, "--no-plots"]
        plan = folder / "plan.toml"
        plan.write_text(f'kind = "trials"\nsystem = "held"\nseed = 1\n[trials]\ncount = {count}\n')
        truth = None
        for shards in (1, 2, 3):
            # Again each time: what else the machine does changes the speed of a processor.
            bare = seconds(program, "trials", folder / "held", *alone, "-o", folder / "alone")
            for threads in (1, 2):
                out = folder / f"{shards}-{threads}"
                used = seconds(program, "sweep", "plan", plan, "-q", "-o", out)
                for shard in range(shards, 0, -1):
                    part = f"{shard}/{shards}"
                    used += seconds(program, "sweep", "run", out, "-q", "--shard", part, "--threads", threads)
                used += seconds(program, "sweep", "merge", out, "-q")
                found = [(out / file).read_bytes() for file in ("results.csv", "results.parquet")]
                truth = truth or found
                assert found == truth, f"{shards} shards, {threads} threads: other bytes"
                more = 100 * (used / bare - 1)
                print(f"{shards} shards, {threads} threads: {used:.1f} s of processor time, {more:+.1f} % of {bare:.1f} s", flush=True)
        names = ("seed", "loop", "reach", "held", "bounds")
        same = rows(folder / "alone" / "trials.csv", names) == rows(folder / "1-1" / "results.csv", names)
        assert same, "other rows than those of `airloop trials`"
    print(f"{2 * count} trials: the same bytes, and the rows of `airloop trials`")


if __name__ == "__main__":
    main(*sys.argv[1:])
