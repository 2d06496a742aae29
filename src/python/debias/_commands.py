"""The commands of the program."""

from __future__ import annotations

import functools
import warnings
from typing import Any, Callable, Dict, List, Optional, Tuple, Type, TypeVar, Union, cast

import numpy as np

from . import _debias, _kept
from ._errors import DebiasWarning, GoalMissedWarning, InfiniteVarianceWarning, NonFiniteWarning
from ._options import (Number, Pmf, Progress, Seed, _Bar, _estimator, _inner, _options, _pmf, _problem,
                       _seed, _whole)
from ._problem import Problem
from ._reports import Report, Result, Samples

F = TypeVar("F", bound=Callable[..., Any])


def estimate(problem: Union[str, Problem], *, samples: Optional[Number] = None, seed: Seed = 1, threads: Number = 0,
             estimator: Optional[str] = None, pmf: Pmf = None, base_level: Optional[Number] = None,
             block: Optional[Number] = None, points: Optional[str] = None, error: Optional[Number] = None,
             relative_error: Optional[Number] = None, seconds: Optional[Number] = None, max_seconds: Optional[Number] = None,
             confidence: Number = 0.95, progress: Progress = None, executor: Any = None, shards: Optional[int] = None,
             shard: Optional[Tuple[int, int]] = None, checkpoint: Any = None) -> Result:
    """Estimates a problem: so many samples, or as many as a goal asks for.

    Parameters
    ----------
    problem : str or Problem
        A name of `problems()`, or one of your own.
    samples : int, optional
        1e6 where neither they nor a goal are given; rounded up to whole blocks.
    seed : int, None, "random", Generator or SeedSequence
        See the head of `debias`.
    threads : int
        0: as many as the machine has. Problems of Python functions run on the thread that called, and refuse more than one;
        those of compiled functions and of the catalogue run on all.
    estimator : str, optional
        See `estimators()`. "recipe": a pilot chooses PMF, base level and strata, also where neither a PMF nor rates are given;
        "multilevel", the biased baseline, takes an `error`.
    pmf : str, sequence or callable, optional
        Of the random level: "geometric:r=0.6", the masses of the first levels, or a function of 0, 1, ... that gives them. Beyond
        the last mass (of a function: number 63) they fall by the last ratio for ever. Without one the declared rates choose.
    base_level : int, optional
        Of the estimate that each sample holds.
    block : int, optional
        Samples of a block of systematic strata.
    points : {"plain", "nets", "auto"}, optional
        "nets": the samples of a level are points of a scrambled net in each block; a recipe chooses ("auto").
    error, relative_error, seconds : float, optional
        A goal in place of samples: a standard error, one in units of the mean, or a time with the pilot's in it.
    max_seconds : float, optional
        Beside a goal of error: a pilot takes as many samples as fit into the time where these are fewer; then the goal is missed.
    confidence : float
        Of the interval.
    progress : bool or callable, optional
        True for a bar by tqdm, or a function of (done, total). total is 0 while it is not known: while pilots draw, of a run to a
        goal up to a second longer. What had a total ends with (total, total).
    executor : optional
        Splits the samples over its workers: of concurrent.futures, a client of dask.distributed, joblib.Parallel(...), or one of
        mpi4py.futures. The bits are those of one process; a shard whose worker is lost runs again. The problem is pickled.
    shards : int, optional
        Parts for an executor; two a worker.
    shard : (int, int), optional
        (i, n): this call draws the i-th of n parts alone; `merge` joins them.
    checkpoint : path, optional
        A file that is kept about once a second, and taken up by the same call. A run that ended is read, not drawn. A problem is
        known by its repr: functions of one name, or large arrays, look the same, so give problems of one file different names.

    Returns
    -------
    Result

    Raises
    ------
    NoPmfError
        Where no PMF has finite variance and finite work.
    ValueError, TypeError
        For arguments that cannot be, before anything is drawn.

    Warns
    -----
    DebiasWarning
        For each doubt of the result.

    Examples
    --------
    >>> import debias
    >>> own = debias.function_of_mean(lambda x: 1 + x[:, 0] ** 2, "reciprocal")
    >>> result = debias.estimate(own, samples=100_000, seed=7)
    >>> bool(abs(result.mean - 0.75) < 4.5 * result.standard_error)
    True
    """
    problem = _problem(problem)
    _refuse_threads(problem, threads)
    estimator = _estimator(problem, pmf, estimator, pilot=True)
    options = _options(samples=samples, seed=_seed(seed), threads=threads, **_shape(problem, estimator, pmf), base_level=base_level,
                       block=block, points=points, error=error, relative_error=relative_error, seconds=seconds,
                       confidence=confidence)
    limit = _options(max_seconds=max_seconds)
    max_seconds = _debias.seconds("max_seconds", limit) if limit else None
    ways = {"executor": executor, "shard": shard, "checkpoint": checkpoint, "max_seconds": max_seconds}
    given = [name for name, x in ways.items() if x is not None]
    if len(given) > 1:
        raise ValueError(f"{given[0]} and {given[1]} (do not go together); take one of them")
    if shards is not None and executor is None:
        raise ValueError("shards (are parts for an executor); for one part alone write shard=(i, n)")
    if shards is not None:
        shards = _whole("shards", shards, 1)
    if shard is not None:
        shard = _kept._shard_of(shard)
    doubts: List[DebiasWarning] = []
    with _Bar(progress) as bar:
        if estimator == "multilevel":
            if given:
                raise ValueError(f"{given[0]}: not of multilevel (whose samples depend on those before)")
            options.pop("estimator")
            result = Result(*_debias.multilevel(_inner(problem), options, bar))
            result._problem = problem
        elif executor is not None:
            result, doubts = _kept._distributed(problem, options, executor, shards, bar)
        elif checkpoint is not None:
            result = _kept._checkpointed(problem, options, bar, checkpoint)
        elif max_seconds is not None:
            result = _kept._within(problem, options, max_seconds, bar)
        else:
            result = _kept._run(problem, options, bar, shard=shard)
    for doubt in doubts:
        warnings.warn(doubt, stacklevel=3)
    _warn(result)
    return result


def _refuse_threads(problem: Union[str, Problem], threads: Any) -> None:
    if isinstance(problem, str) or problem._inner.compiled or threads in (None, 0, 1, "0", "1"):
        return
    raise ValueError(f"threads = {threads} (Python functions answer on the thread that called, whatever they release); leave it "
                     "out, take executor=, or a compiled function")


def _shape(problem: Union[str, Problem], estimator: Optional[str], pmf: Pmf) -> Dict[str, Any]:
    """The estimator, under the name that the module knows it by, and the PMF."""
    special = not isinstance(problem, str) and problem._special == estimator
    return {"special" if special else "estimator": estimator, "pmf": _pmf(pmf)}


def _of_levels(problem: Union[str, Problem], threads: Any) -> Any:
    problem = _problem(problem, has_levels=True)
    _refuse_threads(problem, threads)
    return _inner(problem)


def _warn(result: Result, stacklevel: int = 4) -> None:
    data = result._data
    doubts: List[Tuple[Type[DebiasWarning], Dict[str, Any]]] = []
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
        warnings.warn(category(doubt["text"], doubt["code"]), stacklevel=stacklevel)


def samples(problem: Union[str, Problem], n: int, *, seed: Seed = 1, first: int = 0,
            estimator: Optional[str] = None, pmf: Pmf = None, base_level: Optional[Number] = None,
            block: Optional[Number] = None, points: Optional[str] = None, progress: Progress = None) -> Samples:
    """Samples first, first + 1, ... of a seed, n of them: the very ones that `estimate` averages.

    Parameters
    ----------
    problem : str or Problem
        A name of `problems()`, or one of your own.
    n, first : int
        Multiples of the block, where there is one.
    seed, estimator, pmf, base_level, block, points, progress
        As of `estimate`.

    Returns
    -------
    Samples
        An array (n,), or (n, components), that knows its `seed`; with `block` one value for each block, the mean of its samples.

    Examples
    --------
    >>> import debias
    >>> x = debias.samples("A10", 1000, seed=7)
    >>> x.shape, x.seed
    ((1000,), 7)
    """
    seed = _seed(seed)
    n, first = _whole("n", n, 1), _whole("first", first, 0)
    problem = _problem(problem)
    options = _options(seed=seed, **_shape(problem, _estimator(problem, pmf, estimator), pmf), base_level=base_level,
                       block=block, points=points)
    components = problem.components if isinstance(problem, Problem) else 1
    too_many = f"n = {n} (numbers do not fit into memory); draw them in parts, by `first`"
    if n * components >= 2**56:
        raise MemoryError(too_many)
    try:
        with _Bar(progress) as bar:
            values = _debias.samples(_inner(problem), options, n, first, bar)
    except MemoryError as e:
        if str(e) != "std::bad_alloc":  # of the user's function
            raise
        raise MemoryError(too_many) from None
    result = (values.reshape(-1, components) if components > 1 else values).view(Samples)
    result.seed = seed
    return result


def replay(problem: Union[str, Problem], sample: Number, *, seed: Seed, estimator: Optional[str] = None,
           pmf: Pmf = None, base_level: Optional[Number] = None, block: Optional[Number] = None,
           points: Optional[str] = None) -> Report:
    """One sample of a run again, with every level that it touched.

    Parameters
    ----------
    problem : str or Problem
        A name of `problems()`, or one of your own.
    sample : int
        Its index; of a block, all its samples are drawn, each level with the `member` that drew it.
    seed : int
        That of the result.
    estimator, pmf, base_level, block, points
        As of `estimate`.

    Returns
    -------
    Report

    Examples
    --------
    >>> import debias
    >>> x = debias.samples("A10", 1, first=77, seed=3)
    >>> bool(debias.replay("A10", 77, seed=3)["value"] == x[0])
    True
    """
    if seed is None or isinstance(seed, np.random.Generator):
        raise TypeError(f"seed: {type(seed).__name__} (would be another one than that of the run); give the `seed` of "
                        "its result")
    if sample is None:
        raise TypeError("sample: NoneType (must be the index of one); that of the largest is result.largest['index'][0]")
    problem = _problem(problem)
    options = _options(sample=sample, seed=seed if isinstance(seed, str) else _seed(seed),
                       **_shape(problem, _estimator(problem, pmf, estimator), pmf), base_level=base_level, block=block,
                       points=points)
    return Report(*_debias.replay(_inner(problem), options, None))


def survey(problem: Union[str, Problem], *, levels: Number = 10, samples: Number = 10_000, seed: Seed = 1,
           threads: Number = 0, first: Number = 0, progress: Progress = None) -> Report:
    """Measures the levels: how differences decay, how work grows, and whether a PMF exists.

    Parameters
    ----------
    problem : str or Problem
        A name of `problems()`, or one of your own.
    levels : int
        How many.
    samples : int
        Draws of each level.
    first : int
        The first level.
    seed, threads, progress
        As of `estimate`.

    Returns
    -------
    Report

    Examples
    --------
    >>> import debias
    >>> report = debias.survey("A10", levels=6, samples=2000)
    >>> report.levels["level"].tolist()
    [0, 1, 2, 3, 4, 5]
    """
    options = _options(levels=levels, first=first, samples=samples, seed=_seed(seed), threads=threads)
    with _Bar(progress) as bar:
        return Report(*_debias.survey(_of_levels(problem, threads), options, bar))


def tradeoff(problem: Union[str, Problem], *, family: str = "geometric", points: Number = 15,
             samples: Number = 100_000, seed: Seed = 1, threads: Number = 0, estimator: Optional[str] = None,
             base_level: Optional[Number] = None, block: Optional[Number] = None,
             progress: Progress = None) -> Report:
    """Sweeps the PMF through its family: variance against work.

    Parameters
    ----------
    problem : str or Problem
        A name of `problems()`, or one of your own.
    family : str
        "geometric", "zeta" or "poisson".
    points : int
        PMFs of the sweep; ['points'] has a row for each.
    samples : int
        Of each.
    seed, threads, estimator, base_level, block, progress
        As of `estimate`.

    Returns
    -------
    Report

    Examples
    --------
    >>> import debias
    >>> len(debias.tradeoff("A10", points=3, samples=2000)["points"])
    3
    """
    options = _options(family=family, points=points, samples=samples, seed=_seed(seed), threads=threads,
                       estimator=estimator, base_level=base_level, block=block)
    with _Bar(progress) as bar:
        return Report(*_debias.tradeoff(_of_levels(problem, threads), options, bar))


def advise(problem: Union[str, Problem], *, samples: Optional[Number] = None, seed: Seed = 1, threads: Number = 0,
           estimator: Optional[str] = None, base_level: Optional[Number] = None, points: Optional[str] = None,
           error: Optional[Number] = None, relative_error: Optional[Number] = None, seconds: Optional[Number] = None,
           progress: Progress = None) -> Report:
    """What a recipe would choose: base level, PMF, strata and points, and what they are worth.

    `estimate(problem, pmf=a["pmf"], base_level=a["base_level"], block=a["block"], points=a["points"], estimator=...)` follows it
    without another pilot, "single_term_outcome" where its a["base"] is "one_outcome".

    Parameters
    ----------
    problem : str or Problem
        A name of `problems()`, or one of your own.
    samples, seed, threads, estimator, base_level, points, error, relative_error, seconds, progress
        As of `estimate`.

    Returns
    -------
    Report

    Examples
    --------
    >>> import debias
    >>> debias.advise("A10", samples=20_000)["pmf"].split(":")[0] in ("tabulated", "geometric", "dyadic")
    True
    """
    options = _options(samples=samples, seed=_seed(seed), threads=threads, estimator=estimator, base_level=base_level,
                       points=points, error=error, relative_error=relative_error, seconds=seconds)
    with _Bar(progress) as bar:
        return Report(*_debias.advise(_of_levels(problem, threads), options, bar))


def problems() -> List[Any]:
    """The problems with known answers.

    Returns
    -------
    list of dict
        Each with its id, name, truth, rates and source.

    Examples
    --------
    >>> import debias
    >>> any(p["id"] == "A10" for p in debias.problems())
    True
    """
    return _debias.problems()


def estimators() -> List[Any]:
    """The estimators that `estimate` knows.

    Returns
    -------
    list of dict

    Examples
    --------
    >>> import debias
    >>> "single_term" in [e["name"] for e in debias.estimators()]
    True
    """
    return _debias.estimators()


def pmfs() -> List[Any]:
    """The PMFs that `estimate` knows by name.

    Returns
    -------
    list of dict

    Examples
    --------
    >>> import debias
    >>> "geometric" in [p["name"] for p in debias.pmfs()]
    True
    """
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
