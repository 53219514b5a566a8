"""Progress in a notebook: an output of the cell that is renewed, and empty in the end."""

import sys
import types

import pytest

import airloop


class Handle:
    """An output of a cell."""

    def __init__(self, shown):
        self.shown = shown

    def update(self, data, raw):
        assert raw
        self.shown.append(data["text/plain"])


@pytest.fixture
def notebook(monkeypatch):
    """A notebook, as far as the package can tell: the texts that it shows."""
    shown = []

    def display(data, raw, display_id):
        assert raw and display_id
        shown.append(data["text/plain"])
        return Handle(shown)

    ipython, outputs = types.ModuleType("IPython"), types.ModuleType("IPython.display")
    ipython.get_ipython = lambda: types.SimpleNamespace(kernel=None)
    outputs.display = display
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", outputs)
    return shown


def test_a_command_tells_its_progress_and_its_errors_come_through(notebook, examples):
    report = airloop.refine(examples / "study.toml")
    assert report.verdict == "effect"
    assert len(notebook) > 1 and notebook[-1] == "" and not any("progress: " in text for text in notebook)
    with pytest.raises(airloop.CommandError, match="nothing.toml"):
        airloop.refine(examples / "nothing.toml")


def test_a_run_tells_its_steps(notebook, system):
    system.run(stop=200, progress=True)
    assert "of 200000 steps" in notebook[0] and notebook[-1] == ""


def test_nothing_is_shown_where_nobody_looks_or_asks(notebook, system, examples):
    system.run(stop=1)
    airloop.refine(examples / "study.toml", progress=False)
    assert notebook == []
