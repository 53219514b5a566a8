"""Step by step: one instance, or many side by side."""

from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any, Union

import numpy as np

from . import program
from ._native import Batch as _Batch
from ._native import SettingError
from ._native import Simulation as _Simulation

Array = np.ndarray[Any, np.dtype[np.float64]]
Where = Union[None, int, Sequence[int], Sequence[bool], "np.ndarray[Any, np.dtype[Any]]"]
"""Some instances of a batch: their numbers, or a mask; None for all."""


class Simulation:
    """One instance of a system, made by :meth:`airloop.System.instantiate`.

    >>> with system.instantiate(step="1ms") as sim:  # doctest: +SKIP
    ...     for _ in range(1000):
    ...         sim.set(u=-2.0 * sim.get("x"))
    ...         sim.step()

    A step with the step size of :meth:`~airloop.System.instantiate` ends at the communication points of a run with the
    same step, so that the same inputs give the same numbers, bit for bit.
    """

    def __init__(self, native: _Simulation) -> None:
        self._native = native
        # Bound methods of the extension module: nothing is spent on a call in between.
        self.set = native.set
        """Set system inputs by name for the steps to come: ``sim.set(u=1.0)`` or ``sim.set(**{"a b": 1.0})``."""
        self.step = native.step
        """Step on by ``step`` [s] (default: that of ``instantiate``), ``count`` times; returns the new time [s]."""
        self.get = native.get
        """Value of an input, output, or ``component.variable`` at the current time."""

    @property
    def time(self) -> float:
        """Current time [s]."""
        return self._native.time

    @property
    def ended(self) -> str | None:
        """The component that ended the simulation, in words; None while it can go on."""
        return self._native.ended

    @property
    def closed(self) -> bool:
        """Whether :meth:`close` was called."""
        return self._native.closed

    def save(self) -> tuple[float, bytes]:
        """Time and state of all instances, for :meth:`restore`; every FMU must be able to serialize its state."""
        return self._native.save()

    def restore(self, saved: tuple[float, bytes]) -> None:
        """Returns to what :meth:`save` returned."""
        self._native.restore(*saved)

    def reset(self, set: Mapping[str, "float | int | bool | str"] | None = None) -> None:
        """Begins again at the start time, with start values of parameters and states as in ``instantiate``.

        Inputs have their start values again. Start values given to ``instantiate`` hold where ``set`` has no other.

        Raises
        ------
        SystemFileError
            A name or value that does not fit; the simulation is as it was.
        FmuError
            An instance cannot be made again; the simulation is closed.
        """
        self._native.reset([(name, program.text(value)) for name, value in (set or {}).items()])

    def close(self) -> None:
        """Frees the instances; a second call does nothing."""
        self._native.close()

    def __enter__(self) -> "Simulation":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Batch:
    """Instances of one system side by side, made by ``system.instantiate(batch=64)``.

    All calls concern all instances; they are stepped by several threads, with the interpreter's lock released.

    >>> with system.instantiate(step="1ms", batch=64) as batch:  # doctest: +SKIP
    ...     batch.set(u=numpy.linspace(-10, 10, 64))
    ...     batch.step(count=100)
    ...     x = batch.get("x")                      # shape [64]
    """

    def __init__(self, native: _Batch) -> None:
        self._native = native

    @property
    def size(self) -> int:
        """Number of instances."""
        return self._native.size

    @property
    def threads(self) -> int:
        """Number of threads."""
        return self._native.threads

    @property
    def time(self) -> Array:
        """Times [s], shape ``[batch]``."""
        return self._native.time()

    @property
    def ended(self) -> "np.ndarray[Any, np.dtype[np.bool_]]":
        """Whether a component ended the simulation, shape ``[batch]``; such an instance stays where it is."""
        return self._native.ended()

    def set(self, **values: "Union[float, Sequence[float], Array]") -> None:
        """Sets system inputs for the steps to come: a number for all instances, or one for each, shape ``[batch]``."""
        for name, value in values.items():
            array = np.asarray(value, dtype=np.float64)
            if array.ndim == 0:
                array = np.full(self.size, float(array))
            if array.ndim != 1:
                raise SettingError(f"`{name}` has the shape {array.shape}; give a number or the shape ({self.size},)")
            self._native.set(name, np.ascontiguousarray(array))

    def step(self, step: float | None = None, count: int = 1) -> None:
        """Steps all instances on by ``step`` [s] (default: that of ``instantiate``), ``count`` times."""
        self._native.step(step, count)

    def get(self, *names: str) -> Any:
        """Values at the current time.

        Returns
        -------
        numpy.ndarray
            Shape ``[batch]`` for one name, ``[batch, n]`` for several.
        """
        columns = [self._native.get(name) for name in names]
        return columns[0] if len(columns) == 1 else np.stack(columns, axis=1)

    def rollout(self, inputs: "Mapping[str, Any] | None" = None, *, steps: int, read: Sequence[str]) -> dict[str, Array]:
        """Steps all instances many times in one call.

        Parameters
        ----------
        inputs
            Inputs of every step: shape ``[steps, batch]``, or what broadcasts to it, such as ``[steps, 1]``.
        steps
            Number of steps.
        read
            Values to read at the start and after every step.

        Returns
        -------
        dict of str to numpy.ndarray
            By name, shape ``[steps + 1, batch]``.
        """
        shape = (steps, self.size)
        given = []
        for name, values in (inputs or {}).items():
            try:
                full = np.broadcast_to(np.asarray(values, dtype=np.float64), shape)
            except ValueError:
                found = np.shape(values)
                raise SettingError(f"`{name}` has the shape {found}; it must be {shape}: steps, instances") from None
            given.append((name, np.ascontiguousarray(full)))
        tables = self._native.rollout(given, list(read), steps)
        return dict(zip(read, tables, strict=True))

    def save(self, where: "Where" = None) -> list[tuple[float, bytes]]:
        """Times and states of instances, for :meth:`restore`; every FMU must be able to serialize its state.

        Parameters
        ----------
        where
            Instances: numbers, or a mask of shape ``[batch]``; default: all.
        """
        return self._native.save(self._which(where))

    def restore(self, saved: Sequence[tuple[float, bytes]], where: "Where" = None) -> None:
        """Returns instances to what :meth:`save` returned: one state for each of them, in their order.

        A state may be restored in another instance than that of which it was saved.

        Raises
        ------
        SettingError
            Not as many states as instances, or one of another system; instances before that one have theirs.
        """
        which = self._which(where)
        if len(saved) != len(which):
            raise SettingError(f"{len(saved)} states are given for {len(which)} instances")
        self._native.restore(which, list(saved))

    def reset(self, where: "Where" = None, set: "Mapping[str, float | Sequence[float] | Array] | None" = None) -> None:
        """Makes instances begin again at the start time, such as those of an environment whose episode is over.

        Parameters
        ----------
        where
            Instances: numbers, or a mask of shape ``[batch]``, e.g. ``batch.ended``; default: all.
        set
            Start values of parameters and states by name: a number, or one for each of these instances. Without them those
            of ``instantiate`` hold; inputs have their start values again.

        Raises
        ------
        SettingError, SystemFileError, FmuError
            A wrong number, shape, name or value, or an instance that cannot be made; all are as they were.
        """
        which = self._which(where)
        columns = []
        for name, value in (set or {}).items():
            try:
                column = np.broadcast_to(np.asarray(value, dtype=np.float64), (len(which),))
            except ValueError:
                found = np.shape(value)
                raise SettingError(f"`{name}` has the shape {found}; give a number or the shape ({len(which)},)") from None
            columns.append((name, column.tolist()))
        self._native.reset(which, columns)

    def _which(self, where: "Where") -> list[int]:
        """Numbers of the instances that are meant."""
        if where is None:
            return list(range(self.size))
        numbers = np.asarray(where)
        if numbers.size == 0:
            return []
        try:
            found = np.arange(self.size)[numbers]
        except IndexError as error:
            raise SettingError(f"`where`: {error}; the batch has {self.size} instances") from None
        return [int(number) for number in np.atleast_1d(found)]

    def close(self) -> None:
        """Frees the instances; a second call does nothing."""
        self._native.close()

    def __enter__(self) -> "Batch":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
