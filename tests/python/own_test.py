"""Own problems of all kinds: unbiased, and refused in one sentence; runs in parts, in other processes and on disk.

    PYTHONPATH=BUILD/python /usr/bin/python3 tests/python/own_test.py

Fixed seeds; an estimate may be 4.5 standard errors off its truth, and each family has a wrong relative that must be further off.
"""

import concurrent.futures
import ctypes
import importlib.util
import math
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import unittest
import warnings
from pathlib import Path

import numpy as np

import debias
from debias import chains

try:
    import scipy
    import scipy.sparse
    import scipy.sparse.linalg
except ImportError:
    scipy = None


def x_squared(u):
    return 1 + u[:, 0] ** 2


def dies_once(u):
    flag = os.environ["DEBIAS_TEST_FLAG"]
    if not os.path.exists(flag):
        open(flag, "w").close()
        os._exit(1)
    return x_squared(u)


def normal_log_density(x):
    return -0.5 * x[:, 0] ** 2


def start(u):
    return 3 * debias.normal_quantile(u)


def second_moment(x):
    return x[:, 0] ** 2


class Quiet(unittest.TestCase):
    def setUp(self):
        caught = warnings.catch_warnings()
        caught.__enter__()
        self.addCleanup(caught.__exit__, None, None, None)
        warnings.simplefilter("ignore", debias.DebiasWarning)

    def raises(self, error, pattern, f, /, *arguments, **options):
        with self.assertRaisesRegex(error, pattern):
            f(*arguments, **options)

    def close(self, problem, truth, wrong=None, **options):
        """Unbiased for the truth, and sharp enough to tell it from something wrong."""
        result = debias.estimate(problem, **{"samples": 40_000, "seed": 11, **options})
        off = np.max(abs(np.asarray(result.mean) - truth) / np.maximum(result.standard_error, 1e-13))
        self.assertLess(off, 4.5, f"{result.mean} is not {truth}")
        if wrong is not None:
            self.assertGreater(np.max(abs(np.asarray(result.mean) - wrong) / result.standard_error), 4.5)
        return result


class Means(Quiet):
    def test_any_function_of_a_mean(self):
        own = debias.function_of_mean(x_squared, lambda m: 1 / m)
        named = debias.function_of_mean(x_squared, "reciprocal")
        gap = debias.function_of_mean(x_squared, lambda m: 1 / m, gap=lambda m, d: -d * d / (m * (m - d) * (m + d)))
        self.close(own, 0.75, wrong=0.76)
        for problem in own, gap:
            for options in ({"pmf": "geometric:r=0.6"}, {"pmf": "geometric:r=0.6", "base_level": 2},
                            {"pmf": "geometric:r=0.6", "estimator": "independent_sum"},
                            {"pmf": "geometric:r=0.6", "estimator": "single_term_outcome"}):
                a, b = (debias.samples(p, 500, seed=3, **options) for p in (problem, named))
                np.testing.assert_allclose(a, b, rtol=1e-9)
        self.close(own, 0.75, estimator="recipe")
        self.assertEqual(debias.estimate(debias.reciprocal(x_squared), samples=1000).mean,
                         debias.estimate(named, samples=1000).mean)

    def test_vector_means_and_vector_functions(self):
        ratio = debias.function_of_mean(lambda u: u, lambda m: m[:, 0] / (1 + m[:, 1]), dimension=2, inputs=2)
        self.close(ratio, 1 / 3, wrong=0.345)
        both = debias.function_of_mean(lambda u: u, lambda m: m**2, dimension=2, inputs=2, components=2)
        self.assertEqual(both.components, 2)
        self.close(both, [0.25, 0.25], wrong=[0.25, 0.26])
        self.close(both, [0.25, 0.25], block=16)

    def test_normal_numbers_and_blocks(self):
        self.close(debias.function_of_mean(lambda z: z[:, 0], "square", normals=True), 0.0)
        shapes = set()

        def counted(u):
            shapes.add(u.shape)
            return x_squared(u)

        blocks = debias.function_of_mean(counted, "reciprocal", block=4096)
        plain = debias.function_of_mean(x_squared, "reciprocal")
        self.assertEqual(debias.estimate(blocks, samples=5000).mean, debias.estimate(plain, samples=5000).mean)
        self.assertEqual(shapes, {(4096, 1)})

    def test_nested(self):
        square = debias.nested(lambda u: u[:, 0], lambda y, u: y + debias.normal_quantile(u[:, 0]), lambda m: m**2)
        self.close(square, 1 / 3, wrong=0.45)

    def test_bad_input(self):
        self.raises(TypeError, "g: int", debias.function_of_mean, x_squared, 3)
        self.raises(ValueError, "gap: beside g = 'log'", debias.function_of_mean, x_squared, "log", gap=lambda m, d: d)
        self.raises(ValueError, "g: returned shape", debias.estimate, debias.function_of_mean(x_squared, lambda m: 1.0))
        self.raises(ValueError, "integrand: returned nan", debias.estimate,
                    debias.function_of_mean(lambda u: u[:, 0] * np.nan, lambda m: m))
        self.raises(ValueError, "threads = 2.*executor", debias.estimate, debias.function_of_mean(x_squared, "log"), threads=2)


class Levels(Quiet):
    def test_a_shared_base(self):
        def square(level, u):
            if level == 0:
                return u[:, 0] ** 2
            even, odd = u[:, ::2].mean(axis=1), u[:, 1::2].mean(axis=1)
            return ((even + odd) / 2) ** 2, (even**2 + odd**2) / 2

        def shared(level, base, u):
            groups = u.reshape(len(u), -1, 1 << base).mean(axis=2)
            fine, coarse = square(level, u)
            return (groups**2).mean(axis=1), fine - coarse

        options = {"dimension": lambda k: 2**k, "rates": (2, 1)}
        plain = debias.estimate(debias.levels(square, **options), samples=40_000, seed=2)
        quiet = self.close(debias.levels(square, shared=shared, **options), 0.25, wrong=0.26)
        self.assertLess(quiet.standard_error, plain.standard_error)
        self.assertLess(quiet.work, plain.work)
        self.raises(ValueError, "shared: returned ndarray", debias.estimate,
                    debias.levels(square, shared=lambda k, m, u: u[:, 0], **options), samples=100)

    def test_brownian_increments(self):
        def law_holds(m, steps):  # increment j is the sum of z_i m[i, j]: independent, of variance h
            return np.allclose(m.T @ m, np.eye(steps) * 2 / steps, atol=1e-12)

        for steps in (1, 2, 3, 8, 12, 512, 768):
            m = debias.brownian_increments(np.eye(steps), 2)
            self.assertTrue(law_holds(m, steps))
            np.testing.assert_allclose(m.sum(axis=1), np.sqrt(2) * (np.arange(steps) == 0), atol=1e-12)  # number 0 is the end
            m[0] *= 1.01
            self.assertFalse(law_holds(m, steps))

        def call(level, z):
            def end(dw, h):
                x = np.full(len(dw), 100.0)
                for w in dw.T:
                    x = x + 0.05 * x * h + 0.2 * x * w + 0.02 * x * (w * w - h)
                return np.maximum(x - 100, 0) * np.exp(-0.05)

            dw, h = debias.brownian_increments(z), 1 / z.shape[1]
            return end(dw, h) if level == 0 else (end(dw, h), end(dw[:, ::2] + dw[:, 1::2], 2 * h))

        # The points of the catalogue's call, but for the one draw of the tail, which is far down.
        own = debias.levels(call, dimension=lambda k: 2**k, rates=(2, 1), normals=True)
        options = {"pmf": "dyadic:6,4,3,2,2,1,1,1,1,1;theta=1.25", "points": "nets", "block": 107, "samples": 107 * 40, "seed": 3,
                   "estimator": "single_term_outcome"}
        mine, theirs = debias.estimate(own, **options), debias.estimate("E02", **options)
        self.assertLess(abs(mine.mean - theirs.mean), theirs.standard_error / 20)
        in_time = debias.levels(lambda k, z: call(k, z[:, ::-1]), dimension=lambda k: 2**k, rates=(2, 1), normals=True)
        wrong = debias.estimate(in_time, **options)  # the end by the last number
        self.assertGreater(abs(wrong.mean - theirs.mean), theirs.standard_error / 20)
        self.raises(ValueError, "normals of shape .*at least one step", debias.brownian_increments, np.zeros((3, 0)))
        self.raises(ValueError, "horizon = 0", debias.brownian_increments, np.zeros((3, 2)), 0)

    def test_a_generator_for_each_draw(self):
        def gamma(level, rng):
            x = rng.gamma(2.0, size=2**level)
            if level == 0:
                return x[0] ** 2
            return x.mean() ** 2, (x[::2].mean() ** 2 + x[1::2].mean() ** 2) / 2

        own = debias.levels(gamma, rng=True, work=lambda k: 2.0**k, rates=(2, 1))
        self.close(own, 4.0, wrong=5.5, samples=4000)
        values = debias.samples(own, 50, seed=3)
        np.testing.assert_array_equal(values[20:30], debias.samples(own, 10, seed=3, first=20))

    def test_a_pmf_of_ones_own(self):
        own = debias.function_of_mean(x_squared, "reciprocal")
        for pmf in ([0.6, 0.25, 0.1, 0.04], lambda j: 0.6 * 0.4**j):
            self.close(own, 0.75, pmf=pmf)
        same = [debias.estimate(own, samples=2000, pmf=p) for p in ([0.6, 0.24, 0.096], "geometric:r=0.6")]
        np.testing.assert_allclose(same[0].mean, same[1].mean, rtol=1e-9)
        self.raises(ValueError, "all positive", debias.estimate, own, pmf=[0.5, 0.0, 0.5])
        self.raises(ValueError, "must fall", debias.estimate, own, pmf=[0.5, 0.5])


class Terms(Quiet):
    def test_series(self):
        half = debias.series(lambda k: 0.5**k, ratio=0.5)
        for options in ({}, {"estimator": "roulette"}, {"estimator": "roulette", "base_level": 3}, {"estimator": "recipe"},
                        {"estimator": "independent_sum"}):
            self.close(half, 2.0, **options)
        noisy = debias.series(lambda k, u: 2 * u[:, 0] * 0.5**k, ratio=0.5, dimension=1)
        for options in ({}, {"estimator": "roulette"}):
            self.close(noisy, 2.0, wrong=2.1, **options)
        self.close(debias.series(lambda k: (k + 1.0) ** -2, exponent=2), math.pi**2 / 6)
        values = debias.samples(noisy, 60, estimator="roulette")
        np.testing.assert_array_equal(values[20:30], debias.samples(noisy, 10, first=20, estimator="roulette"))
        self.raises(ValueError, "ratio = 1.5", debias.series, lambda k: 1.0, ratio=1.5)
        self.raises(ValueError, "term: returned nan", debias.estimate, debias.series(lambda k: math.nan, ratio=0.5))

    def test_paths(self):
        paths = debias.path_series(lambda u: np.ones(len(u)), lambda x, u: x * u[:, 0], lambda x: x, ratio=3**-0.5)
        for options in ({}, {"estimator": "roulette"}, {"estimator": "roulette", "base_level": 2}, {"estimator": "independent_sum"}):
            result = self.close(paths, 2.0, wrong=2.05, **options)
            self.assertGreater(result.work, result.samples)
        values = debias.samples(paths, 60, estimator="roulette")
        np.testing.assert_array_equal(values[20:30], debias.samples(paths, 10, first=20, estimator="roulette"))
        traced = debias.replay(paths, 25, seed=1, estimator="roulette")
        self.assertEqual(traced["value"], values[25])
        cut = debias.estimate(paths, estimator="truncated", base_level=3, samples=40_000)
        self.assertGreater(abs(cut.mean - 2.0), 4.5 * cut.standard_error)  # what a path cut at depth 3 gives

    def test_taylor_and_transmittance(self):
        for g, truth in (("reciprocal", 0.75), ("log", math.log(4 / 3)), ("power:1.5", (4 / 3) ** 1.5),
                         ("exp-minus", math.exp(-4 / 3))):
            problem = debias.taylor(x_squared, g, 1.4, mean_square=0.1)
            for options in ({}, {"estimator": "roulette"}):
                self.close(problem, truth, wrong=truth * 1.1, **options)
        own = debias.taylor(x_squared, lambda k: math.exp(-1.4) * (-1.0) ** k / math.factorial(k), 1.4)
        self.close(own, math.exp(-4 / 3), pmf="geometric:r=0.5")
        medium = debias.transmittance(lambda x: 1 + x[:, 0], length=1.0, control=2.0)
        self.close(medium, math.exp(-1.5), wrong=math.exp(-1.6), estimator="single_term_outcome", pmf="poisson:lambda=2")
        self.raises(ValueError, "mean_square = 3", debias.taylor, x_squared, "log", 1.4, mean_square=3)
        self.raises(ValueError, "g = 'sine'", debias.taylor, x_squared, "sine", 1.4)

    def test_trials(self):
        trials = debias.reciprocal_trials(x_squared, bound=2.0)
        result = self.close(trials, 0.75, wrong=0.765)
        self.assertAlmostEqual(result.work / result.samples, 1.5, delta=0.05)
        values = debias.samples(trials, 60)
        np.testing.assert_array_equal(values[20:30], debias.samples(trials, 10, first=20))
        self.assertGreater(values.min(), 0)
        self.raises(ValueError, r"must lie in \[0, 1.5\]", debias.estimate, debias.reciprocal_trials(x_squared, bound=1.5))

    def test_linear_operators(self):
        rng = np.random.default_rng(1)
        n = 12
        a = 0.5 * rng.random((n, n)) / n
        spd = np.diag(np.linspace(1, 2, n)) + 0.1 * (a + a.T)
        low, high = np.linalg.eigvalsh(spd)[[0, -1]]
        b, c = rng.random(n), rng.random(n)
        forms = [np.asarray]
        if scipy is not None:
            forms += [scipy.sparse.csr_matrix, scipy.sparse.linalg.aslinearoperator]
        for form in forms:
            self.close(debias.neumann(form(a), b, c, radius=0.5), c @ np.linalg.solve(np.eye(n) - a, b))
            self.close(debias.solve(form(spd), b, c, lower=low, upper=high), c @ np.linalg.solve(spd, b))
            for options in ({}, {"estimator": "roulette"}):
                truth = np.linalg.slogdet(spd)[1]
                self.close(debias.log_determinant_spd(form(spd), lower=low, upper=high), truth, wrong=1.01 * truth, samples=5000,
                           **options)
                self.close(debias.log_determinant(form(a), radius=0.5), np.linalg.slogdet(np.eye(n) - a)[1], samples=5000, **options)
        self.raises(ValueError, "must be square", debias.neumann, np.ones((2, 3)), [1, 1], [1, 1], radius=0.5)
        self.raises(ValueError, "spectrum in", debias.solve, spd, b, c, lower=-1, upper=2)


class Derivatives(Quiet):
    def test_differences(self):
        for kind, truth in (("central", math.cos(1)), ("forward", math.cos(1)), ("second", -math.sin(1))):
            result = debias.estimate(debias.finite_difference(math.sin, 1.0, kind=kind), samples=40_000)
            bias = result["bias_bound"]["size"]
            self.assertLess(bias, 1e-3)
            self.assertLess(abs(result.mean - truth), 4.5 * result.standard_error + bias)
        noisy = debias.finite_difference(lambda x, u: np.exp(x * u[:, 0]), 0.0, dimension=1)
        self.close(noisy, 0.5, wrong=0.52)
        self.raises(ValueError, "kind = 'backward'", debias.finite_difference, math.sin, 1.0, kind="backward")

    def test_gradient(self):
        both = debias.gradient(lambda x, u: u[:, 0] * x[0] * x[1] ** 2, [1.0, 2.0], dimension=1)
        self.close(both, [2.0, 2.0], wrong=[2.0, 2.1])
        self.close(debias.gradient(lambda x: x[0] ** 2 + 3 * x[1], [1.0, 2.0]), [2.0, 3.0], samples=2000)


class Kept(Quiet):
    PROBLEMS = {"catalogue": "A10", "own": debias.function_of_mean(x_squared, "reciprocal"),
                "array": debias.function_of_mean(lambda u: u, lambda m: m**2, dimension=2, inputs=2, components=2),
                "sampler": debias.reciprocal_trials(x_squared, bound=2.0)}

    def test_shards_merge_to_the_bits_of_the_run(self):
        for name, problem in self.PROBLEMS.items():
            options = {"samples": 20_000, "seed": 5}
            if name == "own":
                options["block"] = 4
            with self.subTest(name):
                whole = debias.estimate(problem, **options)
                parts = [debias.estimate(problem, shard=(i, 3), **options) for i in (1, 2, 3)]
                merged = debias.merge(*parts[::-1])
                np.testing.assert_array_equal(merged.mean, whole.mean)
                np.testing.assert_array_equal(merged.standard_error, whole.standard_error)
                for column in whole.levels.dtype.names:
                    if column != "seconds":
                        np.testing.assert_array_equal(merged.levels[column], whole.levels[column])
                self.raises(ValueError, "leave out", debias.merge, *parts[:2])
                self.raises(ValueError, "both results hold sample 0", debias.merge, *parts, parts[0])
                other = debias.estimate(problem, shard=(3, 3), **{**options, "seed": 6})
                self.raises(ValueError, "different runs", debias.merge, *parts[:2], other)

    def test_extend(self):
        for name, problem in self.PROBLEMS.items():
            with self.subTest(name):
                short = debias.estimate(problem, samples=7000, seed=5)
                longer = debias.extend(short, samples=20_000)
                np.testing.assert_array_equal(longer.mean, debias.estimate(problem, samples=20_000, seed=5).mean)
                self.raises(ValueError, "ask for more", debias.extend, longer, samples=100)
        short = debias.estimate("A10", samples=7000, seed=5)
        again = pickle.loads(pickle.dumps(short))
        self.assertEqual(again, short)
        self.assertEqual(debias.extend(again, samples=20_000).mean, debias.extend(short, samples=20_000).mean)
        goal = debias.extend(short, error=0.01)
        self.assertLess(goal.standard_error, 0.012)

    def test_checkpoints(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "run"
            own = self.PROBLEMS["own"]
            for options in ({"samples": 20_000}, {"error": 0.002, "estimator": "recipe"}):
                whole = debias.estimate(own, checkpoint=file, **options)
                self.assertEqual(whole.mean, debias.estimate(own, **options).mean)
                again = debias.estimate(own, checkpoint=file, **options)
                self.assertEqual((again.mean, again.standard_error, again.samples), (whole.mean, whole.standard_error, whole.samples))
                self.raises(ValueError, "of another run", debias.estimate, own, samples=777, checkpoint=file)
                self.raises(ValueError, "of another run", debias.estimate, "A10", checkpoint=file, **options)
                contents = file.read_bytes()
                for broken in (contents[:-1], contents[:50], b"", contents[:-9] + b"x" + contents[-8:]):
                    file.write_bytes(broken)
                    self.raises(ValueError, "is no run", debias.estimate, own, checkpoint=file, **options)
                file.unlink()

    def test_an_interrupted_run_goes_on_to_the_same_bits(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "run"

            class Stop(Exception):
                pass

            def stop(done, total):
                if file.exists():
                    raise Stop

            options = {"samples": 40_000_000, "seed": 9}  # some seconds: a checkpoint is written about once a second
            with self.assertRaises(Stop):
                debias.estimate("A10", checkpoint=file, progress=stop, **options)
            resumed = debias.estimate("A10", checkpoint=file, **options)
            self.assertEqual(resumed.mean, debias.estimate("A10", **options).mean)

    def test_intervals_of_any_level(self):
        for problem in self.PROBLEMS.values():
            result = debias.estimate(problem, samples=5000)
            interval = result.confidence_interval
            self.assertTrue(np.array_equal(interval(0.95), interval))
            self.assertTrue(np.all(interval(0.99).low < interval.low) and np.all(interval(0.5).high < interval.high))
            np.testing.assert_array_equal(interval(0.9), debias.estimate(problem, samples=5000, confidence=0.9).confidence_interval)

    def test_a_limit_of_time_beside_an_error(self):
        own = debias.function_of_mean(x_squared, "reciprocal")
        easy = debias.estimate(own, error=0.01, max_seconds=20)
        self.assertEqual(easy.samples, debias.estimate(own, error=0.01).samples)
        hard = debias.estimate(own, error=1e-6, max_seconds=0.3, pmf="geometric:theta=1.7")
        self.assertLess(hard.seconds, 3)
        self.assertFalse(hard["goal"]["met"])
        self.raises(ValueError, "max_seconds: stands beside", debias.estimate, own, max_seconds=1)


class Processes(Quiet):
    def test_problems_pickle(self):
        walk = chains.random_walk(normal_log_density, 2.4)
        for problem in (debias.function_of_mean(x_squared, "reciprocal"), debias.reciprocal_trials(x_squared, bound=2.0),
                        debias.function_of_mean(x_squared, np.log), chains.coupled_chain(walk, start, second_moment, length=9)):
            again = pickle.loads(pickle.dumps(problem))
            self.assertEqual(repr(again), repr(problem))
            np.testing.assert_array_equal(debias.samples(again, 20), debias.samples(problem, 20))
        unnamed = debias.function_of_mean(lambda u: u[:, 0], "log")
        try:
            import cloudpickle
        except ImportError:
            self.raises(pickle.PicklingError, "install cloudpickle", pickle.dumps, unnamed)
        else:
            del cloudpickle
            self.assertEqual(debias.samples(pickle.loads(pickle.dumps(unnamed)), 1)[0], debias.samples(unnamed, 1)[0])

    def test_processes_give_the_bits_of_one(self):
        own = debias.function_of_mean(x_squared, "reciprocal")
        with concurrent.futures.ProcessPoolExecutor(2) as pool:
            for problem in own, "A10":
                for options in ({"samples": 30_000, "seed": 3}, {"error": 0.004, "estimator": "recipe"}):
                    a = debias.estimate(problem, executor=pool, **options)
                    b = debias.estimate(problem, **options)
                    self.assertEqual((a.mean, a.standard_error, a.samples, a.work), (b.mean, b.standard_error, b.samples, b.work))
        self.raises(TypeError, "executor: int", debias.estimate, own, executor=3)
        self.raises(ValueError, "do not go together", debias.estimate, own, executor=pool, shard=(1, 2))

    def test_a_lost_worker_is_replaced(self):
        class Losing:
            """Its first worker dies."""

            _max_workers = 2
            calls = 0

            def submit(self, f, *arguments):
                future = concurrent.futures.Future()
                self.calls += 1
                if self.calls == 1:
                    future.set_exception(concurrent.futures.BrokenExecutor("gone"))
                else:
                    future.set_result(f(*arguments))
                return future

        own = debias.function_of_mean(x_squared, "reciprocal")
        whole = debias.estimate(own, samples=30_000).mean
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            self.assertEqual(debias.estimate(own, samples=30_000, executor=Losing()).mean, whole)
        self.assertIn("worker_lost", [w.message.code for w in caught])
        with tempfile.TemporaryDirectory() as folder:
            os.environ["DEBIAS_TEST_FLAG"] = os.path.join(folder, "died")
            with concurrent.futures.ProcessPoolExecutor(2) as pool, warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                dying = debias.function_of_mean(dies_once, "reciprocal")
                self.assertEqual(debias.estimate(dying, samples=30_000, executor=pool).mean, whole)
            self.assertIn("worker_lost", [getattr(w.message, "code", "") for w in caught])

    def test_joblib_and_dask(self):
        own = debias.function_of_mean(x_squared, "reciprocal")
        here = debias.estimate(own, samples=30_000).mean
        tried = 0
        try:
            import joblib
        except ImportError:
            pass
        else:
            tried += 1
            self.assertEqual(debias.estimate(own, samples=30_000, executor=joblib.Parallel(n_jobs=2)).mean, here)
        try:
            from dask.distributed import Client, LocalCluster
        except ImportError:
            pass
        else:
            tried += 1
            with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
                self.assertEqual(debias.estimate(own, samples=30_000, executor=client).mean, here)
        if not tried:
            self.skipTest("neither joblib nor dask.distributed")


    def test_mpi(self):
        """mpi4py.futures has a pool of ranks: a program of its own, started by mpiexec."""
        launcher = shutil.which("mpiexec")
        if launcher is None or importlib.util.find_spec("mpi4py") is None:
            self.skipTest("no mpiexec or no mpi4py")
        with tempfile.TemporaryDirectory() as folder:
            script = Path(folder) / "ranks.py"
            script.write_text("""
import debias
from mpi4py.futures import MPIPoolExecutor
from own import own
if __name__ == "__main__":
    with MPIPoolExecutor() as pool:
        print(debias.estimate(own, samples=30_000, executor=pool).mean.hex())
""")
            (Path(folder) / "own.py").write_text("""
import debias
def x_squared(u):
    return 1 + u[:, 0] ** 2
own = debias.function_of_mean(x_squared, "reciprocal")
""")
            version = subprocess.run([launcher, "--version"], capture_output=True, text=True).stdout
            options = ["--oversubscribe", "--allow-run-as-root"] if "Open" in version else []  # Open MPI, OpenRTE
            found = subprocess.run([launcher, *options, "-n", "3", sys.executable, "-m", "mpi4py.futures", str(script)],
                                   capture_output=True, text=True, cwd=folder,
                                   env={**os.environ, "PYTHONPATH": folder + os.pathsep + os.environ.get("PYTHONPATH", "")})
        here = debias.estimate(debias.function_of_mean(x_squared, "reciprocal"), samples=30_000).mean
        self.assertEqual(found.stdout.split(), [here.hex()], found.stderr)


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


class Conventions(Quiet):
    def test_examples_of_the_documentation(self):
        """Each public name has an example that runs, and each function says what it takes and gives."""
        import doctest

        modules = [debias, chains]
        try:
            import matplotlib
        except ImportError:
            pass
        else:
            matplotlib.use("svg")
            modules.append(debias.plot)
        tried = 0
        for module in modules:
            for name in module.__all__:
                thing = getattr(module, name)
                if isinstance(thing, (int, type(debias))):
                    continue
                with self.subTest(f"{module.__name__}.{name}"):
                    self.assertTrue(thing.__doc__, "no docstring")
                    test = doctest.DocTestFinder(recurse=False).find(thing, name, module=False, globs={})
                    examples = [t for t in test if t.examples]
                    self.assertTrue(examples, "no example")
                    for t in examples:
                        out = []
                        failed, n = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(t, out=out.append)
                        self.assertEqual(failed, 0, "".join(out))
                        tried += n
                    if not isinstance(thing, type) and thing.__code__.co_argcount:
                        self.assertRegex(thing.__doc__, r"(?s)Parameters\n    -+\n.*Returns\n    -+\n")
        self.assertGreater(tried, 90)

    def test_the_names_are_the_api(self):
        self.assertEqual(set(dir(debias)) - {"__version__", "__doc__", "plot"}, set(debias.__all__))
        self.assertTrue(issubclass(debias.NoPmfError, debias.Error))
        self.assertEqual(debias.estimate.__module__, "debias")

    def test_frames(self):
        result = debias.estimate(Kept.PROBLEMS["array"], samples=2000)
        for package, call in (("pandas", lambda: result.to_frame()), ("xarray", lambda: result.to_xarray())):
            try:
                __import__(package)
            except ImportError:
                self.raises(ImportError, package, call)
                continue
            found = call()
            if package == "pandas":
                self.assertEqual(len(found), len(result.levels))
            else:
                np.testing.assert_array_equal(found["mean"], result.mean)

    def test_python_m_debias_is_the_program(self):
        program = os.environ.get("DEBIAS_PROGRAM")
        if not program:
            self.skipTest("no program")
        said = subprocess.run([sys.executable, "-m", "debias", "list", "pmfs"], capture_output=True, text=True)
        self.assertEqual(said.stdout, subprocess.run([program, "list", "pmfs"], capture_output=True, text=True).stdout)
        self.assertIn("geometric", said.stdout)


if __name__ == "__main__":
    unittest.main()
