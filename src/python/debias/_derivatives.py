"""Derivatives by differences whose step shrinks from level to level."""

from __future__ import annotations

import math
from typing import Any, Callable, Dict, Optional, Sequence

import numpy as np

from . import _debias
from ._options import _real, _reals, _whole
from ._own import _checked, _facts, _function, normal_quantile
from ._problem import Problem, _maker
from ._types import Array

_EPSILON = float(np.finfo(float).eps)
#: Of a quotient: its order, and how many evaluations it takes.
_KINDS = {"forward": (1, 2), "central": (2, 2), "second": (2, 3)}


def _quotients(f: Callable[..., Any], at: Array, kind: str, first_step: float, ratio: float, last_level: Optional[int],
               dimension: int, normals: bool, components: Optional[int], facts: Dict[str, Any]) -> Problem:
    if not isinstance(kind, str) or kind not in _KINDS:
        raise ValueError(f"kind = '{kind}' (must be forward, central or second)")
    first_step, ratio = _real("first_step", first_step), _real("ratio", ratio)
    if not np.isfinite(at).all():
        raise ValueError(f"at = {at[~np.isfinite(at)][0]} (must be finite)")
    if not (first_step > 0 and math.isfinite(first_step)):
        raise ValueError(f"first_step = {first_step} (must be positive and finite: about the length over which f changes)")
    if not 0 < ratio < 1:
        raise ValueError(f"ratio = {ratio} (must lie in (0, 1)); 0.5 halves the step")
    order, evaluations = _KINDS[kind]
    degree = 2 if kind == "second" else 1
    width = _whole("dimension", dimension, 0)
    if last_level is None:  # where rounding, eps / h^degree, outgrows what is left out, h^order
        last_level = int(math.log(_EPSILON) / ((order + degree) * math.log(ratio)))
    last = _whole("last_level", last_level, 0)
    n_of = len(at)

    def values(x: Array, u: Array, level: int) -> Array:  # f may write into what it sees, or into one array each time
        point: Any = x.copy() if components is not None else float(x[0])
        if width == 0:
            return np.full(len(u), float(_checked("f", np.reshape(f(point), (1,)), (1,), level, x[None, :])[0]))
        return _checked("f", f(point, u.copy()), (len(u),), level, u).copy()

    def quotient(level: int, u: Array, here: Optional[Array]) -> Array:
        columns = []
        for i in range(n_of):
            up, down = at.copy(), at.copy()
            up[i] += first_step * ratio**level
            h = up[i] - at[i]  # as it acts
            down[i] -= h
            if h == 0:
                raise ValueError(f"at = {at[i]} (the step of level {level} is lost beside it); take a larger one")
            above = values(up, u, level)
            if kind == "forward":
                columns.append((above - here) / h)
            elif kind == "central":
                columns.append((above - values(down, u, level)) / (2 * h))
            else:
                assert here is not None
                columns.append(((above - here) - (here - values(down, u, level))) / (h * h))
        return np.stack(columns, axis=1)

    def answer(level: int, uniforms: Array) -> Array:
        u = normal_quantile(uniforms) if normals else uniforms
        here = None if kind == "central" else values(at, u, level)
        fine = quotient(min(level, last), u, here)
        if level == 0:
            return fine
        difference = fine - quotient(level - 1, u, here) if level <= last else np.zeros_like(fine)
        return np.concatenate((fine, difference), axis=1)

    per_level = n_of * (evaluations if kind == "central" else evaluations - 1) * 2.0 + (0 if kind == "central" else 1)
    if facts["variance_decay"] is None:
        facts.update(variance_decay=-2 * order * math.log2(ratio), work_growth=0.0)
    if width == 0:
        size = abs(float(f(at.copy() if components is not None else float(at[0]))))
    else:
        few = (np.arange(32 * width).reshape(32, width) + 0.5) / (32 * width)
        size = float(np.sqrt(np.mean(values(at, normal_quantile(few) if normals else few, 0) ** 2)))
    h_last = first_step * ratio**last
    facts.update(last_level=last, rounding=4 * _EPSILON * size / h_last**degree)
    return Problem(_debias.levels(facts, answer, lambda level: (width, per_level), 0 if components is None else n_of, False, 2.0**24))


@_maker
def finite_difference(f: Callable[..., Any], at: float, *, kind: str = "central", first_step: float = 1.0, ratio: float = 0.5,
                      last_level: Optional[int] = None, dimension: int = 0, rates: Optional[Sequence[float]] = None,
                      truth: Optional[float] = None, name: str = "derivative", formula: str = "", normals: bool = False) -> Problem:
    """The derivative of f, or of E f, at a point: level k is a difference quotient of step first_step * ratio^k.

    Parameters
    ----------
    f : callable
        f(x), a number; with a `dimension` f(x, u): random, an array (n,), from an array (n, dimension) of uniforms. x is a float.
        Both sides of a quotient see the same u.
    at : float
    kind : {"central", "forward", "second"}
        The last is the second derivative.
    first_step : float
        About the length over which f changes.
    ratio : float
        Of one step to the one before.
    last_level : int, optional
        The last with a difference of its own; where it is not given, the one at which rounding outgrows what is left out. What is
        left out is a bias, and stands in the result: ['bias_bound'].
    dimension : int
        Uniforms of a draw; 0: f is not random.
    rates : (float, float), optional
        (beta, gamma), for f smooth where they are not given.
    truth, name, formula, normals
        As of `levels`.

    Returns
    -------
    Problem

    Examples
    --------
    >>> import math
    >>> import debias
    >>> slope = debias.finite_difference(math.sin, 1.0)
    >>> result = debias.estimate(slope, samples=10_000)
    >>> bool(abs(result.mean - math.cos(1.0)) < 4.5 * result.standard_error + result["bias_bound"]["size"])
    True
    """
    _function("f", f, "x" if dimension == 0 else "(x, array)")
    facts = _facts(name, formula, truth, rates, False, 0)
    return _quotients(f, np.array([_real("at", at)]), kind, first_step, ratio, last_level, dimension, normals, None, facts)


@_maker
def gradient(f: Callable[..., Any], at: Sequence[float], *, kind: str = "central", first_step: float = 1.0, ratio: float = 0.5,
             last_level: Optional[int] = None, dimension: int = 0, rates: Optional[Sequence[float]] = None,
             name: str = "gradient", formula: str = "", normals: bool = False) -> Problem:
    """The gradient of f, or of E f, at a point: an array of components, by `finite_difference` in each coordinate.

    Parameters
    ----------
    f : callable
        As of `finite_difference`; x is an array (p,).
    at : array_like
        Of p coordinates.
    kind, first_step, ratio, last_level, dimension, rates, name, formula, normals
        As of `finite_difference`.

    Returns
    -------
    Problem

    Examples
    --------
    >>> import debias
    >>> both = debias.gradient(lambda x, u: u[:, 0] * x[0] * x[1] ** 2, [1.0, 2.0], dimension=1)
    >>> result = debias.estimate(both, samples=10_000)
    >>> bool((abs(result.mean - [2.0, 2.0]) < 4.5 * result.standard_error + 1e-9).all())
    True
    """
    _function("f", f, "x" if dimension == 0 else "(x, array)")
    point = np.array(_reals("at", at))
    if point.ndim != 1 or not len(point):
        raise ValueError(f"at: of shape {point.shape} (must be a row of coordinates)")
    facts = _facts(name, formula, None, rates, False, 0)
    return _quotients(f, point, kind, first_step, ratio, last_level, dimension, normals, len(point), facts)
