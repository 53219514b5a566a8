"""The command `airloop`, run as a user runs it: the release binary, or the one that AIRLOOP names."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BINARY = ROOT / os.environ.get("AIRLOOP", "target/release/airloop")


def start(*arguments, cwd=ROOT):
    """The finished process, whatever its exit code."""
    if not BINARY.exists():
        pytest.fail(f"{BINARY} does not exist: run `make fmu` first")
    environment = {"AIRLOOP_FMUS": str(ROOT / "target" / "fmu"), **os.environ}
    command = [BINARY, *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, env=environment)


def airloop(*arguments, code=0):
    """The standard output of a command that ends with `code`."""
    result = start(*arguments)
    assert result.returncode == code, result.stdout + result.stderr
    return result.stdout
