"""Unbiased estimates from biased sequences.

    >>> import debias
    >>> print(debias.estimate("square-of-mean", samples=1e6, seed=7))

`problems()` lists the problems with known answers; `levels`, `function_of_mean` and `function_of_integral` make one of
your own from a NumPy function, and `debias.chains` an expectation by Markov chains. The same seed gives the same bits as the program `debias` and as C++, on any number of
threads. Options are those of the program, by the same names: `base_level=2` is `--base-level 2`.

Every `seed` is a whole number of 64 bits, 1 where it is left out. None takes a fresh one from the operating system. A
`numpy.random.Generator` gives its next 64 bits, `integers(2**64, dtype=uint64)`, so that each call is another run; a
`numpy.random.SeedSequence` gives `generate_state(1, uint64)`, the same each time: spawn it for independent runs. The
result holds the number that was taken, as `seed`.
"""

from __future__ import annotations

import copy
import functools
import html
import math
import numbers
import operator
import secrets
import warnings
from typing import Any, Callable, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from . import _debias

__version__: str = _debias.version
#: Changes whenever the same seed would give other numbers.
stream_version: int = _debias.stream_version

__all__ = [
    "DebiasWarning", "Diagnosis", "GoalMissedWarning", "InfiniteVarianceWarning", "Interval", "NoPmfError",
    "NonFiniteWarning", "Problem", "Report", "Result", "Samples", "advise", "chains", "diagnose", "estimate", "estimators",
    "function_of_integral", "function_of_mean", "pmfs", "levels", "normal_quantile", "problems", "replay", "samples",
    "stream_version", "survey", "tradeoff",
]

Problem = _debias.UserProblem
Number = Union[int, float, str]
Seed = Union[None, int, str, np.random.Generator, np.random.SeedSequence]
Progress = Union[None, bool, Callable[[float, float], Any]]


class NoPmfError(ValueError):
    """No PMF has finite variance and finite work: no mistake of the caller, but a property of the sequence.

    variance_decay, work_growth  of E D_k^2 and of the work: powers of 2, or of the level, as `decay` says ("geometric",
                                 "polynomial"); None where they are not known
    variance_decay_error, work_growth_error   where they were measured, else None
    grade         "declared", or what the levels show: "shown" (wrong once in 200), "likely" (once in 10)
    reason, help  why there is none, and what would help
    """

    variance_decay: Optional[float] = None
    variance_decay_error: Optional[float] = None
    work_growth: Optional[float] = None
    work_growth_error: Optional[float] = None
    decay: str = "geometric"
    grade: str = "declared"
    reason: str = ""
    help: str = ""


class DebiasWarning(UserWarning):
    """A doubt that a result has about itself: `code` is its name ("coupling", "threads", ...), `text` the sentence."""

    def __init__(self, text: str = "", code: str = ""):
        super().__init__(text)
        self.code = code

    @property
    def text(self) -> str:
        return str(self)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, DebiasWarning) and (self.code, self.text) == (other.code, other.text)

    def __hash__(self) -> int:
        return hash((self.code, self.text))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.text!r}, code={self.code!r})"


class InfiniteVarianceWarning(DebiasWarning):
    """The variance of a sample is infinite: the standard error is too small most of the time."""


class NonFiniteWarning(DebiasWarning):
    """Samples that are no finite numbers, so there is no mean."""


class GoalMissedWarning(DebiasWarning):
    """The error or the time that was asked for is missed."""


class Interval(NamedTuple):
    low: Any
    high: Any

    def __repr__(self) -> str:
        return f"Interval(low={_ends(self.low)}, high={_ends(self.high)})"


# ---- reports


class Report:
    """What a command has to say: `print` shows the program's text, brief where it could be long, `full` all of it;
    `to_dict` and `to_json` have its JSON."""

    def __init__(self, text: str, full_text: str, json_text: str, data: dict):
        self._text = text
        self._full = full_text
        self._json = json_text
        self._data = data

    def __str__(self) -> str:
        return self._text.rstrip("\n")

    def full(self) -> str:
        """The whole text, as `--full` of the program: levels, tails, largest values, reasons."""
        return self._full.rstrip("\n")

    def __repr__(self) -> str:
        return f"<debias.{type(self).__name__}: {self._data.get('problem') or self._data.get('file')}>"

    def __getitem__(self, key: str) -> Any:
        if key not in self._data:
            _debias.refuse_if_renamed(f"['{key}']")
        return self._data[key]

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.__reduce__() == other.__reduce__()

    def __reduce__(self):
        return type(self), (self._text, self._full, self._json, self._data)

    __hash__ = None  # type: ignore[assignment]

    def to_dict(self) -> dict:
        """The JSON of the program; numbers that are not finite are None."""
        return copy.deepcopy(self._data)

    def to_json(self) -> str:
        return self._json

    def _repr_html_(self) -> str:
        rows = (f"<td>{html.escape(line[:14].strip())}</td><td>{html.escape(line[14:].strip())}</td>"
                for line in str(self).splitlines())
        return "<table>" + "".join(f"<tr style='text-align: left'>{row}</tr>" for row in rows) + "</table>"

    @property
    def levels(self) -> np.ndarray:
        """What is known of each level, as a structured array."""
        return _table(self._data["levels"])

    @property
    def warnings(self) -> list:
        """Doubts, each with a `code` and a `text`."""
        return _doubts(self._data.get("warnings") or [])

    @property
    def remarks(self) -> list:
        """What else the levels show, of a survey or a recipe: likewise."""
        return _doubts(self._data.get("remarks") or [])

    @property
    def seed(self) -> int:
        """Of all random numbers, also where it was taken fresh: the same one gives the same bits."""
        if "seed" not in self._data:
            raise AttributeError(f"seed (a {type(self).__name__} draws nothing)")
        return self._data["seed"]


class Result(Report):
    """An estimate and its doubt."""

    def __repr__(self) -> str:
        return (f"<debias.Result: {self._data['problem']}, mean {_ends(self.mean)}, standard error "
                f"{_ends(self.standard_error)}>")

    def _components(self, name: str, of_one: Any) -> Any:
        if "components" not in self._data:
            return _number(of_one)
        return np.array([_number(c[name]) for c in self._data["components"]])

    @property
    def mean(self) -> Any:
        """NaN if a sample was not finite; an array if the problem has components."""
        return self._components("mean", self._data["mean"])

    @property
    def standard_error(self) -> Any:
        return self._components("standard_error", self._data["standard_error"])

    @property
    def confidence_interval(self) -> Interval:
        """Of the confidence that was asked for; of normal theory, so see `verdict`."""
        interval = self._known("interval")
        return Interval(self._components("low", interval["low"]), self._components("high", interval["high"]))

    def _known(self, key: str) -> Any:
        if key not in self._data:
            raise AttributeError(f"{key} (a result of multilevel has none; it has a 'bias')")
        return self._data[key]

    @property
    def samples(self) -> int:
        """`blocks` times `block`."""
        return self._known("samples")

    @property
    def blocks(self) -> int:
        return self._known("blocks")

    @property
    def block(self) -> int:
        """Samples of a block, which are drawn together; 1 without strata."""
        return self._known("block")

    @property
    def work(self) -> float:
        return _number(self._data["work"])

    @property
    def seconds(self) -> float:
        return self._data["seconds"]

    @property
    def pilot_work(self) -> float:
        """Of `work`, what a pilot took that chose the estimator or its samples; of multilevel, the first draws."""
        return _number(self._data["pilot_work"])

    @property
    def pilot_seconds(self) -> float:
        """Of `seconds`."""
        return self._data["pilot_seconds"]

    @property
    def efficiency(self) -> float:
        """1 / (variance x seconds per sample), the pilot's seconds among them."""
        return _number(self._known("efficiency"))

    @property
    def verdict(self) -> str:
        """Is the variance finite: "finite", "infinite" or "undecided", from this run alone; "unknown" without two
        finite samples. ['evidence'] has the reasons."""
        return self._data.get("evidence", {}).get("variance", "unknown")

    @property
    def grade(self) -> str:
        """How far the verdict is to be trusted: "shown" (wrong once in 200), "likely" (once in 10), "open"."""
        return self._data.get("evidence", {}).get("grade", "open")

    @property
    def reliable(self) -> bool:
        """Can the interval be trusted? Its variance is finite, and most of it was seen, in enough hits."""
        return self._data.get("evidence", {}).get("interval_reliable", False)

    @property
    def largest(self) -> np.ndarray:
        """The largest samples by magnitude: index (for `replay`), level, value."""
        return _table(self._known("largest"))


class Diagnosis(Report):
    """What numbers alone say of their mean and of its error."""

    @property
    def mean(self) -> float:
        return _number(self._data["mean"])

    @property
    def standard_error(self) -> float:
        return _number(self._data["standard_error"])

    @property
    def confidence_interval(self) -> Interval:
        interval = self._data["interval"] or {"low": None, "high": None}
        return Interval(_number(interval["low"]), _number(interval["high"]))

    @property
    def verdict(self) -> str:
        return (self._data["verdict"] or {}).get("variance", "unknown")

    @property
    def grade(self) -> str:
        """How far the verdict is to be trusted: "shown", "likely", "open"."""
        return (self._data["verdict"] or {}).get("grade", "open")

    @property
    def largest(self) -> np.ndarray:
        """The largest values by magnitude: index into the array, value, share of the sum of squares."""
        rows = [{"index": v["row"] - 1, "value": v["value"], "share": v["share"]} for v in self._data["largest"]]
        return _table(rows)

    @property
    def running(self) -> np.ndarray:
        """Mean and standard error after 2, 4, 8, ... values."""
        return _table(self._data["running"])


class Samples(np.ndarray):
    """An array of samples that knows the `seed` they were drawn with; what is computed from it is a plain array."""

    seed: Union[None, int, str] = None

    def __array_finalize__(self, origin: Any) -> None:
        self.seed = getattr(origin, "seed", None)

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        plain = np.asarray(array)
        return plain if plain.ndim else plain[()]

    def __reduce__(self) -> Any:
        rebuild, arguments, state = super().__reduce__()
        return rebuild, arguments, (state, self.seed)

    def __setstate__(self, state: Any) -> None:
        super().__setstate__(state[0])
        self.seed = state[1]


def _doubts(rows: Sequence[dict]) -> list:
    return [DebiasWarning(row["text"], row["code"]) for row in rows]


def _ends(x: Any) -> str:
    """A number, or an array: of more than 16 components the first and last three, and how many there are."""
    if not isinstance(x, np.ndarray):
        return str(x)
    text = np.array2string(x, threshold=16, edgeitems=3)
    return f"{text} ({x.size} components)" if x.size > 16 else text


def _number(x: Any) -> float:
    return math.nan if x is None else x


def _table(rows: Sequence[dict]) -> np.ndarray:
    """Rows of JSON as a structured array; None is NaN."""
    if not rows:
        return np.zeros(0, dtype=[("level", np.int64)])

    def kind(key: str) -> Any:
        column = [row[key] for row in rows]
        if all(isinstance(x, bool) for x in column):
            return bool
        if all(isinstance(x, int) for x in column) and key not in ("value", "mean", "work"):
            return np.int64
        return f"U{max(len(x) for x in column)}" if all(isinstance(x, str) for x in column) else np.float64

    dtype = [(key, kind(key)) for key in rows[0]]
    return np.array([tuple(_number(row[key]) for key, _ in dtype) for row in rows], dtype=dtype)


# ---- options for the commands


def _options(**options: Any) -> dict:
    return {name: _option(name, value) for name, value in options.items() if value is not None}


def _option(name: str, value: Any) -> Union[str, int, float]:
    if isinstance(value, str):
        return value
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
        raise TypeError(f"{name}: {type(value).__name__} (must be a number, or the program's word for one)")
    return int(value) if isinstance(value, numbers.Integral) else float(value)


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


def _problem(problem: Any, has_levels: bool = False) -> Any:
    """What the module knows of a problem: of coupled chains what they have made of themselves."""
    if isinstance(problem, chains.CoupledChain):
        if not has_levels:
            return problem._problem
        raise TypeError("problem: coupled chains (have no levels that a PMF draws: their level is the time when they met); "
                        "debias.chains.advise measures what they need")
    if isinstance(problem, (str, Problem)):
        return problem
    raise TypeError(f"problem: {type(problem).__name__} (must be a name, see debias.problems(), or one of your own, "
                    "see debias.levels, debias.function_of_mean and debias.chains)")


def _estimator(problem: Any, pmf: Optional[str], estimator: Optional[str], pilot: bool = False) -> Optional[str]:
    """Without declared rates and without a PMF only a recipe can go on, where there may be a pilot."""
    if isinstance(problem, Problem) and problem.special and estimator is None:
        return problem.special
    needs = pmf is None and estimator not in ("truncated", "multilevel", "recipe", "coupled_chain")
    if not needs or not isinstance(problem, Problem) or problem.declares_rates:
        return estimator
    if pilot and estimator is None:
        return "recipe"
    raise ValueError(f"pmf: none ('{problem.name}' declares no rates to choose it by); give rates, or the ['pmf'] of "
                     "an estimate or of `advise`")


class _Bar:
    """Shows progress by tqdm, if there is such a thing."""

    def __init__(self, progress: Progress):
        self._bar = None
        self.call = progress if callable(progress) else None
        if progress is True:
            try:
                from tqdm.auto import tqdm
            except ImportError:
                return
            self._bar = tqdm(unit=" draws", unit_scale=True, leave=False)
            self.call = self._show
        elif self.call is None and progress not in (None, False):
            raise TypeError(f"progress: {type(progress).__name__} (must be True, or a function of (done, total))")

    def _show(self, done: float, total: float) -> None:
        self._bar.total = total or None
        self._bar.update(done - self._bar.n)

    def __enter__(self) -> Any:
        return self.call

    def __exit__(self, *_: Any) -> None:
        if self._bar is not None:
            self._bar.close()


# ---- commands


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
        result = Result(*command(problem, options, bar))
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
        values = _debias.samples(problem, options, int(n), int(first), bar)
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
    return Report(*_debias.replay(problem, options, None))


def survey(problem: Union[str, Problem], *, levels: Number = 10, samples: Number = 10_000, seed: Seed = 1,
           threads: Number = 0, first: Number = 0, progress: Progress = None) -> Report:
    """Measures the levels from `first` on: how differences decay, how work grows, and whether a PMF exists."""
    options = _options(levels=levels, first=first, samples=samples, seed=_seed(seed), threads=threads)
    with _Bar(progress) as bar:
        return Report(*_debias.survey(_problem(problem, has_levels=True), options, bar))


def tradeoff(problem: Union[str, Problem], *, family: str = "geometric", points: Number = 15,
             samples: Number = 100_000, seed: Seed = 1, threads: Number = 0, estimator: Optional[str] = None,
             base_level: Optional[Number] = None, block: Optional[Number] = None,
             progress: Progress = None) -> Report:
    """Sweeps the PMF through its family: variance against work; ['points'] has a row for each pmf."""
    options = _options(family=family, points=points, samples=samples, seed=_seed(seed), threads=threads,
                       estimator=estimator, base_level=base_level, block=block)
    with _Bar(progress) as bar:
        return Report(*_debias.tradeoff(_problem(problem, has_levels=True), options, bar))


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
        return Report(*_debias.advise(_problem(problem, has_levels=True), options, bar))


def diagnose(values: Any, *, name: str = "array") -> Diagnosis:
    """Mean, error, tails and verdict of any numbers. Nothing is copied but a buffer: any real type, any strides.

    Booleans are 0 and 1. What is masked, or NA in pandas, is left out; a warning of the result says how much.
    """
    array, missing = _numbers(values)
    if array.dtype.kind not in "fiub":
        raise TypeError(f"values: an array of {array.dtype} (must be of real numbers)")
    diagnostician = _debias.Diagnostician()
    pieces = np.nditer([array, np.False_ if missing is None else missing],
                       flags=["external_loop", "buffered", "zerosize_ok"], op_dtypes=[np.float64, np.bool_],
                       casting="same_kind", order="C", buffersize=1 << 16)
    for piece, left_out in pieces if array.size else ():
        diagnostician.add(piece, left_out)
    return Diagnosis(*diagnostician.finish(name))


def _has_mask(values: Any) -> bool:
    if isinstance(values, (list, tuple)):
        return any(_has_mask(x) for x in values)
    return isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values)


def _masked(values: Any) -> np.ma.MaskedArray:
    nested = isinstance(values, (list, tuple)) and any(isinstance(x, (list, tuple)) for x in values)
    return np.ma.stack([_masked(x) for x in values]) if nested else np.ma.array(values)


def _numbers(values: Any) -> Tuple[np.ndarray, Optional[np.ndarray]]:
    """An array, and which of its numbers are missing: masked, or NA in one of pandas' types that can say so."""
    kind = getattr(getattr(values, "dtype", None), "numpy_dtype", None)
    if kind is not None and hasattr(values, "isna") and hasattr(values, "to_numpy"):
        missing = np.asarray(values.isna(), dtype=bool)
        array = values.to_numpy(dtype=kind, na_value=np.zeros((), kind)[()])
    elif _has_mask(values):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # in lists: "a masked element to nan"
            masked = _masked(values)
        array, missing = masked.data, np.ma.getmaskarray(masked)
        if missing.dtype != bool:  # of records, which are no numbers
            missing = None
    else:
        array, missing = np.asarray(values), None
    return np.asarray(array), missing if missing is not None and missing.any() else None


def problems() -> list:
    """The problems with known answers, each with its id, name, truth, rates and source."""
    return _debias.problems()


def estimators() -> list:
    return _debias.estimators()


def pmfs() -> list:
    return _debias.pmfs()


# ---- problems of one's own


def normal_quantile(uniforms: Any) -> np.ndarray:
    """Standard normal numbers from uniform ones, the bits of C++. A mask stays."""
    numbers_of = _debias.normal_quantile(uniforms)
    return np.ma.array(numbers_of, mask=np.ma.getmaskarray(uniforms)) if _has_mask(uniforms) else numbers_of


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
    return _debias.levels(facts, answer, lambda level: (dimension_of(level), work_of(level)),
                          0 if components is None else width)


def function_of_mean(integrand: Callable[[np.ndarray], Any], g: str, *, dimension: int = 1,
                     rates: Optional[Sequence[float]] = None, lowest_base: int = 0, truth: Optional[float] = None,
                     name: str = "function of a mean", formula: str = "") -> Problem:
    """g(E integrand(x)), x uniform in the unit cube: integrand(x) sees an array (n, dimension) and returns (n,).

    g is one of exp, exp-minus, reciprocal, square, log, sqrt, power:a, davis:c, logistic, absolute, positive-part.
    Level k averages 2^k draws. Where g has a pole that a mean of a few draws can come near, raise `lowest_base`.
    """
    return _mean(integrand, g, "independent", _whole("dimension", dimension, 1), 0.0, 1.0,
                 _facts(name, formula, truth, rates, False, lowest_base))


def function_of_integral(integrand: Callable[[np.ndarray], Any], g: str, *, interval: Sequence[float] = (0.0, 1.0),
                         dimension: int = 1, points: Optional[str] = None, rates: Optional[Sequence[float]] = None,
                         lowest_base: int = 0, truth: Optional[float] = None, name: str = "function of an integral",
                         formula: str = "") -> Problem:
    """g(integral of the integrand over an interval, or over the unit cube of so many dimensions): integrand(x) sees an
    array (n, dimension) and returns (n,).

    points="comb" takes equidistant ones with one random offset (the default in one dimension), "jittered" one in each
    part, for integrands that do not continue periodically, "nets" scrambled nets in the cube (the default in more).
    """
    try:
        low, high = interval
    except (TypeError, ValueError):
        raise TypeError(f"interval: {interval!r} (must be (from, to))") from None
    d = _whole("dimension", dimension, 1)
    points = points or ("comb" if d == 1 else "nets")
    if points == "nets" and (low, high) != (0, 1):
        raise ValueError(f"interval = {interval!r} (nets are in the unit cube); scale x in the integrand")
    if points in ("comb", "jittered") and d > 1:
        raise ValueError(f"points = {points!r} (one-dimensional, dimension = {d}); take nets")
    return _mean(integrand, g, points, d, float(low), float(high),
                 _facts(name, formula, truth, rates, False, lowest_base))


def _mean(integrand: Any, g: str, points: str, dimension: int, low: float, high: float, facts: dict) -> Problem:
    if not callable(integrand):
        raise TypeError(f"integrand: {type(integrand).__name__} (must be a function of an array)")
    if not isinstance(g, str):
        raise TypeError(f"g: {type(g).__name__} (must be the name of a function)")

    def answer(_: int, x: np.ndarray) -> np.ndarray:
        return _checked("integrand", integrand(x), (len(x),), None, x).reshape(-1, 1)

    return _debias.mean(facts, answer, lambda _: (dimension, 1.0), g, points, low, high)


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


# ---- names of 0.1 say what they are now; to be removed at 0.3, with `refuse_if_renamed`


def __getattr__(name: str) -> Any:
    _debias.refuse_if_renamed(f"{name}()")
    raise AttributeError(f"module 'debias' has no attribute '{name}'")


def _knows_old_names(f: Any) -> Any:
    @functools.wraps(f)
    def checked(*arguments: Any, **options: Any) -> Any:
        for name, value in options.items():
            for typed in (f"{name}={value!r}", f"{name}="):
                _debias.refuse_if_renamed(typed)
        return f(*arguments, **options)
    return checked


for _f in (estimate, samples, replay, survey, tradeoff, advise):
    globals()[_f.__name__] = _knows_old_names(_f)

from . import chains  # noqa: E402  it takes what stands above
