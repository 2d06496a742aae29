"""Chains that meet: expectations under the invariant law of a Markov kernel, without the bias of a burn-in.

Two copies of a chain, one `lag` steps behind the other, take coupled steps until they meet; what they differ by until then
takes the bias of the start away (Jacob, O'Leary, Atchade 2020). Kernels and densities are NumPy functions over blocks of chains:
points are arrays (n, dimension), one row a chain, and thousands of chains take each step together.

    >>> import numpy as np
    >>> import debias
    >>> from debias import chains
    >>> walk = chains.random_walk(lambda x: -0.5 * x[:, 0] ** 2, step=2.4)
    >>> start = lambda u: 3 * debias.normal_quantile(u)
    >>> square = chains.coupled_chain(walk, start, lambda x: x[:, 0] ** 2)
    >>> advice = chains.advise(square)
    >>> result = debias.estimate(square.with_options(**advice.options), samples=2000)
    >>> bool(abs(result.mean - 1) < 4 * result.standard_error)
    True

`debias.estimate`, `samples` and `replay` take a coupled chain like any problem: sample i of a seed is the same whatever else is
drawn, as far as NumPy gives a row the same numbers in another block (matrix products may differ in the last digit).
"""

from __future__ import annotations

import json
import math
import numbers
import operator
import warnings
from typing import Any, Callable, Dict, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from . import _debias
from . import DebiasWarning, Report, Seed, _checked, _ends, _facts, _number, _seed, _table, _whole

__all__ = ["ChainAdvice", "CoupledChain", "CouplingCheck", "Kernel", "advise", "check_coupling", "coupled_chain", "hamiltonian",
           "kernel", "mala", "meeting_times", "mixture", "random_walk"]

#: What a kernel carries with each chain: arrays whose first axis is the chains; the first of them are the points.
State = Tuple[np.ndarray, ...]

_FIRST_REPORT = 1 << 16  # steps, and then each doubling


# ---- kernels


class _Numbers:
    """The uniforms of the chains in `rows` of a block, each from its own stream: the next `width` of each."""

    def __init__(self, streams: Any, rows: np.ndarray):
        self._streams, self._rows = streams, rows

    def __call__(self, width: int) -> np.ndarray:
        return self._streams.uniforms(self._rows, width)

    def of(self, some: np.ndarray) -> "_Numbers":
        return _Numbers(self._streams, self._rows[some])


class Kernel:
    """A step of many chains at once, and of many pairs of chains: made by `random_walk`, `mala`, `hamiltonian`, `mixture` and
    `kernel`."""

    name = "kernel"

    def _begin(self, points: np.ndarray) -> State:
        return (points,)

    def _step(self, x: State, uniforms: _Numbers) -> State:
        raise NotImplementedError

    def _coupled_step(self, x: State, y: State, uniforms: _Numbers) -> Tuple[State, State]:
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<debias.chains kernel: {self.name}>"


def _exponential(u: np.ndarray) -> np.ndarray:
    return -np.log(u)


def _rows(mask: np.ndarray) -> np.ndarray:
    return mask[:, None]


def _chosen(mask: np.ndarray, a: State, b: State) -> State:
    """Of a where the mask holds, else of b."""
    return tuple(np.where(mask if p.ndim == 1 else _rows(mask), p, q) for p, q in zip(a, b))


def _density(name: str, log_density: Callable, x: np.ndarray, start: bool = False) -> np.ndarray:
    out = np.asarray(log_density(x))
    if out.dtype.kind not in "fiub":
        raise TypeError(f"log_density: returned {out.dtype} (must be an array of real numbers)")
    if out.shape != (len(x),):
        raise ValueError(f"log_density: returned shape {out.shape} (must be {(len(x),)}: one for each row)")
    out = out.astype(np.float64, copy=False)
    wrong = ~(out < math.inf)
    if start:
        wrong |= ~(out > -math.inf)
    if wrong.any():
        row = int(np.argmax(wrong))
        shown = np.array2string(x[row], threshold=8, precision=17)
        if start and out[row] == -math.inf:
            raise ValueError(f"{name}: the chain starts at {shown}, where the density is zero (a chain cannot come from "
                             "there); start inside")
        raise ValueError(f"{name}: the log density is {out[row]} at {shown} (must be a number, or minus infinity outside)")
    return out


def _gradient(name: str, gradient: Callable, x: np.ndarray, needed: np.ndarray) -> np.ndarray:
    out = np.asarray(gradient(x), dtype=np.float64)
    if out.shape != x.shape:
        raise ValueError(f"gradient: returned shape {out.shape} (must be {x.shape}: that of the points)")
    wrong = needed & ~np.isfinite(out).all(axis=1)
    if wrong.any():
        shown = np.array2string(x[int(np.argmax(wrong))], threshold=8, precision=17)
        raise ValueError(f"{name}: the gradient is not finite at {shown}, where the density is (must be numbers)")
    return out


def _step_size(name: str, step: Any) -> float:
    if isinstance(step, (bool, np.bool_)) or not isinstance(step, numbers.Real):
        raise TypeError(f"step: {type(step).__name__} (must be a number)")
    if not (step > 0 and math.isfinite(step)):
        raise ValueError(f"{name}: step = {step} (must be positive and finite); 2.4 / sqrt(dimension) standard deviations "
                         "of the target is usual for a random walk")
    return float(step)


def _function(name: str, f: Any) -> Callable:
    if not callable(f):
        raise TypeError(f"{name}: {type(f).__name__} (must be a function of an array (n, dimension))")
    return f


def _normals(u: np.ndarray) -> np.ndarray:
    return _debias.normal_quantile(u).reshape(u.shape)


def _reflection_maximal(a: np.ndarray, b: np.ndarray, h: float, u: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """a + h W and b + h W', equal as often as two normal laws allow, else mirror images; and where they are equal."""
    w = _normals(u[:, :-1])
    z = (a - b) / h
    zz = np.einsum("ij,ij->i", z, z)
    wz = np.einsum("ij,ij->i", w, z)
    same = _exponential(u[:, -1]) >= wz + 0.5 * zz
    twice = np.divide(2 * wz, zz, out=np.zeros_like(zz), where=zz > 0)
    x = a + h * w
    y = np.where(_rows(same), x, b + h * (w - _rows(twice) * z))
    return x, y, same


class _RandomWalk(Kernel):
    def __init__(self, log_density: Callable, step: float):
        self.name = f"random walk of steps {step:g}"
        self._log_density = _function("log_density", log_density)
        self._h = step

    def _begin(self, points: np.ndarray) -> State:
        points = points.astype(np.float64, copy=False)
        return points, _density("random_walk", self._log_density, points, start=True)

    def _at(self, points: np.ndarray) -> State:
        return points, _density("random_walk", self._log_density, points)

    @staticmethod
    def _decided(x: State, proposal: State, threshold: np.ndarray) -> State:
        return _chosen(threshold >= x[1] - proposal[1], proposal, x)

    def _step(self, x: State, uniforms: _Numbers) -> State:
        u = uniforms(x[0].shape[1] + 1)
        return self._decided(x, self._at(x[0] + self._h * _normals(u[:, :-1])), _exponential(u[:, -1]))

    def _coupled_step(self, x: State, y: State, uniforms: _Numbers) -> Tuple[State, State]:
        u = uniforms(x[0].shape[1] + 2)
        to_x, to_y, same = _reflection_maximal(x[0], y[0], self._h, u[:, :-1])
        at_x = self._at(to_x)
        at_y = (to_y, at_x[1].copy())
        other = ~same
        if other.any():  # equal proposals have one density
            at_y[1][other] = self._at(to_y[other])[1]
        threshold = _exponential(u[:, -1])
        return self._decided(x, at_x, threshold), self._decided(y, at_y, threshold)


def random_walk(log_density: Callable[[np.ndarray], Any], step: float) -> Kernel:
    """Random-walk Metropolis, its proposals coupled by reflection and maximal overlap.

    Parameters
    ----------
    log_density : of points (n, dimension), an array (n,); up to a constant, -inf outside
    step : standard deviation of a proposal in each coordinate; 2.4 / sqrt(dimension) of that of the target is usual

    Examples
    --------
    >>> walk = random_walk(lambda x: -0.5 * (x**2).sum(axis=1), step=1.7)
    """
    return _RandomWalk(log_density, _step_size("random_walk", step))


class _Langevin(Kernel):
    """State: points, log density, means of the proposals."""

    def __init__(self, log_density: Callable, gradient: Callable, step: float):
        self.name = f"Langevin steps of {step:g}"
        self._log_density = _function("log_density", log_density)
        self._slope = _function("gradient", gradient)
        self._h = step

    def _at(self, points: np.ndarray, start: bool = False) -> State:
        density = _density("mala", self._log_density, points, start)
        slope = _gradient("mala", self._slope, points, density > -math.inf)
        return points, density, points + 0.5 * self._h**2 * slope

    def _begin(self, points: np.ndarray) -> State:
        return self._at(points.astype(np.float64, copy=False), start=True)

    def _decided(self, x: State, to: State, threshold: np.ndarray) -> State:
        def distance(a: State, b: State) -> np.ndarray:
            d = (b[0] - a[2]) / self._h
            return 0.5 * np.einsum("ij,ij->i", d, d)

        inside = to[1] > -math.inf
        with np.errstate(invalid="ignore"):
            accepted = inside & (threshold >= x[1] - to[1] + distance(to, x) - distance(x, to))
        return _chosen(accepted, to, x)

    def _step(self, x: State, uniforms: _Numbers) -> State:
        u = uniforms(x[0].shape[1] + 1)
        return self._decided(x, self._at(x[2] + self._h * _normals(u[:, :-1])), _exponential(u[:, -1]))

    def _coupled_step(self, x: State, y: State, uniforms: _Numbers) -> Tuple[State, State]:
        u = uniforms(x[0].shape[1] + 2)
        to_x, to_y, same = _reflection_maximal(x[2], y[2], self._h, u[:, :-1])
        at_x = self._at(to_x)
        at_y = tuple(part.copy() for part in at_x)
        other = ~same
        if other.any():
            for whole, part in zip(at_y, self._at(to_y[other])):
                whole[other] = part
        threshold = _exponential(u[:, -1])
        return self._decided(x, at_x, threshold), self._decided(y, at_y, threshold)


def mala(log_density: Callable[[np.ndarray], Any], gradient: Callable[[np.ndarray], Any], step: float) -> Kernel:
    """The Metropolis-adjusted Langevin algorithm, coupled like `random_walk`.

    Parameters
    ----------
    log_density : of points (n, dimension), an array (n,)
    gradient : of log_density, an array (n, dimension)
    step : standard deviation h of a proposal; its mean is x + h^2 / 2 gradient(x)

    Examples
    --------
    >>> langevin = mala(lambda x: -0.5 * (x**2).sum(axis=1), lambda x: -x, step=1.2)
    """
    return _Langevin(log_density, gradient, _step_size("mala", step))


class _Hamiltonian(Kernel):
    """State: points, log density, gradients."""

    def __init__(self, log_density: Callable, gradient: Callable, step: float, steps: int):
        self.name = f"{steps} Hamiltonian steps of {step:g}"
        self._log_density = _function("log_density", log_density)
        self._slope = _function("gradient", gradient)
        self._h = step
        self._n = steps

    def _begin(self, points: np.ndarray) -> State:
        points = points.astype(np.float64, copy=False)
        density = _density("hamiltonian", self._log_density, points, start=True)
        return points, density, _gradient("hamiltonian", self._slope, points, density > -math.inf)

    def _moved(self, x: State, momentum: np.ndarray, threshold: np.ndarray) -> State:
        every = np.ones(len(momentum), dtype=bool)
        before = 0.5 * np.einsum("ij,ij->i", momentum, momentum)
        point, slope = x[0], x[2]
        momentum = momentum + 0.5 * self._h * slope
        for s in range(1, self._n + 1):
            point = point + self._h * momentum
            slope = _gradient("hamiltonian", self._slope, point, every)
            momentum = momentum + (self._h if s < self._n else 0.5 * self._h) * slope
        density = _density("hamiltonian", self._log_density, point)
        after = 0.5 * np.einsum("ij,ij->i", momentum, momentum)
        return _chosen(threshold >= x[1] - before - density + after, (point, density, slope), x)

    def _step(self, x: State, uniforms: _Numbers) -> State:
        u = uniforms(x[0].shape[1] + 1)
        return self._moved(x, _normals(u[:, :-1]), _exponential(u[:, -1]))

    def _coupled_step(self, x: State, y: State, uniforms: _Numbers) -> Tuple[State, State]:
        u = uniforms(x[0].shape[1] + 1)
        momentum, threshold = _normals(u[:, :-1]), _exponential(u[:, -1])
        return self._moved(x, momentum, threshold), self._moved(y, momentum, threshold)


def hamiltonian(log_density: Callable[[np.ndarray], Any], gradient: Callable[[np.ndarray], Any], step: float,
                steps: int) -> Kernel:
    """Hamiltonian steps that share momentum and acceptance: they bring chains together, but let none meet.

    Take them in a `mixture` with a random walk of small steps.

    Parameters
    ----------
    log_density, gradient : as of `mala`
    step, steps : of the leapfrog scheme; one call is one step of work, whatever `steps`

    Examples
    --------
    >>> density, slope = lambda x: -0.5 * (x**2).sum(axis=1), lambda x: -x
    >>> both = mixture([0.9, 0.1], hamiltonian(density, slope, 0.4, 3), random_walk(density, 0.5))
    """
    return _Hamiltonian(log_density, gradient, _step_size("hamiltonian", step), _whole("steps", steps, 1))


class _Mixture(Kernel):
    """State: points. What a kernel carries beside them is made anew at each step."""

    def __init__(self, weights: np.ndarray, kernels: Sequence[Kernel]):
        self.name = "mixture of " + ", ".join(k.name for k in kernels)
        self._up_to = np.cumsum(weights) / np.sum(weights)
        self._kernels = kernels

    def _begin(self, points: np.ndarray) -> State:
        return (self._kernels[0]._begin(points)[0],)

    def _groups(self, uniforms: _Numbers, n: int) -> Any:
        which = np.minimum(np.searchsorted(self._up_to, uniforms(1)[:, 0], side="right"), len(self._kernels) - 1)
        for i, one in enumerate(self._kernels):
            group = np.flatnonzero(which == i)
            if len(group):
                yield one, group, uniforms.of(group)

    def _step(self, x: State, uniforms: _Numbers) -> State:
        points = x[0].copy()
        for one, group, own in self._groups(uniforms, len(points)):
            points[group] = one._step(one._begin(x[0][group]), own)[0]
        return (points,)

    def _coupled_step(self, x: State, y: State, uniforms: _Numbers) -> Tuple[State, State]:
        to_x, to_y = x[0].copy(), y[0].copy()
        for one, group, own in self._groups(uniforms, len(to_x)):
            a, b = one._coupled_step(one._begin(x[0][group]), one._begin(y[0][group]), own)
            to_x[group], to_y[group] = a[0], b[0]
        return (to_x,), (to_y,)


def mixture(weights: Sequence[float], *kernels: Kernel) -> Kernel:
    """Each step is one of the kernels, drawn with these relative weights, the same one for both chains.

    All of them must leave the same law invariant.

    Examples
    --------
    >>> density = lambda x: -0.5 * x[:, 0] ** 2
    >>> both = mixture([3, 1], random_walk(density, 2.4), random_walk(density, 0.5))
    """
    array = np.asarray(weights, dtype=float)
    for one in kernels:
        if not isinstance(one, Kernel):
            raise TypeError(f"mixture: {type(one).__name__} (must be a kernel); see debias.chains.kernel for your own")
    if array.shape != (len(kernels),) or not len(kernels):
        raise ValueError(f"mixture: weights of shape {array.shape} for {len(kernels)} kernels (must be one for each)")
    if not (np.isfinite(array).all() and (array > 0).all()):
        raise ValueError(f"mixture: weights = {array} (must be positive and finite); leave out a kernel that is never taken")
    return _Mixture(array, kernels)


class _Own(Kernel):
    def __init__(self, step: Callable, coupled_step: Callable, width: int, coupled_width: int):
        self.name = "kernel of one's own"
        self._one, self._both, self._width, self._coupled_width = step, coupled_step, width, coupled_width

    @staticmethod
    def _checked(name: str, out: Any, before: np.ndarray) -> np.ndarray:
        out = np.asarray(out)
        if out.dtype.kind not in "fiub":
            raise TypeError(f"{name}: returned {out.dtype} (must be an array of real numbers)")
        if out.shape != before.shape:
            raise ValueError(f"{name}: returned points of shape {out.shape} (must be {before.shape}: a row for each chain)")
        if out.dtype.kind == "f" and not np.isfinite(out).all():
            row = int(np.argmin(np.isfinite(out).all(axis=1)))
            raise ValueError(f"{name}: moved a chain to {_ends(out[row])} (must be finite) from {_ends(before[row])}")
        return out

    def _step(self, x: State, uniforms: _Numbers) -> State:
        return (self._checked("step", self._one(x[0], uniforms(self._width)), x[0]),)

    def _coupled_step(self, x: State, y: State, uniforms: _Numbers) -> Tuple[State, State]:
        out = self._both(x[0], y[0], uniforms(self._coupled_width))
        if not isinstance(out, tuple) or len(out) != 2:
            raise TypeError(f"coupled_step: returned {type(out).__name__} (must be a pair: the next x and the next y)")
        return tuple((self._checked("coupled_step", a, b),) for a, b in zip(out, (x[0], y[0])))  # type: ignore[return-value]


def kernel(step: Callable[[np.ndarray, np.ndarray], Any], coupled_step: Callable[[np.ndarray, np.ndarray, np.ndarray], Any], *,
           uniforms: int, coupled_uniforms: Optional[int] = None) -> Kernel:
    """A kernel of one's own.

    Parameters
    ----------
    step : step(x, u) returns the next points of x (n, dimension), from numbers u (n, uniforms) in (0, 1)
    coupled_step : coupled_step(x, y, u) returns the next x and the next y, each as `step` would move it, together so that rows
        may become equal; equal rows must stay equal. `check_coupling` looks whether both hold.
    uniforms, coupled_uniforms : numbers that a step takes; the coupled one as many, where it is not given

    Examples
    --------
    Two states, one uniform for both chains:

    >>> def flip(x, u):
    ...     return np.where(x == 0, u < 0.3, u < 0.8).astype(float)
    >>> two = kernel(flip, lambda x, y, u: (flip(x, u), flip(y, u)), uniforms=1)
    """
    _function("step", step)
    _function("coupled_step", coupled_step)
    width = _whole("uniforms", uniforms, 1)
    return _Own(step, coupled_step, width, width if coupled_uniforms is None else _whole("coupled_uniforms", coupled_uniforms, 1))


# ---- chains


def _taken(state: State, rows: np.ndarray) -> State:
    return tuple(part[rows] for part in state)


def _joined(a: State, b: State) -> State:
    return tuple(np.concatenate(pair) for pair in zip(a, b))


class _Chains:
    """Runs the pairs of chains of a block in step."""

    def __init__(self, kernel: Kernel, start: Any, f: Callable, dimension: int, components: Optional[int]):
        self.kernel, self.start, self.f, self.dimension, self.components = kernel, start, f, dimension, components

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

    def observed(self, points: np.ndarray) -> np.ndarray:
        n = len(points)
        shape = (n,) if self.components is None else (n, self.components)
        return _checked("f", self.f(points), shape, None, points).reshape(n, self.components or 1)

    def meet(self, streams: Any, options: Dict[str, int], f: bool = True) -> np.ndarray:
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

        def correct(w: int, rows: np.ndarray, of_x: np.ndarray, y: State) -> None:
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


class CoupledChain:
    """What `coupled_chain` makes: a problem for `debias.estimate`, `debias.samples` and `debias.replay`.

    options : burn_in, length, lag, limit
    """

    def __init__(self, chains: _Chains, options: Dict[str, int], facts: dict):
        self._chains, self._facts = chains, facts
        self.options = dict(options)
        self._problem = _debias.coupled_chain(facts, chains.meet, chains.components or 0, self.options)

    @property
    def name(self) -> str:
        return self._problem.name

    @property
    def components(self) -> int:
        return self._problem.components

    def with_options(self, *, burn_in: Optional[int] = None, length: Optional[int] = None, lag: Optional[int] = None,
                     limit: Optional[int] = None) -> "CoupledChain":
        """The same chain with other options: `chain.with_options(**advice.options)`."""
        given = {"burn_in": burn_in, "length": length, "lag": lag, "limit": limit}
        return CoupledChain(self._chains, {**self.options, **{name: _whole(name, x, 0) for name, x in given.items()
                                                              if x is not None}}, self._facts)

    def __repr__(self) -> str:
        options = ", ".join(f"{name} {value}" for name, value in self.options.items() if name != "limit" or value)
        return f"<debias.chains.CoupledChain: {self.name}, {options}>"


def coupled_chain(kernel: Kernel, start: Any, f: Callable[[np.ndarray], Any], *, burn_in: int = 0, length: int = 0, lag: int = 1,
                  limit: int = 0, dimension: int = 1, components: Optional[int] = None, truth: Optional[float] = None,
                  name: str = "coupled chain", formula: str = "") -> CoupledChain:
    """An estimate of E f under the invariant law of a kernel, unbiased for any burn-in, length and lag.

    Parameters
    ----------
    kernel : `random_walk`, `mala`, `mixture`, `kernel`, ...
    start : a point, or start(u), which draws points (n, dimension of the points) from numbers u (n, dimension) in (0, 1); both
        chains start so. Start from a law that covers all modes: where no chain has seen one, nothing can tell.
    f : f(points) returns (n,), or (n, components)
    burn_in : the first state that is averaged
    length : the last one
    lag : steps that the second chain is behind
    limit : steps after which chains that have not met are cut, which biases the estimate, and the result says so; 0: none is
    dimension : uniforms that a start takes
    components : c, where f returns an array (n, c)

    `advise` measures burn_in, length and lag. A run takes blocks of 512 to 65536 chains, fewer of long ones, on the thread that
    called.
    Chains that have not met after 65536 steps, 131072, ... are told by a DebiasWarning with the code "not_met".

    Examples
    --------
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
    options = {key: operator.index(value) for key, value in options.items()}
    chains = _Chains(kernel, start, f, _whole("dimension", dimension, 1), width)
    return CoupledChain(chains, options, _facts(name, formula, truth, None, False, 0))


def meeting_times(chain: CoupledChain, n: int = 1000, *, seed: Seed = 1, first: int = 0) -> np.ndarray:
    """When the pairs of chains of samples first, first + 1, ... meet, n of them; f is not looked at.

    The very times of a run of that seed. Where `limit` cuts chains, theirs is above it: limit + 1.

    Examples
    --------
    >>> walk = random_walk(lambda x: -0.5 * x[:, 0] ** 2, step=2.4)
    >>> times = meeting_times(coupled_chain(walk, 0.0, lambda x: x[:, 0]), 100)
    >>> bool((times >= 1).all())
    True
    """
    streams = _debias.streams(int(_seed(seed)), _whole("first", first, 0), _whole("n", n, 1))
    rows = _known(chain)._chains.meet(streams, {**chain.options, "burn_in": 0, "length": 0}, f=False)
    times = rows[:, -3].astype(np.int64)
    return np.where(rows[:, -4] != 0, chain.options["limit"] + 1, times)


def _known(chain: Any) -> CoupledChain:
    if not isinstance(chain, CoupledChain):
        raise TypeError(f"chain: {type(chain).__name__} (must be made by debias.chains.coupled_chain)")
    return chain


# ---- advice


class ChainAdvice(Report):
    """How long chains have to be, by a pilot of meeting times: what `advise` returns."""

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
        return self._data["meeting"]["tail"]

    @property
    def meetings(self) -> np.ndarray:
        """The meeting times at the advised lag: first, last, chains of each interval."""
        return _table(self._data["meetings"])

    @property
    def distance(self) -> np.ndarray:
        """Upper bounds on the distance (total variation) of a plain chain from its steady state: time, bound."""
        return _table(self._data["distance"])

    def burn_in_for(self, distance: float) -> int:
        """The time from which on a plain chain is that close to its steady state; -1 where the pilot cannot say."""
        rows = self.distance
        near = np.flatnonzero(rows["bound"] <= distance) if len(rows) else ()
        return int(rows["time"][near[0]]) if len(near) else -1


def advise(chain: CoupledChain, *, chains: int = 1000, seed: Seed = 1, limit: int = 0, multiple: int = 20) -> ChainAdvice:
    """burn_in, length and lag of a chain, what they cost, and how far a plain chain is from its steady state.

    lag and burn_in are 99 % quantiles of meeting times, length `multiple` of burn_in. The pilot has streams of its own, so that a
    run of the same seed stays unbiased; it waits for chains that do not meet, unless it is given a `limit`.

    Examples
    --------
    >>> walk = random_walk(lambda x: -0.5 * x[:, 0] ** 2, step=2.4)
    >>> advice = advise(coupled_chain(walk, lambda u: 6 * u - 3, lambda x: x[:, 0] ** 2), chains=200)
    >>> advice.options["length"] == 20 * advice.options["burn_in"], advice.tail
    (True, 'light')
    """
    chains_of = _known(chain)._chains
    pilot = {"chains": _whole("chains", chains, 0), "seed": int(_seed(seed)), "limit": _whole("limit", limit, 0),
             "multiple": _whole("multiple", multiple, 0)}
    text, data = _debias.advise_chains(chains_of.meet, chain._chains.components or 0, pilot)
    data = {"problem": chain.name, **data}
    return ChainAdvice(text, text, json.dumps(data), data)


class CouplingCheck(NamedTuple):
    """What `check_coupling` found."""

    worst: float  #: of all z-scores of marginals
    threshold: float  #: a family of so many is above it once in a million
    tests: int
    pair: Tuple[int, int]  #: the states where the worst is
    parted: int  #: chains of equal states that came apart
    meetings: int  #: of different states, in one step

    @property
    def passed(self) -> bool:
        return self.worst <= self.threshold and self.parted == 0


def check_coupling(kernel: Kernel, states: Any, f: Optional[Callable[[np.ndarray], Any]] = None, *, draws: int = 1 << 14,
                   seed: Seed = 1) -> CouplingCheck:
    """Does coupled_step move each chain as step does, and do equal chains stay together? At all pairs of `states`.

    By z-tests on f(x'), the coordinates where it is not given, and on its square, of so many draws. A coupling that fails
    biases every estimate.

    Examples
    --------
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
    number = int(_seed(seed))
    every = np.arange(n)
    at = [0]

    def numbers() -> _Numbers:  # of streams of their own each time
        at[0] += n
        return _Numbers(_debias.streams(number, at[0] - n, n), every)

    def begin(i: int) -> State:
        return kernel._begin(np.repeat(points[i:i + 1], n, axis=0))

    def features(state: State, before: State) -> np.ndarray:
        values = np.asarray(state[0] if f is None else f(state[0]), dtype=float).reshape(n, -1)
        stays = (state[0] == before[0]).all(axis=1)
        return np.column_stack((values, values**2, stays))

    def z_scores(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        gap = np.abs(a.mean(axis=0) - b.mean(axis=0))
        error = np.sqrt((a.var(axis=0) + b.var(axis=0)) / n)
        least = np.maximum(64 * np.finfo(float).eps * np.abs(a.mean(axis=0)), gap / n)
        return np.divide(gap, np.maximum(error, least), out=np.zeros_like(gap), where=gap > 0)

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
