"""What the commands have to say."""

from __future__ import annotations

import copy
import html
import math
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple, Union, cast

import numpy as np

from . import _debias
from ._errors import DebiasWarning
from ._options import _option, _problem
from ._types import Array


class Interval(NamedTuple):
    """From `low` to `high`; arrays where an estimate has components.

    Examples
    --------
    >>> import debias
    >>> low, high = debias.diagnose([1.0, 2.0, 3.0]).confidence_interval
    >>> low < 2 < high
    True
    """

    low: Any
    high: Any

    def __repr__(self) -> str:
        return f"Interval(low={_ends(self.low)}, high={_ends(self.high)})"


# As texts they would be looked up where namedtuple made the function, which does not know them: for inspect and pdoc.
Interval.__new__.__annotations__.update(low=Any, high=Any)


class _IntervalOf(Interval):
    """The interval of a report, which gives those of other levels where it is called."""

    _report: Any

    @classmethod
    def _made(cls, report: Any, low: Any, high: Any) -> "_IntervalOf":
        found = cls(low, high)
        found._report = report
        return found

    def __call__(self, level: float, problem: Any = None) -> Interval:
        found: Interval = self._report._interval(_option("confidence", level), None if problem is None else _problem(problem))
        return found

    def __reduce__(self) -> Tuple[Any, ...]:
        return Interval, (self.low, self.high)


class Report:
    """What a command has to say: `print` shows the program's text, brief where it could be long, `full` all of it;
    `to_dict` and `to_json` have its JSON.

    Examples
    --------
    >>> import debias
    >>> report = debias.survey("A10", levels=4, samples=1000)
    >>> report["seed"], len(report.levels)
    (1, 4)
    """

    def __init__(self, text: str, full_text: str, json_text: str, data: Dict[str, Any]):
        self._texts: Optional[Tuple[str, str, str]] = (text, full_text, json_text)
        self._said: Any = None
        self._data = data

    def _three(self) -> Tuple[str, str, str]:
        """The brief text, the full one and the JSON, made when they are asked for first."""
        if self._texts is None:
            self._texts = self._said.texts()
            self._said = None
        assert self._texts is not None
        return self._texts

    def __str__(self) -> str:
        return self._three()[0].rstrip("\n")

    def full(self) -> str:
        """The whole text, as `--full` of the program: levels, tails, largest values, reasons."""
        return self._three()[1].rstrip("\n")

    def __repr__(self) -> str:
        return f"<debias.{type(self).__name__}: {self._data.get('problem') or self._data.get('file')}>"

    def __getitem__(self, key: str) -> Any:
        if key not in self._data:
            _debias.refuse_if_renamed(f"['{key}']")
        return self._data[key]

    def __contains__(self, key: object) -> bool:
        return key in self._data

    def __iter__(self) -> Iterator[str]:
        return iter(self._data)

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self._same() == other._same()

    def _same(self) -> Tuple[Any, ...]:
        return self.__reduce__()

    def __reduce__(self) -> Tuple[Any, ...]:
        return type(self), (*self._three(), self._data)

    __hash__ = None  # type: ignore[assignment]

    def to_dict(self) -> Dict[str, Any]:
        """The JSON of the program; numbers that are not finite are None."""
        return copy.deepcopy(self._data)

    def to_json(self) -> str:
        """The JSON of the program as a text.

        Returns
        -------
        str
        """
        return self._three()[2]

    def to_frame(self) -> Any:
        """`levels` as a `pandas.DataFrame`, indexed by the level.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        ImportError
            Without pandas.
        """
        import pandas

        frame = pandas.DataFrame.from_records(self.levels)
        return frame.set_index("level") if "level" in frame else frame

    def _repr_html_(self) -> str:
        rows = (f"<td>{html.escape(line[:14].strip())}</td><td>{html.escape(line[14:].strip())}</td>"
                for line in str(self).splitlines())
        return "<table>" + "".join(f"<tr style='text-align: left'>{row}</tr>" for row in rows) + "</table>"

    @property
    def levels(self) -> Array:
        """What is known of each level, as a structured array."""
        if "levels" not in self._data:
            raise AttributeError(f"levels (this {type(self).__name__} has none)")
        return _table(self._data["levels"])

    @property
    def warnings(self) -> List[Any]:
        """Doubts, each with a `code` and a `text`."""
        return _doubts(self._data.get("warnings") or [])

    @property
    def remarks(self) -> List[Any]:
        """What else the levels show, of a survey or a recipe: likewise."""
        return _doubts((self._data if "remarks" in self._data else self._data.get("recipe") or {}).get("remarks") or [])

    @property
    def seed(self) -> int:
        """Of all random numbers, also where it was taken fresh: the same one gives the same bits."""
        if "seed" not in self._data:
            raise AttributeError(f"seed (a {type(self).__name__} draws nothing)")
        return int(self._data["seed"])


class Result(Report):
    """An estimate and its doubt: what `estimate` returns. It pickles, and goes on where `extend` says so.

    Examples
    --------
    >>> import debias
    >>> result = debias.estimate("A10", samples=100_000, seed=7)
    >>> result.samples, result.verdict
    (100000, 'finite')
    >>> result.confidence_interval.low < 1 < result.confidence_interval.high
    True
    """

    _problem: Any = None  # what was estimated, where this process knows it
    _state: Any = None  # its sums
    _settled: Dict[str, Any] = {}  # arguments that draw the same samples without a pilot
    _shard: Optional[Tuple[int, int]] = None

    @classmethod
    def _of(cls, said: Any) -> "Result":
        result = cls("", "", "", said.data())
        result._texts, result._said = None, said
        return result

    def _kept(self, problem: Any, state: Any, settled: Dict[str, Any], shard: Optional[Tuple[int, int]]) -> None:
        self._problem, self._state, self._settled, self._shard = problem, state, settled, shard

    def _problem_or(self, problem: Any) -> Any:
        """That one, or its own. A name of the catalogue is in the report."""
        found = problem if problem is not None else self._problem
        if found is None and self._data.get("id"):
            found = self._data["id"]
        if found is None:
            raise ValueError("problem: not known (the result comes from a file or another process); give it as problem=")
        return found

    def __getstate__(self) -> Dict[str, Any]:
        return {"state": None if self._state is None else self._state.bytes(), "settled": self._settled, "shard": self._shard,
                "name": self._problem if isinstance(self._problem, str) else None}

    def __setstate__(self, kept: Dict[str, Any]) -> None:
        state = None if kept["state"] is None else _debias.State(kept["state"])
        self._kept(kept["name"], state, kept["settled"], kept["shard"])

    def __reduce__(self) -> Tuple[Any, ...]:
        return (*super().__reduce__(), self.__getstate__())

    def _same(self) -> Tuple[Any, ...]:
        return super().__reduce__()

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
    def confidence_interval(self) -> _IntervalOf:
        """Of the confidence that was asked for, and called with another level that one: `result.confidence_interval(0.99)`.

        By Student's t, so see `verdict` for whether it is to be trusted. A result that comes from a file or another process has
        forgotten a problem of one's own: `result.confidence_interval(0.99, problem=p)`.

        Examples
        --------
        >>> import debias
        >>> result = debias.estimate("A10", samples=1000)
        >>> result.confidence_interval(0.99).low < result.confidence_interval.low
        True
        """
        interval = self._known("interval")
        return _IntervalOf._made(self, self._components("low", interval["low"]), self._components("high", interval["high"]))

    def _interval(self, level: float, problem: Any = None) -> Interval:
        if level == self._known("interval").get("confidence"):
            return Interval(*self.confidence_interval)
        from ._kept import _run

        again = _run(self._problem_or(problem), {**self._settled, "confidence": level}, None, self._state, self._shard)
        return Interval(*again.confidence_interval)

    def to_xarray(self) -> Any:
        """Mean, standard error and interval, by component, and the levels.

        Returns
        -------
        xarray.Dataset

        Raises
        ------
        ImportError
            Without xarray.
        """
        import xarray

        low, high = self.confidence_interval
        by = () if np.ndim(self.mean) == 0 else ("component",)
        numbers = {"mean": self.mean, "standard_error": self.standard_error, "low": low, "high": high}
        rows = self.levels
        table = {f"level_{name}": ("row", rows[name]) for name in rows.dtype.names or ()}
        about = {"problem": str(self._data["problem"]), "samples": self.samples, "seed": self.seed, "work": self.work}
        return xarray.Dataset({**{name: (by, x) for name, x in numbers.items()}, **table}, attrs=about)

    def _known(self, key: str) -> Any:
        if key not in self._data:
            name = "confidence_interval" if key == "interval" else key
            raise AttributeError(f"{name} (a result of multilevel has none; it has a 'bias')")
        return self._data[key]

    @property
    def samples(self) -> int:
        """`blocks` times `block`."""
        return int(self._known("samples"))

    @property
    def blocks(self) -> int:
        return int(self._known("blocks"))

    @property
    def block(self) -> int:
        """Samples of a block, which are drawn together; 1 without strata."""
        return int(self._known("block"))

    @property
    def work(self) -> float:
        return _number(self._data["work"])

    @property
    def seconds(self) -> float:
        return float(self._data["seconds"])

    @property
    def pilot_work(self) -> float:
        """Of `work`, what a pilot took that chose the estimator or its samples; of multilevel, the first draws."""
        return _number(self._data["pilot_work"])

    @property
    def pilot_seconds(self) -> float:
        """Of `seconds`."""
        return float(self._data["pilot_seconds"])

    @property
    def efficiency(self) -> float:
        """1 / (variance x seconds per sample), the pilot's seconds among them."""
        return _number(self._known("efficiency"))

    @property
    def verdict(self) -> str:
        """Is the variance finite: "finite", "infinite" or "undecided", from this run alone; "unknown" without two
        finite samples. ['evidence'] has the reasons."""
        return str(self._data.get("evidence", {}).get("variance", "unknown"))

    @property
    def grade(self) -> str:
        """How far the verdict is to be trusted: "shown" (wrong once in 200), "likely" (once in 10), "open"."""
        return str(self._data.get("evidence", {}).get("grade", "open"))

    @property
    def reliable(self) -> bool:
        """Can the interval be trusted? Its variance is finite, and most of it was seen, in enough hits."""
        return bool(self._data.get("evidence", {}).get("interval_reliable", False))

    @property
    def largest(self) -> Array:
        """The largest samples by magnitude: index (for `replay`), level, value."""
        return _table(self._known("largest"))


class Diagnosis(Report):
    """What numbers alone say of their mean and of its error: what `diagnose` returns.

    Examples
    --------
    >>> import numpy as np
    >>> import debias
    >>> debias.diagnose(np.arange(1000.0)).mean
    499.5
    """

    @property
    def mean(self) -> float:
        return _number(self._data["mean"])

    @property
    def standard_error(self) -> float:
        return _number(self._data["standard_error"])

    def __init__(self, text: str, full_text: str, json_text: str, data: Dict[str, Any], spread: Tuple[float, float]):
        super().__init__(text, full_text, json_text, data)
        self._spread = spread  # standard error and degrees of freedom of the interval

    def __reduce__(self) -> Tuple[Any, ...]:
        return (*super().__reduce__()[:1], (*self._three(), self._data, self._spread))

    @property
    def confidence_interval(self) -> _IntervalOf:
        """Of confidence 0.95, and called with another level that one: `diagnosis.confidence_interval(0.99)`.

        By Student's t, with the standard error that allows for values that resemble their neighbours; see `verdict` for whether it
        is to be trusted. NaN where there is none: of one value, or if one is not finite.

        Examples
        --------
        >>> import debias
        >>> diagnosis = debias.diagnose([1.0, 2.0, 3.0])
        >>> diagnosis.confidence_interval(0.5).high < diagnosis.confidence_interval.high
        True
        """
        return _IntervalOf._made(self, *self._interval((self._data["interval"] or {}).get("confidence", 0.95)))

    def _interval(self, level: float, problem: Any = None) -> Interval:
        if problem is not None:
            raise TypeError("problem: of a diagnosis (has none, but its numbers); leave it out")
        interval = self._data["interval"] or {"low": None, "high": None, "confidence": None}
        if level == interval["confidence"]:
            return Interval(_number(interval["low"]), _number(interval["high"]))
        error, degrees = self._spread if self._data["interval"] else (math.nan, 1.0)
        return Interval(*_debias.interval(self.mean, error, degrees, {"confidence": level}))

    @property
    def verdict(self) -> str:
        return str((self._data["verdict"] or {}).get("variance", "unknown"))

    @property
    def grade(self) -> str:
        """How far the verdict is to be trusted: "shown", "likely", "open"."""
        return str((self._data["verdict"] or {}).get("grade", "open"))

    @property
    def largest(self) -> Array:
        """The largest values by magnitude: index into the array, value, share of the sum of squares."""
        rows = [{"index": v["row"] - 1, "value": v["value"], "share": v["share"]} for v in self._data["largest"]]
        return _table(rows)

    @property
    def running(self) -> Array:
        """Mean and standard error after 2, 4, 8, ... values."""
        return _table(self._data["running"])


class Samples(np.ndarray[Any, Any]):
    """An array of samples that knows the `seed` they were drawn with; what is computed from it is a plain array.

    Examples
    --------
    >>> import debias
    >>> debias.samples("A10", 3, seed=5).seed
    5
    """

    seed: Union[None, int, str] = None

    def __array_finalize__(self, origin: Any) -> None:
        self.seed = getattr(origin, "seed", None)

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        plain = np.asarray(array)
        return plain if plain.ndim else plain[()]

    def __reduce__(self) -> Any:
        rebuild, arguments, state = cast(Tuple[Any, Any, Any], super().__reduce__())
        return rebuild, arguments, (state, self.seed)

    def __setstate__(self, state: Any) -> None:
        super().__setstate__(state[0])
        self.seed = state[1]


def _doubts(rows: Sequence[Dict[str, Any]]) -> List[Any]:
    return [DebiasWarning(row["text"], row["code"]) for row in rows]


def _ends(x: Any) -> str:
    """A number, or an array: of more than 16 components the first and last three, and how many there are."""
    if not isinstance(x, np.ndarray):
        return str(x)
    text = np.array2string(x, threshold=16, edgeitems=3)
    return f"{text} ({x.size} components)" if x.size > 16 else text


def _number(x: Any) -> float:
    return math.nan if x is None else x


def _table(rows: Sequence[Dict[str, Any]]) -> Array:
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
