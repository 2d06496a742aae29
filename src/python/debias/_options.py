"""Arguments of the commands: numbers, seeds, problems, progress."""

from __future__ import annotations

import decimal
import math
import numbers
import operator
import secrets
from collections.abc import Mapping, Set
from typing import Any, Callable, Dict, Iterable, Optional, Sequence, Union

import numpy as np

from ._problem import Problem, _said
from ._types import Array

Number = Union[int, float, str]
Seed = Union[None, int, str, np.random.Generator, np.random.SeedSequence]
Pmf = Union[None, str, Sequence[float], Array, Callable[[int], float]]
Progress = Union[None, bool, Callable[[float, float], Any]]


#: The program's words for what is not given.
_NOT_GIVEN = {"samples": "auto", "base_level": "auto", "error": "none", "relative_error": "none", "seconds": "none",
              "max_seconds": "none"}
_KINDS = {"estimator": "a name, see debias.estimators()", "family": "geometric, zeta or poisson"}


def _options(**options: Any) -> Dict[str, Any]:
    """Those that are given, as the module takes them."""
    given = {name: value for name, value in options.items()
             if value is not None and not (isinstance(value, str) and value == _NOT_GIVEN.get(name))}
    return {name: _option(name, value) for name, value in given.items()}


def _option(name: str, value: Any) -> Union[str, int, float]:
    value = _scalar(value)
    if isinstance(value, str):
        return value
    if name in _KINDS or not _is_real(value):
        kind = _KINDS.get(name, "a number, or the program's word for one")
        raise TypeError(f"{name}: {type(value).__name__} (must be {kind})")
    return int(value) if isinstance(value, numbers.Integral) else float(value)


def _scalar(value: Any) -> Any:
    """The number that an array without dimensions holds, or a Decimal; anything else as it is."""
    if isinstance(value, decimal.Decimal):
        return float(value)
    return value.item() if getattr(value, "ndim", None) == 0 and hasattr(value, "item") else value


def _is_real(value: Any) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, (bool, np.bool_))


def _seed(seed: Any) -> Union[int, str]:
    """The number that a seed stands for; a text is the program's word for one."""
    if seed is None or (isinstance(seed, str) and seed == "random"):  # as the program says it
        return secrets.randbits(64)
    if isinstance(seed, str):
        return seed
    if isinstance(seed, np.random.Generator):
        return int(seed.integers(2**64, dtype=np.uint64))
    if isinstance(seed, np.random.SeedSequence):
        return int(seed.generate_state(1, np.uint64)[0])
    try:
        if isinstance(seed, (bool, np.bool_)):
            raise TypeError
        number = operator.index(seed)
    except TypeError:
        raise TypeError(f"seed: {type(seed).__name__} (must be a whole number, None for a fresh one, or a Generator or "
                        "SeedSequence of numpy.random)") from None
    if not 0 <= number < 2**64:
        raise ValueError(f"seed = {number} (must lie in 0 ... 2^64 - 1)")
    return number


def _seed_number(seed: Any) -> int:
    """As `_seed`, where there is no program to read a text."""
    number = _seed(seed)
    if isinstance(number, str):
        try:
            number = _seed(int(number))
        except ValueError:
            raise ValueError(f"seed = {number!r} (not a number of 64 bits); write a whole number such as 1000") from None
    return int(number)


def _problem(problem: Any, has_levels: bool = False) -> Union[str, Problem]:
    if isinstance(problem, Problem):
        if has_levels and not problem._has_levels:
            raise TypeError("problem: coupled chains (have no levels that a PMF draws: their level is the time when they met); "
                            "debias.chains.advise measures what they need")
        return problem
    if isinstance(problem, str):
        return problem
    raise TypeError(f"problem: {type(problem).__name__} (must be a name, see debias.problems(), or one of your own, "
                    "see debias.levels, debias.function_of_mean and debias.chains)")


def _inner(problem: Union[str, Problem]) -> Any:
    """What the module takes."""
    return problem if isinstance(problem, str) else problem._inner


def _estimator(problem: Union[str, Problem], pmf: Pmf, estimator: Optional[str],
               pilot: bool = False) -> Optional[str]:
    """Without declared rates and without a PMF only a recipe can go on, where there may be a pilot."""
    if isinstance(problem, str):
        return estimator
    if problem._special and estimator is None:
        return problem._special
    declared = isinstance(pmf, str) and pmf == "declared"  # the program's word for no PMF
    needs = (pmf is None or declared) and estimator in (None, "single_term", "single_term_outcome", "independent_sum", "roulette")
    if not needs or problem.declares_rates:
        return estimator
    if pilot and estimator is None and not declared:
        return "recipe"
    raise ValueError(f"pmf: none ('{problem.name}' declares no rates to choose it by); give rates, or the ['pmf'] of "
                     "an estimate or of `advise`")


def _pmf(pmf: Pmf) -> Optional[str]:
    """In the program's words: a text as it is, masses as a table whose last ratio goes on for ever."""
    if pmf is None or isinstance(pmf, str):
        return pmf
    pmf = _scalar(pmf)
    given: Iterable[Any]
    if callable(pmf) and not isinstance(pmf, type):
        given = [pmf(j) for j in range(64)]
    elif isinstance(pmf, Iterable) and not isinstance(pmf, (bytes, bytearray, Mapping, Set)):  # which have no order
        given = pmf
    else:
        raise TypeError(f"pmf: {type(pmf).__name__} (must be a name with its parameters, see debias.pmfs(), the masses of the first "
                        "levels, or a function of 0, 1, ... that gives them); write pmf='geometric:r=0.6', say")
    masses = []
    for j, mass in enumerate(given):
        mass = _scalar(mass)
        if not _is_real(mass):
            raise TypeError(f"pmf: mass {j} is {_said(mass)}, {type(mass).__name__} (must be a number)")
        masses.append(float(mass))
    if callable(pmf):
        while len(masses) > 2 and not masses[-1] > 1e-300:
            masses.pop()
    if len(masses) < 2 or not all(m > 0 and math.isfinite(m) for m in masses):
        said = ", ".join(f"{m:g}" for m in masses[:4]) + (", ..." if len(masses) > 4 else "")
        raise ValueError(f"pmf: masses {said or 'none'} (must be two or more, all positive: a level that is never drawn is a bias)")
    ratio = masses[-1] / masses[-2]
    if not ratio < 1:
        raise ValueError(f"pmf: the last masses are {masses[-2]} and {masses[-1]} (must fall, since their ratio goes on for ever)")
    total = sum(masses) + masses[-1] * ratio / (1 - ratio)
    return "tabulated:" + ",".join(repr(m / total) for m in masses) + f";tail={ratio!r}"


def _whole(name: str, value: Any, least: int) -> int:
    value = _scalar(value)
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise TypeError(f"{name}: {type(value).__name__} (must be a whole number)")
    if not least <= value < 2**62:  # type: ignore[operator]
        raise ValueError(f"{name} = {value} (must be at least {least})")
    return int(value)


def _real(name: str, value: Any) -> float:
    """A number, and none of the program's words."""
    value = _scalar(value)
    if not _is_real(value):
        raise TypeError(f"{name}: {type(value).__name__} (must be a number)")
    return float(value)


def _finite(name: str, value: Any) -> float:
    x = _real(name, value)
    if not math.isfinite(x):
        raise ValueError(f"{name} = {x} (must be finite)")
    return x


def _reals(name: str, values: Any) -> Array:
    """An array of real numbers, of any shape."""
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        array = np.empty(1, dtype=object)
    if array.dtype.kind not in "fiub" and not (array.dtype.kind == "O" and all(_is_real(_scalar(x)) for x in array.flat)):
        raise TypeError(f"{name}: {type(values).__name__} (must be an array of real numbers)")
    numbers_of: Array = array.astype(np.float64, copy=False)
    return numbers_of


class _Bar:
    """Tells a function of the progress, or shows it by tqdm, if there is such a thing. What has a total ends there."""

    def __init__(self, progress: Progress):
        self._bar: Any = None
        self._told = (0.0, 0.0)
        self._show: Optional[Callable[[float, float], Any]] = None
        if progress is True:
            try:
                from tqdm.auto import tqdm
            except ImportError:
                return
            self._bar = tqdm(unit=" draws", unit_scale=True, leave=False)
            self._show = self._drawn
        elif callable(progress):
            self._show = progress
        elif progress not in (None, False):
            raise TypeError(f"progress: {type(progress).__name__} (must be True, or a function of (done, total))")

    def _drawn(self, done: float, total: float) -> None:
        self._bar.total = total or None
        self._bar.update(done - self._bar.n)

    def _tell(self, done: float, total: float) -> None:
        self._told = done, total
        assert self._show is not None
        self._show(done, total)

    def __enter__(self) -> Any:
        return None if self._show is None else self._tell

    def __exit__(self, kind: Any, *_: Any) -> None:
        try:
            done, total = self._told
            if kind is None and done < total:
                self._tell(total, total)
        finally:
            if self._bar is not None:
                self._bar.close()
