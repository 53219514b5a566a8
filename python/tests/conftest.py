"""The package under test is the one that is installed, never the source tree."""

import os
import signal
import subprocess
from pathlib import Path

import pytest

import airloop
from airloop import program

ROOT = Path(__file__).resolve().parents[2]


def pytest_sessionstart(session):
    # Shells start what runs in the background with Ctrl-C ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    installed = Path(airloop.__file__).resolve()
    if ROOT / "python" in installed.parents and not os.environ.get("AIRLOOP_SOURCE_TREE"):
        pytest.exit(f"{installed} is the source tree: install the wheel (`make test-wheel`)", returncode=2)


@pytest.fixture(scope="session")
def root():
    """Folder of the repository, for its examples and records."""
    return ROOT


@pytest.fixture(scope="session")
def examples():
    """Examples inside the package."""
    return Path(airloop.__file__).parent / "examples"


@pytest.fixture(scope="session")
def system(examples):
    """The pneumatic cart-pole of example 01."""
    return airloop.System(examples / "system.ssd")


@pytest.fixture
def command(tmp_path):
    """Runs the program of the wheel; returns the finished process."""

    def run(*words):
        return subprocess.run([program.path(), *map(str, words)], capture_output=True, text=True, cwd=tmp_path)

    return run
