"""Commands that write a folder of results: excite, optimize, stabilize, trials, new study."""

import csv
import json
import os
import tempfile
import weakref
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import data, program
from ._native import from_toml, to_toml

if TYPE_CHECKING:
    import pandas

_INFEASIBLE = (0, 20, 21, 22)


class Outcome:
    """Folder that a command wrote.

    Attributes
    ----------
    folder : pathlib.Path
        The folder; a temporary one lives as long as this object.
    summary : dict
        Content of ``summary.json``, empty if the command writes none.
    text : str
        What the command printed.
    exit_code : int
        Exit code; 0, or an answer of its own (see ``docs/commands.md``).
    """

    def __init__(self, folder: Path, text: str, exit_code: int, kept: Any = None) -> None:
        self.folder = folder
        self.text = text
        self.exit_code = exit_code
        self._kept = kept
        file = folder / "summary.json"
        self.summary: dict[str, Any] = json.loads(file.read_text()) if file.is_file() else {}

    def table(self, name: str) -> "pandas.DataFrame":
        """A CSV file of the folder as DataFrame, e.g. ``table("trajectory")``."""
        import pandas

        file = self.folder / (name if name.endswith(".csv") else f"{name}.csv")
        # pandas 2 rounds correctly only when asked to; pandas 3 always does, and warns of the question.
        exact: dict[str, Any] = {"float_precision": "round_trip"} if pandas.__version__.startswith("2.") else {}
        frame: pandas.DataFrame = pandas.read_csv(file, **exact)
        return frame

    def svg(self, name: str) -> str:
        """A figure of the folder as SVG text."""
        return (self.folder / (name if name.endswith(".svg") else f"{name}.svg")).read_text()

    def _repr_html_(self) -> str:
        page = self.folder / "index.html"
        if page.is_file():
            from html import escape

            return f'<iframe srcdoc="{escape(page.read_text(), quote=True)}" width="100%" height="700"></iframe>'
        return f"<pre>{self.text}</pre>"

    def __repr__(self) -> str:
        return f"<airloop.{type(self).__name__} {self.folder}>\n{self.text}"


@contextmanager
def table_file(table: "str | os.PathLike[str] | Mapping[str, Any]", folder: Path) -> Iterator[str]:
    """A TOML file with the table; one that is written lies in ``folder`` for the time of the block."""
    if not isinstance(table, Mapping):
        yield os.fspath(table)
        return
    text = to_toml(json.dumps(table))
    handle, name = tempfile.mkstemp(prefix=".airloop-", suffix=".toml", dir=folder)
    try:
        with open(handle, "w") as out:
            out.write(text)
        yield name
    finally:
        os.unlink(name)


def read_toml(path: "str | os.PathLike[str]") -> dict[str, Any]:
    """Content of a TOML file (study, problem, settings) as dictionary, to be changed and given to a command."""
    content: dict[str, Any] = json.loads(from_toml(Path(path).read_text(encoding="utf-8")))
    return content


def into(output: "str | os.PathLike[str] | None") -> tuple[Path, Any]:
    """The folder for results, and what keeps a temporary one alive."""
    if output is not None:
        return Path(output), None
    kept = tempfile.TemporaryDirectory(prefix="airloop-")
    return Path(kept.name), kept


def command(
    words: Sequence[str],
    options: Mapping[str, object],
    output: "str | os.PathLike[str] | None",
    *,
    allowed: Sequence[int] = (0,),
    progress: bool = False,
) -> Outcome:
    """Runs a command that writes a folder."""
    folder, kept = into(output)
    line = [*words, *program.words(options), "-o", str(folder)]
    code, text = program.run(line, allowed=allowed, progress=progress)
    return Outcome(folder, text, code, kept)


def optimize(
    problem: "str | os.PathLike[str] | Mapping[str, Any]",
    *,
    output: "str | os.PathLike[str] | None" = None,
    folder: "str | os.PathLike[str]" = ".",
    progress: bool = True,
    **options: object,
) -> Outcome:
    """Finds a motion for a system of FMUs (``airloop optimize``).

    Parameters
    ----------
    problem
        Problem file, or its content as dictionary; paths in it are then relative to ``folder``.
    output
        Folder for the results; default: a temporary one.
    folder
        Base of the paths in a dictionary.
    progress
        Show the progress, on a terminal or in a notebook.
    **options
        Options of the command line: ``intervals=200``, ``no_plots=True`` ...

    Returns
    -------
    Outcome
        ``exit_code`` 0 solved, 20 infeasible, 21 not solved, 22 not evaluated; ``table("trajectory")`` is the motion.
    """
    kept = ExitStack()
    file = kept.enter_context(table_file(problem, Path(folder)))
    try:
        outcome = command(["optimize", file], options, output, allowed=_INFEASIBLE, progress=progress)
    except BaseException:
        kept.close()
        raise
    # `stabilize` reads the problem again: a file that stands for a dictionary lives as long as the plan.
    weakref.finalize(outcome, kept.close)
    return outcome


def stabilize(
    plan: "str | os.PathLike[str] | Outcome",
    settings: "str | os.PathLike[str] | Mapping[str, Any] | None" = None,
    *,
    output: "str | os.PathLike[str] | None" = None,
    **options: object,
) -> Outcome:
    """Makes a regulator with state estimator that keeps a system on its plan (``airloop stabilize``).

    Parameters
    ----------
    plan
        What :func:`optimize` returned, its folder, or a trajectory as CSV file.
    settings
        Settings file, or its content as dictionary.
    output
        Folder for the results; default: a temporary one.
    **options
        Options of the command line.

    Returns
    -------
    Outcome
        With ``controller.fmu`` and ``closed_loop.ssd`` in its folder.
    """
    kept = plan
    place = str(plan.folder) if isinstance(plan, Outcome) else os.fspath(plan)
    if settings is None:
        outcome = command(["stabilize", place], options, output)
    else:
        with tempfile.TemporaryDirectory() as folder, table_file(settings, Path(folder)) as file:
            outcome = command(["stabilize", place, file], options, output)
    # The closed loop refers to files of the plan.
    outcome._kept = (outcome._kept, kept)
    return outcome


def trials(
    system: "str | os.PathLike[str] | Outcome",
    *,
    output: "str | os.PathLike[str] | None" = None,
    progress: bool = True,
    **options: object,
) -> Outcome:
    """Tries a stabilized plan on perturbed systems with sensor noise (``airloop trials``).

    Parameters
    ----------
    system
        What :func:`stabilize` returned, or its folder.
    output
        Folder for the results; default: a temporary one.
    progress
        Show the progress, on a terminal or in a notebook.
    **options
        Options of the command line: ``count=200``, ``scale=2`` ...

    Returns
    -------
    Outcome
        ``table("trials")`` has one row per trial.
    """
    place = str(system.folder) if isinstance(system, Outcome) else os.fspath(system)
    return command(["trials", place], options, output, progress=progress)


def excite(kind: str, **options: object) -> "dict[str, Any]":
    """A command for an experiment (``airloop excite``).

    Parameters
    ----------
    kind
        ``chirp``, ``stairs``, ``multisine`` or ``prbs``.
    **options
        Options of the command line: ``band="0.1..12Hz"``, ``amplitude=20``, ``duration="30s"`` ...

    Returns
    -------
    dict of str to numpy.ndarray
        The time and the command, for ``System.run(inputs=...)``.
    """
    import numpy as np

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "command.csv"
        program.run(["excite", kind, *program.words(options), "-o", str(file)])
        header, *rows = file.read_text().splitlines()
        names = next(iter(csv.reader([header])))
        numbers = np.array([[float(cell) for cell in row.split(",")] for row in rows])
        return {name: np.ascontiguousarray(numbers[:, index]) for index, name in enumerate(names)}


def new_study(
    folder: "str | os.PathLike[str]",
    records: "data.Signals | Sequence[data.Signals]",
    *,
    system: "str | os.PathLike[str]",
    signals: Mapping[str, str] | None = None,
) -> Path:
    """Writes a commented ``study.toml`` from the columns of records (``airloop new study``).

    Parameters
    ----------
    folder
        New folder for the study; records that are no files are written into it.
    records
        CSV file, DataFrame or mapping, or a list of them.
    system
        System or FMU of the study; ``airloop:NAME`` for one of this project.
    signals
        Columns of another name, ``{input or output: column}``.

    Returns
    -------
    pathlib.Path
        The study file, ready for :func:`airloop.refine`.
    """
    several = records if isinstance(records, (list, tuple)) else [records]
    with tempfile.TemporaryDirectory() as scratch:
        files = [
            data.write(one, Path(scratch) / f"record_{index + 1}.csv", "records") for index, one in enumerate(several)
        ]
        named = {"from": [str(file) for file in files], "system": os.fspath(system), "signal": signals}
        options = program.words(named)
        program.run(["new", "study", os.fspath(folder), *options])
    return Path(folder) / "study.toml"
