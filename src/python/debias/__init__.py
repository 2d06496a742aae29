"""Unbiased estimates from biased sequences.

    >>> import debias
    >>> print(debias.estimate("square-of-mean", samples=1e6, seed=7))

`problems()` lists the problems with known answers; `levels`, `function_of_mean`, `series` and others make one of your own from
NumPy functions, and `debias.chains` an expectation by Markov chains. The same seed gives the same bits as the program `debias` and
as C++, on any number of threads. Options are those of the program, by the same names: `base_level=2` is `--base-level 2`.

Every `seed` is a whole number of 64 bits, 1 where it is left out. None takes a fresh one from the operating system. A
`numpy.random.Generator` gives its next 64 bits, `integers(2**64, dtype=uint64)`, so that each call is another run; a
`numpy.random.SeedSequence` gives `generate_state(1, uint64)`, the same each time: spawn it for independent runs. The
result holds the number that was taken, as `seed`.
"""

from __future__ import annotations

from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, Union  # noqa: F401  annotations of classes name them

import numpy as np  # noqa: F401  likewise

from . import _debias
from ._commands import advise, estimate, estimators, pmfs, problems, replay, samples, survey, tradeoff
from ._derivatives import finite_difference, gradient
from ._errors import DebiasWarning, Error, GoalMissedWarning, InfiniteVarianceWarning, NoPmfError, NonFiniteWarning
from ._kept import extend, merge
from ._means import function_of_integral, function_of_mean, nested, reciprocal
from ._numbers import diagnose
from ._own import brownian_increments, levels, normal_quantile
from ._problem import Problem
from ._reports import Diagnosis, Interval, Report, Result, Samples
from ._types import Array, Facts  # noqa: F401  likewise
from ._terms import (log_determinant, log_determinant_spd, neumann, path_series, reciprocal_trials, series, solve, taylor,
                     transmittance)
from . import chains

__version__: str = _debias.version
#: Changes whenever the same seed would give other numbers.
stream_version: int = _debias.stream_version

__all__ = [
    "DebiasWarning", "Diagnosis", "Error", "GoalMissedWarning", "InfiniteVarianceWarning", "Interval", "NoPmfError",
    "NonFiniteWarning", "Problem", "Report", "Result", "Samples", "advise", "brownian_increments", "chains", "diagnose", "estimate",
    "estimators", "extend", "finite_difference", "function_of_integral", "function_of_mean", "gradient", "levels", "log_determinant",
    "log_determinant_spd", "merge", "nested", "neumann", "normal_quantile", "path_series", "pmfs", "problems", "reciprocal",
    "reciprocal_trials", "replay", "samples", "series", "solve", "stream_version", "survey", "taylor", "tradeoff",
    "transmittance",
]

for _name in __all__:
    if hasattr(globals()[_name], "__module__"):
        globals()[_name].__module__ = __name__


def __dir__() -> List[str]:
    return sorted([*__all__, "plot", "__version__", "__doc__"])


def __getattr__(name: str) -> Any:
    if name == "plot":  # matplotlib takes its time
        import importlib

        return importlib.import_module(".plot", __name__)
    _debias.refuse_if_renamed(f"{name}()")
    raise AttributeError(f"module 'debias' has no attribute '{name}'")
