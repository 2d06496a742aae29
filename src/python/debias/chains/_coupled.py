"""Pairs of chains that meet, as a problem."""

from __future__ import annotations

import warnings
from typing import Any, Callable, Dict, Optional, Tuple

import numpy as np

from .. import _debias
from .._errors import DebiasWarning
from .._options import Seed, _seed_number, _whole
from .._own import _checked, _facts
from .._problem import Problem, _packed
from .._types import Array, Facts
from ._kernels import Kernel, State, _function, _Numbers

_FIRST_REPORT = 1 << 16  # steps, and then each doubling


def _taken(state: State, rows: Array) -> State:
    return tuple(part[rows] for part in state)


def _joined(a: State, b: State) -> State:
    return tuple(np.concatenate(pair) for pair in zip(a, b))


class _Chains:
    """Runs the pairs of chains of a block in step."""

    def __init__(self, kernel: Kernel, start: Any, f: Callable[..., Any], dimension: int, components: Optional[int]):
        self.kernel, self.start, self.f, self.dimension, self.components = kernel, start, f, dimension, components

    def __getstate__(self) -> Dict[str, Any]:
        return {name: _packed(x) for name, x in vars(self).items()}

    def begin(self, streams: Any) -> State:
        n = len(streams)
        if callable(self.start):
            u = streams.uniforms(np.arange(n), self.dimension)
            points = np.asarray(self.start(u))
            if points.dtype.kind not in "fiub":
                raise TypeError(f"start: returned {points.dtype} (must be an array of real numbers)")
            if points.ndim != 2 or len(points) != n:
                raise ValueError(f"start: returned shape {points.shape} (must be ({n}, dimension): a row for each chain)")
        else:
            points = np.repeat(self.start[None, :], n, axis=0)
        if points.dtype.kind == "f" and not np.isfinite(points).all():
            raise ValueError("start: a point that is not finite (must be numbers)")
        return self.kernel._begin(points)

    def observed(self, points: Array) -> Array:
        n = len(points)
        shape = (n,) if self.components is None else (n, self.components)
        return _checked("f", self.f(points.copy()), shape, None, points).reshape(n, self.components or 1)

    def meet(self, streams: Any, options: Dict[str, int], f: bool = True) -> Array:
        """A row of numbers for each stream, as src/python/chains.hpp has them; without f, sums are zero."""
        k, m, lag, limit = (options[name] for name in ("burn_in", "length", "lag", "limit"))
        n, c = len(streams), self.components or 1
        kernel = self.kernel
        every = np.arange(n)
        average, correction = np.zeros((n, c)), np.zeros((n, c))
        corrected, cut = np.zeros(n), np.zeros(n)
        meeting = np.full(n, lag)

        def averages(t: int) -> bool:
            return f and k <= t <= m

        def correct(w: int, rows: Array, of_x: Array, y: State) -> None:
            correction[rows] += w * (of_x - self.observed(y[0]))
            corrected[rows] = 1

        def weight(t: int) -> int:
            return (t - k) // lag + (-max(lag, t - m) // lag) + 1 if t >= k + lag else 0  # -ceil(a / b) = -a // b

        x = self.begin(streams)
        if averages(0):
            average += self.observed(x[0])
        for t in range(1, lag + 1):
            x = kernel._step(x, _Numbers(streams, every))
            if averages(t):
                average += self.observed(x[0])
        y = self.begin(streams)
        same = (x[0] == y[0]).all(axis=1)
        met, apart = np.flatnonzero(same), np.flatnonzero(~same)
        together, x, y = _taken(x, met), _taken(x, apart), _taken(y, apart)
        t = lag
        if f and len(apart) and weight(t):
            correct(weight(t), apart, self.observed(x[0]), y)
        pause = _FIRST_REPORT
        while len(apart) or t < m:
            if limit and t >= limit and len(apart):
                cut[apart] = 1
                break
            if t >= pause and len(apart):
                warnings.warn(DebiasWarning(f"{len(apart)} of {n} chains have not met after {t} steps, and go on (a kernel that "
                                            "mixes or meets faster would help; `limit` cuts them, which is a bias)", "not_met"),
                              stacklevel=2)
                pause *= 2
            if t < m and len(met):
                together = kernel._step(together, _Numbers(streams, met))
            if len(apart):
                x, y = kernel._coupled_step(x, y, _Numbers(streams, apart))
            t += 1
            if averages(t) and len(met):
                average[met] += self.observed(together[0])
            if not len(apart):
                continue
            same = (x[0] == y[0]).all(axis=1)
            w = weight(t)
            if averages(t) or (f and w and not same.all()):
                of_x = self.observed(x[0])
                if averages(t):
                    average[apart] += of_x
                if w and not same.all():
                    other = ~same
                    correct(w, apart[other], of_x[other], _taken(y, other))
            meeting[apart] = t
            if same.any():
                if t < m:
                    together = _joined(together, _taken(x, same))
                    met = np.concatenate((met, apart[same]))
                apart, x, y = apart[~same], _taken(x, ~same), _taken(y, ~same)
        steps = np.maximum(meeting, m)
        return np.column_stack((average, correction, corrected, cut, meeting, steps, meeting - lag))


class CoupledChain(Problem):
    """What `coupled_chain` makes: a problem for `debias.estimate`, `debias.samples` and `debias.replay`.

    Attributes
    ----------
    options : dict
        burn_in, length, lag and limit.

    Examples
    --------
    >>> from debias.chains import coupled_chain, random_walk
    >>> chain = coupled_chain(random_walk(lambda x: -0.5 * x[:, 0] ** 2, step=2.4), 0.0, lambda x: x[:, 0])
    >>> chain.with_options(burn_in=5, length=50).options["length"]
    50
    """

    _has_levels = False

    def __init__(self, chains: _Chains, options: Dict[str, int], facts: Facts):
        self._chains, self._facts = chains, facts
        self.options = dict(options)
        super().__init__(_debias.coupled_chain(facts, chains.meet, chains.components or 0, self.options))

    def __reduce__(self) -> Tuple[Any, ...]:
        return CoupledChain, (self._chains, self.options, self._facts)

    def with_options(self, *, burn_in: Optional[int] = None, length: Optional[int] = None, lag: Optional[int] = None,
                     limit: Optional[int] = None) -> "CoupledChain":
        """The same chain with other options: `chain.with_options(**advice.options)`."""
        given = {"burn_in": burn_in, "length": length, "lag": lag, "limit": limit}
        return CoupledChain(self._chains, {**self.options, **{name: _whole(name, x, 0) for name, x in given.items()
                                                              if x is not None}}, self._facts)

    def __repr__(self) -> str:
        options = ", ".join(f"{name} {value}" for name, value in self.options.items() if name != "limit" or value)
        return f"<debias.chains.CoupledChain: {self.name}, {options}>"


def coupled_chain(kernel: Kernel, start: Any, f: Callable[[Array], Any], *, burn_in: int = 0, length: int = 0, lag: int = 1,
                  limit: int = 0, dimension: int = 1, components: Optional[int] = None, truth: Optional[float] = None,
                  name: str = "coupled chain", formula: str = "") -> CoupledChain:
    """An estimate of E f under the invariant law of a kernel, unbiased for any burn-in, length and lag.

    Parameters
    ----------
    kernel : Kernel
        `random_walk`, `mala`, `mixture`, `kernel`, ...
    start : array_like or callable
        A point, or start(u), which draws points (n, dimension of the points) from numbers u (n, dimension) in (0, 1); both
        chains start so. Start from a law that covers all modes: where no chain has seen one, nothing can tell.
    f : callable
        f(points) returns (n,), or (n, components).
    burn_in : int
        The first state that is averaged.
    length : int
        The last one.
    lag : int
        Steps that the second chain is behind.
    limit : int
        Steps after which chains that have not met are cut, which biases the estimate, and the result says so; 0: none is.
    dimension : int
        Uniforms that a start takes.
    components : int, optional
        c, where f returns an array (n, c).
    truth : float, optional
        For tests: a result says how far it is.
    name, formula : str
        What reports call the problem.

    Returns
    -------
    CoupledChain

    Notes
    -----
    `advise` measures burn_in, length and lag. A run takes blocks of 512 to 65536 chains, fewer of long ones, on the thread that
    called.
    Chains that have not met after 65536 steps, 131072, ... are told by a DebiasWarning with the code "not_met".

    Examples
    --------
    >>> from debias.chains import coupled_chain, random_walk
    >>> walk = random_walk(lambda x: -0.5 * (x**2).sum(axis=1), step=1.7)
    >>> means = coupled_chain(walk, [1.0, 0.0], lambda x: x, components=2, burn_in=10, length=100, lag=10)
    >>> means
    <debias.chains.CoupledChain: coupled chain, burn_in 10, length 100, lag 10>
    """
    if not isinstance(kernel, Kernel):
        raise TypeError(f"kernel: {type(kernel).__name__} (must be one of debias.chains, or debias.chains.kernel(step, "
                        "coupled_step, ...))")
    _function("f", f)
    if not callable(start):
        start = np.atleast_1d(np.asarray(start))
        if start.dtype.kind not in "fiub" or start.ndim != 1:
            raise TypeError("start: no point (must be a row of numbers, or a function of uniforms)")
    width = None if components is None else _whole("components", components, 1)
    options = {"burn_in": burn_in, "length": length, "lag": lag, "limit": limit}
    options = {key: _whole(key, value, -(2**62)) for key, value in options.items()}
    chains = _Chains(kernel, start, f, _whole("dimension", dimension, 1), width)
    return CoupledChain(chains, options, _facts(name, formula, truth, None, False, 0))


def meeting_times(chain: CoupledChain, n: int = 1000, *, seed: Seed = 1, first: int = 0) -> Array:
    """When the pairs of chains of samples first, first + 1, ... meet, n of them; f is not looked at.

    The very times of a run of that seed. Where `limit` cuts chains, theirs is above it: limit + 1.

    Parameters
    ----------
    chain : CoupledChain
    n, first : int
        Which samples.
    seed
        As of `debias.estimate`.

    Returns
    -------
    ndarray of int
        (n,), in steps.

    Examples
    --------
    >>> from debias.chains import coupled_chain, meeting_times, random_walk
    >>> walk = random_walk(lambda x: -0.5 * x[:, 0] ** 2, step=2.4)
    >>> times = meeting_times(coupled_chain(walk, 0.0, lambda x: x[:, 0]), 100)
    >>> bool((times >= 1).all())
    True
    """
    streams = _debias.streams(_seed_number(seed), _whole("first", first, 0), _whole("n", n, 1))
    rows = _known(chain)._chains.meet(streams, {**chain.options, "burn_in": 0, "length": 0}, f=False)
    times = rows[:, -3].astype(np.int64)
    return np.where(rows[:, -4] != 0, chain.options["limit"] + 1, times)


def _known(chain: Any) -> CoupledChain:
    if not isinstance(chain, CoupledChain):
        raise TypeError(f"chain: {type(chain).__name__} (must be made by debias.chains.coupled_chain)")
    return chain
