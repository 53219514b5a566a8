"""Folders inside the package: the FMUs of the project and the program."""

import os
import sys
from pathlib import Path

PACKAGE = Path(__file__).parent
FMUS = PACKAGE / "fmu"
PROGRAM = PACKAGE / "bin" / ("airloop.exe" if sys.platform == "win32" else "airloop")
EXAMPLES = PACKAGE / "examples"


def use_own_fmus() -> None:
    """Lets library and program find the FMUs of the package, unless AIRLOOP_FMUS names others."""
    if FMUS.is_dir() and not os.environ.get("AIRLOOP_FMUS"):
        os.environ["AIRLOOP_FMUS"] = str(FMUS)
