"""FMUs by themselves: what they declare, and whether they keep to the standard."""

import json
import os
from dataclasses import dataclass
from typing import Any

from . import program
from .system import _resolved


@dataclass(frozen=True)
class Finding:
    """Something that a check found.

    Attributes
    ----------
    severity : str
        ``error``, ``warning`` or ``note``.
    rule : str
        Rule that is broken.
    element : str
        Place in the FMU.
    message : str
        What is wrong and what to do.
    """

    severity: str
    rule: str
    element: str
    message: str


class Fmu:
    """An FMU.

    Parameters
    ----------
    path
        The ``.fmu`` file, or ``airloop:NAME`` for one of this project.

    Attributes
    ----------
    path : str
        The file.
    description : dict
        Content of its ``modelDescription.xml``.
    platforms : list of str
        Platforms that it has libraries for.

    Raises
    ------
    CommandError
        The archive or its description cannot be read.
    """

    def __init__(self, path: "str | os.PathLike[str]") -> None:
        self.path = _resolved(os.fspath(path))
        shown = json.loads(program.run(["inspect", "--json", "--", self.path])[1])
        self.description: dict[str, Any] = shown["model_description"]
        self.platforms: list[str] = shown["platforms"]

    @property
    def name(self) -> str:
        """Name of the model."""
        return str(self.description["model_name"])

    @property
    def variables(self) -> list[dict[str, Any]]:
        """Variables with causality, unit and start value, as ``airloop inspect --json`` has them."""
        return list(self.description["variables"])

    def check(self, *, run: bool = True, time_limit: float = 60.0) -> list[Finding]:
        """Checks the FMU against the standard.

        Parameters
        ----------
        run
            Also run its library, in a process of its own: a crash is a finding.
        time_limit
            Time [s] that the library may take.

        Returns
        -------
        list of Finding
            Empty for an FMU without faults.
        """
        words = program.words({"check": True, "json": True, "no_run": not run, "time_limit": time_limit if run else None})
        answer = json.loads(program.run(["inspect", *words, "--", self.path], allowed=(0, 1))[1])
        found = answer["checks"][0]["findings"]
        return [Finding(*(str(one[key]) for key in ("severity", "rule", "element", "message"))) for one in found]

    def __repr__(self) -> str:
        return f"<airloop.Fmu {self.name}>"
