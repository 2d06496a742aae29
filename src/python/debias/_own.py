"""Problems of one's own, from NumPy functions."""

from __future__ import annotations

import math
import numbers
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np

from . import _compiled, _debias
from ._numbers import _has_mask, _numbers
from ._options import _real, _reals, _scalar, _whole
from ._problem import Problem, _maker
from ._reports import _ends
from ._types import Array


def normal_quantile(uniforms: Any) -> Array:
    """Standard normal numbers from uniform ones, the bits of C++. A mask stays.

    Parameters
    ----------
    uniforms : array_like
        In (0, 1).

    Returns
    -------
    ndarray
        Of the same shape.

    Examples
    --------
    >>> import debias
    >>> debias.normal_quantile([0.5, 0.975]).round(6).tolist()
    [0.0, 1.959964]
    """
    numbers_of: Array = _debias.normal_quantile(_reals("uniforms", uniforms))
    if not _has_mask(uniforms):
        return numbers_of
    masked: Array = np.ma.array(numbers_of, mask=np.ma.getmaskarray(uniforms))
    return masked


def brownian_increments(normals: Any, horizon: float = 1.0) -> Array:
    """Increments of Brownian paths by bridges: number 0 is a path's end, then come midpoints, the coarse first.

    As increments in the order of time (`normals * sqrt(horizon / steps)`) they have the same law. But where a recipe takes nets, the
    first numbers are the best ones, and here these move the whole path: a European call takes less work by them.

    Parameters
    ----------
    normals : array_like
        (n, steps) standard normal numbers, one row a path: what a function of `levels` with `normals=True` sees.
    horizon : float
        The time at the end.

    Returns
    -------
    ndarray
        (n, steps): W at the end of each step less W at its beginning. Those of `BrownianPath` in C++, to rounding.

    Examples
    --------
    >>> import debias
    >>> debias.brownian_increments([[1.0, 0.0]], horizon=4).tolist()
    [[1.0, 1.0]]
    """
    z = _reals("normals", normals)
    if z.ndim != 2 or z.shape[1] < 1:
        raise ValueError(f"brownian_increments: normals of shape {z.shape} (must be (n, steps), with at least one step)")
    horizon = _real("horizon", horizon)
    if not (horizon > 0 and math.isfinite(horizon)):
        raise ValueError(f"brownian_increments: horizon = {horizon!r} (must be positive and finite)")
    n, steps = z.shape
    nodes = min(256, steps & -steps)  # a power of two that divides the steps; within their intervals in the order of time
    w = np.zeros((n, nodes + 1))
    w[:, nodes] = math.sqrt(horizon) * z[:, 0]
    used, width = 1, nodes
    while width > 1:
        middle = z[:, used:used + nodes // width] * (math.sqrt(horizon * width / nodes) / 2)
        w[:, width // 2::width] = (w[:, :nodes:width] + w[:, width::width]) * 0.5 + middle
        used, width = used + nodes // width, width // 2
    left: Array = np.diff(w, axis=1)
    inner = steps // nodes
    if inner == 1:
        return left
    rest = z[:, used:].reshape(n, nodes, inner - 1) * math.sqrt(horizon / steps)
    increments = np.empty((n, nodes, inner))
    for i in range(inner - 1):
        increments[..., i] = left / (inner - i) + rest[..., i] * math.sqrt((inner - i - 1) / (inner - i))
        left = left - increments[..., i]
    increments[..., -1] = left
    return increments.reshape(n, steps)


@_maker
def levels(differences: Callable[..., Any], *, dimension: Union[int, Callable[[int], int]] = 1,
           work: Union[None, float, Callable[[int], float]] = None, components: Optional[int] = None,
           rates: Optional[Sequence[float]] = None, polynomial: bool = False, lowest_base: int = 0,
           truth: Optional[float] = None, name: str = "levels", formula: str = "",
           deepest_level: Optional[int] = None, shared: Optional[Callable[..., Any]] = None, normals: bool = False,
           rng: bool = False, block: Optional[int] = None) -> Problem:
    """A sequence of coupled levels, in batches.

    Parameters
    ----------
    differences : callable
        differences(level, uniforms) sees an array (n, dimension(level)) of numbers in (0, 1), one row a draw, and returns at level
        0 the estimates I_0, an array (n,); above it (fine, coarse), the estimates I_k and I_(k-1) of the same draws, or
        D_k = I_k - I_(k-1) alone, which is enough to estimate, but not for a survey, a recipe, or a base level above 0.
        Or a compiled function, which runs without Python's lock on all threads: a cfunc of numba, a function pointer of ctypes, or
        a scipy.LowLevelCallable, void (int64_t level, int64_t n, double *uniforms, double *out), with a last argument void * if it
        takes data. It writes the fine and the coarse estimate, at level 0 the estimate alone.
    dimension : int or callable
        Uniforms of a draw, or a function of the level; 2 ** level, say.
    work : float or callable, optional
        Of a draw, likewise; its dimension where it is not given.
    components : int, optional
        c, where an estimate is an array: (n, c) in place of (n,).
    rates : (float, float), optional
        (beta, gamma): E D_k^2 falls like 2^(-beta k), work grows like 2^(gamma k); k^-beta and k^gamma if `polynomial`. Without
        rates a pilot chooses the PMF.
    polynomial : bool
    lowest_base : int
        The base level below which estimates have no fourth moment.
    truth : float, optional
        For tests: a result says how far it is.
    name, formula : str
        What reports call the problem.
    deepest_level : int, optional
        The last level that can be drawn, where it is not the one with 2 ** 24 uniforms: a run that is likely to need a deeper one
        is refused before it starts, with a PMF or a number of samples that can be drawn.
    shared : callable, optional
        shared(level, base_level, uniforms) returns (base, difference): an estimate of the base level made of the draws of `level`,
        averaged over all of them, and D_level. One draw instead of two, and a quieter base.
    normals : bool
        Standard normal numbers in place of uniform ones.
    rng : bool
        differences(level, rng) is called for each draw alone, with a `numpy.random.Generator` of its own: for rejection, gammas
        and other draws whose numbers cannot be counted before. Slower: some 20 microseconds a draw beside its own time.
    block : int, optional
        The function sees blocks of this size alone, the last ones padded with numbers that do not count: for functions that are
        compiled once for each shape, such as those of JAX and PyTorch.

    Returns
    -------
    Problem

    Notes
    -----
    The function is called once for each level and block of 65536 samples, on the thread that called `estimate`.

    Examples
    --------
    The square of the mean of a uniform number, 1/4, from the means of 2^k draws and of their halves:

    >>> import debias
    >>> def squares(level, u):
    ...     if level == 0:
    ...         return u[:, 0] ** 2
    ...     even, odd = u[:, ::2].mean(axis=1), u[:, 1::2].mean(axis=1)
    ...     return ((even + odd) / 2) ** 2, (even**2 + odd**2) / 2
    >>> problem = debias.levels(squares, dimension=lambda level: 2**level, rates=(2, 1))
    >>> result = debias.estimate(problem, samples=20_000)
    >>> bool(abs(result.mean - 0.25) < 4.5 * result.standard_error)
    True
    """
    compiled = _compiled._levels(differences)
    if compiled is None:
        _function("differences", differences, "(level, uniforms)")
    if shared is not None:
        _function("shared", shared, "(level, base_level, uniforms)")
    width = 1 if components is None else _whole("components", components, 1)
    dimension_of = _function_of_level("dimension", dimension, whole=True)
    work_of = dimension_of if work is None else _function_of_level("work", work, whole=False)
    facts = _facts(name, formula, truth, rates, polynomial, lowest_base)
    if deepest_level is not None:
        facts["deepest_level"] = _whole("deepest_level", deepest_level, 0)
    if compiled is not None:
        for option, x in (("components", components), ("shared", shared), ("normals", normals or None), ("rng", rng or None),
                          ("block", block)):
            if x is not None:
                raise ValueError(f"{option}: not of compiled levels (which write two numbers, from uniforms)")
        sizes: List[Tuple[float, float]] = []
        while len(sizes) < 63 and len(sizes) <= facts.get("deepest_level", 62) and dimension_of(len(sizes)) <= 2.0**26:
            sizes.append((dimension_of(len(sizes)), work_of(len(sizes))))
        return Problem(_debias.compiled_levels(facts, compiled.address, compiled.user, sizes))
    if rng:
        if normals or shared is not None or block is not None:
            raise ValueError("rng: goes with neither normals, shared nor block (each draw is a call of its own)")
        dimension_of = _function_of_level("dimension", 3, whole=True)
        differences = _each_alone(differences)
    if block is not None:
        size = _whole("block", block, 1)
        differences = _in_blocks("differences", differences, size)
        shared = None if shared is None else _in_blocks("shared", shared, size)

    def answer(level: int, uniforms: Array, base_level: Optional[int] = None) -> Array:
        numbers = normal_quantile(uniforms) if normals else uniforms
        n = len(uniforms)
        shape = (n,) if components is None else (n, width)
        if base_level is not None and shared is not None:
            out = shared(level, base_level, numbers)
            if not isinstance(out, tuple) or len(out) != 2:
                raise ValueError(f"shared: returned {type(out).__name__} (must be (base, difference))")
            return np.concatenate([_checked("shared", x, shape, level, numbers).reshape(n, width) for x in out], axis=1)
        out = differences(level, numbers)
        if not isinstance(out, tuple):
            return _checked("differences", out, shape, level, numbers).reshape(n, width)
        if level == 0:
            raise ValueError("differences: a tuple at level 0 (which has no coarse partner); return the estimates")
        if len(out) != 2:
            raise ValueError(f"differences: a tuple of {len(out)} (must be (fine, coarse))")
        both = np.empty((n, 2 * width))
        both[:, :width] = _checked("differences", out[0], shape, level, numbers).reshape(n, width)
        np.subtract(both[:, :width], _checked("differences", out[1], shape, level, numbers).reshape(n, width),
                    out=both[:, width:])
        return both

    return Problem(_debias.levels(facts, answer, lambda level: (dimension_of(level), work_of(level)),
                                  0 if components is None else width, shared is not None, 2.0**24))


def _function(name: str, f: Any, of: str) -> None:
    if not callable(f):
        raise TypeError(f"{name}: {type(f).__name__} (must be a function of {of})")


def _generator(row: Array) -> np.random.Generator:
    """The generator that a row of uniforms stands for."""
    return np.random.Generator(np.random.Philox(key=[int(u * 2.0**52) for u in row[:2]], counter=int(row[2] * 2.0**52)))


def _each_alone(differences: Callable[..., Any]) -> Callable[..., Any]:
    def own(answer: Any) -> Any:  # of a function that writes into one array each time
        if isinstance(answer, tuple):
            return tuple(own(part) for part in answer)
        return answer.copy() if isinstance(answer, np.ndarray) else answer

    def all_of(level: int, uniforms: Array) -> Any:
        answers = [own(differences(level, _generator(row))) for row in uniforms]
        if answers and isinstance(answers[0], tuple):
            return tuple(np.array(part) for part in zip(*answers))
        return np.array(answers)

    return all_of


def _in_blocks(name: str, f: Callable[..., Any], size: int) -> Callable[..., Any]:
    """f of blocks of one size: the rows of the last one again fill it up."""

    def padded(*arguments: Any) -> Any:
        *levels_of, numbers = arguments
        n = len(numbers)
        answers = []
        for first in range(0, n, size):
            rows = numbers[first:first + size]
            fill = size - len(rows)
            if fill:
                rows = np.concatenate((rows, np.broadcast_to(rows[-1:], (fill, rows.shape[1]))))
            out = f(*levels_of, rows)
            parts = [_checked_mask(name, part) for part in (out if isinstance(out, tuple) else (out,))]
            if any(not part.ndim for part in parts):
                return out  # no rows: whoever looks at it says so
            answers.append(tuple(part[:size - fill].copy() for part in parts))  # f may write into one array each time
        joined = tuple(np.concatenate(part) for part in zip(*answers))
        return joined if len(joined) > 1 else joined[0]

    return padded


def _checked_mask(function: str, out: Any, where: str = "") -> Array:
    try:
        array, missing = _numbers(out)
    except ValueError:
        raise TypeError(f"{function}: returned {type(out).__name__}{where} of rows of different lengths (must be an array of real "
                        "numbers)") from None
    if missing is not None:
        raise ValueError(f"{function}: returned {missing.sum()} masked or missing values{where} (draws that are left "
                         "out would be a bias); return a number for each row")
    return array


def _meant(function: str, returned: Tuple[int, ...], shape: Tuple[int, ...]) -> str:
    """What goes wrong first."""
    if returned == (*shape, 1):
        return "; take a column, x[:, 0]"
    if returned == () and len(shape) == 1:
        return "; numbers of a row go together by axis=1"
    return "; two parts are a tuple, (fine, coarse)" if function == "differences" and returned == (2, *shape) else ""


def _checked(function: str, out: Any, shape: Tuple[int, ...], level: Optional[int], inputs: Array) -> Array:
    where = "" if level is None else f" at level {level}"
    array = _checked_mask(function, out, where)
    if array.dtype.kind not in "fiub":
        raise TypeError(f"{function}: returned {array.dtype if array.ndim else type(out).__name__}{where} (must be an "
                        "array of real numbers)")
    if array.shape != shape:
        raise ValueError(f"{function}: returned shape {array.shape}{where} (must be {shape}: one for each row)"
                         f"{_meant(function, array.shape, shape)}")
    array = array.astype(np.float64, copy=False)
    if math.isfinite(np.add.reduce(array, axis=None)):  # then each of them is
        return array
    finite = np.isfinite(array)
    if not finite.all():
        row = int(np.argmin(finite.reshape(shape[0], -1).all(axis=1)))
        shown = np.array2string(inputs[row], threshold=8, precision=17)
        raise ValueError(f"{function}: returned {_ends(np.asarray(array[row]))}{where} (must be finite) for the row {shown}")
    return array


def _function_of_level(name: str, value: Any, *, whole: bool) -> Callable[[int], float]:
    def checked(level: int) -> float:
        x = _scalar(value(level) if callable(value) else value)
        if isinstance(x, bool) or not isinstance(x, numbers.Integral if whole else numbers.Real):
            raise TypeError(f"{name}: {type(x).__name__} at level {level} (must be a "
                            f"{'whole ' if whole else ''}number)")
        if not 0 < x < math.inf:  # type: ignore[operator]
            raise ValueError(f"{name} = {x} at level {level} (must be positive)")
        return min(float(min(x, 2**62)), 2.0**62)  # type: ignore[arg-type]

    if not callable(value):
        checked(0)
    return checked


def _rates(rates: Any) -> Tuple[float, float]:
    try:
        beta, gamma = (_real("rates", r) for r in rates)
    except (TypeError, ValueError):
        raise TypeError(f"rates: {rates!r} (must be two numbers, (beta, gamma): the decay of E D_k^2 and the growth of work)") from None
    if not (beta > 0 and math.isfinite(gamma)):
        raise ValueError(f"rates = ({beta}, {gamma}) (must be the decay of E D_k^2, positive, and the growth of work)")
    return beta, gamma


def _facts(name: str, formula: str, truth: Optional[float], rates: Optional[Sequence[float]], polynomial: bool,
           lowest_base: int) -> Dict[str, Any]:
    beta, gamma = (None, None) if rates is None else _rates(rates)
    if truth is not None:
        truth = _real("truth", truth)
    return {"name": str(name), "formula": str(formula), "truth": truth, "variance_decay": beta, "work_growth": gamma,
            "polynomial": bool(polynomial), "lowest_base": _whole("lowest_base", lowest_base, 0)}
