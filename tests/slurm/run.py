"""One plan here and on a Slurm cluster of three nodes, one of which is killed in the middle: the same bytes.

    python tests/slurm/run.py target/release/airloop [PLAN.toml]
"""

import contextlib
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cluster

ROOT = Path(__file__).resolve().parents[2]
SHARDS = 12
PLAN = """\
kind = "simulate"
system = "{system}"
seed = 1
[run]
stop = 4
step = 0.0005
[sample]
method = "latin-hypercube"
count = 3600
[[factors]]
name = "cart_pole.m_p"
from = 0.1
to = 0.5
[[factors]]
name = "u"
from = 5
to = 10
[[quantities]]
name = "theta_peak"
signal = "theta"
of = "peak"
[[quantities]]
name = "x_final"
signal = "x"
of = "final"
"""


def main(program, given=None):
    if os.geteuid() != 0 or cluster.missing():
        print(f"skipped: needs root and {', '.join(cluster.missing()) or 'nothing else'}")
        print("run as root: apt-get install -y slurmctld slurmd slurm-client munge && make test-slurm")
        return 0
    with tempfile.TemporaryDirectory(prefix="airloop-sweep-") as name:
        folder = Path(name)
        plan = Path(given or folder / "plan.toml")
        if given is None:
            plan.write_text(PLAN.format(system=ROOT / "examples/01_run/system.ssd"))

        def airloop(*words, environment=None):
            return subprocess.run([program, "sweep", *map(str, words)], check=True, env=environment, text=True,
                                  capture_output=True).stdout

        def finished():
            return len(list((folder / "there" / "shards").glob("*.csv")))

        airloop("plan", plan, "--shards", SHARDS, "-o", folder / "here")
        began = time.monotonic()
        airloop("run", folder / "here", "--quiet")
        airloop("merge", folder / "here")
        print(f"here: {time.monotonic() - began:.1f} s")
        try:
            slurm = cluster.Cluster()
        except (OSError, RuntimeError) as error:
            print(f"skipped: the cluster does not start here: {error}")
            return 0
        with contextlib.closing(slurm):
            there = folder / "there"
            airloop("plan", plan, "--shards", SHARDS, "-o", there)
            began = time.monotonic()
            airloop("submit", there, "--engine", "slurm", environment=slurm.environment)
            job = json.loads((there / "submission.json").read_text())["job"]
            again = subprocess.run([program, "sweep", "submit", there, "--engine", "slurm"], env=slurm.environment,
                                   capture_output=True, text=True)
            assert again.returncode == 1 and "runs this folder already" in again.stderr, again
            told = subprocess.run([program, "sweep", "status", there], env=slurm.environment, capture_output=True, text=True)
            states = re.search(rf"Slurm job {job} with {SHARDS} shards; (.*)", told.stdout)
            waiting = sum(int(part.split()[0]) for part in states[1].split(", ")) if states else 0
            assert 0 < waiting <= SHARDS, told
            slurm.wait(lambda: finished() >= 3, "three shards are finished", 120)
            slurm.wait(lambda: slurm.working_node() is not None, "a node runs a shard", 60)
            node = slurm.working_node()
            killed = slurm.kill_node(node)
            seconds = time.monotonic() - began
            print(f"node {node} and {killed} processes on it killed after {finished()} shards, {seconds:.1f} s")
            assert killed >= 2, "the node runs a shard"
            slurm.wait_for_job(job, 600)
            restarts = slurm.restarts(job)
            assert restarts >= 1, "its shard was queued again"
            airloop("merge", there)
            print(f"there: {time.monotonic() - began:.1f} s, {restarts} shards queued again, nodes {slurm.states()}")
        for file in ("results.csv", "results.parquet"):
            same = (folder / "here" / file).read_bytes() == (there / file).read_bytes()
            print(f"{file}: {'the same bytes' if same else 'DIFFERENT'}")
            assert same, file
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
