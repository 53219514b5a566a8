"""Finds the FMUs under test. Every test that takes `fmu` runs once for each of them.

    pytest tests/fmpy                       target/fmu/*.fmu and target/fmu/test/*.fmu
    pytest tests/fmpy --fmus=DIR            the FMUs of another folder and its folder test (also: environment AIRLOOP_FMUS)
"""

import os
import sys
from pathlib import Path

import fmpy.simulation
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from fmu import Fmu  # noqa: E402  (needs the path above)

ROOT = Path(__file__).resolve().parents[2]

# FMPy has one logger proxy for the process. It calls the logger that was given last, also in later simulations without one, when
# Python has freed it; so all of them are kept.
_LOGGERS = []
_new_logger = fmpy.simulation.fmi2CallbackLoggerTYPE


def _kept_logger(function):
    _LOGGERS.append(_new_logger(function))
    return _LOGGERS[-1]


fmpy.simulation.fmi2CallbackLoggerTYPE = _kept_logger


def pytest_addoption(parser):
    parser.addoption("--fmus", metavar="DIR", help="folder with the FMUs to test (default: target/fmu and its folder test)")


def _folders(config):
    other = config.getoption("--fmus") or os.environ.get("AIRLOOP_FMUS")
    folder = Path(other) if other else ROOT / "target" / "fmu"
    return [folder, folder / "test"]


def _files(config):
    files = [path for folder in _folders(config) for path in sorted(folder.glob("*.fmu"))]
    if not files:
        raise pytest.UsageError(f"no .fmu file in {', '.join(map(str, _folders(config)))}: run `make fmu` first")
    return files


def pytest_generate_tests(metafunc):
    if "fmu" in metafunc.fixturenames:
        files = _files(metafunc.config)
        metafunc.parametrize("fmu", files, ids=[path.stem for path in files], indirect=True, scope="session")


@pytest.fixture(scope="session")
def _unpacked():
    return {}


@pytest.fixture(scope="session")
def fmu(request, _unpacked, tmp_path_factory):
    path = request.param
    if path not in _unpacked:
        _unpacked[path] = Fmu(path, tmp_path_factory.mktemp(path.stem))
    return _unpacked[path]


@pytest.fixture(scope="session")
def shipped(request, _unpacked, tmp_path_factory):
    """Function name -> Fmu, for tests about one named FMU of this project; skips when another folder is under test."""

    def find(name):
        paths = [path for path in _files(request.config) if path.stem == name]
        if not paths:
            if request.config.getoption("--fmus") or os.environ.get("AIRLOOP_FMUS"):
                pytest.skip(f"{name}.fmu is not in the folder under test")
            pytest.fail(f"{name}.fmu is not in {', '.join(map(str, _folders(request.config)))}")
        if paths[0] not in _unpacked:
            _unpacked[paths[0]] = Fmu(paths[0], tmp_path_factory.mktemp(name))
        return _unpacked[paths[0]]

    return find
