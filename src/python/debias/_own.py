"""Problems of one's own, from NumPy functions."""

from __future__ import annotations

import math
import numbers
from typing import Any, Callable, Optional, Sequence, Union

import numpy as np

from . import _debias
from ._numbers import _has_mask, _numbers
from ._problem import Problem, _maker
from ._reports import _ends


def normal_quantile(uniforms: Any) -> np.ndarray:
    """Standard normal numbers from uniform ones, the bits of C++. A mask stays."""
    numbers_of = _debias.normal_quantile(uniforms)
    return np.ma.array(numbers_of, mask=np.ma.getmaskarray(uniforms)) if _has_mask(uniforms) else numbers_of


@_maker
def levels(differences: Callable[[int, np.ndarray], Any], *, dimension: Union[int, Callable[[int], int]],
           work: Union[None, float, Callable[[int], float]] = None, components: Optional[int] = None,
           rates: Optional[Sequence[float]] = None, polynomial: bool = False, lowest_base: int = 0,
           truth: Optional[float] = None, name: str = "levels", formula: str = "",
           deepest_level: Optional[int] = None) -> Problem:
    """A sequence of coupled levels, in batches.

    differences(level, uniforms) sees an array (n, dimension(level)) of numbers in (0, 1), one row a draw, and returns

      at level 0   the estimates I_0, an array (n,)
      above        (fine, coarse), the estimates I_k and I_(k-1) of the same draws; or D_k = I_k - I_(k-1) alone, which
                   is enough to estimate, but not for a survey, a recipe, or a base level above 0

    components   c, where an estimate is an array: (n, c) in place of (n,)
    dimension    uniforms of a draw, or a function of the level; 2 ** level, say
    work         of a draw, likewise; its dimension where it is not given
    rates        (beta, gamma): E D_k^2 falls like 2^(-beta k), work grows like 2^(gamma k); k^-beta and k^gamma if
                 `polynomial`. Without rates a pilot chooses the PMF.
    deepest_level   the last level that can be drawn, where it is not the one with 2 ** 24 uniforms: a run that is likely
                 to need a deeper one is refused before it starts, with a PMF or a number of samples that can be drawn

    The function is called once for each level and block of 65536 samples, on the thread that called `estimate`.
    """
    if not callable(differences):
        raise TypeError(f"differences: {type(differences).__name__} (must be a function of (level, uniforms))")
    width = 1 if components is None else _whole("components", components, 1)

    def answer(level: int, uniforms: np.ndarray) -> np.ndarray:
        out = differences(level, uniforms)
        n = len(uniforms)
        shape = (n,) if components is None else (n, width)
        if not isinstance(out, tuple):
            return _checked("differences", out, shape, level, uniforms).reshape(n, width)
        if level == 0:
            raise ValueError("differences: a tuple at level 0 (which has no coarse partner); return the estimates")
        if len(out) != 2:
            raise ValueError(f"differences: a tuple of {len(out)} (must be (fine, coarse))")
        fine, coarse = (_checked("differences", part, shape, level, uniforms).reshape(n, width) for part in out)
        return np.concatenate((fine, fine - coarse), axis=1)

    dimension_of = _function_of_level("dimension", dimension, whole=True)
    work_of = dimension_of if work is None else _function_of_level("work", work, whole=False)
    facts = _facts(name, formula, truth, rates, polynomial, lowest_base)
    if deepest_level is not None:
        facts["deepest_level"] = _whole("deepest_level", deepest_level, 0)
    return Problem(_debias.levels(facts, answer, lambda level: (dimension_of(level), work_of(level)),
                                  0 if components is None else width, False, 2.0**24))


@_maker
def function_of_mean(integrand: Callable[[np.ndarray], Any], g: str, *, dimension: int = 1,
                     rates: Optional[Sequence[float]] = None, lowest_base: int = 0, truth: Optional[float] = None,
                     name: str = "function of a mean", formula: str = "") -> Problem:
    """g(E integrand(x)), x uniform in the unit cube: integrand(x) sees an array (n, dimension) and returns (n,).

    g is one of exp, exp-minus, reciprocal, square, log, sqrt, power:a, davis:c, logistic, absolute, positive-part.
    Level k averages 2^k draws. Where g has a pole that a mean of a few draws can come near, raise `lowest_base`.
    """
    return _mean(integrand, g, "independent", _whole("dimension", dimension, 1), 0.0, 1.0,
                 _facts(name, formula, truth, rates, False, lowest_base))


@_maker
def function_of_integral(integrand: Callable[[np.ndarray], Any], g: str, *, interval: Sequence[float] = (0.0, 1.0),
                         points: str = "comb", rates: Optional[Sequence[float]] = None, lowest_base: int = 0,
                         truth: Optional[float] = None, name: str = "function of an integral",
                         formula: str = "") -> Problem:
    """g(integral of the integrand over an interval): integrand(x) sees an array (n, 1) and returns (n,).

    points="comb" takes equidistant ones with one random offset, "jittered" one in each part, for integrands that do
    not continue periodically.
    """
    try:
        low, high = interval
    except (TypeError, ValueError):
        raise TypeError(f"interval: {interval!r} (must be (from, to))") from None
    return _mean(integrand, g, points, 1, float(low), float(high),
                 _facts(name, formula, truth, rates, False, lowest_base))


def _mean(integrand: Any, g: str, points: str, dimension: int, low: float, high: float, facts: dict) -> Problem:
    if not callable(integrand):
        raise TypeError(f"integrand: {type(integrand).__name__} (must be a function of an array)")
    if not isinstance(g, str):
        raise TypeError(f"g: {type(g).__name__} (must be the name of a function)")

    def answer(_: int, x: np.ndarray) -> np.ndarray:
        return _checked("integrand", integrand(x), (len(x),), None, x).reshape(-1, 1)

    return Problem(_debias.mean(facts, answer, lambda _: (dimension, 1.0), g, points, low, high))


def _checked(function: str, out: Any, shape: tuple, level: Optional[int], inputs: np.ndarray) -> np.ndarray:
    where = "" if level is None else f" at level {level}"
    array, missing = _numbers(out)
    if missing is not None:
        raise ValueError(f"{function}: returned {missing.sum()} masked or missing values{where} (draws that are left "
                         "out would be a bias); return a number for each row")
    if array.dtype.kind not in "fiub":
        raise TypeError(f"{function}: returned {array.dtype if array.ndim else type(out).__name__}{where} (must be an "
                        "array of real numbers)")
    if array.shape != shape:
        raise ValueError(f"{function}: returned shape {array.shape}{where} (must be {shape}: one for each row)")
    array = array.astype(np.float64, copy=False)
    finite = np.isfinite(array)
    if not finite.all():
        row = int(np.argmin(finite.reshape(shape[0], -1).all(axis=1)))
        shown = np.array2string(inputs[row], threshold=8, precision=17)
        raise ValueError(f"{function}: returned {_ends(np.asarray(array[row]))}{where} (must be finite) for the row {shown}")
    return array


def _function_of_level(name: str, value: Any, *, whole: bool) -> Callable[[int], float]:
    def checked(level: int) -> float:
        x = value(level) if callable(value) else value
        if isinstance(x, bool) or not isinstance(x, numbers.Integral if whole else numbers.Real):
            raise TypeError(f"{name}: {type(x).__name__} at level {level} (must be a "
                            f"{'whole ' if whole else ''}number)")
        if not 0 < x < math.inf:
            raise ValueError(f"{name} = {x} at level {level} (must be positive)")
        return min(float(min(x, 2**62)), 2.0**62)

    if not callable(value):
        checked(0)
    return checked


def _whole(name: str, value: Any, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise TypeError(f"{name}: {type(value).__name__} (must be a whole number)")
    if not least <= value < 2**62:
        raise ValueError(f"{name} = {value} (must be at least {least})")
    return int(value)


def _facts(name: str, formula: str, truth: Optional[float], rates: Optional[Sequence[float]], polynomial: bool,
           lowest_base: int) -> dict:
    beta, gamma = (None, None) if rates is None else (float(r) for r in rates)
    if beta is not None and not (beta > 0 and math.isfinite(gamma)):
        raise ValueError(f"rates = ({beta}, {gamma}) (must be the decay of E D_k^2, positive, and the growth of work)")
    return {"name": str(name), "formula": str(formula), "truth": truth, "variance_decay": beta, "work_growth": gamma,
            "polynomial": bool(polynomial), "lowest_base": _whole("lowest_base", lowest_base, 0)}
