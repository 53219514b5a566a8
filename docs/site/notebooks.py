"""Notebooks as pages: each is executed, and becomes Markdown with the figures and tables that its cells gave.

A notebook lies in the repository without outputs. A cell that fails ends the build.
"""

import base64
import html
import re
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

# Longest time of a cell [s]: a search on a slow machine takes some minutes.
LONGEST_CELL_S = 900
FRAME = re.compile(r'<iframe srcdoc="(.*?)"', re.DOTALL)
# What pandas says about the looks of a table; the site has its own.
LOOKS = re.compile(r'<style.*?</style>| border="1" class="dataframe"| style="text-align: right;"', re.DOTALL)
BLANK_LINES = re.compile(r"\n\s*\n")
# Richest form first, as a notebook shows it.
FORMS = ("text/html", "image/svg+xml", "image/png", "text/plain")


def sources(file):
    """The notebook, with the text of its cells as one string each."""
    return nbformat.read(file, as_version=4)


def execute(file, folder):
    """The notebook with outputs; it runs in `folder`."""
    notebook = sources(file)
    kept = [cell for cell in notebook.cells if cell.cell_type == "code" and cell.outputs]
    if kept:
        raise SystemExit(f"{file} is under version control with {len(kept)} outputs: clear them, the build makes them")
    client = NotebookClient(notebook, timeout=LONGEST_CELL_S, kernel_name="python3", resources={"metadata": {"path": str(folder)}})
    try:
        return client.execute()
    except CellExecutionError as error:
        raise SystemExit(f"{file}: a cell failed\n{error}") from None


def page(file, copy, scratch, linked):
    """Writes the executed notebook `file` as the page `copy`, with what it shows beside it; `linked` mends the links of
    Markdown cells."""
    notebook = execute(file, scratch)
    lines = []
    shown = Shown(copy)
    for number, cell in enumerate(notebook.cells):
        if cell.cell_type == "markdown":
            lines += [linked(cell.source), ""]
            continue
        lines += ["```python", cell.source, "```", ""]
        for output in cell.outputs:
            lines += [shown.output(output, number), ""]
    note = f"[This page as a notebook]({file.name}); its outputs were made when the page was."
    first = next(index for index, line in enumerate(lines) if line.startswith("# "))
    heading, _, rest = lines[first].partition("\n")
    lines[first] = f"{heading}\n\n{note}\n{rest}"
    copy.write_text("\n".join(lines) + "\n", encoding="utf-8")


class Shown:
    """Files with the outputs of a page."""

    def __init__(self, page_file):
        self.page = page_file
        self.count = 0

    def file(self, suffix, content):
        """Writes the next file; returns its name."""
        self.count += 1
        name = f"{self.page.stem}_{self.count}{suffix}"
        (self.page.parent / name).write_bytes(content)
        return name

    def output(self, output, number):
        """An output as Markdown."""
        if output.output_type == "stream":
            return fenced(output.text)
        data = output.data
        form = next(form for form in FORMS if form in data)
        if form == "image/svg+xml":
            return f"![Figure of cell {number}]({self.file('.svg', data[form].encode())})"
        if form == "image/png":
            return f"![Figure of cell {number}]({self.file('.png', base64.b64decode(data[form]))})"
        if form == "text/plain":
            return fenced(data[form])
        # A whole page inside a page lies in a file of its own.
        inner = FRAME.search(data[form])
        if inner:
            name = self.file(".html", html.unescape(inner[1]).encode())
            return f'<iframe src="{name}" width="100%" height="800" style="border: 1px solid #8888"></iframe>'
        # Python-Markdown takes a block of HTML as it is up to a blank line.
        table = BLANK_LINES.sub("\n", LOOKS.sub("", data[form]).strip())
        return f'<div class="md-typeset__table">{table}</div>'


def fenced(text):
    """Text as it was printed."""
    return f"```text\n{text.rstrip()}\n```"
