"""Functions of a mean, of an integral, and of conditional means."""

from __future__ import annotations

from typing import Any, Callable, Optional, Sequence, Tuple, Union

import numpy as np

from . import _compiled, _debias
from ._options import _real, _whole
from ._own import _checked, _facts, _function, _in_blocks, normal_quantile
from ._problem import Problem, _maker
from ._types import Array, Facts

#: A function of means: an array (n,), or (n, c), to one of n rows.
Function = Callable[[Array], Any]
Gap = Callable[[Array, Array], Any]


class _Doubling:
    """g of the mean of 2^k draws, and of its halves: answers for the levels of the module."""

    def __init__(self, draws: Callable[[int, Array], Array], g: Function, gap: Optional[Gap],
                 components: Optional[int]):
        self._draws, self._g, self._gap, self._components = draws, g, gap, components

    def _values(self, means: Array) -> Array:
        shape = (len(means),) if self._components is None else (len(means), self._components)
        return _checked("g", self._g(means), shape, None, means).reshape(len(means), -1)

    def __call__(self, level: int, uniforms: Array, base_level: Optional[int] = None) -> Array:
        y = self._draws(level, uniforms)  # (n, 2^level) or (n, 2^level, c)
        n, size = y.shape[:2]
        if level == 0:
            return self._values(y[:, 0])
        group = 1 << (base_level or 0)  # halves are the even and the odd groups, as in C++
        sums = y.reshape(n, size // (2 * group), 2, group, *y.shape[2:]).sum(axis=(1, 3))
        even, odd = sums[:, 0], sums[:, 1]
        means = (even + odd) / size
        fine: Optional[Array]
        if self._gap is None:
            values = self._values(np.concatenate((means, even * (2 / size), odd * (2 / size))))
            fine, difference = values[:n], values[:n] - (values[n:2 * n] + values[2 * n:]) * 0.5
        else:
            shape = (n,) if self._components is None else (n, self._components)
            difference = _checked("gap", self._gap(means, (even - odd) / size), shape, level, means).reshape(n, -1)
            fine = None if base_level is not None else self._values(means)
        if base_level is not None:
            groups = y.reshape(n * (size // group), group, *y.shape[2:]).mean(axis=1)
            base = self._values(groups).reshape(n, size // group, -1).mean(axis=1)
            return np.concatenate((base, difference), axis=1)
        assert fine is not None
        return np.concatenate((fine, difference), axis=1)


def _own_mean(draws: Callable[[int, Array], Array], g: Function, gap: Optional[Gap], components: Optional[int],
              size: Callable[[int], Tuple[float, float]], facts: Facts) -> Problem:
    width = None if components is None else _whole("components", components, 1)
    if gap is not None:
        _function("gap", gap, "(means, d)")
    facts["deepest_level"] = 26
    return Problem(_debias.levels(facts, _Doubling(draws, g, gap, width), size, width or 0, True, 2.0**30))


@_maker
def function_of_mean(integrand: Callable[[Array], Any], g: Union[str, Function], *, gap: Optional[Gap] = None,
                     dimension: int = 1, inputs: Optional[int] = None, components: Optional[int] = None,
                     rates: Optional[Sequence[float]] = None, lowest_base: int = 0, truth: Optional[float] = None,
                     name: str = "function of a mean", formula: str = "", normals: bool = False,
                     block: Optional[int] = None) -> Problem:
    """g(E integrand(x)), x uniform in the unit cube. Level k averages 2^k draws.

    Parameters
    ----------
    integrand : callable
        Of an array (n, dimension), one row a draw; returns (n,), or (n, inputs). Or a compiled function, which runs without Python's
        lock on all threads: a cfunc of numba, a function pointer of ctypes, or a scipy.LowLevelCallable, double (int n, double *x),
        with a last argument void * if it takes data; g is then a name.
    g : str or callable
        One of exp, exp-minus, reciprocal, square, log, sqrt, power:a, davis:c, logistic, absolute, positive-part, which have forms
        without cancellation; or a function of means, (n,) or (n, inputs), that returns (n,) or (n, components).
    gap : callable, optional
        gap(m, d) = g(m) - (g(m + d) + g(m - d)) / 2 in a form without cancellation. Without one the differences of deep levels are
        rounding of g.
    dimension : int
        Uniforms of a draw.
    inputs : int, optional
        Numbers of the integrand, where it returns an array of rows.
    components : int, optional
        Numbers of g, likewise.
    rates : (float, float), optional
        As of `levels`; (2, 1), for g smooth at the mean and four moments of the integrand.
    lowest_base : int
        Where g has a pole that a mean of a few draws can come near, raise it.
    truth, name, formula
        As of `levels`.
    normals : bool
        The integrand sees standard normal numbers.
    block : int, optional
        As of `levels`: the integrand sees blocks of this size alone.

    Returns
    -------
    Problem

    Examples
    --------
    >>> import numpy as np
    >>> import debias
    >>> x = lambda u: 1 + u[:, 0] ** 2
    >>> debias.estimate(debias.function_of_mean(x, "log"), samples=1000).verdict
    'finite'
    >>> ratio = debias.function_of_mean(lambda u: u, lambda m: m[:, 0] / (1 + m[:, 1]), dimension=2, inputs=2)
    >>> result = debias.estimate(ratio, samples=20_000)
    >>> bool(abs(result.mean - 1 / 3) < 4.5 * result.standard_error)
    True
    """
    compiled = _compiled._integrand(integrand)
    if compiled is None:
        _function("integrand", integrand, "an array")
    width = _whole("dimension", dimension, 1)
    facts = _facts(name, formula, truth, rates, False, lowest_base)
    if compiled is not None:
        options = {"gap": gap, "inputs": inputs, "components": components, "normals": normals or None, "block": block}
        for option, x in options.items():
            if x is not None:
                raise ValueError(f"{option}: not of a compiled integrand (which gives one number, from uniforms)")
        if not isinstance(g, str):
            raise TypeError(f"g: {type(g).__name__} (must be the name of a function, beside a compiled integrand)")
        return Problem(_debias.compiled_mean(facts, compiled.address, compiled.user, width, g, "independent", 0.0, 1.0))
    seen = integrand if block is None else _in_blocks("integrand", integrand, _whole("block", block, 1))
    numbers = (lambda u: seen(normal_quantile(u))) if normals else seen
    if isinstance(g, str):
        for option, x in (("gap", gap), ("inputs", inputs), ("components", components)):
            if x is not None:
                raise ValueError(f"{option}: beside g = '{g}' (which knows its own, of one number); give a function")
        return _named_mean(numbers, g, "independent", width, 0.0, 1.0, facts)
    if not callable(g):
        raise TypeError(f"g: {type(g).__name__} (must be the name of a function, or one of arrays of means)")
    columns = None if inputs is None else _whole("inputs", inputs, 1)

    def draws(level: int, u: Array) -> Array:
        n, size = len(u), 1 << level
        rows = u.reshape(n * size, width)
        shape = (n * size,) if columns is None else (n * size, columns)
        y = _checked("integrand", numbers(rows), shape, level, rows)
        return y.reshape(n, size) if columns is None else y.reshape(n, size, columns)

    if rates is None:
        facts.update(variance_decay=2.0, work_growth=1.0)
    return _own_mean(draws, g, gap, components, lambda level: (width * 2.0**level, 2.0**level), facts)


@_maker
def function_of_integral(integrand: Callable[[Array], Any], g: str, *, interval: Sequence[float] = (0.0, 1.0),
                         dimension: int = 1, points: Optional[str] = None, rates: Optional[Sequence[float]] = None,
                         lowest_base: int = 0, truth: Optional[float] = None, name: str = "function of an integral",
                         formula: str = "") -> Problem:
    """g(integral of the integrand over an interval, or over the unit cube). Level k takes 2^k points.

    Parameters
    ----------
    integrand : callable
        Of an array (n, dimension); returns (n,). Or in one dimension a compiled function, as of `function_of_mean`.
    g : str
        As of `function_of_mean`.
    interval : (float, float)
        In one dimension.
    dimension : int
        Of the unit cube.
    points : {"comb", "jittered", "nets"}, optional
        Equidistant ones with one random offset (in one dimension), one in each part, for integrands that do not continue
        periodically, or scrambled nets in the cube (in more).
    rates, lowest_base, truth, name, formula
        As of `function_of_mean`; rates are (4, 1) for a comb and (6, 1) for jittered points, of nets by the dimension.

    Returns
    -------
    Problem

    Examples
    --------
    >>> import debias
    >>> one = debias.function_of_integral(lambda x: 1 + x[:, 0], "reciprocal")
    >>> result = debias.estimate(one, samples=10_000)
    >>> bool(abs(result.mean - 2 / 3) < 4.5 * result.standard_error)
    True
    """
    try:
        low, high = interval
    except (TypeError, ValueError):
        raise TypeError(f"interval: {interval!r} (must be (from, to))") from None
    if not isinstance(g, str):
        raise TypeError(f"g: {type(g).__name__} (must be the name of a function)")
    low, high = _real("interval", low), _real("interval", high)
    d = _whole("dimension", dimension, 1)
    points = points or ("comb" if d == 1 else "nets")
    if points == "nets" and (low, high) != (0, 1):
        raise ValueError(f"interval = {interval!r} (nets are in the unit cube); scale x in the integrand")
    if points in ("comb", "jittered") and d > 1:
        raise ValueError(f"points = {points!r} (one-dimensional, dimension = {d}); take nets")
    facts = _facts(name, formula, truth, rates, False, lowest_base)
    compiled = _compiled._integrand(integrand)
    if compiled is not None:
        return Problem(_debias.compiled_mean(facts, compiled.address, compiled.user, 1, g, points, low, high))
    _function("integrand", integrand, "an array")
    return _named_mean(integrand, g, points, d, low, high, facts)


def _named_mean(integrand: Any, g: str, points: str, dimension: int, low: float, high: float, facts: Facts) -> Problem:
    def answer(_: int, x: Array) -> Array:
        return _checked("integrand", integrand(x), (len(x),), None, x).reshape(-1, 1)

    return Problem(_debias.mean(facts, answer, lambda _: (dimension, 1.0), g, points, low, high))


@_maker
def reciprocal(integrand: Callable[[Array], Any], *, dimension: int = 1, lowest_base: int = 0,
               truth: Optional[float] = None, name: str = "reciprocal of a mean", formula: str = "",
               normals: bool = False) -> Problem:
    """1 / E integrand(x), for an integrand of one sign.

    Parameters
    ----------
    integrand, dimension, truth, name, formula, normals
        As of `function_of_mean`.
    lowest_base : int
        3 where the integrand has a positive density at 0: means of fewer draws have no fourth moment of their reciprocal.

    Returns
    -------
    Problem

    Examples
    --------
    >>> import debias
    >>> result = debias.estimate(debias.reciprocal(lambda x: 1 + x[:, 0] ** 2), samples=10_000)
    >>> bool(abs(result.mean - 0.75) < 4.5 * result.standard_error)
    True
    """
    return function_of_mean(integrand, "reciprocal", dimension=dimension, lowest_base=lowest_base, truth=truth, name=name,
                            formula=formula, normals=normals)


@_maker
def nested(outer: Callable[[Array], Any], inner: Callable[[Array, Array], Any], f: Function, *,
           outer_dimension: int = 1, inner_dimension: int = 1, inputs: Optional[int] = None, components: Optional[int] = None,
           gap: Optional[Gap] = None, rates: Optional[Sequence[float]] = None, lowest_base: int = 0,
           truth: Optional[float] = None, name: str = "nested expectation", formula: str = "", normals: bool = False) -> Problem:
    """E f(E[X given Y]): level k averages 2^k inner draws for one outer draw.

    Parameters
    ----------
    outer : callable
        Of an array (n, outer_dimension); returns outer draws Y, an array (n,) or (n, d).
    inner : callable
        inner(y, u): y holds the outer draw of each row of u (m, inner_dimension); returns X, (m,) or (m, inputs).
    f : callable
        Of inner means, (n,) or (n, inputs); returns (n,) or (n, components).
    outer_dimension, inner_dimension : int
        Uniforms of a draw.
    inputs, components, gap, lowest_base, truth, name, formula, normals
        As of `function_of_mean`.
    rates : (float, float), optional
        As of `levels`; (2, 1), for f smooth. (1.5, 1) where f has a kink, as max(m, 0).

    Returns
    -------
    Problem

    Examples
    --------
    E (E[X given Y])^2 with X normal about Y, and Y uniform: 1/3.

    >>> import debias
    >>> square = debias.nested(lambda u: u[:, 0], lambda y, u: y + debias.normal_quantile(u[:, 0]), lambda m: m**2)
    >>> result = debias.estimate(square, samples=20_000)
    >>> bool(abs(result.mean - 1 / 3) < 4.5 * result.standard_error)
    True
    """
    _function("outer", outer, "an array")
    _function("inner", inner, "(y, array)")
    _function("f", f, "an array of means")
    d_outer, d_inner = _whole("outer_dimension", outer_dimension, 1), _whole("inner_dimension", inner_dimension, 1)
    columns = None if inputs is None else _whole("inputs", inputs, 1)

    def draws(level: int, uniforms: Array) -> Array:
        u = normal_quantile(uniforms) if normals else uniforms
        n, size = len(u), 1 << level
        y = np.asarray(outer(u[:, :d_outer]))
        if len(y) != n:
            raise ValueError(f"outer: returned shape {y.shape} at level {level} (must have {n} rows)")
        rows = u[:, d_outer:].reshape(n * size, d_inner)
        shape = (n * size,) if columns is None else (n * size, columns)
        x = _checked("inner", inner(np.repeat(y, size, axis=0), rows), shape, level, rows)
        return x.reshape(n, size) if columns is None else x.reshape(n, size, columns)

    facts = _facts(name, formula, truth, rates if rates is not None else (2, 1), False, lowest_base)
    return _own_mean(draws, f, gap, components, lambda level: (d_outer + d_inner * 2.0**level, 1 + 2.0**level), facts)
