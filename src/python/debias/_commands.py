"""The commands of the program."""

from __future__ import annotations

import functools
import numbers
import warnings
from typing import Any, Callable, Optional, TypeVar, Union, cast

import numpy as np

from . import _debias
from ._errors import DebiasWarning, GoalMissedWarning, InfiniteVarianceWarning, NonFiniteWarning
from ._options import Number, Progress, Seed, _Bar, _estimator, _inner, _options, _problem, _seed
from ._problem import Problem
from ._reports import Report, Result, Samples

F = TypeVar("F", bound=Callable[..., Any])


def estimate(problem: Union[str, Problem], *, samples: Optional[Number] = None, seed: Seed = 1, threads: Number = 0,
             estimator: Optional[str] = None, pmf: Optional[str] = None, base_level: Optional[Number] = None,
             block: Optional[Number] = None, points: Optional[str] = None, error: Optional[Number] = None,
             relative_error: Optional[Number] = None, seconds: Optional[Number] = None,
             confidence: Number = 0.95, progress: Progress = None) -> Result:
    """Estimates a problem: `samples` of them (1e6), or as many as `error`, `relative_error` or `seconds` ask for.

    estimator   see `estimators()`; "recipe": a pilot chooses PMF, base level and strata, also where neither a PMF nor
                rates are given; "multilevel", the biased baseline, takes an `error`
    pmf         of the random level, "geometric:r=0.6"; without one the declared rates of the problem choose
    block       samples of a block of systematic strata; `samples` is rounded up to whole blocks
    points      "plain"; "nets": the samples of a level are points of a scrambled net in each block; "auto" leaves it
                to a recipe
    progress    True for a bar by tqdm, or a function of (done, total); total is 0 while it is not known

    Issues a DebiasWarning for each doubt of the result.
    """
    problem = _problem(problem)
    estimator = _estimator(problem, pmf, estimator, pilot=True)
    command = _debias.multilevel if estimator == "multilevel" else _debias.run
    options = _options(samples=samples, seed=_seed(seed), threads=threads,
                       estimator=None if estimator == "multilevel" else estimator, pmf=pmf, base_level=base_level,
                       block=block, points=points, error=error, relative_error=relative_error, seconds=seconds,
                       confidence=confidence)
    with _Bar(progress) as bar:
        result = Result(*command(_inner(problem), options, bar))
    _warn(result)
    return result


def _warn(result: Result) -> None:
    data = result._data
    doubts = []
    if data.get("nonfinite"):
        nonfinite = next(w for w in data["warnings"] if w["code"] == "nonfinite_samples")
        doubts.append((NonFiniteWarning, nonfinite))
    elif result.verdict == "infinite":
        doubts.append((InfiniteVarianceWarning, {"code": "infinite_variance", "text": data["evidence"]["sentences"][0]}))
    if isinstance(data["goal"], dict) and not data["goal"]["met"]:
        doubts.append((GoalMissedWarning, {"code": "goal_missed", "text": "the goal is missed"}))
    said = {doubt["code"] for _, doubt in doubts}
    doubts += [(DebiasWarning, doubt) for doubt in data.get("warnings", []) if doubt["code"] not in said]
    for category, doubt in doubts:
        warnings.warn(category(doubt["text"], doubt["code"]), stacklevel=4)


def samples(problem: Union[str, Problem], n: int, *, seed: Seed = 1, first: int = 0,
            estimator: Optional[str] = None, pmf: Optional[str] = None, base_level: Optional[Number] = None,
            block: Optional[Number] = None, points: Optional[str] = None, progress: Progress = None) -> Samples:
    """Samples first, first + 1, ... of a seed, n of them: the very ones that `estimate` averages. With `block`, one value
    for each block, the mean of its samples: n and first are then multiples of the block.

    The array knows its `seed`.
    """
    seed = _seed(seed)
    for name, value, least in (("n", n, 1), ("first", first, 0)):
        if isinstance(value, bool) or not isinstance(value, numbers.Integral):
            raise TypeError(f"{name}: {type(value).__name__} (must be a whole number)")
        if not least <= value < 2**62:
            raise ValueError(f"{name} = {value} (must be at least {least})")
    problem = _problem(problem)
    options = _options(seed=seed, estimator=_estimator(problem, pmf, estimator), pmf=pmf, base_level=base_level, block=block,
                       points=points)
    with _Bar(progress) as bar:
        values = _debias.samples(_inner(problem), options, int(n), int(first), bar)
    components = problem.components if isinstance(problem, Problem) else 1
    result = (values.reshape(-1, components) if components > 1 else values).view(Samples)
    result.seed = seed
    return result


def replay(problem: Union[str, Problem], sample: Number, *, seed: Seed, estimator: Optional[str] = None,
           pmf: Optional[str] = None, base_level: Optional[Number] = None, block: Optional[Number] = None,
           points: Optional[str] = None) -> Report:
    """One sample of a run again, with every level that it touched; of a block, all its samples, each level with the `member`
    that drew it."""
    if seed is None or isinstance(seed, np.random.Generator):
        raise TypeError(f"seed: {type(seed).__name__} (would be another one than that of the run); give the `seed` of "
                        "its result")
    problem = _problem(problem)
    options = _options(sample=sample, seed=seed if isinstance(seed, str) else _seed(seed),
                       estimator=_estimator(problem, pmf, estimator), pmf=pmf, base_level=base_level, block=block,
                       points=points)
    return Report(*_debias.replay(_inner(problem), options, None))


def survey(problem: Union[str, Problem], *, levels: Number = 10, samples: Number = 10_000, seed: Seed = 1,
           threads: Number = 0, first: Number = 0, progress: Progress = None) -> Report:
    """Measures the levels from `first` on: how differences decay, how work grows, and whether a PMF exists."""
    options = _options(levels=levels, first=first, samples=samples, seed=_seed(seed), threads=threads)
    with _Bar(progress) as bar:
        return Report(*_debias.survey(_inner(_problem(problem, has_levels=True)), options, bar))


def tradeoff(problem: Union[str, Problem], *, family: str = "geometric", points: Number = 15,
             samples: Number = 100_000, seed: Seed = 1, threads: Number = 0, estimator: Optional[str] = None,
             base_level: Optional[Number] = None, block: Optional[Number] = None,
             progress: Progress = None) -> Report:
    """Sweeps the PMF through its family: variance against work; ['points'] has a row for each pmf."""
    options = _options(family=family, points=points, samples=samples, seed=_seed(seed), threads=threads,
                       estimator=estimator, base_level=base_level, block=block)
    with _Bar(progress) as bar:
        return Report(*_debias.tradeoff(_inner(_problem(problem, has_levels=True)), options, bar))


def advise(problem: Union[str, Problem], *, samples: Optional[Number] = None, seed: Seed = 1, threads: Number = 0,
           estimator: Optional[str] = None, base_level: Optional[Number] = None, points: Optional[str] = None,
           error: Optional[Number] = None, relative_error: Optional[Number] = None, seconds: Optional[Number] = None,
           progress: Progress = None) -> Report:
    """What a recipe would choose: base level, PMF, strata and points, and what they are worth.

    `estimate(problem, pmf=a["pmf"], base_level=a["base_level"], block=a["block"], points=a["points"], estimator=...)` follows it
    without another pilot, "single_term_outcome" where its a["base"] is "one_outcome".
    """
    options = _options(samples=samples, seed=_seed(seed), threads=threads, estimator=estimator, base_level=base_level,
                       points=points, error=error, relative_error=relative_error, seconds=seconds)
    with _Bar(progress) as bar:
        return Report(*_debias.advise(_inner(_problem(problem, has_levels=True)), options, bar))


def problems() -> list:
    """The problems with known answers, each with its id, name, truth, rates and source."""
    return _debias.problems()


def estimators() -> list:
    return _debias.estimators()


def pmfs() -> list:
    return _debias.pmfs()


# ---- names of 0.1 say what they are now; to be removed at 0.3, with `refuse_if_renamed`


def _knows_old_names(f: F) -> F:
    @functools.wraps(f)
    def checked(*arguments: Any, **options: Any) -> Any:
        for name, value in options.items():
            for typed in (f"{name}={value!r}", f"{name}="):
                _debias.refuse_if_renamed(typed)
        return f(*arguments, **options)

    return cast(F, checked)


estimate, samples, replay = _knows_old_names(estimate), _knows_old_names(samples), _knows_old_names(replay)
survey, tradeoff, advise = _knows_old_names(survey), _knows_old_names(tradeoff), _knows_old_names(advise)
