"""Runs that are kept: on disk, over many processes, in parts that merge, and longer than they were."""

from __future__ import annotations

import concurrent.futures
import json
import math
import operator
import os
import time
import zlib
from typing import Any, Callable, Dict, Iterable, List, Optional, Tuple, Union

import numpy as np

from . import _debias
from ._errors import DebiasWarning
from ._options import _inner
from ._problem import Problem
from ._reports import Result

Options = Dict[str, Any]
_GOALS = ("error", "relative_error", "seconds")
_MAGIC = b"debias run of Python, 1\n"


def _name(problem: Union[str, Problem]) -> str:
    return problem if isinstance(problem, str) else repr(problem)


def _shard_of(shard: Any) -> Tuple[int, int]:
    """(i, n) as two whole numbers; whether there is such a part, the module says."""
    try:
        i, n = (operator.index(x) for x in shard)
    except (TypeError, ValueError):
        raise TypeError(f"shard: {shard!r} (must be two whole numbers, (i, n)); (1, 4) is the first of four") from None
    if not all(-(2**63) <= x < 2**63 for x in (i, n)):
        raise ValueError(f"shard = ({i}, {n}) (must be one of (1, n), (2, n), ... (n, n)); (1, 4) is the first of four")
    return i, n


def _run(problem: Union[str, Problem], options: Options, progress: Any = None, earlier: Any = None,
         shard: Optional[Tuple[int, int]] = None, save: Optional[Callable[[Any, Options], Any]] = None) -> Result:
    tell, keep = _telling(progress, save, options)
    report, state, settled = _debias.run_kept(_inner(problem), options, tell, earlier, shard, keep, False)
    return _reported(problem, report, state, settled, shard, progress)


def _telling(progress: Any, save: Any, options: Options) -> Tuple[Any, Any]:
    """progress and save of a run. How many samples a goal takes it says when it saves, about a second after its pilots."""
    if progress is None or not any(name in options for name in _GOALS):
        return progress, save
    total = [0.0]

    def keep(state: Any, settled: Options) -> None:
        total[0] = settled["samples"]
        if save is not None:
            save(state, settled)

    return (lambda done, of: progress(done, of or total[0])), keep


def _reported(problem: Union[str, Problem], report: Any, state: Any, settled: Options, shard: Optional[Tuple[int, int]],
              progress: Any) -> Result:
    result = Result._of(report)
    result._kept(problem, state, settled, shard)
    if progress is not None:
        progress(result.samples, result.samples)
    return result


class _Late(Exception):
    """The time is up."""


def _within(problem: Union[str, Problem], options: Options, seconds: Any, progress: Any) -> Result:
    """To a goal of error, in so many seconds: pilots fix the samples of both, and the fewer are drawn."""
    goal = {name: options[name] for name in ("error", "relative_error") if name in options}
    if len(goal) != 1 or "seconds" in options:
        raise ValueError("max_seconds: stands beside error or relative_error (a goal); for a time alone write seconds")
    inner = _inner(problem)
    threads = {"threads": options.get("threads", 0)}
    start = time.monotonic()
    try:
        limit = float(str(seconds).rstrip("s"))
    except ValueError:
        limit = math.inf  # the module says what is wrong with it

    def in_half(*at: Any) -> Any:
        if time.monotonic() > start + limit / 2:
            raise _Late
        return None if progress is None else progress(*at)

    settled, state = None, None
    try:
        report, state, settled = _debias.run_kept(inner, options, in_half, None, None, None, True)
        if report is not None:
            return _reported(problem, report, state, settled, None, progress)
    except (_Late, ValueError):  # so many samples cannot be drawn, perhaps: fewer may
        pass
    if limit < math.inf:
        seconds = max(limit - (time.monotonic() - start), limit / 10)
    rest = {name: x for name, x in options.items() if name not in goal}
    _, timed, in_time = _debias.run_kept(inner, {**rest, "seconds": seconds}, progress, None, None, None, True)
    if settled is None or state is None:
        settled = {name: x for name, x in in_time.items() if not name.startswith("served")}
        settled.update({f"served_{name}": x for name, x in goal.items()})
        state = timed
    else:
        state = state.with_pilot_of(timed)
    options = {**settled, "samples": min(settled["samples"], in_time["samples"]), **threads}
    goes_on = state.last <= options["samples"]
    # A pilot that came too late, and draws beyond the end, took their time, too.
    counted = state.pilot_seconds + (state.seconds if goes_on else 0)
    state = state.with_lost_seconds(max(0.0, time.monotonic() - start - counted))
    if goes_on:
        return _run(problem, options, progress, state)
    drawn = _run(problem, options, progress)
    return _run(problem, options, None, drawn._state.with_pilot_of(state))


# ---- on disk


def _file_of(path: Any) -> str:
    """The file that a run can be kept in: an answer before the work."""
    try:
        file = os.fsdecode(path)
    except TypeError:
        raise TypeError(f"checkpoint: {type(path).__name__} (must be the path of a file)") from None
    said = f"checkpoint: {file!r}"
    if not file or "\0" in file:
        raise ValueError(f"{said} (is no name of a file); write checkpoint='run.checkpoint', say")
    if os.path.isdir(file):
        raise IsADirectoryError(f"{said} (is a folder); name a file in it")
    if os.path.exists(file) and not os.path.isfile(file):
        raise ValueError(f"{said} (is a device or a pipe); take the name of a file")
    folder = os.path.dirname(file)
    if folder and not os.path.isdir(folder):
        raise FileNotFoundError(f"{said} (there is no folder {folder!r}); make it first, or take another name")
    try:
        with open(_beside(file), "wb"):
            pass
        os.remove(_beside(file))
    except OSError as e:
        raise type(e)(f"{said} (cannot be written: {e.strerror}); take another name") from None
    return file


def _beside(file: str) -> str:
    """The name under which a file is written before it takes the place of the last one."""
    return f"{file}.{os.getpid()}.new"


def _checkpointed(problem: Union[str, Problem], options: Options, progress: Any, path: Any) -> Result:
    file = _file_of(path)
    asked = json.dumps({name: x for name, x in options.items() if name not in ("threads", "confidence")}, sort_keys=True)
    whose = {"problem": _name(problem), "asked": asked, "version": _debias.version, "streams": _debias.stream_version}

    def save(state: Any, settled: Options) -> None:
        contents = state.bytes()
        head = json.dumps({**whose, "settled": settled, "size": len(contents), "crc": zlib.crc32(contents)}).encode()
        written = _beside(file)
        with open(written, "wb") as out:
            out.write(_MAGIC + head + b"\n" + contents)
            out.flush()
            os.fsync(out.fileno())
        os.replace(written, file)

    earlier = None
    if os.path.exists(file):
        held, earlier = _read(file)
        for name, mine in whose.items():
            if held.get(name) != mine:
                raise ValueError(f"checkpoint: '{file}' is of another run ({name}: {held.get(name)}, here {mine}); remove it, or "
                                 "take another name")
        options = {**held["settled"], **{name: options[name] for name in ("threads", "confidence") if name in options}}
    return _run(problem, options, progress, earlier, save=save)


def _read(file: str) -> Tuple[Options, Any]:
    with open(file, "rb") as source:
        contents = source.read()
    try:
        if not contents.startswith(_MAGIC):
            raise ValueError("it does not begin as one")
        head, _, state = contents[len(_MAGIC):].partition(b"\n")
        held = json.loads(head)
        if held["size"] != len(state) or held["crc"] != zlib.crc32(state):
            raise ValueError("it is damaged, or cut short")
        return held, _debias.State(state)
    except (ValueError, KeyError) as e:
        raise ValueError(f"checkpoint: '{file}' is no run of debias.estimate ({e}); remove it, or take another name") from None


# ---- in parts


def merge(*results: Result, problem: Union[None, str, Problem] = None) -> Result:
    """The union of the shards of a run: the bits of the run itself.

    Parameters
    ----------
    *results : Result
        Of `estimate(..., shard=(i, n))`, all n of them, in any order.
    problem : str or Problem, optional
        Needed where all results come from a file or another process; theirs where it is left out.

    Returns
    -------
    Result

    Raises
    ------
    ValueError
        For a shard that is missing or there twice, and for shards of different runs.

    Examples
    --------
    >>> import debias
    >>> parts = [debias.estimate("A10", samples=20_000, shard=(i, 3)) for i in (1, 2, 3)]
    >>> debias.merge(*parts).mean == debias.estimate("A10", samples=20_000).mean
    True
    """
    from ._commands import _warn

    if not results:
        raise ValueError("merge: no results (must be one for each shard)")
    first = results[0]
    for other in results:
        if not isinstance(other, Result):
            raise TypeError(f"merge: {type(other).__name__} (must be the results of shards); merge(first, second, ...)")
        if other._state is None:
            raise ValueError("merge: a result of multilevel (has no samples to join)")
        if other["problem"] != first["problem"] or _asked(other) != _asked(first):
            raise ValueError("merge: results of different runs (problem, options, seed and samples must be the same)")
    state = first._state
    for other in results[1:]:
        state = state.merged(other._state)
    if state.first != 0 or not state.contiguous or state.last < first._settled["samples"]:
        raise ValueError(f"merge: the shards leave out some of the {first._settled['samples']} samples (each of (1, n) ... (n, n) "
                         "must be there)")
    doubts: Dict[str, str] = {}
    for part in results:
        doubts = {**dict(part._settled.get("doubts", [])), **doubts}
    whole = first._problem_or(problem)
    for part in results:
        _draws_again("merge", whole, part)
    merged = _run(whole, {**first._settled, "doubts": list(doubts.items())}, earlier=state)
    _warn(merged, 3)
    return merged


def _draws_again(what: str, problem: Union[str, Problem], result: Result) -> None:
    """That it is the problem of a result, by its largest sample, drawn again: a name says little of functions."""
    largest = result["largest"][:1]
    if not largest or not math.isfinite(largest[0]["value"] or math.nan):
        return
    index, value = largest[0]["index"], largest[0]["value"]
    block = int(result._settled.get("block", 1))
    drawn = np.ravel(_debias.samples(_inner(problem), result._settled, block, index // block * block, None))
    again = float(np.linalg.norm(drawn)) if "components" in result._data else float(drawn[0])
    # In parts of another size, NumPy may round in another way.
    if not abs(again - value) <= 1e-9 * abs(value):
        raise ValueError(f"{what}: problem {_name(problem)} (draws {again:.6g} as sample {index}, and the result of "
                         f"'{result['problem']}' has {value:.6g} there); give the problem that was estimated")


def _asked(shard: Result) -> Options:
    """Without doubts: one of a pilot's seconds is not in every shard."""
    return {name: x for name, x in shard._settled.items() if name != "doubts"}


def extend(result: Result, *, samples: Union[None, int, float] = None, error: Optional[float] = None,
           relative_error: Optional[float] = None, problem: Union[None, str, Problem] = None, threads: int = 0,
           progress: Any = None) -> Result:
    """A run that goes on: more samples, or to another goal. What it has counts; the bits are those of one run of that size.

    Parameters
    ----------
    result : Result
        Of `estimate`, `merge` or `extend`.
    samples : int, optional
        In all, those of the result among them.
    error, relative_error : float, optional
        A goal in their place, as of `estimate`.
    problem : str or Problem, optional
        Needed where the result comes from a file or another process.
    threads, progress
        As of `estimate`.

    Returns
    -------
    Result

    Raises
    ------
    ValueError
        For fewer samples than there are.

    Examples
    --------
    >>> import debias
    >>> short = debias.estimate("A10", samples=10_000)
    >>> debias.extend(short, samples=30_000).mean == debias.estimate("A10", samples=30_000).mean
    True
    """
    from ._commands import _warn
    from ._options import _Bar, _options

    if not isinstance(result, Result):
        raise TypeError(f"extend: {type(result).__name__} (must be a result of estimate, merge or extend)")
    if result._state is None:
        raise ValueError("extend: a result of multilevel (has no samples to add to); ask for a smaller error")
    goal = _options(samples=samples, error=error, relative_error=relative_error)
    if len(goal) != 1:
        raise ValueError("extend: one of samples, error and relative_error (says how far)")
    if result._shard is not None:
        raise ValueError("extend: a shard ends where the next one begins; merge the shards, then extend the union")
    block = int(result._settled.get("block", 1))
    try:
        asked = -(-int(float(goal.get("samples", math.inf))) // block) * block
    except (ValueError, OverflowError):  # what is no number, the module says
        asked = result.samples
    if asked < result.samples:
        raise ValueError(f"samples = {samples} (the result has {result.samples} already, and none is thrown away); ask for more")
    kept = {name: x for name, x in result._settled.items() if name != "samples" and not name.startswith("served")}
    whole = result._problem_or(problem)
    _draws_again("extend", whole, result)
    with _Bar(progress) as bar:
        longer = _run(whole, {**kept, **goal, "threads": threads}, bar, result._state)
    _warn(longer, 3)
    return longer


# ---- over many processes


def _shard(problem: Union[str, Problem], options: Options, shard: Tuple[int, int]) -> bytes:
    """In a worker: the sums of a shard."""
    _, state, _ = _debias.run_kept(_inner(problem), options, None, None, shard, None, False)
    data: bytes = state.bytes()
    return data


def _check_executor(executor: Any, problem: Union[str, Problem]) -> None:
    """Before any pilot."""
    joblib = callable(executor) and hasattr(executor, "n_jobs")
    if isinstance(executor, type) or not (hasattr(executor, "submit") or joblib):
        said = executor.__name__ if isinstance(executor, type) else type(executor).__name__
        raise TypeError(f"executor: {said} (must be one of concurrent.futures, a client of dask.distributed, "
                        "joblib.Parallel(...), or mpi4py.futures)" + ("; call it" if isinstance(executor, type) else ""))
    own = isinstance(problem, Problem) and not problem._inner.compiled
    if own and isinstance(executor, concurrent.futures.ThreadPoolExecutor) and _workers(executor) > 1:
        raise ValueError("executor: ThreadPoolExecutor (whose threads share the problem, and Python functions answer one run at a "
                         "time); take processes, or leave it out")


def _workers(executor: Any) -> int:
    if hasattr(executor, "scheduler_info"):  # dask.distributed
        return max(1, sum(int(w.get("nthreads", 1)) for w in executor.scheduler_info()["workers"].values()))
    for name in ("_max_workers", "num_workers"):
        if isinstance(getattr(executor, name, None), int):
            return max(1, int(getattr(executor, name)))
    jobs = getattr(executor, "n_jobs", None)  # joblib
    if isinstance(jobs, int):
        return jobs if jobs > 0 else max(1, (os.cpu_count() or 1) + 1 + jobs)
    return os.cpu_count() or 1


def _answers(executor: Any, calls: List[Tuple[Any, ...]]) -> Iterable[Optional[bytes]]:
    """What each call gave; None where its worker is lost."""
    if not hasattr(executor, "submit"):
        return list(executor((_shard, call, {}) for call in calls))
    more: Dict[str, Any] = {"pure": False} if hasattr(executor, "scheduler_info") else {}
    futures = []
    for call in calls:
        try:
            futures.append(executor.submit(_shard, *call, **more))
        except RuntimeError:  # a broken pool takes no more
            futures.append(None)
    answers: List[Optional[bytes]] = []
    for future in futures:
        try:
            answers.append(None if future is None else future.result())
        except Exception as e:
            if not _is_loss(e):
                raise
            answers.append(None)
    return answers


def _is_loss(e: Exception) -> bool:
    """Of the worker, not of the function: that one's errors come again."""
    names = {kind.__name__ for kind in type(e).__mro__}
    return bool(names & {"BrokenExecutor", "KilledWorker", "CancelledError", "FutureCancelledError", "CommClosedError",
                         "TerminatedWorkerError"})


def _distributed(problem: Union[str, Problem], options: Options, executor: Any, shards: Optional[int],
                 progress: Any = None) -> Tuple[Result, List[DebiasWarning]]:
    """The run of these options by shards. Pilots run here; a shard whose worker is lost runs again: on another one, at last
    here."""
    _check_executor(executor, problem)
    threads = options.pop("threads", 0)
    pilot = None
    if any(name in options for name in _GOALS) or options.get("estimator") == "recipe":
        report, pilot, settled = _debias.run_kept(_inner(problem), {**options, "threads": threads}, progress, None, None, None, True)
        if report is not None:  # it was short
            return _reported(problem, report, pilot, settled, None, progress), []
        options = settled
    samples = int(float(options.get("samples", 1e6)))
    chunk = 512 * int(options.get("block", 1))
    count = min(shards or 2 * _workers(executor), max(1, samples // (4 * chunk)))
    options = {**options, "samples": samples}
    each = {**options, "threads": threads or 1}
    open_shards = [(i, count) for i in range(1, count + 1)]
    state = None
    lost = 0
    for attempt in range(2):
        if not open_shards:
            break
        answers = _answers(executor, [(problem, each, shard) for shard in open_shards])
        missing = []
        for shard, answer in zip(open_shards, answers):
            if answer is None:
                missing.append(shard)
                continue
            part = _debias.State(answer)
            state = part if state is None else state.merged(part)
        lost += len(missing)
        open_shards = missing
    for shard in open_shards:
        part = _debias.State(_shard(problem, {**options, "threads": threads}, shard))
        state = part if state is None else state.merged(part)
    if pilot is not None and state is not None:
        state = state.with_pilot_of(pilot)
    result = _run(problem, {**options, "threads": threads}, progress, state)
    doubts = []
    if lost:
        doubts.append(DebiasWarning(f"workers were lost, and {lost} shards ran again; the numbers are those of one process",
                                    "worker_lost"))
    return result, doubts
