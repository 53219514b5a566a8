"""Copies all pages of the repository into one folder for the documentation site, with their paths: `stage.py FOLDER`.
Notebooks are executed and become pages (`notebooks.py`).

Links between pages stay as they are; a link to something that is no page (a source file, a folder) becomes plain text,
as the site has no place for it. mkdocs refuses what is then still broken.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import notebooks

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
FIGURES = {".svg", ".png"}


def pages():
    """Pages and figures, but for what git ignores."""
    listed = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    files = [Path(line) for line in listed.splitlines()]
    return [file for file in files if file.suffix in {".md", ".ipynb", *FIGURES} and file.parts[0] != "modelDescriptions"]


def target(link, page, known):
    """Where a link leads inside of the site; None if nowhere."""
    path, _, anchor = link.partition("#")
    if "://" in path or path.startswith("mailto:") or not path:
        return link
    aim = Path(os.path.normpath(page.parent / path))
    if aim / "README.md" in known:
        aim = aim / "README.md"
    if aim not in known:
        return None
    # A link to a notebook leads to its page.
    if aim.suffix == ".ipynb":
        aim = aim.with_suffix(".md")
    return os.path.relpath(aim, page.parent) + (f"#{anchor}" if anchor else "")


def text_of(text, page, known):
    """Text of a page, whose links lead to pages."""

    def replaced(match):
        found = target(match[3], page, known)
        return match[2] if found is None else f"{match[1]}[{match[2]}]({found})"

    lines, fenced = [], False
    for line in text.splitlines():
        fenced ^= line.lstrip().startswith("```")
        lines.append(line if fenced else LINK.sub(replaced, line))
    return "\n".join(lines) + "\n"


def main():
    """Fills the folder anew."""
    folder = Path(sys.argv[1])
    shutil.rmtree(folder, ignore_errors=True)
    files = pages()
    known = set(files)
    for file in files:
        copy = folder / file
        copy.parent.mkdir(parents=True, exist_ok=True)
        if file.suffix == ".md":
            copy.write_text(text_of((ROOT / file).read_text(encoding="utf-8"), file, known), encoding="utf-8")
            continue
        shutil.copy2(ROOT / file, copy)
        if file.suffix == ".ipynb":
            began = time.monotonic()
            with tempfile.TemporaryDirectory() as scratch:
                notebooks.page(
                    ROOT / file, copy.with_suffix(".md"), scratch, lambda text, file=file: text_of(text, file, known)
                )
            print(f"{file}: {time.monotonic() - began:.1f} s")


if __name__ == "__main__":
    main()
