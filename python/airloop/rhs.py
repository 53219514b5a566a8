"""A system as one differentiable right-hand side, for SciPy, CasADi and JAX."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ._native import Rhs, SettingError

Array = np.ndarray[Any, np.dtype[np.float64]]


class RightHandSide:
    """``dx/dt = f(t, x, u)`` and ``y = g(t, x, u)`` of a system, made by :meth:`airloop.System.rhs`.

    Derivatives are those of the FMUs (directional derivatives), joined by the chain rule. Calls from several threads
    wait for each other.

    >>> rhs = airloop.System("airloop:pendulum").rhs()  # doctest: +SKIP
    >>> rhs(0.0, [0.1, 0.0], [0.0])  # doctest: +SKIP
    >>> scipy.integrate.solve_ivp(rhs.scipy([0.0]), (0, 2), rhs.start)  # doctest: +SKIP

    Attributes
    ----------
    states, inputs, outputs : list of str
        Names, in the order of the arrays.
    units : dict of str to (str or None)
        Units by name.
    start : numpy.ndarray
        States at which the components were initialized, shape ``[n_x]``.
    notes : list of str
        Assumptions and omissions, one sentence each.
    """

    def __init__(self, native: Rhs) -> None:
        self._native = native
        n_x, n_u, n_y = native.sizes
        names = native.names
        self._n = (n_x, n_u, n_y)
        self.states: list[str] = names[:n_x]
        self.inputs: list[str] = names[n_x : n_x + n_u]
        self.outputs: list[str] = names[n_x + n_u :]
        self.units: dict[str, str | None] = dict(zip(names, native.units, strict=True))
        self.start: Array = native.start
        self.notes: list[str] = native.notes

    def __call__(self, t: float, x: "Sequence[float] | Array", u: "Sequence[float] | Array" = ()) -> Array:
        """Rates of the states, shape ``[n_x]``."""
        return self._native.values(t, _array(x), _array(u))[: self._n[0]]

    def output(self, t: float, x: "Sequence[float] | Array", u: "Sequence[float] | Array" = ()) -> Array:
        """Outputs, shape ``[n_y]``."""
        return self._native.values(t, _array(x), _array(u))[self._n[0] :]

    def jac(
        self, t: float, x: "Sequence[float] | Array", u: "Sequence[float] | Array" = ()
    ) -> tuple[Array, Array]:
        """Derivatives of the rates: by the states, shape ``[n_x, n_x]``, and by the inputs, ``[n_x, n_u]``."""
        n_x = self._n[0]
        jacobian = self._native.derivatives(t, _array(x), _array(u))[1]
        return jacobian[:n_x, :n_x], jacobian[:n_x, n_x:]

    def linearize(
        self, x: "Sequence[float] | Array | None" = None, u: "Sequence[float] | Array | None" = None, t: float = 0.0
    ) -> tuple[Array, Array, Array, Array]:
        """Matrices A, B, C, D at a point; default: the start states and zero inputs."""
        n_x, n_u, _ = self._n
        states = self.start if x is None else _array(x)
        inputs = np.zeros(n_u) if u is None else _array(u)
        jacobian = self._native.derivatives(t, states, inputs)[1]
        return jacobian[:n_x, :n_x], jacobian[:n_x, n_x:], jacobian[n_x:, :n_x], jacobian[n_x:, n_x:]

    def scipy(
        self, u: "Sequence[float] | Array | Callable[[float], Sequence[float]]" = ()
    ) -> Callable[[float, Array], Array]:
        """``fun(t, x)`` for :func:`scipy.integrate.solve_ivp`; ``u`` is constant or a function of the time."""
        if callable(u):
            course = u
            return lambda t, x: self(t, x, course(t))
        constant = _array(u)
        return lambda t, x: self(t, x, constant)

    def scipy_jac(
        self, u: "Sequence[float] | Array | Callable[[float], Sequence[float]]" = ()
    ) -> Callable[[float, Array], Array]:
        """``jac(t, x)`` for the implicit methods of :func:`scipy.integrate.solve_ivp`."""
        if callable(u):
            course = u
            return lambda t, x: self.jac(t, x, course(t))[0]
        constant = _array(u)
        return lambda t, x: self.jac(t, x, constant)[0]

    def casadi(self, name: str = "f") -> Any:
        """A ``casadi.Callback`` ``(t, x, u) -> dx/dt`` with exact Jacobian; keep it alive as long as it is used."""
        try:
            import casadi
        except ModuleNotFoundError:
            raise SettingError("CasADi is not installed: pip install casadi") from None
        return _casadi(self, casadi, name)

    def jax(self) -> Callable[[Any, Any, Any], Any]:
        """A JAX function ``f(t, x, u)`` with exact first derivatives, also inside ``jit`` (``jax.pure_callback``)."""
        try:
            import jax
        except ModuleNotFoundError:
            raise SettingError("JAX is not installed: pip install jax") from None
        return _jax(self, jax)

    def __repr__(self) -> str:
        return f"<airloop.RightHandSide x = {self.states}, u = {self.inputs}>"


def _array(values: Any) -> Array:
    return np.ascontiguousarray(values, dtype=np.float64).ravel()


def _casadi(rhs: RightHandSide, casadi: Any, name: str) -> Any:
    n_x, n_u = len(rhs.states), len(rhs.inputs)
    sizes = (1, n_x, n_u)

    class Base(casadi.Callback):  # type: ignore[misc]
        def __init__(self, own: str, options: dict[str, Any]) -> None:
            casadi.Callback.__init__(self)
            self.construct(own, options)

        def get_n_in(self) -> int:
            return 3

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, index: int) -> Any:
            return casadi.Sparsity.dense(sizes[index], 1)

        def get_sparsity_out(self, _index: int) -> Any:
            return casadi.Sparsity.dense(n_x, 1)

        def eval(self, arguments: Any) -> Any:
            t, x, u = (np.array(value).ravel() for value in arguments)
            return [casadi.DM(rhs(float(t[0]), x, u))]

        def has_jacobian(self) -> bool:
            return True

        def get_jacobian(self, own: str, _inames: Any, _onames: Any, options: Any) -> Any:
            self._jacobian = Jacobian(own, options)
            return self._jacobian

    class Jacobian(casadi.Callback):  # type: ignore[misc]
        def __init__(self, own: str, options: dict[str, Any]) -> None:
            casadi.Callback.__init__(self)
            self.construct(own, options)

        def get_n_in(self) -> int:
            return 4

        def get_n_out(self) -> int:
            return 3

        def get_sparsity_in(self, index: int) -> Any:
            return casadi.Sparsity.dense((*sizes, n_x)[index], 1)

        def get_sparsity_out(self, index: int) -> Any:
            return casadi.Sparsity(n_x, 1) if index == 0 else casadi.Sparsity.dense(n_x, sizes[index])

        def eval(self, arguments: Any) -> Any:
            t, x, u, _ = (np.array(value).ravel() for value in arguments)
            by_x, by_u = rhs.jac(float(t[0]), x, u)
            return [casadi.DM(n_x, 1), casadi.DM(by_x), casadi.DM(by_u)]

    return Base(name, {})


def _jax(rhs: RightHandSide, jax: Any) -> Callable[[Any, Any, Any], Any]:
    n_x, n_u = len(rhs.states), len(rhs.inputs)

    def shape(*sizes: int) -> Any:
        return jax.ShapeDtypeStruct(sizes, jax.numpy.result_type(float))

    def values(t: Any, x: Any, u: Any) -> Any:
        return rhs(float(t), x, u).astype(shape().dtype)

    def derivatives(t: Any, x: Any, u: Any) -> Any:
        return np.hstack(rhs.jac(float(t), x, u)).astype(shape().dtype)

    @jax.custom_jvp  # type: ignore[untyped-decorator]
    def f(t: Any, x: Any, u: Any) -> Any:
        return jax.pure_callback(values, shape(n_x), t, x, u, vmap_method="sequential")

    @f.defjvp  # type: ignore[untyped-decorator]
    def f_jvp(primals: Any, tangents: Any) -> Any:
        t, x, u = primals
        jacobian = jax.pure_callback(derivatives, shape(n_x, n_x + n_u), t, x, u, vmap_method="sequential")
        direction = jax.numpy.concatenate([tangents[1], tangents[2]])
        return f(t, x, u), jacobian @ direction

    return f  # type: ignore[no-any-return]
