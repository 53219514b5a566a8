"""How far long work is: a line that is renewed, on a terminal or in a notebook."""

import os
import sys
from typing import Any, Protocol


class Line(Protocol):
    """A line that is renewed."""

    def show(self, text: str) -> None:
        """Puts a text in place of the one before."""

    def close(self) -> None:
        """Takes the line away."""


class _Nothing:
    def show(self, text: str) -> None:
        pass

    def close(self) -> None:
        pass


class _Terminal:
    def show(self, text: str) -> None:
        width = os.get_terminal_size(sys.stderr.fileno()).columns
        sys.stderr.write(f"\r\x1b[2K{text[: width - 1]}")
        sys.stderr.flush()

    def close(self) -> None:
        sys.stderr.write("\r\x1b[2K")
        sys.stderr.flush()


class _Notebook:
    """An output of the cell, empty in the end."""

    def __init__(self) -> None:
        self._handle: Any = None

    def show(self, text: str) -> None:
        from IPython.display import display

        shown = {"text/plain": text}
        if self._handle is None:
            self._handle = display(shown, raw=True, display_id=True)
        else:
            self._handle.update(shown, raw=True)

    def close(self) -> None:
        if self._handle is not None:
            self._handle.update({"text/plain": ""}, raw=True)


def in_notebook() -> bool:
    """Whether this is a notebook, where outputs can be renewed."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return shell is not None and hasattr(shell, "kernel")


def line(wanted: bool = True) -> Line:
    """The line of this place; one that shows nothing where it is not wanted or nobody looks."""
    if wanted and in_notebook():
        return _Notebook()
    if wanted and sys.stderr.isatty():
        return _Terminal()
    return _Nothing()
