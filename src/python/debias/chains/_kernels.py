"""Steps of many chains at once, and of many pairs of chains."""

from __future__ import annotations

import math
from typing import Any, Callable, Dict, Optional, Sequence, Tuple, cast

import numpy as np

from .. import _debias
from .._options import _real, _reals, _whole
from .._problem import _packed
from .._reports import _ends
from .._types import Array

#: What a kernel carries with each chain: arrays whose first axis is the chains; the first of them are the points.
State = Tuple[Array, ...]


class _Numbers:
    """The uniforms of the chains in `rows` of a block, each from its own stream: the next `width` of each."""

    def __init__(self, streams: Any, rows: Array):
        self._streams, self._rows = streams, rows

    def __call__(self, width: int) -> Array:
        numbers_of: Array = self._streams.uniforms(self._rows, width)
        return numbers_of

    def of(self, some: Array) -> "_Numbers":
        return _Numbers(self._streams, self._rows[some])


class Kernel:
    """A step of many chains at once, and of many pairs of chains: made by `random_walk`, `mala`, `hamiltonian`, `mixture` and
    `kernel`.

    Examples
    --------
    >>> from debias.chains import random_walk
    >>> random_walk(lambda x: -0.5 * x[:, 0] ** 2, step=2.4)
    <debias.chains kernel: random walk of steps 2.4>
    """

    name = "kernel"

    def _begin(self, points: Array) -> State:
        return (points,)

    def _step(self, x: State, uniforms: _Numbers) -> State:
        raise NotImplementedError

    def _coupled_step(self, x: State, y: State, uniforms: _Numbers) -> Tuple[State, State]:
        raise NotImplementedError

    def __getstate__(self) -> Dict[str, Any]:
        return {name: _packed(x) for name, x in vars(self).items()}

    def __repr__(self) -> str:
        return f"<debias.chains kernel: {self.name}>"


def _exponential(u: Array) -> Array:
    return -np.log(u)


def _rows(mask: Array) -> Array:
    return mask[:, None]


def _chosen(mask: Array, a: State, b: State) -> State:
    """Of a where the mask holds, else of b."""
    return tuple(np.where(mask if p.ndim == 1 else _rows(mask), p, q) for p, q in zip(a, b))


def _density(name: str, log_density: Callable[..., Any], x: Array, start: bool = False) -> Array:
    out = np.asarray(log_density(x.copy()))  # a function may write into its points, or into one array each time
    if out.dtype.kind not in "fiub":
        raise TypeError(f"log_density: returned {out.dtype} (must be an array of real numbers)")
    if out.shape != (len(x),):
        raise ValueError(f"log_density: returned shape {out.shape} (must be {(len(x),)}: one for each row)")
    out = out.astype(np.float64)
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


def _gradient(name: str, gradient: Callable[..., Any], x: Array, needed: Array) -> Array:
    out = np.array(gradient(x.copy()), dtype=np.float64)
    if out.shape != x.shape:
        raise ValueError(f"gradient: returned shape {out.shape} (must be {x.shape}: that of the points)")
    wrong = needed & ~np.isfinite(out).all(axis=1)
    if wrong.any():
        shown = np.array2string(x[int(np.argmax(wrong))], threshold=8, precision=17)
        raise ValueError(f"{name}: the gradient is not finite at {shown}, where the density is (must be numbers)")
    return out


def _step_size(name: str, step: Any) -> float:
    step = _real("step", step)
    if not (step > 0 and math.isfinite(step)):
        raise ValueError(f"{name}: step = {step} (must be positive and finite); 2.4 / sqrt(dimension) standard deviations "
                         "of the target is usual for a random walk")
    return step


def _function(name: str, f: Any) -> Callable[..., Any]:
    if not callable(f):
        raise TypeError(f"{name}: {type(f).__name__} (must be a function of an array (n, dimension))")
    return cast(Callable[..., Any], f)


def _normals(u: Array) -> Array:
    return np.reshape(_debias.normal_quantile(u), u.shape)


def _reflection_maximal(a: Array, b: Array, h: float, u: Array) -> Tuple[Array, Array, Array]:
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
    def __init__(self, log_density: Callable[..., Any], step: float):
        self.name = f"random walk of steps {step:g}"
        self._log_density = _function("log_density", log_density)
        self._h = step

    def _begin(self, points: Array) -> State:
        points = points.astype(np.float64, copy=False)
        return points, _density("random_walk", self._log_density, points, start=True)

    def _at(self, points: Array) -> State:
        return points, _density("random_walk", self._log_density, points)

    @staticmethod
    def _decided(x: State, proposal: State, threshold: Array) -> State:
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


def random_walk(log_density: Callable[[Array], Any], step: float) -> Kernel:
    """Random-walk Metropolis, its proposals coupled by reflection and maximal overlap.

    Parameters
    ----------
    log_density : callable
        Of points (n, dimension), an array (n,); up to a constant, -inf outside.
    step : float
        Standard deviation of a proposal in each coordinate; 2.4 / sqrt(dimension) of that of the target is usual.

    Returns
    -------
    Kernel

    Examples
    --------
    >>> from debias.chains import random_walk
    >>> walk = random_walk(lambda x: -0.5 * (x**2).sum(axis=1), step=1.7)
    """
    return _RandomWalk(log_density, _step_size("random_walk", step))


class _Langevin(Kernel):
    """State: points, log density, means of the proposals."""

    def __init__(self, log_density: Callable[..., Any], gradient: Callable[..., Any], step: float):
        self.name = f"Langevin steps of {step:g}"
        self._log_density = _function("log_density", log_density)
        self._slope = _function("gradient", gradient)
        self._h = step

    def _at(self, points: Array, start: bool = False) -> State:
        density = _density("mala", self._log_density, points, start)
        slope = _gradient("mala", self._slope, points, density > -math.inf)
        return points, density, points + 0.5 * self._h**2 * slope

    def _begin(self, points: Array) -> State:
        return self._at(points.astype(np.float64, copy=False), start=True)

    def _decided(self, x: State, to: State, threshold: Array) -> State:
        def distance(a: State, b: State) -> Array:
            d = (b[0] - a[2]) / self._h
            return np.asarray(0.5 * np.einsum("ij,ij->i", d, d))

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


def mala(log_density: Callable[[Array], Any], gradient: Callable[[Array], Any], step: float) -> Kernel:
    """The Metropolis-adjusted Langevin algorithm, coupled like `random_walk`.

    Parameters
    ----------
    log_density : callable
        Of points (n, dimension), an array (n,).
    gradient : callable
        Of log_density, an array (n, dimension).
    step : float
        Standard deviation h of a proposal; its mean is x + h^2 / 2 gradient(x).

    Returns
    -------
    Kernel

    Examples
    --------
    >>> from debias.chains import mala
    >>> langevin = mala(lambda x: -0.5 * (x**2).sum(axis=1), lambda x: -x, step=1.2)
    """
    return _Langevin(log_density, gradient, _step_size("mala", step))


class _Hamiltonian(Kernel):
    """State: points, log density, gradients."""

    def __init__(self, log_density: Callable[..., Any], gradient: Callable[..., Any], step: float, steps: int):
        self.name = f"{steps} Hamiltonian steps of {step:g}"
        self._log_density = _function("log_density", log_density)
        self._slope = _function("gradient", gradient)
        self._h = step
        self._n = steps

    def _begin(self, points: Array) -> State:
        points = points.astype(np.float64, copy=False)
        density = _density("hamiltonian", self._log_density, points, start=True)
        return points, density, _gradient("hamiltonian", self._slope, points, density > -math.inf)

    def _moved(self, x: State, momentum: Array, threshold: Array) -> State:
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


def hamiltonian(log_density: Callable[[Array], Any], gradient: Callable[[Array], Any], step: float,
                steps: int) -> Kernel:
    """Hamiltonian steps that share momentum and acceptance: they bring chains together, but let none meet.

    Take them in a `mixture` with a random walk of small steps.

    Parameters
    ----------
    log_density, gradient : callable
        As of `mala`.
    step : float
        Of the leapfrog scheme.
    steps : int
        Of it; one call is one step of work, whatever they are.

    Returns
    -------
    Kernel

    Examples
    --------
    >>> from debias.chains import hamiltonian, mixture, random_walk
    >>> density, slope = lambda x: -0.5 * (x**2).sum(axis=1), lambda x: -x
    >>> both = mixture([0.9, 0.1], hamiltonian(density, slope, 0.4, 3), random_walk(density, 0.5))
    """
    return _Hamiltonian(log_density, gradient, _step_size("hamiltonian", step), _whole("steps", steps, 1))


class _Mixture(Kernel):
    """State: points. What a kernel carries beside them is made anew at each step."""

    def __init__(self, weights: Array, kernels: Sequence[Kernel]):
        self.name = "mixture of " + ", ".join(k.name for k in kernels)
        self._up_to = np.cumsum(weights) / np.sum(weights)
        self._kernels = kernels

    def _begin(self, points: Array) -> State:
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

    Parameters
    ----------
    weights : sequence of float
        One for each kernel, positive; they need not sum to 1.
    *kernels : Kernel

    Returns
    -------
    Kernel

    Examples
    --------
    >>> from debias.chains import mixture, random_walk
    >>> density = lambda x: -0.5 * x[:, 0] ** 2
    >>> both = mixture([3, 1], random_walk(density, 2.4), random_walk(density, 0.5))
    """
    array = _reals("weights", weights)
    for one in kernels:
        if not isinstance(one, Kernel):
            raise TypeError(f"mixture: {type(one).__name__} (must be a kernel); see debias.chains.kernel for your own")
    if array.shape != (len(kernels),) or not len(kernels):
        raise ValueError(f"mixture: weights of shape {array.shape} for {len(kernels)} kernels (must be one for each)")
    if not (np.isfinite(array).all() and (array > 0).all()):
        raise ValueError(f"mixture: weights = {array} (must be positive and finite); leave out a kernel that is never taken")
    return _Mixture(array, kernels)


class _Own(Kernel):
    def __init__(self, step: Callable[..., Any], coupled_step: Callable[..., Any], width: int, coupled_width: int):
        self.name = "kernel of one's own"
        self._one, self._both, self._width, self._coupled_width = step, coupled_step, width, coupled_width

    @staticmethod
    def _checked(name: str, out: Any, before: Array) -> Array:
        out = np.array(out)
        if out.dtype.kind not in "fiub":
            raise TypeError(f"{name}: returned {out.dtype} (must be an array of real numbers)")
        if out.shape != before.shape:
            raise ValueError(f"{name}: returned points of shape {out.shape} (must be {before.shape}: a row for each chain)")
        if out.dtype.kind == "f" and not np.isfinite(out).all():
            row = int(np.argmin(np.isfinite(out).all(axis=1)))
            raise ValueError(f"{name}: moved a chain to {_ends(out[row])} (must be finite) from {_ends(before[row])}")
        return cast(Array, out)

    def _step(self, x: State, uniforms: _Numbers) -> State:
        return (self._checked("step", self._one(x[0].copy(), uniforms(self._width)), x[0]),)

    def _coupled_step(self, x: State, y: State, uniforms: _Numbers) -> Tuple[State, State]:
        out = self._both(x[0].copy(), y[0].copy(), uniforms(self._coupled_width))
        if not isinstance(out, tuple) or len(out) != 2:
            raise TypeError(f"coupled_step: returned {type(out).__name__} (must be a pair: the next x and the next y)")
        return tuple((self._checked("coupled_step", a, b),) for a, b in zip(out, (x[0], y[0])))  # type: ignore[return-value]


def kernel(step: Callable[[Array, Array], Any], coupled_step: Callable[[Array, Array, Array], Any], *,
           uniforms: int, coupled_uniforms: Optional[int] = None) -> Kernel:
    """A kernel of one's own.

    Parameters
    ----------
    step : callable
        step(x, u) returns the next points of x (n, dimension), from numbers u (n, uniforms) in (0, 1).
    coupled_step : callable
        coupled_step(x, y, u) returns the next x and the next y, each as `step` would move it, together so that rows
        may become equal; equal rows must stay equal. `check_coupling` looks whether both hold.
    uniforms, coupled_uniforms : int
        Numbers that a step takes; the coupled one as many, where it is not given.

    Returns
    -------
    Kernel

    Examples
    --------
    Two states, one uniform for both chains:

    >>> import numpy as np
    >>> from debias.chains import kernel
    >>> def flip(x, u):
    ...     return np.where(x == 0, u < 0.3, u < 0.8).astype(float)
    >>> two = kernel(flip, lambda x, y, u: (flip(x, u), flip(y, u)), uniforms=1)
    """
    _function("step", step)
    _function("coupled_step", coupled_step)
    width = _whole("uniforms", uniforms, 1)
    return _Own(step, coupled_step, width, width if coupled_uniforms is None else _whole("coupled_uniforms", coupled_uniforms, 1))
