"""Runs in parts, in other processes and on disk: to the bits of one.

    PYTHONPATH=BUILD/python /usr/bin/python3 tests/python/own_kept_test.py
"""

import concurrent.futures
import importlib.util
import math
import os
from pathlib import Path
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
import warnings

import numpy as np

import debias
from debias import chains

from own_shared import Quiet, dies_once, normal_log_density, second_moment, start, x_squared


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

    def test_what_a_recipe_doubts_is_kept(self):
        for problem, seed, doubt in (("A08", 1, "no_second_moment"), ("I05", 1, "declared_rates")):
            with self.subTest(problem), tempfile.TemporaryDirectory() as folder:
                options = {"estimator": "recipe", "samples": 20_000, "seed": seed}
                whole = debias.estimate(problem, **options)
                codes = [w.code for w in whole.warnings]
                self.assertIn(doubt, codes)
                kept = {"checkpoint": Path(folder) / "run", **options}
                parts = [debias.estimate(problem, shard=(i, 2), **options) for i in (1, 2)]
                for name, again in (("kept", debias.estimate(problem, **kept)), ("resumed", debias.estimate(problem, **kept)),
                                    ("merged", debias.merge(*parts)), ("by the other shard first", debias.merge(*parts[::-1])),
                                    ("longer", debias.extend(pickle.loads(pickle.dumps(whole)), samples=whole.samples))):
                    with self.subTest(name):
                        self.assertEqual([w.code for w in again.warnings], codes)
                        self.assertIn("\nwarning  ", str(again))

    def test_a_result_goes_on_with_its_own_problem_alone(self):
        a, b = self.PROBLEMS["own"], debias.function_of_mean(x_squared, "log")
        same_name = debias.function_of_mean(lambda x: 5 + x[:, 0], "reciprocal")
        parts = {problem: [debias.estimate(problem, samples=4096, shard=(i, 2)) for i in (1, 2)] for problem in ("A10", a, same_name)}
        for mine, other in (("A10", "A01"), ("A10", a), (a, b), (a, same_name)):
            with self.subTest(f"{mine}, {other}"):
                self.raises(ValueError, "give the problem that was estimated", debias.merge, *parts[mine], problem=other)
                whole = debias.merge(*parts[mine], problem=mine)
                for options in ({"samples": 8192}, {"error": 0.5 * whole.standard_error}):
                    self.raises(ValueError, "give the problem that was estimated", debias.extend, whole, problem=other, **options)
        self.raises(ValueError, "give the problem that was estimated", debias.merge, parts[a][0], parts[same_name][1])
        array, other = (debias.function_of_mean(lambda u, c=c: u + c, lambda m: m**2, dimension=2, inputs=2, components=2) for c in (0, 1))
        whole = debias.estimate(array, samples=4096)
        self.raises(ValueError, "give the problem that was estimated", debias.extend, whole, samples=8192, problem=other)
        self.assertEqual(debias.extend(whole, samples=8192, problem=array).samples, 8192)
        self.raises(TypeError, "must be the results of shards", debias.merge, parts[a][0], 3)
        self.raises(TypeError, "must be a result of estimate", debias.extend, 3, samples=3)
        whole = debias.merge(*parts[a])
        for wrong in ("x", math.nan, math.inf):
            self.raises(ValueError, "not a number", debias.extend, whole, samples=wrong)
        by_recipe = debias.estimate("A03", samples=12_000, estimator="recipe")
        self.assertGreater(by_recipe.samples, 12_000)  # whole blocks
        self.assertEqual(debias.extend(by_recipe, samples=12_000).mean, by_recipe.mean)

    def test_merge_warns_as_the_run(self):
        options = {"samples": 3000, "pmf": "geometric:r=0.9", "seed": 3}
        parts = [debias.estimate("A10", shard=(i, 2), **options) for i in (1, 2)]
        told = []
        for run in (lambda: debias.estimate("A10", **options), lambda: debias.merge(*parts)):
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                run()
            told.append([(w.category, w.message.code) for w in caught])
        self.assertIn(debias.InfiniteVarianceWarning, [category for category, _ in told[0]])
        self.assertEqual(*told)

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

    def test_a_run_that_goes_on_asks_for_as_many_rows_at_once(self):
        # Chunk by chunk: 30 seconds of calls where `max_seconds` said 6.
        calls = []

        def counted(u):
            calls.append(len(u))
            return x_squared(u)

        own = debias.function_of_mean(counted, "reciprocal")
        for first, block in ((65_536, 1), (70_000, 1), (70_000, 4)):
            with self.subTest(first=first, block=block):
                short = debias.estimate(own, samples=first, seed=5, block=block)
                calls.clear()
                whole = debias.estimate(own, samples=4 * first, seed=5, block=block)
                new = len(calls)
                calls.clear()
                self.assertEqual(debias.extend(short, samples=4 * first).mean, whole.mean)
                self.assertLess(len(calls), new + 3)

    def test_max_seconds_counts_what_came_too_late(self):
        # The pilot of the error takes half of the time, and was not counted.
        def slow(u):
            time.sleep(0.03)
            return x_squared(u)

        own = debias.function_of_mean(slow, "reciprocal")
        start = time.monotonic()
        late = debias.estimate(own, error=1e-6, max_seconds=0.4, pmf="geometric:theta=1.3")
        self.assertGreater(late.pilot_seconds, 0.2)
        self.assertLess(late.seconds, time.monotonic() - start)
        self.assertTrue(late["goal"]["error"] == 1e-6 and not late["goal"]["met"])

    def test_executors_that_are_none(self):
        own = self.PROBLEMS["own"]
        for executor in (3, "processes", print, x_squared, concurrent.futures.ThreadPoolExecutor, [], object()):
            for problem in ("A10", own):
                self.raises(TypeError, "^executor: .*must be one of concurrent.futures", debias.estimate, problem, samples=20_000,
                            executor=executor)
        with concurrent.futures.ThreadPoolExecutor(2) as pool:  # "in use by another run; make two"
            self.raises(ValueError, "^executor: ThreadPoolExecutor .*take processes", debias.estimate, own, samples=20_000, executor=pool)
            self.assertEqual(debias.estimate("A10", samples=20_000, executor=pool).mean, debias.estimate("A10", samples=20_000).mean)
        with concurrent.futures.ThreadPoolExecutor(1) as pool:
            self.assertEqual(debias.estimate(own, samples=20_000, executor=pool).mean, debias.estimate(own, samples=20_000).mean)

    def test_a_checkpoint_that_cannot_be_written_is_refused_before_the_work(self):
        # After it, of '' and of a folder that is not there; bytes were written beside the file.
        calls = []

        def counted(u):
            calls.append(len(u))
            return x_squared(u)

        own = debias.function_of_mean(counted, "reciprocal")
        with tempfile.TemporaryDirectory() as folder:
            taken = Path(folder) / "taken"
            taken.write_text("x")
            os.mkfifo(Path(folder) / "pipe")
            for path, kind, said in (
                    ("", ValueError, "is no name"), (b"", ValueError, "is no name"), ("a\0b", ValueError, "is no name"),
                    (folder, IsADirectoryError, "is a folder"), (Path(folder), IsADirectoryError, "is a folder"),
                    (folder + "/", IsADirectoryError, "is a folder"), (os.fsencode(folder), IsADirectoryError, "is a folder"),
                    (folder + "/none/run", FileNotFoundError, "there is no folder '.*none'"),
                    (folder + "/none/", FileNotFoundError, "no folder"),
                    (taken / "run", FileNotFoundError, "there is no folder '.*taken'"), (folder + "/pipe", ValueError, "is a device or a pipe"),
                    (folder + "/" + 300 * "x", OSError, "cannot be written: File name too long"), (taken, ValueError, "is no run of debias"),
                    (3, TypeError, "int .must be the path"), (True, TypeError, "bool .must be"), (["x"], TypeError, "list .must be"),
                    (open, TypeError, "must be the path")):
                with self.subTest(path):
                    self.raises(kind, f"^checkpoint: .*{said}", debias.estimate, own, samples=2000, checkpoint=path)
            self.assertEqual(calls, [])
            self.assertEqual(sorted(os.listdir(folder)), ["pipe", "taken"])
            plain = debias.estimate(own, samples=2000)
            for path in (os.fsencode(folder) + b"/run", folder + "/run", Path(folder) / "run"):  # one file
                self.assertEqual(debias.estimate(own, samples=2000, checkpoint=path).mean, plain.mean)
            self.assertEqual(len(calls), 2)
            self.assertEqual(sorted(os.listdir(folder)), ["pipe", "run", "taken"])

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
            again = pickle.loads(pickle.dumps(result)).confidence_interval
            np.testing.assert_array_equal(again(0.5, problem=problem), interval(0.5))
            self.assertTrue(np.all(interval(0.99).low < interval.low) and np.all(interval(0.5).high < interval.high))
            np.testing.assert_array_equal(interval(0.9), debias.estimate(problem, samples=5000, confidence=0.9).confidence_interval)

    def test_a_limit_of_time_beside_an_error(self):
        own = debias.function_of_mean(x_squared, "reciprocal")
        easy = debias.estimate(own, error=0.01, max_seconds=20)
        self.assertEqual(easy.samples, debias.estimate(own, error=0.01).samples)
        hard = debias.estimate(own, error=1e-6, max_seconds=0.3, pmf="geometric:theta=1.7")
        self.assertLess(hard.seconds, 3)
        self.assertFalse(hard["goal"]["met"])
        for error in (1e-4, 1e-6):  # a recipe's pilots for such a goal took minutes
            hard = debias.estimate("A10", error=error, max_seconds=0.5, estimator="recipe")
            self.assertLess(hard.seconds, 5)
            self.assertGreater(hard.pilot_seconds, 0)
            self.assertFalse(hard["goal"]["met"])
        self.raises(ValueError, "max_seconds: stands beside", debias.estimate, own, max_seconds=1)
        self.raises(ValueError, "not a number", debias.estimate, own, error=0.1, max_seconds="soon")


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


if __name__ == "__main__":
    unittest.main()
