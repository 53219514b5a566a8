"""Signals over time, by name."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import data

if TYPE_CHECKING:
    import pandas

Array = np.ndarray[Any, np.dtype[np.float64]]


class TimeSeries(Mapping[str, Array]):
    """Signals over time; ``series["x"]`` is the array of a signal.

    The arrays are the memory that airloop wrote, without a copy.

    Attributes
    ----------
    time : numpy.ndarray
        Times [s], shape ``[n]``.
    columns : dict of str to numpy.ndarray
        Signals in the order of the CSV file, each of shape ``[n]``.
    units : dict of str to (str or None)
        Units of the signals.
    """

    def __init__(self, time: Array, columns: Iterable[tuple[str, str | None, Array]]) -> None:
        listed = list(columns)
        self.time = time
        self.columns: dict[str, Array] = {name: values for name, _, values in listed}
        self.units: dict[str, str | None] = {name: unit for name, unit, _ in listed}

    def __getitem__(self, name: str) -> Array:
        if name in self.columns:
            return self.columns[name]
        if name == "time":
            return self.time
        raise KeyError(f"there is no signal `{name}`; known are: {', '.join(self.columns)}")

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    def to_pandas(self) -> "pandas.DataFrame":
        """A DataFrame with the time [s] as index and a column per signal."""
        import pandas

        index = pandas.Index(self.time, name="time")
        frame: pandas.DataFrame = pandas.DataFrame(self.columns, index=index, copy=False)
        return frame

    def to_csv(self, path: str) -> None:
        """Writes a CSV file as the command line does: first column time [s]; every bit survives."""
        data.write({"time": self.time, **self.columns}, Path(path), "result")

    def __repr__(self) -> str:
        return f"<airloop.{type(self).__name__} {len(self.time)} times, {len(self.columns)} signals>"
