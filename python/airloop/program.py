"""The command ``airloop`` that lies in the package, and what becomes of its messages in Python."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from threading import Thread

from . import _progress
from ._folders import PROGRAM
from ._log import LOGGER, lines as log_lines
from ._native import AirloopError, SettingError

_USAGE = 2
_INTERRUPTED = 130
_GRACE_S = 10.0
# Start of a line on the progress.
_PROGRESS = "progress: "


class CommandError(AirloopError):
    """A command that did not succeed; the text is the one that it prints.

    Attributes
    ----------
    exit_code : int
        Exit code of the command.
    """

    exit_code: int

    def __init__(self, text: str, exit_code: int) -> None:
        super().__init__(text)
        self.exit_code = exit_code

    def __reduce__(self) -> tuple[type["CommandError"], tuple[str, int]]:
        return (type(self), (str(self), self.exit_code))


def path() -> str:
    """Path of the program: that of the environment variable AIRLOOP, else the one in the package."""
    named = os.environ.get("AIRLOOP")
    if named:
        return named
    if PROGRAM.is_file():
        return str(PROGRAM)
    raise AirloopError(f"the program {PROGRAM} is missing: install a wheel made by `make wheel`")


def words(options: Mapping[str, object]) -> list[str]:
    """Options of a command line from keyword arguments.

    ``fit_mass=True`` becomes ``--fit-mass``; None and False are left out; of a list every item is an option of its
    own; a dictionary gives ``--set name=value`` for each of its items.
    """
    line: list[str] = []
    for name, value in options.items():
        option = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            line.append(option)
        elif isinstance(value, Mapping):
            line += [f"{option}={key}={text(item)}" for key, item in value.items()]
        elif isinstance(value, (list, tuple)):
            line += [f"{option}={text(item)}" for item in value]
        else:
            line.append(f"{option}={text(value)}")
    return line


def text(value: object) -> str:
    """A value as the command line writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(float(value))
    return str(value)


def run(
    arguments: Sequence[str], *, allowed: Sequence[int] = (0,), cwd: Path | None = None, progress: bool = False
) -> tuple[int, str]:
    """Runs the program and waits for its end.

    Parameters
    ----------
    arguments
        Words of the command line.
    allowed
        Exit codes that are answers, not failures.
    cwd
        Folder in which it runs.
    progress
        Show its progress, on a terminal or in a notebook.

    Returns
    -------
    tuple of int and str
        Exit code and standard output.

    Raises
    ------
    SettingError
        Wrong usage.
    CommandError
        Any other failure, with the text of the command.
    KeyboardInterrupt
        Ctrl-C; the program is asked to end, too.
    """
    renewed = progress and _progress.in_notebook()
    to_terminal = progress and not renewed and sys.stderr.isatty()
    command = [path(), *arguments]
    LOGGER.debug("%s", " ".join(command))
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=sys.stderr if to_terminal else subprocess.PIPE,
        text=True,
        cwd=cwd,
        env={**os.environ, "AIRLOOP_PROGRESS": "lines"} if renewed else None,
    ) as process:
        try:
            out, err = _shown(process) if renewed else process.communicate()
        except BaseException:
            # In a notebook Ctrl-C reaches this process only.
            process.send_signal(signal.SIGINT)
            try:
                process.wait(_GRACE_S)
            except subprocess.TimeoutExpired:
                process.kill()
            raise
    code = process.returncode
    log_lines(f"{out}\n{err or ''}")
    if code in allowed:
        return code, out
    if code == _INTERRUPTED:
        raise KeyboardInterrupt
    said = (err or "").strip() or f"`{' '.join(command)}` ended with exit code {code}"
    message = said.split("error: ", 1)[-1].strip()
    if code == _USAGE:
        raise SettingError(message)
    raise CommandError(message, code)


def _shown(process: "subprocess.Popen[str]") -> tuple[str, str]:
    """Standard output and error of a process to its end; what it tells of its progress is shown."""
    assert process.stdout is not None and process.stderr is not None
    output: list[str] = []
    # Cells show what their own thread displays.
    reader = Thread(target=lambda stream: output.append(stream.read()), args=(process.stdout,), daemon=True)
    reader.start()
    kept = []
    line = _progress.line()
    try:
        for text in process.stderr:
            if text.startswith(_PROGRESS):
                line.show(text.removeprefix(_PROGRESS).rstrip())
            else:
                kept.append(text)
    finally:
        line.close()
    reader.join()
    process.wait()
    return "".join(output), "".join(kept)


def main() -> None:
    """The console script ``airloop``: the program takes the place of the interpreter."""
    command = [path(), *sys.argv[1:]]
    if sys.platform == "win32" or not shutil.which(command[0]):
        sys.exit(subprocess.call(command))
    os.execv(command[0], command)
