"""Systems of FMUs: read, simulate, instantiate, differentiate, export."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, overload

from . import _progress, data, program
from ._log import LOGGER
from ._native import SimulationError
from ._native import System as _Graph
from ._native import duration as _duration
from .result import Result
from .rhs import RightHandSide
from .simulation import Batch, Simulation

#: A time [s], or a text such as ``"1ms"``.
Time = float | str
#: Masters, as on the command line.
Master = Literal["gauss-seidel", "jacobi", "interface-jacobian", "monolithic"]


@dataclass(frozen=True)
class Connector:
    """Input or output of a system.

    Attributes
    ----------
    name : str
        Name.
    unit : str or None
        Unit, if known.
    type : str
        ``Real``, ``Integer``, ``Boolean``, ``Enumeration`` or ``String``.
    """

    name: str
    unit: str | None
    type: str


class System:
    """A system of FMUs, or a single FMU.

    Parameters
    ----------
    path
        An ``.ssd`` or ``.ssp`` file, an ``.fmu``, or ``airloop:NAME`` for an FMU of this project
        (``airloop:pendulum``).

    Raises
    ------
    SystemFileError
        The file cannot be read or simulated; the message names file, line and remedy.

    Examples
    --------
    >>> system = airloop.System("examples/01_run/system.ssd")  # doctest: +SKIP
    >>> result = system.run(stop=4, step="1ms", set={"u": 10.0})  # doctest: +SKIP
    >>> result["x"][-1]  # doctest: +SKIP
    """

    def __init__(self, path: "str | os.PathLike[str]") -> None:
        self.path = _resolved(os.fspath(path))
        self._graphs: dict[str, _Graph] = {}
        self._any = self._graph("any")

    def __reduce__(self) -> tuple[type["System"], tuple[str]]:
        return (type(self), (self.path,))

    def _graph(self, interface: str) -> _Graph:
        if interface not in self._graphs:
            self._graphs[interface] = _Graph(self.path, interface)
        return self._graphs[interface]

    def _graph_of(self, master: str) -> _Graph:
        return self._graph("model-exchange" if master == "monolithic" else "co-simulation")

    @property
    def name(self) -> str:
        """Name of the system."""
        return self._any.name

    @property
    def inputs(self) -> list[Connector]:
        """Inputs of the system."""
        return [Connector(*one) for one in self._any.inputs]

    @property
    def outputs(self) -> list[Connector]:
        """Outputs of the system."""
        return [Connector(*one) for one in self._any.outputs]

    @property
    def components(self) -> dict[str, str]:
        """Names of the models by component."""
        return dict(self._any.components)

    @property
    def notes(self) -> list[str]:
        """Assumptions and omissions, one sentence each."""
        return self._any.notes

    def __repr__(self) -> str:
        return f"<airloop.System {self.name}: {', '.join(self.components)}>"

    def run(
        self,
        stop: Time | None = None,
        step: Time | None = None,
        *,
        start: Time | None = None,
        inputs: "data.Signals | None" = None,
        measured: "data.Signals | None" = None,
        signals: Mapping[str, str] | None = None,
        initial: Literal["measured", "zero"] = "measured",
        interpolation: Literal["linear", "hold"] = "linear",
        master: Master = "gauss-seidel",
        extrapolation: int | None = None,
        tolerance: float | None = None,
        set: Mapping[str, float | int | bool | str] | None = None,
        adaptive: bool = False,
        step_tolerance: float | None = None,
        min_step: Time | None = None,
        max_step: Time | None = None,
        corrections: int | None = None,
        iterate: float | None = None,
        coupling_inputs: Literal["ramped", "held"] | None = None,
        progress: "bool | Callable[[int, int], object] | None" = None,
    ) -> Result:
        """Simulates the system; the numbers are those of ``airloop run``, bit for bit.

        Parameters
        ----------
        stop, start
            Stop and start time [s]. Default: those of the data, else of the default experiment.
        step
            Communication step [s], e.g. ``1e-3`` or ``"1ms"``. Default: that of the default experiment, else 1 ms.
        inputs
            Inputs of the system over time.
        measured
            Measurement: outputs to compare with (``result.fits``), and the inputs unless ``inputs`` is given.
        signals
            Columns of another name, ``{connector: column}``.
        initial
            Start of measured states: the first measured value, or the start value of the model.
        interpolation
            Continuous inputs between their samples.
        master
            Coupling of the components.
        extrapolation
            Order (0 to 2) of the polynomials that inputs follow inside a step of Gauss-Seidel or Jacobi.
        tolerance
            Relative tolerance of solvers inside FMUs, and of the monolithic master.
        set
            Start values, ``{"component.variable": value}``.
        adaptive, step_tolerance, min_step, max_step
            Communication steps chosen by their error.
        corrections, iterate, coupling_inputs
            Options of the interface-Jacobian master.
        progress
            Called now and then with the steps done and all steps; True: they are shown, on a terminal or in a notebook.

        Returns
        -------
        Result
            Arrays by name.

        Raises
        ------
        RecordError, SettingError, SystemFileError, FmuError
            It cannot start.
        SimulationError, FmuError
            It fails after the start; the attribute ``result`` holds what came before.
        KeyboardInterrupt
            Ctrl-C; the interpreter's lock is released while it runs.
        """
        options = dict(
            _options(start, stop, step, master, tolerance, set),
            extrapolation=extrapolation,
            interpolation=interpolation,
            initial=initial,
            adaptive=adaptive,
            step_tolerance=step_tolerance,
            min_step=_seconds(min_step),
            max_step=_seconds(max_step),
            corrections=corrections,
            iterate=iterate,
            coupling_inputs=coupling_inputs,
            signals=dict(signals or {}),
        )
        driving = None if inputs is None else data.record(inputs, "inputs")
        compared = None if measured is None else data.record(measured, "measured")
        line = _progress.line(progress is True)
        told = progress if callable(progress) else None
        if progress is True:
            told = lambda done, total: line.show(f"{done} of {total} steps")  # noqa: E731
        try:
            answer = self._graph_of(master).run(options, driving, compared, told)
        finally:
            line.close()
        result = Result(self, master, answer)
        if answer["error"] is not None:
            error: Exception = answer["error"]
            error.result = result  # type: ignore[attr-defined]
            raise error
        for note in result.notes:
            LOGGER.info("%s: %s", self.name, note)
        if result.message is not None:
            LOGGER.warning("%s: %s", self.name, result.message)
        return result

    @overload
    def instantiate(
        self,
        *,
        step: Time | None = None,
        start: Time | None = None,
        stop: Time | None = None,
        set: Mapping[str, float | int | bool | str] | None = None,
        master: Master = "gauss-seidel",
        tolerance: float | None = None,
        batch: None = None,
        threads: int | None = None,
    ) -> Simulation: ...

    @overload
    def instantiate(
        self,
        *,
        step: Time | None = None,
        start: Time | None = None,
        stop: Time | None = None,
        set: Mapping[str, float | int | bool | str] | None = None,
        master: Master = "gauss-seidel",
        tolerance: float | None = None,
        batch: int,
        threads: int | None = None,
    ) -> Batch: ...

    def instantiate(
        self,
        *,
        step: Time | None = None,
        start: Time | None = None,
        stop: Time | None = None,
        set: Mapping[str, float | int | bool | str] | None = None,
        master: Master = "gauss-seidel",
        tolerance: float | None = None,
        batch: int | None = None,
        threads: int | None = None,
    ) -> Simulation | Batch:
        """Instances whose steps the caller commands, for a controller in the loop or an environment for learning.

        Parameters
        ----------
        step, start, stop, set, master, tolerance
            As in :meth:`run`; without ``stop`` the simulation has no end. The monolithic master does not step.
        batch
            Number of instances; None for one.
        threads
            Threads of the batch; default: one per processor.

        Returns
        -------
        Simulation or Batch
            To be used in a ``with`` block.
        """
        options = _options(start, stop, step, master, tolerance, set)
        graph = self._graph_of(master)
        if batch is None:
            return Simulation(graph.instantiate(options))
        return Batch(graph.instantiate_batch(options, batch, threads))

    def rhs(
        self,
        *,
        states: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] = (),
        set: Mapping[str, float | int | bool | str] | None = None,
        time: Time = 0.0,
    ) -> RightHandSide:
        """The system as ``dx/dt = f(t, x, u)``, ``y = g(t, x, u)`` with exact derivatives (Model Exchange).

        Parameters
        ----------
        states
            Order of the states (``component.state`` or a connector that shows one); default: that of the file.
        inputs
            Inputs in their order; others keep their start values. Default: all.
        outputs
            Outputs: connectors, or ``component.variable`` of any Real variable.
        set
            Start values of parameters and states.
        time
            Time [s] at which the components are initialized.

        Raises
        ------
        SystemFileError
            A component without Model Exchange, an algebraic loop, an unknown name.
        """
        graph = self._graph("model-exchange")
        start = _seconds(time)
        chosen = None if inputs is None else list(inputs)
        ordered = None if states is None else list(states)
        return RightHandSide(
            graph.rhs(ordered, chosen, list(outputs), 0.0 if start is None else start, _start_values(set))
        )

    def linearize(
        self,
        x: "Sequence[float] | None" = None,
        u: "Sequence[float] | None" = None,
        *,
        outputs: Sequence[str] = (),
        set: Mapping[str, float | int | bool | str] | None = None,
    ) -> tuple[Any, Any, Any, Any]:
        """Matrices A, B, C, D at a point; default: the start states and zero inputs.

        Returns
        -------
        tuple of numpy.ndarray
            ``A [n_x, n_x]``, ``B [n_x, n_u]``, ``C [n_y, n_x]``, ``D [n_y, n_u]``.
        """
        return self.rhs(outputs=outputs, set=set).linearize(x, u)

    def export(self, path: "str | os.PathLike[str]", *, set: Mapping[str, Any] | None = None) -> Path:
        """Writes the system for other tools: an ``.ssp`` or ``.ssd``, or (ending ``.fmu``) as one FMU.

        Parameters
        ----------
        path
            File to write.
        set
            Start values to change.
        """
        file = Path(path)
        command = "export-fmu" if file.suffix == ".fmu" else "export"
        program.run([command, self.path, *program.words({"set": set}), "-o", str(file)])
        return file


# Options of a simulation that commands its own steps, and of a run where it says nothing else.
_DEFAULTS: dict[str, Any] = {
    "extrapolation": None,
    "interpolation": "linear",
    "initial": "zero",
    "adaptive": False,
    "step_tolerance": None,
    "min_step": None,
    "max_step": None,
    "corrections": None,
    "iterate": None,
    "coupling_inputs": None,
    "signals": {},
}


def _options(
    start: Time | None,
    stop: Time | None,
    step: Time | None,
    master: str,
    tolerance: float | None,
    set: Mapping[str, float | int | bool | str] | None,
) -> dict[str, Any]:
    return {
        **_DEFAULTS,
        "start": _seconds(start),
        "stop": _seconds(stop),
        "step": _seconds(step),
        "master": master,
        "tolerance": tolerance,
        "set": _start_values(set),
    }


def _seconds(time: Time | None) -> float | None:
    return _duration(time) if isinstance(time, str) else None if time is None else float(time)


def _start_values(values: Mapping[str, float | int | bool | str] | None) -> list[tuple[str, str]]:
    return [(name, program.text(value)) for name, value in (values or {}).items()]


def _resolved(path: str) -> str:
    from ._folders import FMUS

    if path.startswith("airloop:"):
        folder = Path(os.environ.get("AIRLOOP_FMUS") or FMUS)
        return str(folder / f"{path.removeprefix('airloop:')}.fmu")
    return path


__all__ = ["Connector", "Master", "SimulationError", "System", "Time"]
