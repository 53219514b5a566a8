"""What airloop tells through ``logging``: the logger ``airloop``, silent until the program that uses it asks.

Debug has the commands that run, info the notes (choices that were made), warning what makes a result less than it should be.
"""

import logging

LOGGER = logging.getLogger("airloop")
LOGGER.addHandler(logging.NullHandler())

_LEVELS = {"note: ": logging.INFO, "warning: ": logging.WARNING}


def lines(text: str) -> None:
    """Passes on the notes and warnings of a command; its failure is an exception."""
    for line in text.splitlines():
        for start, level in _LEVELS.items():
            if line.startswith(start):
                LOGGER.log(level, "%s", line.removeprefix(start))
