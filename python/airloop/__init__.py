"""airloop in Python: simulate systems of FMUs, identify models from records, find what a declared model lacks.

>>> import airloop
>>> result = airloop.System("system.ssd").run(measured="record.csv")  # doctest: +SKIP
>>> result.fits["x"].fit_percent  # doctest: +SKIP

All numbers come from the library that the command ``airloop`` is made of; the package holds that command and the FMUs
of the project as well. NumPy is needed; pandas only by what returns or takes a DataFrame.
"""

import importlib
from typing import TYPE_CHECKING, Any

from ._folders import use_own_fmus as _use_own_fmus

if TYPE_CHECKING:
    from . import identify
    from ._native import (
        AirloopError,
        ClosedError,
        FmuError,
        RecordError,
        SettingError,
        SimulationError,
        SystemFileError,
        __version__,
    )
    from .commands import Outcome, excite, new_study, optimize, read_toml, stabilize, trials
    from .fmu import Finding, Fmu
    from .program import CommandError
    from .refinement import Report, refine
    from .result import Fit, Result
    from .rhs import RightHandSide
    from .series import TimeSeries
    from .simulation import Batch, Simulation
    from .solver import Solution, Solver
    from .system import Connector, System

# Modules are read when they are first used: `import airloop` stays fast, also for the console script.
_WHERE = {
    "AirloopError": "_native",
    "Batch": "simulation",
    "ClosedError": "_native",
    "CommandError": "program",
    "Connector": "system",
    "Finding": "fmu",
    "Fit": "result",
    "Fmu": "fmu",
    "FmuError": "_native",
    "Outcome": "commands",
    "RecordError": "_native",
    "Report": "refinement",
    "Result": "result",
    "RightHandSide": "rhs",
    "SettingError": "_native",
    "Simulation": "simulation",
    "SimulationError": "_native",
    "Solution": "solver",
    "Solver": "solver",
    "System": "system",
    "SystemFileError": "_native",
    "TimeSeries": "series",
    "__version__": "_native",
    "excite": "commands",
    "identify": "",
    "new_study": "commands",
    "optimize": "commands",
    "read_toml": "commands",
    "refine": "refinement",
    "stabilize": "commands",
    "trials": "commands",
}

__all__ = [
    "AirloopError",
    "Batch",
    "ClosedError",
    "CommandError",
    "Connector",
    "Finding",
    "Fit",
    "Fmu",
    "FmuError",
    "Outcome",
    "RecordError",
    "Report",
    "Result",
    "RightHandSide",
    "SettingError",
    "Simulation",
    "SimulationError",
    "Solution",
    "Solver",
    "System",
    "SystemFileError",
    "TimeSeries",
    "__version__",
    "excite",
    "identify",
    "new_study",
    "optimize",
    "read_toml",
    "refine",
    "stabilize",
    "trials",
]

_use_own_fmus()


def __getattr__(name: str) -> Any:
    where = _WHERE.get(name)
    if where is None:
        raise AttributeError(f"module 'airloop' has no attribute '{name}'")
    if not where:
        return importlib.import_module(f".{name}", __name__)
    value = getattr(importlib.import_module(f".{where}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
