"""Figures of a page: the drawings inside of it, each able to stand alone."""

import os
import re
from html import unescape
from pathlib import Path

_FIGURE = re.compile(r"<figure\b[^>]*>(.*?)</figure>", re.DOTALL)
# Up to the last end: a drawing holds others, which cut curves off.
_DRAWING = re.compile(r"<svg\b([^>]*)>(.*)</svg>", re.DOTALL)
_STYLE = re.compile(r"<style>(.*?)</style>", re.DOTALL)


class Drawing:
    """A figure of a report, as SVG; a notebook shows it.

    Attributes
    ----------
    title : str
        Title.
    record : str
        File of the record that it is about; empty if it is about all.
    svg : str
        The figure as text.
    """

    def __init__(self, title: str, record: str, svg: str) -> None:
        self.title = title
        self.record = record
        self.svg = svg

    def save(self, path: "str | os.PathLike[str]") -> Path:
        """Writes the figure as SVG file."""
        file = Path(path)
        file.write_text(self.svg, encoding="utf-8")
        return file

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        return f"<airloop figure {self.title!r}{f' of {self.record}' if self.record else ''}>"


def drawings(page: str) -> list[Drawing]:
    """All figures with a title, in the order of a page; each has the styles of the page with it."""
    style = "".join(_STYLE.findall(page))
    found = []
    for figure in _FIGURE.findall(page):
        drawing = _DRAWING.search(figure)
        if drawing is None:
            continue
        attributes, body = drawing.groups()
        named = {name: unescape(value) for name, value in re.findall(r'([\w-]+)="([^"]*)"', attributes)}
        if "aria-label" in named:
            space = "" if "xmlns=" in attributes else ' xmlns="http://www.w3.org/2000/svg"'
            svg = f"<svg{space}{attributes}><style>{style}</style>{body}</svg>"
            found.append(Drawing(named["aria-label"], named.get("data-link", ""), svg))
    return found
