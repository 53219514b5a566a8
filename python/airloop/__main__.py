"""``python -m airloop`` is the command ``airloop``."""

from .program import main

main()
