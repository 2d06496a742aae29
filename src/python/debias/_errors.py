"""What goes wrong, and what is doubted."""

from __future__ import annotations

from typing import Optional


class Error(Exception):
    """What `debias` raises of its own, beside ValueError and TypeError for arguments that cannot be.

    Examples
    --------
    >>> import debias
    >>> try:
    ...     debias.estimate("gbm-by-euler")
    ... except debias.Error as e:
    ...     print(type(e).__name__)
    NoPmfError
    """


class NoPmfError(Error, ValueError):
    """No PMF has finite variance and finite work: no mistake of the caller, but a property of the sequence.

    Attributes
    ----------
    variance_decay, work_growth : float or None
        Of E D_k^2 and of the work: powers of 2, or of the level, as `decay` says; None where they are not known.
    variance_decay_error, work_growth_error : float or None
        Where they were measured.
    decay : {"geometric", "polynomial"}
    grade : {"declared", "shown", "likely"}
        "declared", or what the levels show: "shown" is wrong once in 200 times, "likely" once in 10.
    reason, help : str
        Why there is none, and what would help.

    Examples
    --------
    >>> import debias
    >>> try:
    ...     debias.estimate("gbm-by-euler")
    ... except debias.NoPmfError as e:
    ...     print(e.variance_decay, e.work_growth, e.grade)
    1.0 1.0 declared
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
    """A doubt that a result has about itself: `code` is its name ("coupling", "threads", ...), `text` the sentence.

    Examples
    --------
    >>> import debias
    >>> [w.code for w in debias.diagnose([1.0]).warnings]
    ['one_sample']
    """

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
    """The variance of a sample is infinite: the standard error is too small most of the time.

    Examples
    --------
    Runs that are not to be trusted as errors:

    >>> import warnings
    >>> import debias
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", debias.InfiniteVarianceWarning)
    ...     debias.estimate("A10", samples=10_000).verdict
    'finite'
    """


class NonFiniteWarning(DebiasWarning):
    """Samples that are no finite numbers, so there is no mean: it is NaN, since leaving samples out would be a bias.

    Examples
    --------
    >>> import warnings
    >>> import debias
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", debias.NonFiniteWarning)
    ...     debias.estimate("A10", samples=10_000)["nonfinite"]
    0
    """


class GoalMissedWarning(DebiasWarning):
    """The error or the time that was asked for is missed.

    Examples
    --------
    >>> import warnings
    >>> import debias
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", debias.GoalMissedWarning)
    ...     try:
    ...         debias.estimate("A10", error=1e-7, max_seconds=0.1)
    ...     except debias.GoalMissedWarning as warning:
    ...         print(warning)
    the goal is missed
    """
