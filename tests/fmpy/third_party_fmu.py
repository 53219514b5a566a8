"""FMUs in C of machines whose declared equations a test types, made as the study of third-party machines makes its own."""

import importlib.util
import sys

from command import ROOT

BENCH = ROOT / "tests" / "study" / "third_party"
sys.path.append(str(BENCH))
from systems import System  # noqa: E402, F401

# Another module of these tests has the same name.
_spec = importlib.util.spec_from_file_location("bench_fmu", BENCH / "fmu.py")
_fmu = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_fmu)
make = _fmu.make


def build(system, equations, folder):
    """NAME.fmu of a system with its `equations` in C, in `folder`."""
    home = folder / "home"
    (home / "equations").mkdir(parents=True)
    (home / "equations" / f"{system.name}.h").write_text(equations)
    make(system, folder / f"{system.name}.fmu", home)
