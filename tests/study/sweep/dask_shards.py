"""The shards of example 07 as tasks of dask: the bytes of a run without it.

    python tests/study/sweep/dask_shards.py target/release/airloop
"""

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
EXAMPLE = ROOT / "examples/07_sweep"


def main(program):
    with tempfile.TemporaryDirectory(prefix="airloop-dask-") as name:
        here, there = Path(name) / "here", Path(name) / "there"
        for folder in (here, there):
            subprocess.run([program, "sweep", "plan", EXAMPLE / "sweep.toml", "-o", folder, "-q"], check=True)
        subprocess.run([program, "sweep", "run", here, "-q"], check=True)
        subprocess.run([program, "sweep", "merge", here, "-q"], check=True)
        subprocess.run([sys.executable, EXAMPLE / "with_dask.py", program, there, "6"], check=True)
        for file in ("results.csv", "results.parquet"):
            assert (here / file).read_bytes() == (there / file).read_bytes(), file
    print("dask: the same bytes")


if __name__ == "__main__":
    main(sys.argv[1])
