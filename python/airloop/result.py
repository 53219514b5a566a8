"""Results of a run: arrays by name, fits, figures."""

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from . import data
from ._native import RecordError
from .series import TimeSeries

if TYPE_CHECKING:
    from .system import System


@dataclass(frozen=True)
class Fit:
    """Agreement of a simulated signal with its measurement.

    Attributes
    ----------
    name : str
        Connector of the system.
    unit : str or None
        Unit of the connector.
    column : str
        Column of the measurement.
    fit_percent : float or None
        NRMSE fit [%], ``100 (1 - ||y - ys|| / ||y - mean(y)||)``; None if the measurement is constant.
    rms_error : float
        RMS error in the unit of the connector.
    samples : int
        Samples that were compared.
    """

    name: str
    unit: str | None
    column: str
    fit_percent: float | None
    rms_error: float
    samples: int


class Result(TimeSeries):
    """Values at the communication points of a run; ``result["x"]`` is the array of a signal.

    The arrays are the memory that the simulation wrote, without a copy.

    Attributes
    ----------
    time : numpy.ndarray
        Communication points [s], shape ``[n]``.
    columns : dict of str to numpy.ndarray
        Signals in the order of ``result.csv``, each of shape ``[n]``.
    units : dict of str to (str or None)
        Units of the signals.
    status : str
        ``completed``, ``terminated`` (by a component) or ``failed``.
    message : str or None
        Reason why it did not reach the stop time.
    steps : int
        Communication steps.
    notes : list of str
        Choices that were made, one sentence each.
    start_values : list of str
        Connectors whose start value is the first measured value.
    fits : dict of str to Fit
        Fits to the measurement of the run; empty without one.
    master : str
        Master of the run.
    simulation_s : float
        Wall-clock time of stepping [s].
    """

    def __init__(self, system: "System", master: str, answer: Mapping[str, Any]) -> None:
        super().__init__(answer["time"], answer["columns"])
        self._system = system
        self.master = master
        self.status: str = answer["status"]
        self.message: str | None = answer["message"]
        self.steps: int = answer["steps"]
        self.notes: list[str] = answer["notes"]
        self.start_values: list[str] = answer["start_values"]
        self.simulation_s: float = answer["simulation_s"]
        self.fits: dict[str, Fit] = {fit[0]: Fit(*fit) for fit in answer["fits"]}

    def fit(self, measured: "data.Signals", signals: Mapping[str, str] | None = None) -> dict[str, Fit]:
        """Compares the result with a measurement.

        Parameters
        ----------
        measured
            CSV file, DataFrame or mapping with a column for each measured output.
        signals
            Columns of another name, ``{connector: column}``.

        Returns
        -------
        dict of str to Fit
            One fit for each output that is measured, the same as those of ``airloop run --measured``.

        Raises
        ------
        RecordError
            No column is an output, units that do not fit, no time in common.
        """
        measurement = data.record(measured, "measured")
        mine = data.record(self, "result")
        fits = self._system._graph_of(self.master).fit(self.master, mine, measurement, dict(signals or {}))
        return {fit[0]: Fit(*fit) for fit in fits}

    def plot(self, *names: str, measured: "data.Signals | None" = None) -> Any:
        """Draws signals over time with matplotlib; without names the outputs of the system.

        Returns
        -------
        matplotlib.figure.Figure
            One axis per signal; a notebook shows it as the last line of a cell.
        """
        from ._figure import NotebookFigure

        chosen = list(names) or [output.name for output in self._system.outputs if output.name in self.columns]
        if not chosen:
            raise RecordError(f"there is nothing to draw; name a signal: {', '.join(self.columns)}")
        figure = NotebookFigure(figsize=(7.0, 1.0 + 1.6 * len(chosen)), layout="constrained")
        all_axes = figure.subplots(len(chosen), 1, sharex=True, squeeze=False)[:, 0]
        columns = dict(zip(*data.table(measured, "measured"), strict=True)) if measured is not None else {}
        for axes, name in zip(all_axes, chosen, strict=True):
            if name in columns:
                axes.plot(columns["time"], columns[name], color="0.6", label="measured")
            axes.plot(self.time, self[name], label="simulated")
            axes.set_ylabel(f"{name} [{self.units[name]}]" if self.units[name] else name)
            axes.legend(loc="upper right")
        all_axes[-1].set_xlabel("time [s]")
        return figure

    def __repr__(self) -> str:
        fits = "".join(f", {fit.name} {fit.fit_percent:.2f} %" for fit in self.fits.values() if fit.fit_percent)
        return f"<airloop.Result {self.status}, {self.steps} steps, {len(self.columns)} signals{fits}>"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{escape(fit.name)}</td><td>{'' if fit.fit_percent is None else f'{fit.fit_percent:.2f}'}</td>"
            f"<td>{fit.rms_error:.3g} {escape(fit.unit or '')}</td></tr>"
            for fit in self.fits.values()
        )
        table = f"<table><tr><th>signal</th><th>fit [%]</th><th>RMS error</th></tr>{rows}</table>" if rows else ""
        return f"<p>{escape(repr(self))}</p>{table}"
