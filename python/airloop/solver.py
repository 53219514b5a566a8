"""A plan that is solved again and again, as a controller does it."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Union

import numpy as np

from ._native import SettingError
from ._native import Solver as _Solver
from .commands import table_file
from .series import Array, TimeSeries


@dataclass(frozen=True)
class Solution:
    """How a solve ended.

    Attributes
    ----------
    status : str
        Outcome in words.
    is_solved : bool
        Whether a motion was found.
    objective : float
        Value of the objective.
    iterations : int
        Iterations.
    violation : float
        Largest violation of a bound or condition, in its unit.
    seconds : float
        Wall-clock time [s].
    """

    status: str
    is_solved: bool
    objective: float
    iterations: int
    violation: float
    seconds: float


class Solver:
    """A problem over its FMUs that is kept: after the first motion each solve starts from the last one.

    The first motion is that of :func:`airloop.optimize`. After it other initial states, bounds and parameters cost
    few iterations; the FMUs stay open, inside of this process. One thread at a time works on a solver, others wait.

    >>> solver = airloop.Solver("problem.toml")  # doctest: +SKIP
    >>> solver.set_initial({"theta": 0.02})  # doctest: +SKIP
    >>> solver.solve().seconds  # doctest: +SKIP
    >>> solver.motion()["u"]  # doctest: +SKIP

    Parameters
    ----------
    problem
        Problem file, or its content as dictionary; paths in it are then relative to ``folder``.
    folder
        Base of the paths in a dictionary.

    Attributes
    ----------
    states, inputs : list of str
        Names.
    bounds : list of str
        Names of the bounds along the motion.

    Raises
    ------
    SettingError
        Something in the problem file, with line and column.
    AirloopError
        There is no first motion, with the reason.
    KeyboardInterrupt
        Ctrl-C, also during :meth:`solve`.
    """

    def __init__(
        self, problem: "str | os.PathLike[str] | Mapping[str, Any]", *, folder: "str | os.PathLike[str]" = "."
    ) -> None:
        with table_file(problem, Path(folder)) as file:
            self._native = _Solver(file)
        self.states: list[str] = self._native.states
        self.inputs: list[str] = self._native.inputs
        self.bounds: list[str] = self._native.bounds

    @property
    def initial(self) -> Array:
        """Initial states of the next solve in the units of the FMUs, shape ``[n_x]``, in the order of ``states``."""
        return self._native.initial

    def set_initial(self, values: "Union[Mapping[str, float], Sequence[float], Array]") -> None:
        """Fixes the initial states of the solves to come.

        Parameters
        ----------
        values
            By name, the others stay; or all, in the order of ``states``. In the units of the FMUs.

        Raises
        ------
        SettingError
            An unknown name, a wrong number of values, or one that is not finite or breaks a bound; all states are
            then as before.
        """
        if isinstance(values, Mapping):
            states = self.initial
            for name, value in values.items():
                if name not in self.states:
                    raise SettingError(f"there is no state `{name}`; known are: {', '.join(self.states)}")
                states[self.states.index(name)] = value
        else:
            states = np.array(values, dtype=np.float64)
        self._native.set_initial(np.ascontiguousarray(states).ravel())

    def set_bounds(self, bounds: Mapping[str, tuple[float, float]]) -> None:
        """Gives bounds along the motion other values, ``{name: (lower, upper)}``, in the units of the FMUs.

        Raises
        ------
        SettingError
            An unknown name, or bounds that leave no value.
        """
        for name, (lower, upper) in bounds.items():
            self._native.set_bounds(name, float(lower), float(upper))

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Gives parameters of the system other values, ``{"component.parameter": value}``; opens the FMUs anew.

        Initial states and bounds that were set stay, and so does the start of the next solve.

        Raises
        ------
        SettingError
            An unknown name, or a value that an FMU refuses; nothing has changed then.
        """
        self._native.set_parameters([(name, float(value)) for name, value in values.items()])

    def shift(self, seconds: float) -> None:
        """Moves the start of the next solve ahead in time, for a horizon that moves on."""
        self._native.shift(seconds)

    def solve(self) -> Solution:
        """Solves from the last solution; after a run without one the next start stays as it was."""
        return Solution(*self._native.solve())

    def motion(self) -> TimeSeries:
        """The motion of the last solve: states, inputs, outputs and costates, as in ``trajectory.csv``."""
        return TimeSeries(*self._native.motion())

    def __repr__(self) -> str:
        return f"<airloop.Solver x = {self.states}, u = {self.inputs}>"
