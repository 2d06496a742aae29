"""Compiled functions: C, numba, JAX and PyTorch, each where it is installed.

    PYTHONPATH=BUILD/python /usr/bin/python3 tests/python/own_compiled_test.py
"""

import concurrent.futures
import ctypes
import functools
import math
from pathlib import Path
import pickle
import shutil
import subprocess
import tempfile
import unittest

import numpy as np

import debias

from own_shared import Quiet, scipy, x_squared


def x_squared_beside(_, u):
    return x_squared(u)


class Compiled(Quiet):
    def library(self):
        compiler = shutil.which("gcc") or shutil.which("cc")
        if compiler is None:
            self.skipTest("no C compiler")
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        source = Path(folder.name) / "f.c"
        source.write_text("""
#include <stdint.h>
double f(int n, double *x) { return 1 + x[0] * x[0]; }
double scaled(int n, double *x, void *data) { return 1 + x[0] * x[0] * *(double *)data; }
void levels(int64_t k, int64_t n, double *u, double *out) {
  double a = 0, b = 0;
  for (int64_t i = 0; i < n; i += 2) { a += u[i]; if (i + 1 < n) b += u[i + 1]; }
  if (k == 0) { out[0] = a * a; return; }
  out[0] = (a + b) / n * ((a + b) / n);
  out[1] = (4 * a * a + 4 * b * b) / (2.0 * n * n);
}
""")
        subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-o", source.with_suffix(".so"), source], check=True)
        library = ctypes.CDLL(str(source.with_suffix(".so")))
        doubles = ctypes.POINTER(ctypes.c_double)
        library.f.restype, library.f.argtypes = ctypes.c_double, [ctypes.c_int, doubles]
        library.scaled.restype, library.scaled.argtypes = ctypes.c_double, [ctypes.c_int, doubles, ctypes.c_void_p]
        library.levels.restype = None
        library.levels.argtypes = [ctypes.c_int64, ctypes.c_int64, doubles, doubles]
        return library

    def test_c_functions(self):
        c = self.library()
        python = debias.function_of_mean(x_squared, "reciprocal")
        own = debias.function_of_mean(c.f, "reciprocal")
        options = {"samples": 40_000, "seed": 6, "pmf": "geometric:r=0.6"}
        for threads in 1, 2:
            self.assertEqual(debias.estimate(own, threads=threads, **options).mean, debias.estimate(python, **options).mean)
        np.testing.assert_array_equal(debias.samples(own, 50), debias.samples(python, 50))
        comb = debias.function_of_integral(c.f, "log")
        self.close(comb, math.log(4 / 3))
        levels = debias.levels(c.levels, dimension=lambda k: 2**k, rates=(2, 1))
        self.close(levels, 0.25, wrong=0.27)
        self.close(levels, 0.25, estimator="recipe", threads=2)
        self.raises(TypeError, r"compiled function void .* \(must be double", debias.function_of_mean, c.levels, "log")
        if scipy is not None:
            data = ctypes.c_double(1.0)
            with_data = scipy.LowLevelCallable(c.scaled, ctypes.cast(ctypes.pointer(data), ctypes.c_void_p))
            same = debias.function_of_mean(with_data, "reciprocal")
            self.assertEqual(debias.estimate(same, **options).mean, debias.estimate(python, **options).mean)

    def test_an_address_does_not_pickle(self):
        # "ctypes objects containing pointers cannot be pickled"
        c = self.library()
        compiled = [debias.function_of_mean(c.f, "log"), debias.function_of_integral(c.f, "log"),
                    debias.levels(c.levels, dimension=lambda k: 2**k, rates=(2, 1))]
        if scipy is not None:
            compiled.append(debias.function_of_mean(scipy.LowLevelCallable(c.f), "log"))
        for own in compiled:
            self.raises(pickle.PicklingError, r"^problem: \w+ \(a compiled function, whose address is .*shard=", pickle.dumps, own)
        with concurrent.futures.ProcessPoolExecutor(1) as pool:
            self.raises(pickle.PicklingError, "whose address is of this process", debias.estimate, compiled[0], samples=5000, executor=pool)
        parts = [debias.estimate(compiled[0], samples=5000, shard=(i, 2)) for i in (1, 2)]  # what it says instead
        self.assertEqual(debias.merge(*parts).mean, debias.estimate(compiled[0], samples=5000).mean)
        holds = debias.function_of_mean(functools.partial(x_squared_beside, c.f), "log")
        self.raises(pickle.PicklingError, "^problem: .partial. .holds what cannot be pickled: ctypes", pickle.dumps, holds)

    def test_numba(self):
        try:
            import numba
        except ImportError:
            self.skipTest("no numba")

        @numba.cfunc("float64(intc, CPointer(float64))")
        def f(n, x):
            return 1 + x[0] * x[0]

        own = debias.function_of_mean(f, "reciprocal")
        python = debias.function_of_mean(x_squared, "reciprocal")
        self.assertEqual(debias.estimate(own, samples=20_000, threads=2).mean, debias.estimate(python, samples=20_000).mean)


    def test_njit_levels(self):
        try:
            import numba
        except ImportError:
            self.skipTest("no numba")

        @numba.njit
        def squares(level, u):
            fine, coarse = np.empty(len(u)), np.empty(len(u))
            for i in range(len(u)):
                a, b = u[i, ::2].mean(), u[i, 1::2].mean() if level > 0 else 0.0
                fine[i], coarse[i] = (((a + b) / 2) ** 2, (a * a + b * b) / 2) if level > 0 else (a * a, 0.0)
            return fine, coarse

        own = debias.levels(lambda k, u: squares(k, u) if k else squares(0, u)[0], dimension=lambda k: 2**k, rates=(2, 1))
        self.close(own, 0.25, wrong=0.27)

    def test_jax_compiles_once(self):
        try:
            import jax
        except ImportError:
            self.skipTest("no jax")
        jax.config.update("jax_enable_x64", True)
        traced = []

        @jax.jit
        def f(u):
            traced.append(u.shape)  # while it is compiled, not while it runs
            return 1 + u[:, 0] ** 2

        options = {"samples": 20_000, "seed": 3}
        python = debias.estimate(debias.function_of_mean(x_squared, "reciprocal"), **options)
        own = debias.estimate(debias.function_of_mean(f, "reciprocal", block=4096), **options)
        np.testing.assert_allclose(own.mean, python.mean, rtol=1e-12)
        self.assertEqual(traced, [(4096, 1)])
        debias.estimate(debias.function_of_mean(f, "reciprocal"), **options)
        self.assertGreater(len(traced), 2)  # what `block` saves

    def test_torch(self):
        try:
            import torch
        except ImportError:
            self.skipTest("no torch")
        shapes = set()

        def f(u):
            x = torch.from_numpy(np.ascontiguousarray(u))
            shapes.add(tuple(x.shape))
            return 1 + x[:, 0] ** 2

        options = {"samples": 20_000, "seed": 3}
        own = debias.estimate(debias.function_of_mean(f, "reciprocal", block=4096), **options)
        python = debias.estimate(debias.function_of_mean(x_squared, "reciprocal"), **options)
        np.testing.assert_allclose(own.mean, python.mean, rtol=1e-12)
        self.assertEqual(shapes, {(4096, 1)})


if __name__ == "__main__":
    unittest.main()
