"""What a problem of one's own is: what the module knows of it, and how it was made."""

from __future__ import annotations

import functools
import pickle
from typing import Any, Callable, Dict, Optional, Tuple, TypeVar, cast

import numpy as np

from . import _debias
from ._compiled import _is_address

F = TypeVar("F", bound=Callable[..., Any])


class _ByValue:
    """A function that pickle cannot name, as the bytes of cloudpickle; it is the function again where it is read."""

    def __init__(self, data: bytes):
        self._data = data

    def __reduce__(self) -> Tuple[Any, ...]:
        return pickle.loads, (self._data,)


def _packed(x: Any) -> Any:
    """Of functions, what can be pickled: themselves where they can be imported, else by value."""
    if _is_address(x):
        try:
            pickle.dumps(x)
            return x
        except Exception as e:  # ctypes, SciPy and numba each have their own
            raise pickle.PicklingError(f"problem: {_said(x)} (a compiled function, whose address is of this process alone); run it on "
                                       "threads, without an executor, or make the problem in each process, draw shard=(i, n) there "
                                       "and merge the results") from e
    if not callable(x) or isinstance(x, type):
        return x
    by_name = getattr(x, "__module__", None) != "__main__"
    nameless = "(pickle finds no function by that name); define it at the top of a module, or install cloudpickle"
    try:
        if by_name:
            try:
                pickle.dumps(x)
                return x
            except (pickle.PicklingError, AttributeError):
                pass
            except Exception as e:  # of what it holds, each kind of which has its own
                nameless = f"(holds what cannot be pickled: {e}); let it make that where it is called"
        import cloudpickle

        return _ByValue(cloudpickle.dumps(x))
    except ImportError:
        if not by_name and "<" not in getattr(x, "__qualname__", "<"):
            return x
    except Exception as e:
        nameless = f"(holds what cannot be pickled: {e}); let it make that where it is called"
    raise pickle.PicklingError(f"problem: {getattr(x, '__qualname__', type(x).__name__)!r} {nameless}")


def _made_again(name: str, arguments: Tuple[Any, ...], options: Dict[str, Any]) -> Any:
    import debias

    maker: Any = debias
    for part in name.split("."):
        maker = getattr(maker, part)
    return maker(*arguments, **options)


class Problem:
    """A problem of one's own, for `estimate`, `samples`, `survey` and the other commands.

    Made by `levels`, `function_of_mean` and their relatives, not by hand. It pickles, as the function that made it and its
    arguments: functions by name where they can be imported, else by value where `cloudpickle` is installed.

    Attributes
    ----------
    name : str
    components : int
        Numbers of an estimate; 1 where it is no array.
    declares_rates : bool
        Whether a PMF can be chosen without a pilot.

    Examples
    --------
    >>> import debias
    >>> debias.function_of_mean(lambda x: 1 + x[:, 0] ** 2, "reciprocal", name="1 / E X")
    <debias.Problem '1 / E X': function_of_mean(<lambda>, 'reciprocal')>
    """

    _has_levels = True

    def __init__(self, inner: _debias.UserProblem):
        self._inner = inner
        self._made: Tuple[str, Tuple[Any, ...], Dict[str, Any]] = ("", (), {})

    @property
    def name(self) -> str:
        return self._inner.name

    @property
    def components(self) -> int:
        return self._inner.components

    @property
    def declares_rates(self) -> bool:
        return self._inner.declares_rates

    @property
    def _special(self) -> str:
        return self._inner.special

    def __repr__(self) -> str:
        maker, arguments, options = self._made
        said = [_said(x) for x in arguments]
        said += [f"{name}={_said(x)}" for name, x in options.items() if name not in ("name", "formula")]
        return f"<debias.Problem {self.name!r}: {maker}({', '.join(said)})>"

    def __reduce__(self) -> Tuple[Any, ...]:
        maker, arguments, options = self._made
        return _made_again, (maker, tuple(_packed(x) for x in arguments), {name: _packed(x) for name, x in options.items()})


def _said(x: Any) -> str:
    if callable(x):
        return str(getattr(x, "__name__", type(x).__name__))
    text = repr(x)
    return text if len(text) <= 40 else f"{type(x).__name__}"


def _maker(f: F) -> F:
    """Of a function that makes a problem: it remembers how."""

    @functools.wraps(f)
    def making(*arguments: Any, **options: Any) -> Any:
        for name in ("normals", "rng", "polynomial"):  # any text would be a yes
            if not isinstance(options.get(name), (bool, np.bool_, type(None))):
                raise TypeError(f"{name}: {type(options[name]).__name__} (must be True or False)")
        problem = f(*arguments, **options)
        problem._made = (f.__name__, arguments, options)
        return problem

    return cast(F, making)
