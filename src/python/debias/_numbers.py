"""Anyone's numbers as arrays, and what they say."""

from __future__ import annotations

import warnings
from typing import Any, Optional, Tuple

import numpy as np

from . import _debias
from ._reports import Diagnosis
from ._types import Array


def diagnose(values: Any, *, name: str = "array") -> Diagnosis:
    """Mean, error, tails and verdict of any numbers.

    Parameters
    ----------
    values : array_like
        Of any real type and strides; nothing is copied but a buffer. Booleans are 0 and 1. What is masked, or NA in pandas, is left
        out; a warning of the result says how much.
    name : str
        What the report calls them.

    Returns
    -------
    Diagnosis

    Raises
    ------
    TypeError
        For values that are no real numbers.

    Examples
    --------
    >>> import numpy as np
    >>> import debias
    >>> debias.diagnose(np.random.default_rng(1).normal(size=10_000)).verdict
    'finite'
    """
    try:
        array, missing = _numbers(values)
    except ValueError:
        raise TypeError(f"values: {type(values).__name__} of rows of different lengths (must be an array of real numbers)") from None
    if array.dtype.kind not in "fiub":
        raise TypeError(f"values: an array of {array.dtype} (must be of real numbers)")
    diagnostician = _debias.Diagnostician()
    pieces = np.nditer([array, np.False_ if missing is None else missing],
                       flags=["external_loop", "buffered", "zerosize_ok"], op_dtypes=[np.float64, np.bool_],
                       casting="same_kind", order="C", buffersize=1 << 16)
    for piece, left_out in pieces if array.size else ():
        diagnostician.add(piece, left_out)
    said, spread = diagnostician.finish(name)
    return Diagnosis(*said, spread)


def _has_mask(values: Any) -> bool:
    if isinstance(values, (list, tuple)):
        return any(_has_mask(x) for x in values)
    return isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values)


def _masked(values: Any) -> Any:
    nested = isinstance(values, (list, tuple)) and any(isinstance(x, (list, tuple)) for x in values)
    return np.ma.stack([_masked(x) for x in values]) if nested else np.ma.array(values)


def _numbers(values: Any) -> Tuple[Array, Optional[Array]]:
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
