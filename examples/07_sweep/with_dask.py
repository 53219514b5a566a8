"""Runs the shards of a plan as tasks of dask: ``python with_dask.py PROGRAM FOLDER SHARDS [SCHEDULER ADDRESS]``."""

import subprocess
import sys

from dask.distributed import Client, as_completed


def run_shard(program, folder, shard):
    """One shard; a finished one is skipped, so that dask may run it again as it likes."""
    subprocess.run([program, "sweep", "run", folder, "--shard", shard, "--threads", "1", "--quiet"], check=True)
    return shard


def main(program, folder, shards, address=None):
    with Client(address) if address else Client(n_workers=2, threads_per_worker=1, dashboard_address=None) as client:
        names = [f"{index}/{shards}" for index in range(1, int(shards) + 1)]
        tasks = [client.submit(run_shard, program, folder, name, retries=2, pure=False) for name in names]
        for done in as_completed(tasks):
            print("finished", done.result())
    subprocess.run([program, "sweep", "merge", folder], check=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
