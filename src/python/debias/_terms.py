"""Series, paths and Taylor sums: problems whose terms come in order, so that `estimator="roulette"` takes them, too."""

from __future__ import annotations

import math
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np

from . import _debias
from ._options import _finite, _real, _reals, _whole
from ._own import _checked, _facts, _function, normal_quantile
from ._problem import Problem, _maker
from ._types import Array, Facts

Rates = Optional[Sequence[float]]


def _rates_of(ratio: Optional[float], exponent: Optional[float]) -> Tuple[Rates, bool]:
    """Of terms that fall like ratio^k, or like k^-exponent."""
    if ratio is not None and exponent is not None:
        raise ValueError("ratio and exponent (terms fall like ratio^k, or like k^-exponent); give one of them")
    if ratio is not None:
        ratio = _real("ratio", ratio)
        if not 0 < abs(ratio) < 1:
            raise ValueError(f"ratio = {ratio} (must lie in (-1, 1), and not be 0); a series that diverges has no sum to estimate")
        return (-2 * math.log2(abs(ratio)), 0.0), False
    if exponent is not None:
        exponent = _finite("exponent", exponent)
        if not exponent > 0:
            raise ValueError(f"exponent = {exponent} (must be positive: terms have to fall)")
        return (2.0 * exponent, 0.0), True
    return None, False


def _radius(radius: Any) -> float:
    r = _real("radius", radius)
    if not 0 < r < 1:
        raise ValueError(f"radius = {r} (must lie in (0, 1), a bound of the spectral radius); the series of another has no sum")
    return r


def _path(facts: Facts, terms: Callable[[int, Array], Array], size: Callable[[int], Tuple[float, float]]) -> Problem:
    """terms(k, u) gives the terms 0 ... k of each row of u, an array (n, k + 1)."""
    return Problem(_debias.terms(facts, terms, size, True, 2.0**24))


@_maker
def series(term: Callable[..., Any], *, ratio: Optional[float] = None, exponent: Optional[float] = None, dimension: int = 0,
           truth: Optional[float] = None, name: str = "series", formula: str = "", normals: bool = False) -> Problem:
    """The sum of term(0), term(1), ...; a level is one term.

    Parameters
    ----------
    term : callable
        term(k), a number; with a `dimension`, term(k, u): random terms, an array (n,), from an array (n, dimension) of uniforms.
        Each term has numbers of its own.
    ratio, exponent : float, optional
        Terms fall like ratio^k, or like k^-exponent. Without them a PMF has to be named, or a pilot chooses it.
    dimension : int
        Uniforms of a term.
    truth, name, formula, normals
        As of `levels`.

    Returns
    -------
    Problem

    Examples
    --------
    >>> import debias
    >>> half = debias.series(lambda k: 0.5 ** (k + 1), ratio=0.5)
    >>> result = debias.estimate(half, samples=10_000, estimator="roulette")
    >>> bool(abs(result.mean - 1) < 4.5 * result.standard_error)
    True
    """
    _function("term", term, "k" if dimension == 0 else "(k, array)")
    width = _whole("dimension", dimension, 0)
    rates, polynomial = _rates_of(ratio, exponent)
    known: Dict[int, float] = {}

    def answer(k: int, u: Array) -> Array:
        n = len(u)
        if width > 0:
            numbers = normal_quantile(u) if normals else u
            return _checked("term", term(k, numbers), (n,), k, numbers).reshape(n, 1)
        if k not in known:
            known[k] = float(_checked("term", np.reshape(term(k), (1,)), (1,), k, np.zeros((1, 0)))[0])
        return np.full((n, 1), known[k])

    facts = _facts(name, formula, truth, rates, polynomial, 0)
    return Problem(_debias.terms(facts, answer, lambda k: (width, 1.0), False, 2.0**24))


@_maker
def path_series(start: Callable[[Array], Any], advance: Callable[[Any, Array], Any], read: Callable[[Any], Any], *,
                ratio: Optional[float] = None, exponent: Optional[float] = None, start_dimension: int = 1, dimension: int = 1,
                truth: Optional[float] = None, name: str = "path series", formula: str = "", normals: bool = False) -> Problem:
    """A series along paths: term k is read off the state that `start` gives and `advance` has advanced k times.

    Parameters
    ----------
    start : callable
        start(u), of an array (n, start_dimension), returns the states of n paths: anything that `advance` takes.
    advance : callable
        advance(state, u), of an array (n, dimension), returns the next states.
    read : callable
        read(state) returns the terms, an array (n,).
    ratio, exponent
        As of `series`: of terms of light paths, the albedo.
    start_dimension, dimension : int
        Uniforms of a start and of a step.
    truth, name, formula, normals
        As of `levels`.

    Returns
    -------
    Problem

    Notes
    -----
    `estimator="roulette"` takes all terms of a path up to a random one; a single term walks as far, and counts one.

    Examples
    --------
    The product of k uniforms has the mean 2^-k: the sum is 2.

    >>> import numpy as np
    >>> import debias
    >>> paths = debias.path_series(lambda u: np.ones(len(u)), lambda x, u: x * u[:, 0], lambda x: x, ratio=3**-0.5)
    >>> result = debias.estimate(paths, samples=10_000, estimator="roulette")
    >>> bool(abs(result.mean - 2) < 4.5 * result.standard_error)
    True
    """
    for what, f in (("start", start), ("advance", advance), ("read", read)):
        _function(what, f, "states")
    d_start, d_step = _whole("start_dimension", start_dimension, 0), _whole("dimension", dimension, 0)

    def terms(k: int, uniforms: Array) -> Array:
        u = normal_quantile(uniforms) if normals else uniforms
        n = len(u)
        out = np.empty((n, k + 1))
        state = start(u[:, :d_start])
        out[:, 0] = _checked("read", read(state), (n,), 0, u)
        for i in range(k):
            at = d_start + i * d_step
            state = advance(state, u[:, at:at + d_step])
            out[:, i + 1] = _checked("read", read(state), (n,), i + 1, u)
        return out

    rates, polynomial = _rates_of(ratio, exponent)
    facts = _facts(name, formula, truth, rates, polynomial, 0)
    return _path(facts, terms, lambda k: (d_start + float(k) * d_step, k + 1.0))


# ---- Taylor


def _power_series(g: Union[str, Callable[[int], float]], at: float) -> Tuple[Callable[[int], Array], float, float]:
    """c_0 s^0 ... c_k s^k of g about a point, the scale s, and the radius of convergence."""
    if callable(g):
        own = g
        return (lambda k: np.array([float(own(i)) for i in range(k + 1)])), 1.0, math.inf
    name, _, parameter = g.partition(":")

    def factorials(k: int) -> Array:
        return np.cumprod(np.concatenate(([1.0], 1.0 / np.arange(1, k + 1))))

    def signs(k: int) -> Array:
        return (-1.0) ** np.arange(k + 1)

    if name == "exp":
        return (lambda k: math.exp(at) * factorials(k)), 1.0, math.inf
    if name == "exp-minus":
        return (lambda k: math.exp(-at) * signs(k) * factorials(k)), 1.0, math.inf
    if name not in ("reciprocal", "log", "sqrt", "power"):
        raise ValueError(f"g = '{g}' (must be exp, exp-minus, reciprocal, log, sqrt, power:a, or a function of k that gives "
                         "coefficient k of the power series about `at`)")
    if not at > 0:
        raise ValueError(f"at = {at} (must be positive: {name} has no power series there)")
    if name == "log":
        return (lambda k: np.concatenate(([math.log(at)], -signs(k)[1:] / np.arange(1, k + 1)))), at, at
    p = -1.0 if name == "reciprocal" else 0.5 if name == "sqrt" else float(parameter or "nan")
    if not math.isfinite(p):
        raise ValueError(f"g = '{g}' (needs its parameter); write power:1.5")
    return (lambda k: at**p * np.cumprod(np.concatenate(([1.0], (p - np.arange(k)) / np.arange(1, k + 1))))), at, at


@_maker
def taylor(integrand: Callable[[Array], Any], g: Union[str, Callable[[int], float]], at: float, *,
           mean_square: Optional[float] = None, dimension: int = 1, truth: Optional[float] = None, name: str = "Taylor series",
           formula: str = "", normals: bool = False) -> Problem:
    """g(E integrand(x)) by the power series of g about a point: term k is c_k (X_1 - a) ... (X_k - a).

    Parameters
    ----------
    integrand : callable
        Of an array (n, dimension) of uniforms; returns X, an array (n,).
    g : str or callable
        exp, exp-minus, reciprocal, log, sqrt or power:a; or a function of k = 0, 1, ... that gives coefficient k about `at`.
    at : float
        The point a. For reciprocal, log and powers E X^2 / E X is best.
    mean_square : float, optional
        E (X - a)^2, or a bound of it: says how fast terms fall. Without it a PMF has to be named, or a pilot chooses it; exp needs
        none.
    dimension : int
    truth, name, formula, normals
        As of `levels`.

    Returns
    -------
    Problem

    Raises
    ------
    ValueError
        Where terms do not fall: mean_square is not below the square of the radius of convergence.

    Examples
    --------
    >>> import debias
    >>> inverse = debias.taylor(lambda x: 1 + x[:, 0] ** 2, "reciprocal", at=1.4, mean_square=0.1)
    >>> result = debias.estimate(inverse, samples=10_000, estimator="roulette")
    >>> bool(abs(result.mean - 0.75) < 4.5 * result.standard_error)
    True
    """
    _function("integrand", integrand, "an array")
    width = _whole("dimension", dimension, 1)
    at = _finite("at", at)
    coefficients, scale, radius = _power_series(g, at)
    rates: Rates = (4.0, 0.0) if math.isinf(radius) and isinstance(g, str) else None  # at least
    if mean_square is not None:
        mean_square = _real("mean_square", mean_square)
    if mean_square is not None and math.isfinite(radius):
        b = mean_square / radius**2
        if not 0 < b < 1:
            raise ValueError(f"mean_square = {mean_square} (must lie below {radius**2}, the square of the radius of convergence); "
                             "take another point")
        rates = (-math.log2(b), 0.0)

    def terms(k: int, uniforms: Array) -> Array:
        n = len(uniforms)
        out = np.ones((n, k + 1))
        if k > 0:
            u = (normal_quantile(uniforms) if normals else uniforms).reshape(n * k, width)
            x = _checked("integrand", integrand(u), (n * k,), None, u).reshape(n, k)
            np.cumprod((x - at) / scale, axis=1, out=out[:, 1:])
        return out * coefficients(k)

    facts = _facts(name, formula, truth, rates, False, 0)
    return _path(facts, terms, lambda k: (float(k) * width, max(1.0, k)))


@_maker
def transmittance(density: Callable[[Array], Any], length: float, control: float, *, truth: Optional[float] = None,
                  name: str = "transmittance", formula: str = "") -> Problem:
    """exp(-integral of a density over [0, length]), by the power series about a control density.

    Parameters
    ----------
    density : callable
        Of an array (n, 1) of positions; returns (n,).
    length : float
    control : float
        A density that all others are measured from: the mean one, or a majorant, with which `pmf="poisson:lambda=..."` (its optical
        depth) and `estimator="single_term_outcome"` are ratio tracking.
    truth, name, formula
        As of `levels`.

    Returns
    -------
    Problem

    Examples
    --------
    >>> import math
    >>> import debias
    >>> medium = debias.transmittance(lambda x: 1 + x[:, 0], length=1.0, control=2.0)
    >>> result = debias.estimate(medium, samples=10_000, estimator="single_term_outcome", pmf="poisson:lambda=2")
    >>> bool(abs(result.mean - math.exp(-1.5)) < 4.5 * result.standard_error)
    True
    """
    _function("density", density, "an array")
    length, control = _finite("length", length), _finite("control", control)
    if not length > 0:
        raise ValueError(f"length = {length} (must be positive)")

    def depth(u: Array) -> Array:
        return length * _checked("density", density(length * u), (len(u),), None, u)

    return taylor(depth, "exp-minus", length * control, truth=truth, name=name, formula=formula)


# ---- linear operators


def _applied(operator: Any, x: Array) -> Array:
    y = _reals("operator", operator @ x)
    if y.shape != x.shape:
        raise ValueError(f"operator: of an array {x.shape} it makes one {y.shape} (must be square)")
    return y


def _vector(name: str, values: Any, n: int) -> Array:
    v = _reals(name, values)
    if v.size != n:
        raise ValueError(f"{name}: of shape {v.shape} (must have {n} numbers, as many as the operator has rows)")
    return v.reshape(n).copy()


def _order(operator: Any) -> int:
    shape = getattr(operator, "shape", None)
    if shape is None or len(shape) != 2 or shape[0] != shape[1]:
        raise ValueError(f"operator: of shape {shape} (must be square: an array, a sparse matrix or a LinearOperator)")
    return int(shape[0])


@_maker
def neumann(operator: Any, b: Any, c: Any, *, radius: float, truth: Optional[float] = None, name: str = "Neumann series",
            formula: str = "") -> Problem:
    """<c, x> with x = A x + b, as the sum of <c, A^k b>.

    Parameters
    ----------
    operator : array, sparse matrix or LinearOperator
        A, of spectral radius below 1: anything with a shape and `@`.
    b, c : array_like
    radius : float
        A bound of the spectral radius of A.
    truth, name, formula
        As of `levels`.

    Returns
    -------
    Problem

    Examples
    --------
    >>> import numpy as np
    >>> import debias
    >>> sum_of_x = debias.neumann(np.array([[0.1, 0.2], [0.3, 0.1]]), [1.0, 1.0], [1.0, 1.0], radius=0.4)
    >>> result = debias.estimate(sum_of_x, samples=10_000)
    >>> bool(abs(result.mean - 2.3 / 0.75) < 4.5 * result.standard_error)
    True
    """
    n = _order(operator)
    right, left = _vector("b", b, n), _vector("c", c, n)
    vector = [right]
    found: List[float] = []

    def term(k: int) -> float:
        while len(found) <= k:
            found.append(float(left @ vector[0]))
            vector[0] = _applied(operator, vector[0])
        return found[k]

    return series(term, ratio=_radius(radius), truth=truth, name=name, formula=formula)


def _probes(uniforms: Array) -> Array:
    return np.where(uniforms.T < 0.5, -1.0, 1.0)


@_maker
def log_determinant(operator: Any, *, radius: float, truth: Optional[float] = None, name: str = "log det(I - A)",
                    formula: str = "") -> Problem:
    """log det(I - A), as the sum of -z' A^k z / k with random signs z.

    Parameters
    ----------
    operator : array, sparse matrix or LinearOperator
        A, of spectral radius below 1. A sample applies it to a vector as often as its level says; blocks of samples together.
    radius : float
        A bound of the spectral radius.
    truth, name, formula
        As of `levels`.

    Returns
    -------
    Problem

    Examples
    --------
    >>> import numpy as np
    >>> import debias
    >>> a = np.array([[0.2, 0.1], [0.1, 0.3]])
    >>> result = debias.estimate(debias.log_determinant(a, radius=0.4), samples=10_000, estimator="roulette")
    >>> bool(abs(result.mean - np.log(0.8 * 0.7 - 0.01)) < 4.5 * result.standard_error)
    True
    """
    n = _order(operator)

    def terms(k: int, uniforms: Array) -> Array:
        z = _probes(uniforms)
        v = z
        out = np.empty((len(uniforms), k + 1))
        for i in range(k + 1):
            v = _applied(operator, v)
            out[:, i] = -np.einsum("ij,ij->j", z, v) / (i + 1)
        return out

    facts = _facts(name, formula, truth, _rates_of(_radius(radius), None)[0], False, 0)
    return _path(facts, terms, lambda k: (float(n), k + 1.0))


def _interval(lower: float, upper: float) -> Tuple[float, float, float]:
    """Middle, half width and q of a spectrum: q^k is how Chebyshev terms fall."""
    lower, upper = _real("lower", lower), _real("upper", upper)
    if not 0 < lower < upper < math.inf:
        raise ValueError(f"spectrum in [{lower}, {upper}] (must be positive and finite: bounds of the eigenvalues)")
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    return middle, half, half / (middle + math.sqrt(lower * upper))


@_maker
def log_determinant_spd(operator: Any, *, lower: float, upper: float, truth: Optional[float] = None, name: str = "log det A",
                        formula: str = "") -> Problem:
    """log det A of a symmetric positive definite A, by Chebyshev polynomials and random signs z.

    log(m + h t) = log(h / (2 q)) - 2 sum_k (-q)^k T_k(t) / k, with m, h middle and half width of the spectrum and
    q = (m - sqrt(m^2 - h^2)) / h; term k is that of z' T_k((A - m) / h) z.

    Parameters
    ----------
    operator : array, sparse matrix or LinearOperator
    lower, upper : float
        Bounds of the eigenvalues: terms fall like q^k, and grow where one lies outside.
    truth, name, formula
        As of `levels`.

    Returns
    -------
    Problem

    Examples
    --------
    >>> import numpy as np
    >>> import debias
    >>> a = np.array([[2.0, 0.5], [0.5, 1.0]])
    >>> problem = debias.log_determinant_spd(a, lower=0.7, upper=2.3)
    >>> result = debias.estimate(problem, samples=10_000, estimator="roulette")
    >>> bool(abs(result.mean - np.log(1.75)) < 4.5 * result.standard_error)
    True
    """
    n = _order(operator)
    middle, half, q = _interval(lower, upper)

    def terms(k: int, uniforms: Array) -> Array:
        z = _probes(uniforms)
        before, here = z, (_applied(operator, z) - middle * z) / half
        out = np.empty((len(uniforms), k + 1))
        out[:, 0] = n * math.log(half / (2 * q))
        for i in range(1, k + 1):
            out[:, i] = -2 * (-q) ** i / i * np.einsum("ij,ij->j", z, here)
            if i < k:
                before, here = here, 2 * (_applied(operator, here) - middle * here) / half - before
        return out

    facts = _facts(name, formula, truth, _rates_of(q, None)[0], False, 0)
    return _path(facts, terms, lambda k: (float(n), k + 1.0))


@_maker
def solve(operator: Any, b: Any, c: Any, *, lower: float, upper: float, truth: Optional[float] = None, name: str = "<c, A^-1 b>",
          formula: str = "") -> Problem:
    """<c, A^-1 b> of a symmetric positive definite A, by Chebyshev polynomials.

    Parameters
    ----------
    operator : array, sparse matrix or LinearOperator
    b, c : array_like
    lower, upper : float
        Bounds of the eigenvalues.
    truth, name, formula
        As of `levels`.

    Returns
    -------
    Problem

    Examples
    --------
    >>> import numpy as np
    >>> import debias
    >>> a = np.array([[2.0, 0.5], [0.5, 1.0]])
    >>> problem = debias.solve(a, [1.0, 0.0], [1.0, 0.0], lower=0.7, upper=2.3)
    >>> result = debias.estimate(problem, samples=10_000)
    >>> bool(abs(result.mean - 1 / 1.75) < 4.5 * result.standard_error)
    True
    """
    n = _order(operator)
    right, left = _vector("b", b, n), _vector("c", c, n)
    middle, half, q = _interval(lower, upper)
    root = math.sqrt(lower * upper)
    vectors = [right, (_applied(operator, right) - middle * right) / half]
    found = [float(left @ right) / root]

    def term(k: int) -> float:
        while len(found) <= k:
            i = len(found)
            found.append(2 * (-q) ** i / root * float(left @ vectors[1]))
            vectors[:] = [vectors[1], 2 * (_applied(operator, vectors[1]) - middle * vectors[1]) / half - vectors[0]]
        return found[k]

    return series(term, ratio=q, truth=truth, name=name, formula=formula)


# ---- samples that take as long as they take


@_maker
def reciprocal_trials(integrand: Callable[[Array], Any], bound: float, *, dimension: int = 1, truth: Optional[float] = None,
                      name: str = "reciprocal by trials", formula: str = "") -> Problem:
    """1 / E X for 0 <= X <= bound: the trials until u bound < X, over the bound. Positive, and of no level.

    Parameters
    ----------
    integrand : callable
        Of an array (n, dimension) of uniforms; returns X, an array (n,).
    bound : float
        Of X: a draw outside [0, bound] is an error.
    dimension : int
    truth, name, formula
        As of `levels`.

    Returns
    -------
    Problem

    Examples
    --------
    >>> import debias
    >>> trials = debias.reciprocal_trials(lambda x: 1 + x[:, 0] ** 2, bound=2.0)
    >>> result = debias.estimate(trials, samples=10_000)
    >>> bool(abs(result.mean - 0.75) < 4.5 * result.standard_error)
    True
    """
    _function("integrand", integrand, "an array")
    width = _whole("dimension", dimension, 1)
    bound = _finite("bound", bound)
    if not bound > 0:
        raise ValueError(f"bound = {bound} (must be positive)")

    def run(streams: Any, _: Dict[str, Any]) -> Array:
        n = len(streams)
        trials = np.zeros(n)
        open_rows = np.arange(n)
        while len(open_rows):
            u = streams.uniforms(open_rows, width + 1)
            x = _checked("integrand", integrand(u[:, :width]), (len(u),), None, u)
            outside = ~((x >= 0) & (x <= bound))
            if outside.any():
                raise ValueError(f"integrand: {x[outside][0]} (must lie in [0, {bound}], the bound)")
            trials[open_rows] += 1
            open_rows = open_rows[u[:, width] * bound >= x]
        zeros = np.zeros(n)
        return np.column_stack((trials / bound, zeros, zeros, zeros, zeros, trials, zeros))

    facts = _facts(name, formula, truth, None, False, 0)
    return Problem(_debias.sampler(facts, run, 0, "reciprocal_trials", "trials until one succeeds, over the bound; positive"))
