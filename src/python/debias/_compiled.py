"""Compiled functions: C function pointers of numba, ctypes, cffi or SciPy, which run without Python's lock on all threads."""

from __future__ import annotations

import ctypes
import re
from typing import Any, Callable, NamedTuple, Optional, Tuple

_INTEGRAND = ("double (int, double *)", "double (int, double *, void *)")
_LEVELS = ("void (int64_t, int64_t, double *, double *)", "void (int64_t, int64_t, double *, double *, void *)")


class Pointer(NamedTuple):
    """Where a compiled function is, and the data of its last argument; None where it has no such argument."""

    address: int
    user: Optional[int]


_FUNCTION_POINTER: Any = getattr(ctypes, "_CFuncPtr")
_C_NAMES = {"c_double": "double", "c_int": "int", "c_long": "int64_t", "c_longlong": "int64_t", "c_void_p": "void *",
            "LP_c_double": "double *"}


def _of_ctypes(f: Any) -> str:
    """The signature of a function pointer of ctypes; empty where it has none."""
    if f.argtypes is None:
        return ""
    names = [_C_NAMES.get(getattr(t, "__name__", ""), getattr(t, "__name__", str(t))) for t in f.argtypes]
    result = "void" if f.restype is None else _C_NAMES.get(f.restype.__name__, f.restype.__name__)
    return f"{result} ({', '.join(names)})"


def _normal(signature: str) -> str:
    s = re.sub(r"\b(const|long long|long)\b", lambda m: "" if m.group() == "const" else "int64_t", signature)
    return re.sub(r"\s*\*", " *", re.sub(r"\s+", " ", s)).replace("( ", "(").strip()


def _is_address(f: Any) -> bool:
    """Whether it is a compiled function, of which Python knows the address alone."""
    return (isinstance(f, _FUNCTION_POINTER) or (type(f).__name__ == "LowLevelCallable" and isinstance(f, tuple))
            or (hasattr(f, "address") and hasattr(f, "ctypes")))


def _pointer(what: str, f: Any, expected: Tuple[str, ...]) -> Optional[Pointer]:
    """Of a compiled function; None of any other. Raises TypeError for one of another signature."""
    user = 0
    if type(f).__name__ == "LowLevelCallable" and isinstance(f, tuple):
        capsule = tuple.__getitem__(f, 0)
        name = ctypes.pythonapi.PyCapsule_GetName
        name.restype, name.argtypes = ctypes.c_char_p, [ctypes.py_object]
        signature = (name(capsule) or b"").decode()
        context = ctypes.pythonapi.PyCapsule_GetContext
        context.restype, context.argtypes = ctypes.c_void_p, [ctypes.py_object]
        user = context(capsule) or 0
        at = ctypes.pythonapi.PyCapsule_GetPointer
        at.restype, at.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
        address = at(capsule, name(capsule))
    elif hasattr(f, "address") and hasattr(f, "ctypes"):  # cfunc of numba
        address, signature = f.address, _of_ctypes(f.ctypes)
    elif isinstance(f, _FUNCTION_POINTER):
        address, signature = ctypes.cast(f, ctypes.c_void_p).value, _of_ctypes(f)
    else:
        return None
    if signature and _normal(signature) not in expected:
        raise TypeError(f"{what}: a compiled function {_normal(signature)} (must be {' or '.join(expected)})")
    return Pointer(int(address or 0), user if "void *" in _normal(signature) else None)


def _integrand(f: Callable[..., Any]) -> Optional[Pointer]:
    return _pointer("integrand", f, _INTEGRAND)


def _levels(f: Callable[..., Any]) -> Optional[Pointer]:
    return _pointer("differences", f, _LEVELS)
