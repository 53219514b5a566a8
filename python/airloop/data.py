"""Signals over time from what a notebook has: a DataFrame, a dictionary of arrays, a CSV file, a result."""

import csv
import io
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, Union

import numpy as np

from ._native import Record, RecordError

if TYPE_CHECKING:
    from .result import Result


class Frame(Protocol):
    """A ``pandas.DataFrame``, as type checkers see it also where pandas has no types for them."""

    @property
    def columns(self) -> Any:
        """Names of the columns."""

    @property
    def index(self) -> Any:
        """The time, unless it is a column."""

    def __getitem__(self, key: Any, /) -> Any:
        """A column by name."""


#: A file, a mapping with `time`, a DataFrame with `time` as column or index, or a result.
Signals = Union[str, "os.PathLike[str]", Mapping[str, Any], Frame, "Result"]


def record(data: "Signals", label: str) -> Record:
    """The record that a run takes.

    Parameters
    ----------
    data
        CSV file; mapping or DataFrame with a column ``time`` [s] (or ``time [ms]`` ...) or, for a DataFrame, the time
        as a numeric index or a TimedeltaIndex. Names may hold units, as in ``"x [mm]"``.
    label
        Name in messages.

    Raises
    ------
    RecordError
        With the text that the command line has for the same fault in a file.
    """
    if isinstance(data, (str, os.PathLike)):
        return Record.read(os.fspath(data))
    names, columns = table(data, label)
    return Record.table(label, header(names), columns)


def header(names: Iterable[str]) -> str:
    """First line of the CSV file with these columns."""
    line = io.StringIO()
    csv.writer(line, lineterminator="").writerow(names)
    return line.getvalue()


def table(data: Any, label: str) -> tuple[list[str], list["np.ndarray[Any, np.dtype[np.float64]]"]]:
    """Names and columns, the time first."""
    if hasattr(data, "columns") and hasattr(data, "index") and hasattr(data, "to_numpy"):
        pairs = [(str(name), data.iloc[:, place].to_numpy()) for place, name in enumerate(data.columns)]
        if not any(_is_time(name) for name, _ in pairs):
            pairs.insert(0, ("time", _index_seconds(data.index, label)))
    elif hasattr(data, "time") and hasattr(data, "columns") and isinstance(data.columns, Mapping):
        units = data.units
        named = [(name if not units[name] else f"{name} [{units[name]}]", data[name]) for name in data.columns]
        pairs = [("time", data.time), *named]
    elif isinstance(data, Mapping):
        pairs = [(str(name), values) for name, values in data.items()]
    else:
        raise RecordError(f"{label}: give a CSV file, a dictionary of arrays or a DataFrame, not {type(data).__name__}")
    pairs.sort(key=lambda pair: not _is_time(pair[0]))
    if not pairs or not _is_time(pairs[0][0]):
        names = ", ".join(name for name, _ in pairs)
        raise RecordError(f"{label}: there is no column `time`; it has: {names}")
    return [name for name, _ in pairs], [_numbers(name, values, label) for name, values in pairs]


def write(data: "Signals", file: Path, label: str) -> Path:
    """A CSV file with the signals; a file stays where it is. Every bit of the numbers survives."""
    if isinstance(data, (str, os.PathLike)):
        return Path(data)
    names, columns = table(data, label)
    Record.table(label, header(names), columns)
    with file.open("w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(names)
        writer.writerows(zip(*(column.tolist() for column in columns), strict=True))
    return file


def _is_time(name: str) -> bool:
    return name == "time" or name.startswith("time [")


def _numbers(name: str, values: Any, label: str) -> "np.ndarray[Any, np.dtype[np.float64]]":
    array = np.asarray(values)
    if array.ndim != 1:
        raise RecordError(f"{label}: column `{name}` has the shape {array.shape}; give one number per time")
    if array.dtype.kind == "m":
        return array.astype("timedelta64[ns]").astype(np.float64) / 1e9
    try:
        return np.ascontiguousarray(array, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise RecordError(f"{label}: column `{name}` holds values that are no numbers ({error})") from None


def _index_seconds(index: Any, label: str) -> "np.ndarray[Any, np.dtype[np.float64]]":
    kind = np.asarray(index).dtype.kind
    default = type(index).__name__ == "RangeIndex"
    if default or kind not in "fium":
        found = "a plain row number" if default else f"of type {index.dtype}"
        raise RecordError(
            f"{label}: there is no column `time`, and the index is {found}; "
            "add a column `time` [s] or make the time the index"
        )
    return _numbers("time", index, label)
