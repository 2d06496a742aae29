"""Pictures of estimates with matplotlib: each takes `ax` (or makes one) and returns it.

Colours are those of Okabe and Ito, which colour-blind readers tell apart; markers and dashes tell the same in print.
"""

from __future__ import annotations

import itertools
import warnings
from typing import Any, Callable, Dict, Mapping, Optional, Sequence, Union

import matplotlib.pyplot as plt
import numpy as np

from . import _commands
from ._errors import DebiasWarning
from ._numbers import _numbers, diagnose
from ._problem import Problem
from ._reports import Diagnosis, Report
from .chains import ChainAdvice
from ._types import Array

__all__ = ["distance", "error_map", "levels", "meeting_times", "running_mean", "speed_against_error", "tails", "tradeoff"]

BLUE, ORANGE, GREEN, PURPLE, SKY, RED, BLACK = (
    "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#000000")
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, RED, BLACK)
MARKERS = "osD^vPX"
DASHES = ("-", "--", "-.", ":")


def _ax(ax: Any) -> Any:
    return plt.subplots(figsize=(6, 4), layout="constrained")[1] if ax is None else ax


def _finish(ax: Any, title: Optional[str], xlabel: str, ylabel: str, legend: Union[bool, str] = True) -> Any:
    if title:
        ax.set_title(title, fontsize="medium")
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    ax.grid(True, which="major", color="0.88", linewidth=0.8)
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    if legend and ax.get_legend_handles_labels()[0]:
        # "below": where curves may run anywhere, the legend stands outside of the axes.
        below = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.16), "ncol": 2} if legend == "below" else {}
        ax.legend(frameon=False, fontsize="small", **below)
    return ax


def running_mean(values: Any, *, truth: Optional[float] = None, label: Optional[str] = None, colour: str = BLUE,
                 title: Optional[str] = None, ax: Any = None) -> Any:
    """The mean of the first 16, 32, 64, ... values with its 95 % interval. With infinite variance the band is too narrow, and jumps.

    Parameters
    ----------
    values : array_like or Diagnosis
    truth : float, optional
        Drawn as a line.
    label, colour, title, ax
        As of the others.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import matplotlib
    >>> matplotlib.use("svg")
    >>> import debias
    >>> from debias import plot
    >>> plot.running_mean(debias.samples("A10", 4096), truth=0.25).get_xlabel()
    'samples'
    """
    diagnosis = values if isinstance(values, Diagnosis) else diagnose(values)
    rows = diagnosis.running
    rows = rows[rows["values"] >= min(16, rows["values"].max())]
    ax = _ax(ax)
    n, mean, half = rows["values"], rows["mean"], 1.96 * rows["standard_error"]
    ax.fill_between(n, mean - half, mean + half, color=colour, alpha=0.2, linewidth=0)
    ax.plot(n, mean, color=colour, marker="o", markersize=3.5, label=label or "mean of the first, 95 % interval")
    if truth is not None:
        ax.axhline(truth, color=BLACK, linestyle="--", linewidth=1, label="exact value")
    ax.set_xscale("log", base=2)
    return _finish(ax, title, "samples", "mean")


def levels(report: Union[str, Problem, Report], *, axes: Any = None) -> Any:
    """Giles' four panels over the levels: variance, mean, kurtosis, and consistency of the coupling with the work of a draw.

    Open markers are levels that did not take part in the fit; dashed lines fall as fast as the fitted rates. The band is
    one standard deviation of what the evidence believes of E D_k^2, at levels seen and beyond them. In the last panel the
    grey band holds what a right coupling gives but once in 150,000 times, 4.5 standard errors.

    Parameters
    ----------
    report : Report, str or Problem
        A survey, or a problem that is surveyed here.
    axes : array of matplotlib.axes.Axes, optional
        Four of them.

    Returns
    -------
    array of matplotlib.axes.Axes

    Examples
    --------
    >>> import matplotlib
    >>> matplotlib.use("svg")
    >>> import debias
    >>> from debias import plot
    >>> plot.levels(debias.survey("A10", levels=5, samples=1000)).shape
    (2, 2)
    """
    if not isinstance(report, Report):
        report = _commands.survey(report)
    if axes is None:
        axes = plt.subplots(2, 2, figsize=(8.5, 6.5), layout="constrained")[1]
    flat = np.ravel(axes)
    rows = report.levels
    level = rows["level"]
    above = level > 0
    polynomial = report["rates"]["kind"] == "polynomial"
    unit: Callable[[Any], Any] = (lambda k: np.log2(k + 1)) if polynomial else (lambda k: k)
    of = "k + 1" if polynomial else "k"

    def curve(ax: Any, keep: Array, y: Array, colour: str, marker: str, label: str) -> None:
        keep = keep & (y > 0)
        if not keep.any():
            return
        ax.plot(level[keep], y[keep], color=colour, linewidth=1, label=label)
        fitted = keep & rows["fitted"]
        ax.plot(level[fitted], y[fitted], marker, color=colour)
        ax.plot(level[keep & ~fitted], y[keep & ~fitted], marker, color=colour, markerfacecolor="white")

    def slope(ax: Any, y: Array, name: str, rate: Dict[str, Any]) -> None:
        use = rows["fitted"] & (y > 0)
        if rate["value"] is None or not use.any():
            return
        k = level[use]
        offset = np.mean(np.log2(y[use]) + rate["value"] * unit(k))
        exponent = f"{rate['value']:.2f} ± {rate['error'] or 0:.2f}"
        shown = rf"$\mathregular{{({of})^{{-{name}}}}}$" if polynomial else rf"$2^{{-{name} k}}$"
        ax.plot(k, 2 ** (offset - rate["value"] * unit(k)), "--", color=BLACK, linewidth=1.3,
                label=f"{shown}, ${name}$ = {exponent}")

    every = np.ones(len(rows), dtype=bool)
    believed = report["believed"]
    if len(believed) > 0:
        centre = np.array([b["log2_second_moment"] for b in believed])
        error = np.array([b["error"] for b in believed])
        flat[0].fill_between([b["level"] for b in believed], 2 ** (centre - error), 2 ** (centre + error), color=BLUE,
                             alpha=0.15, linewidth=0, label="believed, ± 1 sd")
    curve(flat[0], every, rows["variance"], ORANGE, "s", r"Var $I_k$")
    curve(flat[0], above, rows["second_moment"], BLUE, "o", r"E $D_k^2$")
    slope(flat[0], rows["second_moment"], r"\beta", report["rates"]["variance_decay"])
    curve(flat[1], every, np.abs(rows["mean"]), ORANGE, "s", r"|E $I_k$|")
    curve(flat[1], above, np.abs(rows["difference"]), BLUE, "o", r"|E $D_k$|")
    slope(flat[1], np.abs(rows["difference"]), r"\alpha", report["rates"]["mean_decay"])
    curve(flat[2], above, rows["kurtosis"], BLUE, "o", r"E $D_k^4$ / (E $D_k^2)^2$")
    flat[2].axhline(3, color=BLACK, linestyle=":", linewidth=1, label="normal draws: 3")
    keep = level > level.min()
    flat[3].axhspan(-4.5, 4.5, color="0.93", linewidth=0)
    flat[3].plot(level[keep], rows["consistency"][keep], "o", color=BLUE, label="consistency")
    flat[3].axhline(0, color=BLACK, linewidth=0.8)
    largest = np.abs(rows["consistency"][keep]).max(initial=0)
    flat[3].set_ylim(-max(6, 1.1 * largest), max(6, 1.1 * largest))
    for ax in flat[:3]:
        ax.set_yscale("log", base=2 if ax is not flat[2] else 10)
    for ax in flat:
        ax.xaxis.get_major_locator().set_params(integer=True)
    _finish(flat[0], "variance", "level k", "second moment")
    _finish(flat[1], "mean", "level k", "size of the mean")
    _finish(flat[2], "kurtosis", "level k", "kurtosis of the difference")
    _finish(flat[3], "consistency of the coupling, and work", "level k",
            "E[$I_k - D_k$] − E[$I_{k-1}$], standard errors", legend=False)
    work = flat[3].twinx()
    work.plot(level, rows["difference_work"], "D--", color=PURPLE, markersize=4, linewidth=1, label="work")
    work.set_yscale("log", base=2)
    work.set_ylabel("work of a draw of $D_k$ (units of the problem)", color=PURPLE)
    work.spines["top"].set_visible(False)
    handles = [h for ax in (flat[3], work) for h in ax.get_legend_handles_labels()[0]]
    # Above the panel: neither the points nor the line of the work has a place that is always free.
    flat[3].set_title("")
    flat[3].legend(handles=handles, frameon=False, fontsize="small", ncol=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return axes


def tradeoff(report: Union[str, Problem, Report], *, ax: Any = None) -> Any:
    """Variance x work against the exponent of the PMF, with the regions where one of them is infinite.

    Parameters
    ----------
    report : Report, str or Problem
        A sweep, or a problem that is swept here.
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import matplotlib
    >>> matplotlib.use("svg")
    >>> import debias
    >>> from debias import plot
    >>> plot.tradeoff(debias.tradeoff("A10", points=3, samples=2000)).get_yscale()
    'log'
    """
    if not isinstance(report, Report):
        report = _commands.tradeoff(report)
    points = report["points"]
    ax = _ax(ax)
    x = np.array([p["exponent"] for p in points], dtype=float)
    none: Callable[[Any], Any] = lambda value: np.nan if value is None else value  # noqa: E731
    predicted = np.array([none(p["predicted_variance"]) * none(p["predicted_work"]) for p in points])
    measured = np.array([none(p["measured_variance"]) * none(p["measured_work"]) for p in points])
    edge = (x[1:] + x[:-1]) / 2
    room = 0.02 * (x[-1] - x[0]) or 0.1  # for the whole of the first and the last marker
    edges = np.concatenate(([x[0] - room], edge, [x[-1] + room]))
    seen = set()
    for i, p in enumerate(points):
        for what, state, colour, hatch in (("work", "infinite", SKY, "\\\\"), ("variance", "infinite", ORANGE, "//"),
                                           ("variance", "undecided", "0.7", "")):
            if p[what] != state:
                continue
            label = None if (what, state) in seen else f"{what} {state}"
            seen.add((what, state))
            ax.axvspan(edges[i], edges[i + 1], facecolor=colour, alpha=0.25, hatch=hatch, edgecolor="white",
                       linewidth=0, label=label)
    ax.plot(x, predicted, color=BLUE, label="predicted from the levels")
    # An infinite variance has no estimate: what a run shows there is left open.
    finite = np.array([p["variance"] == "finite" for p in points])
    ax.plot(x[finite], measured[finite], "o", color=BLUE, label="measured")
    if (~finite & np.isfinite(measured)).any():
        ax.plot(x[~finite], measured[~finite], "o", color=BLUE, markerfacecolor="white",
                label="a run, not to be trusted")
    sure = predicted[finite & np.isfinite(predicted)]
    least = sure.min() if sure.size else 0.0
    for name, colour, dash, label in (("optimum", GREEN, "--", "best of all PMFs"),
                                      ("bound", BLACK, ":", "bound where draws share nothing")):
        value = report[name] or 0.0
        if value > 1e-3 * least:  # a PMF without any variance is off the map
            ax.axhline(value, color=colour, linestyle=dash, linewidth=1.3, label=label)
            least = min(least, value)
    if report["best"]:
        best = [p["pmf"] for p in points].index(report["best"])
        ax.plot(x[best], predicted[best], "*", color=RED, markersize=14, zorder=5,
                label=f"best of the family\n{_short(report['best'])}")
    ax.set_yscale("log")
    ax.set_xlim(edges[0], edges[-1])
    if sure.size:  # beyond, predictions grow without bound
        ax.set_ylim(0.5 * least, 30 * sure.max())
    polynomial = report["rates"]["kind"] == "polynomial"
    return _finish(ax, f"{report['problem']}: which PMF?",
                   r"exponent $\rho$ of the PMF, $p_k \sim k^{-\rho}$" if polynomial else
                   r"exponent $\rho$ of the PMF, $p_k \sim 2^{-\rho k}$", "variance × work of a sample", legend="below")


def _short(spec: str) -> str:
    name, _, value = spec.partition("=")
    try:
        return f"{name}={float(value):.3g}"
    except ValueError:
        return spec


def speed_against_error(runs: Any, *, time: str = "seconds", samples: Sequence[int] = (1 << 12, 1 << 14, 1 << 16, 1 << 18),
                        seed: int = 1, title: Optional[str] = None, ax: Any = None) -> Any:
    """Error against time, of several estimators: one line each, with its fitted slope; lower left is better.

    Parameters
    ----------
    runs : mapping, str or Problem
        A name -> results of growing `samples`, or pairs (time, error). Of a problem the single term by its declared rates and a
        recipe run here, each to `samples`.
    time : {"seconds", "work"}
        Of results.
    samples, seed
        Of the runs of a problem.
    title, ax
        As of the others.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import matplotlib
    >>> matplotlib.use("svg")
    >>> from debias import plot
    >>> plot.speed_against_error("A10", samples=(1 << 10, 1 << 12)).get_ylabel()
    'error of the mean'
    """
    if not isinstance(runs, Mapping):
        runs = _runs_of(runs, samples, seed)
    ax = _ax(ax)
    styles = zip(itertools.cycle(COLOURS), itertools.cycle(MARKERS), itertools.cycle(DASHES))
    for (name, results), (colour, marker, dash) in zip(runs.items(), styles):
        pairs = np.array([r if isinstance(r, (tuple, list, np.ndarray)) else
                          (getattr(r, time), np.linalg.norm(r.standard_error)) for r in results], dtype=float)
        slope = np.polyfit(np.log(pairs[:, 0]), np.log(pairs[:, 1]), 1)[0] if len(pairs) > 1 else np.nan
        ax.plot(pairs[:, 0], pairs[:, 1], color=colour, marker=marker, markersize=5, linestyle=dash,
                label=name if np.isnan(slope) else f"{name} (slope {slope:.2f})")
    ax.set_xscale("log")
    ax.set_yscale("log")
    return _finish(ax, title, "time (s)" if time == "seconds" else "work (units of the problem)", "error of the mean")


def _runs_of(problem: Union[str, Problem], samples: Sequence[int], seed: int) -> Dict[str, Any]:
    ways = ["recipe"] if isinstance(problem, Problem) and not problem.declares_rates else ["single_term", "recipe"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DebiasWarning)
        return {way: [_commands.estimate(problem, samples=n, seed=seed, estimator=way) for n in samples] for way in ways}


def tails(values: Any, *, title: Optional[str] = None, ax: Any = None) -> Any:
    """How often |value - median| exceeds x, log-log, with the tail index k-hat: slope -1 / k.

    Above 1/2 the variance is infinite: a line of slope -2 is drawn to compare with.

    Parameters
    ----------
    values : array_like
        As `diagnose` takes them.
    title, ax
        As of the others.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import matplotlib
    >>> matplotlib.use("svg")
    >>> import debias
    >>> from debias import plot
    >>> plot.tails(debias.samples("A10", 4096)).get_ylabel()
    'share of the samples beyond x'
    """
    array, missing = _numbers(values)
    array = np.ravel(array if missing is None else array[~missing]).astype(float)
    verdict = diagnose(array)["verdict"]
    ax = _ax(ax)
    centre = np.median(array)
    for sign, name, colour, marker in ((1, "upper", BLUE, "o"), (-1, "lower", ORANGE, "s")):
        size = np.sort(sign * (array - centre))[::-1]
        size = size[: min(len(size), 4096)]
        size = size[size > 0]
        if len(size) < 2:
            continue
        share = np.arange(1, len(size) + 1) / len(array)
        index: Dict[str, Any] = verdict[f"{name}_tail"] if verdict else {"k": None}
        label = f"{name} tail"
        if index["k"] is not None:
            label += f", $\\hat k$ = {index['k']:.2f} ± {index['error']:.2f}"
        thinned = np.unique(np.geomspace(1, len(size), 120).astype(int)) - 1
        ax.plot(size[thinned], share[thinned], marker, color=colour, markersize=4, label=label)
        if index["k"] is not None and index["k"] > 0.25:  # below it the values are not yet on a power law
            k, at = index["k"], min(len(size) - 1, max(1, index["values"] // 4))
            x = np.array([size[min(len(size) - 1, index["values"])], size[0]])
            ax.plot(x, share[at] * (x / size[at]) ** (-1 / k), color=colour, linewidth=1.2,
                    label=f"its fit, slope {-1 / k:.2f}")
        if name == "upper":
            at = min(len(size) - 1, max(1, index.get("values") or len(size) // 10))  # where the tail begins
            ax.plot(size[[at, 0]], share[at] * (size[[at, 0]] / size[at]) ** -2.0, ":", color=BLACK, linewidth=1.2,
                    label="slope −2, the border")
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_ylim(bottom=0.5 / len(array))
    return _finish(ax, title, "distance x from the median", "share of the samples beyond x", legend="below")


def error_map(image: Any, reference: Any, *, standard_error: Any = None, title: Optional[str] = None,
              unit: str = "radiance", limit: Optional[float] = None, ax: Any = None) -> Any:
    """What an image misses: image - reference, or that in standard errors. Orange: too bright; purple: too dark.

    Parameters
    ----------
    image, reference : array_like
        Of one shape, (rows, columns) or (rows, columns, colours).
    standard_error : array_like, optional
        The error is shown in units of it.
    title, ax
        As of the others.
    unit : str
        What the numbers are.
    limit : float, optional
        Where the colours end, one for maps that are compared; else it is the 99.5 % quantile of the size of the error.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import matplotlib
    >>> matplotlib.use("svg")
    >>> import numpy as np
    >>> from debias import plot
    >>> plot.error_map(np.eye(3), np.zeros((3, 3))).get_title()
    'error, root mean square 0.577'
    """
    error: Array = np.ma.filled(np.ma.asarray(image, dtype=float) - np.ma.asarray(reference, dtype=float), np.nan)
    if standard_error is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            error = np.where(error == 0, 0.0, error / np.asarray(standard_error, dtype=float))
    if error.ndim == 3:
        error = error.mean(axis=2)  # a pixel without one of its numbers has none
    ax = _ax(ax)
    finite = np.abs(error[np.isfinite(error)])
    if limit is None:
        limit = float(np.quantile(finite, 0.995)) if finite.size else 1.0
    shown = ax.imshow(error, cmap="PuOr_r", vmin=-(limit or 1.0), vmax=limit or 1.0, interpolation="nearest")
    label = f"error ({unit})" if standard_error is None else "error (standard errors)"
    ax.figure.colorbar(shown, ax=ax, label=label, extend="both", shrink=0.85)
    size = np.sqrt(np.sum(finite**2) / max(finite.size, 1))
    ax.set_title(title or f"error, root mean square {size:.3g}", fontsize="medium")
    ax.set_xlabel("column (pixels)")
    ax.set_ylabel("row (pixels)")
    return ax


def meeting_times(times: Any, *, label: Optional[str] = None, colour: str = BLUE, title: Optional[str] = None,
                  ax: Any = None) -> Any:
    """The share of pairs of chains that have not met by a time. A geometric tail, which is light, is a straight line here; a
    tail that bends away from it is heavy, or belongs to a second, slower scale.

    Parameters
    ----------
    times : ndarray or ChainAdvice
        What `debias.chains.meeting_times` or `debias.chains.advise` returned.
    label, colour, title, ax
        As of the others.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> from debias import chains, plot
    >>> walk = chains.random_walk(lambda x: -0.5 * x[:, 0] ** 2, step=2.4)
    >>> ax = plot.meeting_times(chains.meeting_times(chains.coupled_chain(walk, 0.0, lambda x: x[:, 0]), 200))
    """
    if isinstance(times, ChainAdvice):
        rows = times.meetings
        values, counts = rows["last"], rows["chains"]
    else:
        array = np.ravel(np.asarray(times))
        if array.size == 0 or array.dtype.kind not in "iu":
            raise TypeError("times: no array of meeting times (whole numbers)")
        values, counts = np.unique(array, return_counts=True)
    late = 1 - np.cumsum(counts) / counts.sum()
    ax = _ax(ax)
    ax.step(np.concatenate(([0], values)), np.concatenate(([1.0], late)), where="post", color=colour,
            label=label or f"{counts.sum()} pairs")
    ax.set_yscale("log")
    ax.set_ylim(0.5 / counts.sum(), 1.3)
    return _finish(ax, title, "steps t", "share not met by t")


def distance(advice: ChainAdvice, *, label: Optional[str] = None, colour: str = BLUE, title: Optional[str] = None,
             ax: Any = None) -> Any:
    """An upper bound on how far a plain chain is from its steady state after t steps, in total variation: how long a burn-in
    would have had to be [Biswas, Jacob, Vanetti 2019]. The dashed line is one percent.

    Parameters
    ----------
    advice : ChainAdvice
    label, colour, title, ax
        As of the others.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        Where chains were cut, and there is no distance.

    Examples
    --------
    >>> from debias import chains, plot
    >>> walk = chains.random_walk(lambda x: -0.5 * x[:, 0] ** 2, step=2.4)
    >>> start = lambda u: 6 * u - 3
    >>> ax = plot.distance(chains.advise(chains.coupled_chain(walk, start, lambda x: x[:, 0]), chains=200))
    """
    rows = advice.distance
    if len(rows) == 0:
        raise ValueError("advice: no distance (chains were cut, and those that were cut have no meeting time); take a larger "
                         "limit, or none")
    ax = _ax(ax)
    ax.plot(rows["time"], rows["bound"], color=colour, marker="o", markersize=3.5,
            label=label or f"lag {advice['options']['lag']}")
    ax.axhline(0.01, color=BLACK, linestyle="--", linewidth=1)
    ax.set_yscale("log")
    return _finish(ax, title, "steps t of a plain chain", "distance from the steady state, at most")
