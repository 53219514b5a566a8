"""The search for what a declared model lacks (``airloop refine``) and its report."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import program
from ._effects import effects_folder
from ._page import Drawing, drawings
from .commands import into, table_file

if TYPE_CHECKING:
    import pandas

    from .system import System

_ANSWERS = (0, 10, 11, 12, 13)


class Report:
    """What the search found; in a notebook it shows its page.

    Attributes
    ----------
    folder : pathlib.Path
        Folder with ``report.html``, ``report.md``, ``report.json`` and the amended system; a temporary one lives as
        long as this object.
    data : dict
        Content of ``report.json`` (schema: ``airloop refine --schema``).
    exit_code : int
        0 effect found, 10 nothing missing, 11 unexplained, 12 not separable, 13 a law.
    """

    def __init__(self, folder: Path, exit_code: int, kept: Any = None) -> None:
        self.folder = folder
        self.exit_code = exit_code
        self._kept = kept
        self.data: dict[str, Any] = json.loads((folder / "report.json").read_text())

    @classmethod
    def read(cls, folder: "str | os.PathLike[str]") -> "Report":
        """The report in a folder that ``airloop refine -o FOLDER`` wrote."""
        return cls(Path(folder), 0)

    @property
    def verdict(self) -> str:
        """``effect``, ``none``, ``unexplained`` or ``law``."""
        return str(self.data["verdict"])

    @property
    def selected(self) -> list[str]:
        """Ids of the effects that are missing, those with the largest contribution first."""
        return [one["id"] for one in self.data["effects"] if one.get("selected")]

    @property
    def effects(self) -> "pandas.DataFrame":
        """Effects, one row per parameter: id, selected, channel, share, parameter, value, unit, low, high (95 %)."""
        import pandas

        rows = []
        for one in self.data["effects"]:
            common = {key: one.get(key) for key in ("id", "selected", "channel", "port", "share", "score")}
            for parameter, value in (one.get("params") or {"": {}}).items():
                low, high = value.get("ci95") or (None, None)
                number = {"parameter": parameter, "value": value.get("value"), "unit": value.get("unit")}
                rows.append({**common, **number, "low": low, "high": high})
        names = ["id", "selected", "channel", "port", "share", "score", "parameter", "value", "unit", "low", "high"]
        frame: pandas.DataFrame = pandas.DataFrame(rows, columns=names)
        return frame

    @property
    def system(self) -> "System | None":
        """The amended system, ready to run; None if there is none."""
        from .system import System

        file = next(iter(sorted((self.folder / "system").glob("*.ssd"))), None)
        return None if file is None else System(file)

    @property
    def html(self) -> str:
        """The page as text; it needs no network."""
        return (self.folder / "report.html").read_text()

    @property
    def markdown(self) -> str:
        """The report as Markdown."""
        return (self.folder / "report.md").read_text()

    @property
    def figures(self) -> list[Drawing]:
        """Figures of the page in their order, with their titles and records."""
        return drawings(self.html)

    def figure(self, title: str, record: str | None = None) -> Drawing:
        """A figure of the page by its title, or a part of it that only one title has.

        Parameters
        ----------
        title
            Title, e.g. ``"x: measured less predicted"``; the first figure of that title where several records have one.
        record
            File of the record, e.g. ``"trial_07.csv"``.

        Raises
        ------
        KeyError
            There is no such figure; the message lists the titles.
        """
        own = [one for one in self.figures if record is None or one.record == record]
        found = [one for one in own if one.title == title] or [one for one in own if title in one.title]
        if not found or len({one.title for one in found}) > 1:
            titles = dict.fromkeys(one.title for one in (found or own or self.figures))
            what = f"`{title}` is part of several titles" if found else f"there is no figure `{title}`"
            raise KeyError(f"{what}{f' of {record}' if record else ''}; titles: {'; '.join(titles)}")
        return found[0]

    def save(self, folder: "str | os.PathLike[str]") -> Path:
        """Copies the folder of the report."""
        import shutil

        return Path(shutil.copytree(self.folder, folder, dirs_exist_ok=True))

    def _repr_html_(self) -> str:
        from html import escape

        return f'<iframe srcdoc="{escape(self.html, quote=True)}" width="100%" height="800"></iframe>'

    def __repr__(self) -> str:
        return f"<airloop.Report {self.verdict}: {', '.join(self.selected) or 'no effect'}>"


def refine(
    study: "str | os.PathLike[str] | Mapping[str, Any]",
    *,
    effects: "str | os.PathLike[str] | Mapping[str, Any] | Sequence[str | os.PathLike[str] | Mapping[str, Any]] | None" = None,
    output: "str | os.PathLike[str] | None" = None,
    folder: "str | os.PathLike[str]" = ".",
    set: Mapping[str, float] | None = None,
    progress: bool = True,
    **options: object,
) -> Report:
    """Finds the physical effects that a declared model lacks, from measured records.

    Parameters
    ----------
    study
        Folder with ``case.toml``, ``study.toml`` or ``dataset.toml``; a study file; or the content of a study as
        dictionary, with paths relative to ``folder``.
    effects
        Effects of one's own that are looked for as well: a dictionary, the text of an effect in TOML, a path, or a list of
        these; e.g. ``{"kind": "bristle", "port": "torque", "formula": "k*x^3", "parameters": {"k": {...}}}``.
    output
        Folder for the report; default: a temporary one.
    folder
        Base of the paths in a dictionary.
    set
        Numbers that decide the answer (``report.data["settings"]["table"]``).
    progress
        Show the progress, on a terminal or in a notebook.
    **options
        Options of the command line: ``max_effects=2``, ``budget="2 min"``, ``threads=1`` ...

    Returns
    -------
    Report
        Verdict, effects with intervals, amended system, page.

    Raises
    ------
    CommandError
        The study cannot be read or simulated; the message names file and place.
    KeyboardInterrupt
        Ctrl-C.
    """
    place, kept = into(output)
    with table_file(study, Path(folder)) as file, effects_folder(effects) as own:
        words = program.words({**options, "effects": own, "set": set})
        code, _ = program.run(["refine", file, *words, "-o", str(place)], allowed=_ANSWERS, progress=progress)
    return Report(place, code, kept)
