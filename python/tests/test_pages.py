"""Command lines of the pages: those of the how-to run, in its order; all others are at least ones that the program takes."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from airloop import _folders

BLOCK = re.compile(r"^ {4,}(airloop [a-z-].*)$", re.MULTILINE)
USAGE = 2
# Pages with commands; the tutorial has a test of its own.
PAGES = ("README.md", "docs", "examples", "data", "fmus", "orchestrator")


def lines(root, page):
    """Commands of a page, in its order."""
    return BLOCK.findall((root / page).read_text(encoding="utf-8"))


def shell(line, folder):
    """Runs a line as its reader would, with the program of the wheel."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    return subprocess.run(
        ["bash", "-c", line], cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True
    )


def all_lines(root):
    """(page, command) of every page but those that are generated."""
    pages = [page for part in PAGES for page in ([root / part] if (root / part).is_file() else sorted((root / part).rglob("*.md")))]
    own = [page.relative_to(root) for page in pages if page.name != "commands.md"]
    return [(page, line) for page in own for line in lines(root, page)]


def test_the_program_takes_every_command_of_the_pages(root, tmp_path):
    """Most fail as their files are missing in an empty folder; none may be wrong usage."""
    found = all_lines(root)
    assert len(found) > 60
    # What would work, and for long, without any file.
    long = [line for _, line in found if line.startswith(("airloop rig record", "airloop demo"))]
    refused = []
    for page, line in dict.fromkeys(found):
        if line in long:
            continue
        done = shell(line, tmp_path)
        if done.returncode == USAGE:
            refused.append(f"{page}: {line}\n{done.stderr}")
    assert not refused, "\n".join(refused)


@pytest.fixture(scope="module")
def repository(root, tmp_path_factory):
    """What the reader of the how-to has: examples and records of the repository, FMUs, and files of their own."""
    folder = tmp_path_factory.mktemp("how-to")
    shutil.copytree(root / "examples", folder / "examples")
    named = re.findall(r"data/rig/(\w+)", "\n".join(lines(root, "docs/how-to.md")))
    for case in sorted(set(named)):
        shutil.copytree(root / "data" / "rig" / case, folder / "data" / "rig" / case)
    shutil.copytree(_folders.FMUS, folder / "target" / "fmu")
    text = (root / "examples" / "01_run" / "system.ssd").read_text(encoding="utf-8")
    (folder / "system.ssd").write_text(text.replace("../../target", "target"), encoding="utf-8")
    shutil.copy(root / "examples" / "01_run" / "cart.ssv", folder)
    shutil.copy(_folders.FMUS / "pendulum.fmu", folder / "some-other-tool.fmu")
    prepared = shell(
        "airloop excite chirp --amplitude 10 --band 0.1..12Hz --duration 3s -o command.csv"
        " && airloop rig record --plan rod-fixed -o records"
        " && cp records/chirp_20.csv chirp.csv && cp records/stairs.csv stairs.csv && cp records/chirp_validation.csv check.csv",
        folder,
    )
    assert prepared.returncode == 0, prepared.stdout + prepared.stderr
    return folder


def test_the_how_to_runs(root, repository):
    # There is nothing to continue after a run that was not killed; tests/fmpy/test_restart.py kills some.
    found = [line for line in lines(root, "docs/how-to.md") if "--restart-from" not in line]
    assert len(found) > 25
    for line in found:
        done = shell(line, repository)
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
