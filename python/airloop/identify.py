"""Models from records: ARX, state space, friction, comparison of orders (``airloop identify``).

Every function takes the records as CSV files, DataFrames or mappings, and the options of the command line as keyword
arguments. What it returns has ``summary`` (fits, orders, residual tests), ``model`` and the figures.
"""

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from . import data
from .commands import Outcome, command, read_toml


class Identified(Outcome):
    """A model and how well it fits."""

    @property
    def model(self) -> dict[str, Any]:
        """Content of the model file, empty where there is none."""
        file = next(iter(sorted(self.folder.glob("*.toml"))), None)
        return {} if file is None else read_toml(file)

    @property
    def fmu(self) -> Path | None:
        """The FMU, if one was asked for with ``fmu="name"``."""
        return next(iter(sorted(self.folder.glob("*.fmu"))), None)


def arx(
    records: "data.Signals | Sequence[data.Signals]",
    inputs: Sequence[str],
    outputs: Sequence[str],
    *,
    validate: "data.Signals | Sequence[data.Signals] | None" = None,
    output: "str | os.PathLike[str] | None" = None,
    **options: object,
) -> Identified:
    """ARX model ``A(q) y = B(q) u + e`` (``airloop identify arx``).

    Parameters
    ----------
    records
        Records of the estimation, evenly sampled.
    inputs, outputs
        Names of columns.
    validate
        Records that only judge the model.
    output
        Folder for the results; default: a temporary one.
    **options
        Options of the command line: ``na=1``, ``nb=2``, ``order="auto"``, ``fmu="actuator"`` ...
    """
    return _identify("arx", records, validate, {**_columns(inputs, outputs), **options}, output)


def state_space(
    records: "data.Signals | Sequence[data.Signals]",
    inputs: Sequence[str],
    outputs: Sequence[str],
    *,
    validate: "data.Signals | Sequence[data.Signals] | None" = None,
    output: "str | os.PathLike[str] | None" = None,
    **options: object,
) -> Identified:
    """State-space model by subspace methods, refined by output error (``airloop identify state-space``).

    Parameters are those of :func:`arx`, with ``order="auto"``, ``weighting="cva"`` ... as options.
    """
    return _identify("state-space", records, validate, {**_columns(inputs, outputs), **options}, output)


def friction(
    records: "data.Signals | Sequence[data.Signals]",
    force: str,
    *,
    validate: "data.Signals | Sequence[data.Signals] | None" = None,
    output: "str | os.PathLike[str] | None" = None,
    **options: object,
) -> Identified:
    """Coulomb and viscous friction from force and motion (``airloop identify friction``).

    Parameters
    ----------
    records
        Records of the estimation.
    force
        Column of the force that moves the part [N].
    validate
        Records that only judge the law.
    output
        Folder for the results; default: a temporary one.
    **options
        Options of the command line: ``velocity="v"``, ``mass=0.399``, ``fix={"c3": 0}`` ...
    """
    return _identify("friction", records, validate, {"force": force, **options}, output)


def compare(
    records: "data.Signals | Sequence[data.Signals]",
    inputs: Sequence[str],
    outputs: Sequence[str],
    *,
    validate: "data.Signals | Sequence[data.Signals] | None" = None,
    output: "str | os.PathLike[str] | None" = None,
    **options: object,
) -> Identified:
    """ARX and state-space models of rising order on validation data (``airloop identify compare``).

    Parameters are those of :func:`arx`; ``table("compare")`` has a row per model.
    """
    return _identify("compare", records, validate, {**_columns(inputs, outputs), **options}, output)


def _columns(inputs: Sequence[str], outputs: Sequence[str]) -> dict[str, object]:
    return {"inputs": ",".join(inputs), "outputs": ",".join(outputs)}


def _identify(
    kind: str, records: Any, validate: Any, options: dict[str, object], output: "str | os.PathLike[str] | None"
) -> Identified:
    with tempfile.TemporaryDirectory(prefix="airloop-") as folder:
        files = _files(records, Path(folder), "record")
        judges = _files(validate, Path(folder), "validation")
        line = [kind, *files, *(["--validate", *judges] if judges else [])]
        outcome = command(["identify", *line], options, output)
    return Identified(outcome.folder, outcome.text, outcome.exit_code, outcome._kept)


def _files(records: Any, folder: Path, label: str) -> list[str]:
    if records is None:
        return []
    several = records if isinstance(records, (list, tuple)) else [records]
    written = enumerate(several)
    return [str(data.write(one, folder / f"{label}_{index + 1}.csv", f"{label} {index + 1}")) for index, one in written]
