"""Every block of docs/tutorial.md, docs/python-how-to.md and python/README.md runs, in the order of the page."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import airloop
from airloop import _folders

TAB = re.compile(r'^=== "(.+)"$')


def blocks(page, tab):
    """Code of the blocks under a tab, without its indentation."""
    found, inside, code = [], None, None
    for line in page.splitlines():
        if match := TAB.match(line):
            inside = match[1]
        elif line and not line.startswith(" "):
            inside = None
        elif inside == tab and line.strip().startswith("```"):
            if code is None:
                code = []
            else:
                found.append("\n".join(code))
                code = None
        elif code is not None:
            code.append(line.removeprefix("    "))
    return found


@pytest.fixture(scope="module")
def page(root):
    file = root / "docs" / "tutorial.md"
    return file.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory, examples):
    """What the reader of the tutorial has: the records and the FMU."""
    made = tmp_path_factory.mktemp("tutorial")
    for name in ("swing.csv", "tail.csv"):
        shutil.copy(examples / name, made)
    shutil.copy(_folders.FMUS / "pendulum.fmu", made)
    return made


def test_the_how_to_of_python_runs(root, folder, monkeypatch, capsys):
    page = (root / "docs" / "python-how-to.md").read_text(encoding="utf-8")
    monkeypatch.chdir(folder)
    names = {}
    for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        exec(compile(code, "docs/python-how-to.md", "exec"), names)
    printed = capsys.readouterr().out
    assert "cannot be converted to [N]" in printed and "ms per solve; solved" in printed
    assert names["result"].fits["x"].fit_percent > 99


def test_the_readme_of_the_package_runs(root, examples, monkeypatch, capsys):
    page = (root / "python" / "README.md").read_text(encoding="utf-8")
    monkeypatch.chdir(examples)
    names = {}
    for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        exec(compile(code, "python/README.md", "exec"), names)
    assert float(capsys.readouterr().out.split()[0]) > 99
    assert sorted(names["report"].selected) == ["pole.coulomb", "pole.quaddrag"]


def test_the_tutorial_finds_the_effects_on_both_sides(page, folder, monkeypatch):
    commands, python = blocks(page, "Command line"), blocks(page, "Python")
    assert len(commands) == len(python) == page.count('=== "Python"') > 5
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    script = "set -e\n" + "\n".join(commands)
    done = subprocess.run(["bash", "-c", script], cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    by_command = airloop.Report.read(folder / "report")
    monkeypatch.chdir(folder)
    names = {}
    for code in python:
        exec(compile(code, "docs/tutorial.md", "exec"), names)
    by_python = names["report"]
    assert by_command.selected == by_python.selected
    # The effects with which the record was made (examples/06_study/make_records.py), as the page says.
    assert sorted(by_python.selected) == sorted(re.findall(r"`(pole\.\w+)`", page.split("that is the answer")[1])[:2])
    assert by_command.effects.equals(by_python.effects)
    value = by_python.effects.query("selected").set_index("id")["value"]
    assert value["pole.coulomb"] == pytest.approx(4.0e-4, rel=0.02)
    assert value["pole.quaddrag"] == pytest.approx(3.0e-5, rel=0.02)
    assert (folder / "better_pendulum.fmu").is_file() and (folder / "better_pendulum_2.fmu").is_file()
