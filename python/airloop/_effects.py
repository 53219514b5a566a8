"""Effects of one's own, as tables or TOML texts, in a folder that the command line takes."""

import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ._native import to_toml


def is_text(effect: object) -> bool:
    """Whether a string is the text of an effect, not the path of one."""
    return isinstance(effect, str) and "=" in effect and not Path(effect.partition("\n")[0]).exists()


@contextmanager
def effects_folder(
    effects: "str | os.PathLike[str] | Mapping[str, Any] | Sequence[str | os.PathLike[str] | Mapping[str, Any]] | None",
) -> "Iterator[str | None]":
    """A folder with the effects for the time of the block; a path alone stays as it is."""
    several: "Sequence[str | os.PathLike[str] | Mapping[str, Any]]"
    if effects is None:
        yield None
        return
    if isinstance(effects, Mapping) or (isinstance(effects, str) and is_text(effects)):
        several = [effects]
    elif isinstance(effects, (str, os.PathLike)):
        yield os.fspath(effects)
        return
    else:
        several = effects
    with tempfile.TemporaryDirectory(prefix="airloop-effects-") as name:
        for number, effect in enumerate(several, 1):
            # In messages the file stands for the place in the list.
            file = Path(name, f"effect_{number:02d}.toml")
            if isinstance(effect, Mapping):
                table = dict(effect)
                if isinstance(table.get("fmu"), (str, os.PathLike)):
                    table["fmu"] = os.path.abspath(table["fmu"])
                file.write_text(to_toml(json.dumps(table)), encoding="utf-8")
            elif isinstance(effect, str) and is_text(effect):
                file.write_text(effect, encoding="utf-8")
            else:
                # Its FMU is looked for where the file is.
                try:
                    file.symlink_to(Path(effect).absolute())
                except OSError:
                    shutil.copyfile(effect, file)
        yield name
