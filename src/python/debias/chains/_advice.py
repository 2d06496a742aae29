"""How long chains have to be, and whether a coupling is one."""

from __future__ import annotations

import json
from typing import Any, Callable, Dict, NamedTuple, Optional, Tuple

import numpy as np

from .. import _debias
from .._options import Seed, _seed_number, _whole
from .._reports import Report, _number, _table
from .._types import Array
from ._coupled import CoupledChain, _known, _taken
from ._kernels import Kernel, State, _Numbers


class ChainAdvice(Report):
    """How long chains have to be, by a pilot of meeting times: what `advise` returns.

    Examples
    --------
    >>> from debias.chains import advise, coupled_chain, random_walk
    >>> walk = random_walk(lambda x: -0.5 * x[:, 0] ** 2, step=2.4)
    >>> chain = coupled_chain(walk, lambda u: 6 * u - 3, lambda x: x[:, 0] ** 2)
    >>> sorted(advise(chain, chains=200).options)
    ['burn_in', 'lag', 'length', 'limit']
    """

    @property
    def available(self) -> bool:
        return self._data["options"] is not None

    @property
    def options(self) -> Dict[str, int]:
        """burn_in, length, lag and limit for `with_options`. Raises ValueError where more than 1 % of the chains had not met."""
        if not self.available:
            raise ValueError("advice: none (more than 1 % of the chains had not met); take a kernel that mixes or meets faster, "
                             "or a larger limit")
        return dict(self._data["options"])

    @property
    def inefficiency(self) -> float:
        """Variance x work beside a plain chain in its steady state, without end and without burn-in: 1 is the least."""
        return _number(self._data["inefficiency"])

    @property
    def tail(self) -> str:
        """Of the meeting times: "light", "heavy" or "open"; ['meeting'] has the reasons."""
        return str(self._data["meeting"]["tail"])

    @property
    def meetings(self) -> Array:
        """The meeting times at the advised lag: first, last, chains of each interval."""
        return _table(self._data["meetings"])

    @property
    def distance(self) -> Array:
        """Upper bounds on the distance (total variation) of a plain chain from its steady state: time, bound."""
        return _table(self._data["distance"])

    def burn_in_for(self, distance: float) -> int:
        """The time from which on a plain chain is that close to its steady state; -1 where the pilot cannot say."""
        rows = self.distance
        near = np.flatnonzero(rows["bound"] <= distance) if len(rows) else np.zeros(0, dtype=int)
        return int(rows["time"][near[0]]) if len(near) else -1


def advise(chain: CoupledChain, *, chains: int = 1000, seed: Seed = 1, limit: int = 0, multiple: int = 20) -> ChainAdvice:
    """burn_in, length and lag of a chain, what they cost, and how far a plain chain is from its steady state.

    lag and burn_in are 99 % quantiles of meeting times, length `multiple` of burn_in. The pilot has streams of its own, so that a
    run of the same seed stays unbiased; it waits for chains that do not meet, unless it is given a `limit`.

    Parameters
    ----------
    chain : CoupledChain
    chains : int
        Pairs of the pilot, at least 100.
    seed
        As of `debias.estimate`.
    limit : int
        Steps after which pairs that have not met are cut; 0: none is.
    multiple : int
        Of burn_in, for the length.

    Returns
    -------
    ChainAdvice

    Examples
    --------
    >>> from debias.chains import advise, coupled_chain, random_walk
    >>> walk = random_walk(lambda x: -0.5 * x[:, 0] ** 2, step=2.4)
    >>> advice = advise(coupled_chain(walk, lambda u: 6 * u - 3, lambda x: x[:, 0] ** 2), chains=200)
    >>> advice.options["length"] == 20 * advice.options["burn_in"], advice.tail
    (True, 'light')
    """
    chains_of = _known(chain)._chains
    pilot = {"chains": _whole("chains", chains, 0), "seed": _seed_number(seed), "limit": _whole("limit", limit, 0),
             "multiple": _whole("multiple", multiple, 0)}
    text, data = _debias.advise_chains(chains_of.meet, chain._chains.components or 0, pilot)
    data = {"problem": chain.name, **data}
    return ChainAdvice(text, text, json.dumps(data), data)


class CouplingCheck(NamedTuple):
    """What `check_coupling` found.

    Examples
    --------
    >>> from debias.chains import check_coupling, random_walk
    >>> check = check_coupling(random_walk(lambda x: -0.5 * x[:, 0] ** 2, step=2.4), [-1.0, 0.3, 2.5])
    >>> check.worst < check.threshold, check.parted
    (True, 0)
    """

    worst: float  #: of all z-scores of marginals
    threshold: float  #: a family of so many is above it once in a million
    tests: int
    pair: Tuple[int, int]  #: the states where the worst is
    parted: int  #: chains of equal states that came apart
    meetings: int  #: of different states, in one step

    @property
    def passed(self) -> bool:
        return self.worst <= self.threshold and self.parted == 0


CouplingCheck.__new__.__annotations__["pair"] = Tuple[int, int]  # no text, as in Interval


def check_coupling(kernel: Kernel, states: Any, f: Optional[Callable[[Array], Any]] = None, *, draws: int = 1 << 14,
                   seed: Seed = 1) -> CouplingCheck:
    """Does coupled_step move each chain as step does, and do equal chains stay together? At all pairs of `states`.

    By z-tests on f(x'), the coordinates where it is not given, and on its square, of so many draws. A coupling that fails
    biases every estimate.

    Parameters
    ----------
    kernel : Kernel
    states : array_like
        Points (m, dimension), or m numbers: where to look.
    f : callable, optional
        f(points) returns (n,), or (n, components).
    draws : int
        Of each pair.
    seed
        As of `debias.estimate`.

    Returns
    -------
    CouplingCheck

    Examples
    --------
    >>> from debias.chains import check_coupling, random_walk
    >>> walk = random_walk(lambda x: -0.5 * x[:, 0] ** 2, step=2.4)
    >>> check_coupling(walk, [-1.0, 0.3, 2.5]).passed
    True
    """
    points = np.asarray(states)
    points = points.reshape(-1, 1) if points.ndim == 1 else points
    if points.ndim != 2 or len(points) < 2:
        raise ValueError(f"check_coupling: states of shape {points.shape} (must be (two at least, dimension); near and far ones "
                         "are best)")
    n = _whole("draws", draws, 100)
    number = _seed_number(seed)
    every = np.arange(n)
    at = [0]

    def numbers() -> _Numbers:  # of streams of their own each time
        at[0] += n
        return _Numbers(_debias.streams(number, at[0] - n, n), every)

    def begin(i: int) -> State:
        return kernel._begin(np.repeat(points[i:i + 1], n, axis=0))

    def features(state: State, before: State) -> Array:
        values = np.asarray(state[0] if f is None else f(state[0].copy()), dtype=float).reshape(n, -1)
        stays = (state[0] == before[0]).all(axis=1)
        return np.column_stack((values, values**2, stays))

    def z_scores(a: Array, b: Array) -> Array:
        gap = np.abs(a.mean(axis=0) - b.mean(axis=0))
        error = np.sqrt((a.var(axis=0) + b.var(axis=0)) / n)
        least = np.maximum(64 * np.finfo(float).eps * np.abs(a.mean(axis=0)), gap / n)
        return np.asarray(np.divide(gap, np.maximum(error, least), out=np.zeros_like(gap), where=gap > 0))

    plain = []
    for i in range(len(points)):
        x = begin(i)
        plain.append(features(kernel._step(x, numbers()), x))
    worst, pair, tests, meetings = 0.0, (0, 0), 0, 0
    for i in range(len(points)):
        for j in range(len(points)):
            x, y = begin(i), begin(j)
            to_x, to_y = kernel._coupled_step(x, y, numbers())
            if i != j:
                meetings += int((to_x[0] == to_y[0]).all(axis=1).sum())
            for moved, before, expected in ((to_x, x, plain[i]), (to_y, y, plain[j])):
                z = z_scores(features(moved, before), expected)
                tests += len(z)
                if z.max() > worst:
                    worst, pair = float(z.max()), (i, j)
    parted = 0
    steps = 64
    some = np.arange(n // steps + 1)
    for i in range(len(points)):
        x = _taken(begin(i), some)
        y = x
        own = numbers().of(some)
        apart = np.zeros(len(some), dtype=bool)
        for _ in range(steps):
            x, y = kernel._coupled_step(x, y, own)
            apart |= ~(x[0] == y[0]).all(axis=1)
        parted += int(apart.sum())
    threshold = -float(_debias.normal_quantile(1e-6 / (2 * tests)))
    return CouplingCheck(worst, threshold, tests, pair, parted, meetings)
