"""The Python package: the bits of the program and of C++, and one clear exception for each kind of bad input.

    PYTHONPATH=BUILD/python DEBIAS_PROGRAM=BUILD/bin/debias DEBIAS_SAME_BITS=BUILD/bin/debias_same_bits \
        /usr/bin/python3 tests/python/debias_test.py
"""

import contextlib
import doctest
import gc
import io
import json
import math
import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import warnings
import weakref
from pathlib import Path

import numpy as np

import debias
from debias import chains

PROGRAM = os.environ["DEBIAS_PROGRAM"]
SAME_BITS = os.environ["DEBIAS_SAME_BITS"]
PMF = "geometric:r=0.6"


def program(*arguments):
    done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)
    return done.stdout


def without_times(data):
    if isinstance(data, dict):
        return {key: without_times(x) for key, x in data.items() if key not in ("seconds", "pilot_seconds", "efficiency")}
    return [without_times(x) for x in data] if isinstance(data, list) else data


def ignoring_doubts(test):
    def quiet(self):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", debias.DebiasWarning)
            test(self)

    return quiet


def sums(u):
    """Over the even and over the odd columns, in the order of a loop."""
    halves = np.zeros((2, len(u)))
    for i in range(u.shape[1]):
        halves[i % 2] += u[:, i]
    return halves


def powers(value):
    def differences(level, u):
        even, odd = sums(u)
        n = u.shape[1]
        if level == 0:
            return value(even)
        return value((even + odd) / n), (value(2 * even / n) + value(2 * odd / n)) * 0.5

    return differences


def square(m):
    return m * m


SCALAR = debias.levels(powers(square), dimension=lambda k: 2**k, rates=(2, 1), truth=0.25)
VECTOR = debias.levels(powers(lambda m: np.stack((m * m, m * m * m), axis=1)), dimension=lambda k: 2**k,
                       rates=(2, 1), components=2)


class SameBits(unittest.TestCase):
    def same_json(self, a, b):
        for data in (a, b):
            for key in ("seconds", "pilot_seconds", "efficiency", "file"):
                data.pop(key, None)
            for row in data.get("levels", []):
                row.pop("seconds", None)
            points = data.get("points", [])
            for row in points if isinstance(points, list) else []:  # of a sweep; of a run, their name
                row.pop("efficiency", None)
        self.assertEqual(a, b)

    def test_program(self):
        for name, options in (("A10", {}), ("european-call", {"pmf": "geometric:r=0.7", "threads": 3}),
                              ("A10", {"estimator": "recipe", "seed": 5}), ("furnace", {"estimator": "roulette"}),
                              ("B14", {"estimator": "reciprocal_trials"}), ("A01", {"error": 0.01, "base_level": 1})):
            if "error" not in options:
                options["samples"] = 20000
            words = [w for k, v in options.items() for w in ("--" + k.replace("_", "-"), str(v))]
            with self.subTest(name, **options), warnings.catch_warnings():
                warnings.simplefilter("ignore", debias.DebiasWarning)
                result = debias.estimate(name, **options)
                self.same_json(result.to_dict(), json.loads(program("run", name, *words, "--json")))

                def steady(text):  # without times
                    times = ("seconds", "efficiency", "pilot")
                    return [line for line in text.splitlines() if not line.startswith(times)]

                self.assertEqual(steady(str(result)), steady(program("run", name, *words)))
                self.assertEqual(steady(result.full()), steady(program("run", name, *words, "--full")))

    def test_other_commands(self):
        self.same_json(debias.survey("A10", levels=6, samples=2000).to_dict(),
                       json.loads(program("survey", "A10", "--levels", "6", "--samples", "2000", "--json")))
        self.same_json(debias.tradeoff("A10", points=3, samples=5000).to_dict(),
                       json.loads(program("tradeoff", "A10", "--points", "3", "--samples", "5000", "--json")))
        self.assertEqual(str(debias.replay("A10", 77, seed=3)),
                         program("replay", "A10", "--seed", "3", "--sample", "77").rstrip("\n"))
        self.same_json(debias.estimate("A10", estimator="multilevel", error=0.01).to_dict(),
                       json.loads(program("run", "A10", "--estimator", "multilevel", "--error", "0.01", "--json")))
        values = debias.samples("furnace", 20000, estimator="roulette", pmf="geometric:r=0.5")
        out = subprocess.run([PROGRAM, "diagnose", "-", "--format", "f64", "--json"], input=values.tobytes(),
                             capture_output=True).stdout
        self.same_json(debias.diagnose(values).to_dict(), json.loads(out))

    def test_cpp(self):
        expected = {}
        for line in subprocess.run([SAME_BITS], capture_output=True, text=True, check=True).stdout.splitlines():
            name, *numbers = line.split()
            expected[name] = [float(x) for x in numbers]
        plan = {"samples": 30000, "seed": 11}
        mean = debias.function_of_mean(lambda x: 1 + x[:, 0] * x[:, 0], "reciprocal")
        comb = debias.function_of_integral(lambda x: 1 + x[:, 0] * x[:, 0], "log")
        jittered = debias.function_of_integral(lambda x: 1 + x[:, 0] * x[:, 0], "power:1.5", points="jittered")
        runs = {"scalar": (SCALAR, {**plan, "pmf": PMF}),
                "drawn": (SCALAR, {**plan, "pmf": PMF, "estimator": "single_term_outcome", "base_level": 1}),
                "sum": (SCALAR, {**plan, "pmf": PMF, "estimator": "independent_sum"}),
                "block": (SCALAR, {**plan, "pmf": PMF, "block": 8}),
                "vector": (VECTOR, {**plan, "pmf": PMF}),
                "mean": (mean, {**plan, "pmf": PMF}),
                "comb": (comb, {**plan, "pmf": "geometric:r=0.8"}),
                "jittered": (jittered, {**plan, "pmf": "geometric:r=0.8"}),
                "recipe": (SCALAR, {**plan, "estimator": "recipe"})}
        self.assertEqual(set(runs) | {"sample"}, set(expected))
        for name, (problem, options) in runs.items():
            with self.subTest(name), warnings.catch_warnings():
                warnings.simplefilter("ignore", debias.DebiasWarning)
                r = debias.estimate(problem, **options)
                got = [x for pair in zip(np.atleast_1d(r.mean), np.atleast_1d(r.standard_error)) for x in pair]
                self.assertEqual(got + [r.work], expected[name])
        self.assertEqual(debias.replay(SCALAR, 12345, seed=11, pmf=PMF)["value"], expected["sample"][0])

    @ignoring_doubts
    def test_integrals_over_a_cube_are_on_nets(self):
        def f(x):  # log of its integral over the cube: 3 log(e - 1)
            return np.exp(x.sum(axis=1))

        plan = {"samples": 4096, "seed": 22, "base_level": 4}
        nets = debias.estimate(debias.function_of_integral(f, "log", dimension=3), **plan)
        draws = debias.estimate(debias.function_of_mean(f, "log", dimension=3), **plan)
        truth = 3 * np.log(np.e - 1)
        self.assertLess(abs(nets.mean - truth), 4.5 * nets.standard_error)
        self.assertGreater(abs(nets.mean - 1.01 * truth), 4.5 * nets.standard_error)
        self.assertLess(2 * nets.standard_error, draws.standard_error)

    @ignoring_doubts
    def test_an_integrand_in_step_with_a_comb_is_warned_of(self):
        own = debias.function_of_integral(lambda x: 2 + 1.9 * np.cos(2 * np.pi * 1024 * x[:, 0]), "exp-minus")
        for options in ({}, {"block": 64}, {"estimator": "independent_sum"}, {"estimator": "recipe"}):
            with self.subTest(**options):
                r = debias.estimate(own, samples=1 << 13, seed=1, **options)
                self.assertIn("aliased_differences", [w.code for w in r.warnings])

    def test_samples_are_members_and_blocks_stand_beside_them(self):
        for problem in ("A10", SCALAR):
            result = debias.estimate(problem, samples=10_000, seed=4, pmf=PMF, block=64)
            self.assertEqual((result.samples, result.blocks, result.block), (10_048, 157, 64))
            self.assertIn("10048 in 157 blocks of 64, seed 4", str(result))
            self.assertEqual(result.to_dict()["blocks"], 157)
            values = debias.samples(problem, 10_048, seed=4, pmf=PMF, block=64)
            self.assertEqual(values.shape, (157,))  # a value a block
            np.testing.assert_allclose(values.mean(), result.mean, rtol=1e-12)
            part = debias.samples(problem, 640, seed=4, first=1280, pmf=PMF, block=64)
            np.testing.assert_array_equal(values[20:30], part)
            largest = result.largest[0]
            self.assertEqual(values[largest["index"] // 64], largest["value"])
            again = debias.replay(problem, int(largest["index"]) + 5, seed=4, pmf=PMF, block=64)
            self.assertEqual(again["value"], largest["value"])
            self.assertEqual((again["member"], again["first_of_block"]), (5, largest["index"]))
            for wrong in ({"n": 100}, {"n": 64, "first": 10}):
                with self.assertRaisesRegex(ValueError, "take a multiple of 64"):
                    debias.samples(problem, seed=4, pmf=PMF, block=64, **wrong)
        plain = debias.estimate("A10", samples=1000, pmf=PMF)
        self.assertEqual((plain.samples, plain.blocks, plain.block), (1000, 1000, 1))
        vectors = debias.samples(VECTOR, 640, seed=4, pmf=PMF, block=64)
        self.assertEqual(vectors.shape, (10, VECTOR.components))

    def test_samples_are_those_of_the_run(self):
        for problem in ("A10", SCALAR, VECTOR):
            values = debias.samples(problem, 5000, seed=4, pmf=PMF)
            result = debias.estimate(problem, samples=5000, seed=4, pmf=PMF)
            np.testing.assert_allclose(values.mean(axis=0), result.mean, rtol=1e-12)
            part = debias.samples(problem, 10, seed=4, first=4990, pmf=PMF)
            np.testing.assert_array_equal(values[-10:], part)
        replayed = debias.replay("A10", int(result.largest["index"][0]), seed=4, pmf=PMF)["value"]
        self.assertEqual(debias.samples("A10", 1, seed=4, first=int(result.largest["index"][0]), pmf=PMF)[0], replayed)

    def test_readme(self):
        readme = (Path(__file__).parents[2] / "README.md").read_text()
        code = re.search(r"```python\n(.*?)```", readme, re.DOTALL).group(1)
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(code, {})
        shown = re.search(r"^mean +([0-9.]+)\(", readme, re.MULTILINE).group(1)  # by the program of C++
        self.assertIn(f"mean          {shown}(", printed.getvalue())

    def test_normal_quantile(self):
        u = np.array([1e-300, 0.025, 0.5, 0.975])
        np.testing.assert_allclose(debias.normal_quantile(u), [-37.0471, -1.959964, 0, 1.959964], atol=1e-4)


class Results(unittest.TestCase):
    def test_result(self):
        r = debias.estimate("A10", samples=10000, confidence=0.9)
        self.assertEqual(pickle.loads(pickle.dumps(r)), r)
        self.assertIn("<td>mean</td>", r._repr_html_())
        self.assertLess(r.confidence_interval.low, r.mean)
        self.assertEqual(json.loads(r.to_json()), r.to_dict())
        self.assertEqual(r.levels.dtype["level"], np.int64)
        self.assertEqual(r.levels["count"].sum() if not r.levels["is_base"].any() else r.samples, r.samples)
        self.assertEqual((r.verdict, r.seed, r.samples), ("finite", 1, 10000))
        self.assertIsInstance(r.levels["probability"][-1], float)

    def test_vector(self):
        r = debias.estimate(VECTOR, samples=20000, pmf=PMF)
        self.assertEqual(r.mean.shape, (2,))
        self.assertTrue((abs(r.mean - [1 / 4, 1 / 8]) < 4.5 * r.standard_error).all())
        self.assertTrue((r.confidence_interval.low < r.confidence_interval.high).all())

    def test_warnings(self):
        with self.assertWarns(debias.InfiniteVarianceWarning):
            debias.estimate("furnace", estimator="roulette", pmf="geometric:r=0.5", samples=1e5)
        with warnings.catch_warnings():
            warnings.simplefilter("error", debias.DebiasWarning)
            with self.assertRaises(debias.InfiniteVarianceWarning):
                debias.estimate("furnace", estimator="roulette", pmf="geometric:r=0.5", samples=1e5)
            debias.estimate("A10", samples=1e5)

    def test_warnings_have_codes(self):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            result = debias.estimate("A10", samples=1)
        self.assertEqual([w.code for w in result.warnings], ["one_sample"])
        self.assertIn("no standard error", str(result.warnings[0]))
        self.assertEqual(str(result.warnings[0]), result.warnings[0].text)
        self.assertEqual(result.to_dict()["warnings"], [{"code": "one_sample", "text": result.warnings[0].text}])
        self.assertEqual([w.message for w in caught], result.warnings)
        self.assertEqual(pickle.loads(pickle.dumps(result.warnings)), result.warnings)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            debias.estimate("furnace", estimator="roulette", pmf="geometric:r=0.5", samples=1e5)
        self.assertIn("infinite_variance", [w.message.code for w in caught])
        self.assertEqual([w.code for w in debias.diagnose([1.0]).warnings], ["one_sample"])
        self.assertEqual(debias.diagnose([1.0, 2.0, 4.0]).warnings, [])
        survey = debias.survey("A10", levels=8, samples=1000)
        self.assertEqual([r.text for r in survey.remarks], [r["text"] for r in survey["remarks"]])
        self.assertTrue(all(r.code for r in survey.remarks))

    def test_no_pmf_is_no_typing_error(self):
        for problem, options, grade, decay, growth, word in (
                ("gbm-by-euler", {}, "declared", 1, 1, "falls like 2^(-"),
                ("black-scholes-gamma", {"estimator": "recipe"}, None, -1, 0, "grows like 2^(")):
            with self.assertRaisesRegex(debias.NoPmfError, "no PMF has") as caught:
                debias.estimate(problem, **options)
            e = caught.exception
            self.assertIsInstance(e, ValueError)
            self.assertIn(e.grade, [grade] if grade else ["shown", "likely"])
            self.assertEqual(e.variance_decay_error is None, grade == "declared")
            self.assertAlmostEqual(e.variance_decay, decay, delta=0.3)
            self.assertAlmostEqual(e.work_growth, growth, delta=0.05)
            self.assertEqual(e.decay, "geometric")
            self.assertIn("E D_k^2 " + word, e.reason)
            self.assertIn("coupling", e.help)
            again = pickle.loads(pickle.dumps(e))
            self.assertEqual((str(again), again.reason, again.grade), (str(e), e.reason, e.grade))
        with self.assertRaises(debias.NoPmfError) as caught:
            debias.samples("black-scholes-gamma", 10)
        self.assertIn("E D_k^2 grows like 2^(1 k)", caught.exception.reason)
        for options in {"pmf": "geometrc:r=0.5"}, {"samples": -1}, {"base_level": "x"}:
            with self.assertRaises(ValueError) as caught:
                debias.estimate("gbm-by-euler", **options)
            self.assertNotIsInstance(caught.exception, debias.NoPmfError)

    def test_reports_are_brief_unless_full(self):
        reports = [debias.estimate("A10", samples=20000), debias.estimate("A10", samples=20000, estimator="recipe"),
                   debias.estimate("A10", estimator="multilevel", error=0.05), debias.advise("A10", samples=20000),
                   debias.survey("A10", levels=6, samples=1000), debias.diagnose(np.arange(1, 2000) ** 0.5)]
        for report in reports:
            self.assertGreater(len(report.full().splitlines()), len(str(report).splitlines()))
        brief = str(reports[0])
        self.assertLessEqual(len(brief.splitlines()), 8)
        self.assertEqual(len(re.findall("(?m)^verdict ", brief)), 1)
        for word in "efficiency", "coupling", "upper tail", "largest":
            self.assertNotIn(word, brief)
            self.assertIn(word, reports[0].full())
        replay = debias.replay("A10", 7, seed=3)
        self.assertEqual(replay.full(), str(replay))

    def test_long_arrays_show_their_ends(self):
        def wide(n):
            return debias.levels(lambda k, u: u[:, :1] * np.arange(1, n + 1) if k == 0 else
                                 (u[:, :1] * np.arange(1, n + 1),) * 2, dimension=1, components=n, rates=(2, 1))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", debias.DebiasWarning)
            short, long = (debias.estimate(wide(n), samples=1000, pmf=PMF) for n in (16, 40))
        self.assertNotIn("...", repr(short))
        self.assertNotIn("left out", str(short))
        self.assertIn("(40 components)", repr(long))
        self.assertLess(len(repr(long)), 400)
        self.assertIn("(40 components)", repr(long.confidence_interval))
        self.assertNotIn("...", repr(short.confidence_interval))
        self.assertIn("... 34 of 40 components are left out ...", str(long))
        self.assertEqual(len(long.to_dict()["components"]), 40)

    def test_diagnose_takes_any_array(self):
        values = debias.samples("A10", 4000)
        expected = debias.diagnose(values)["mean"]
        self.assertEqual(debias.diagnose(np.repeat(values, 3)[::3])["mean"], expected)
        self.assertEqual(debias.diagnose(values.reshape(40, 100))["mean"], expected)
        self.assertEqual(debias.diagnose(np.array([1, 2, 3]))["mean"], 2)
        self.assertEqual(debias.diagnose(np.float32([1, 2, 3]))["values"], 3)
        self.assertEqual(debias.diagnose([1.0, np.nan]).verdict, "unknown")
        self.assertTrue(math.isnan(debias.diagnose([1.0, np.nan]).mean))

    def test_diagnose_takes_booleans(self):
        hits = np.random.default_rng(1).random(4000) < 0.3
        result = debias.diagnose(hits)
        self.assertEqual(result.mean, hits.mean())
        self.assertEqual(result.to_json(), debias.diagnose(hits.astype(float)).to_json())
        self.assertEqual(debias.diagnose([True, False, True, True]).mean, 0.75)
        self.assertEqual(debias.diagnose(np.array([[True, False]] * 50)[::5]).mean, 0.5)

    def test_diagnose_honours_masks(self):
        self.assertEqual(debias.diagnose(np.ma.array([1.0, 2.0, 1e9], mask=[0, 0, 1])).mean, 1.5)
        rng = np.random.default_rng(2)
        data, mask = rng.random((50, 40)), rng.random((50, 40)) < 0.2
        kept = data[~mask]
        for masked in (np.ma.array(data, mask=mask), np.ma.array(np.where(mask, np.nan, data), mask=mask),
                       np.ma.array(data.astype(">f8"), mask=mask), list(np.ma.array(data, mask=mask))):
            result = debias.diagnose(masked)
            self.assertEqual(result["values"], kept.size)
            self.assertAlmostEqual(result.mean, kept.mean(), delta=1e-15)
            self.assertEqual(result.warnings[-1].text, f"{mask.sum()} of 2000 values are masked or missing, the first is "
                             f"value {np.argmax(mask) + 1}: they are left out of everything here.")
            self.assertEqual(result.warnings[-1].code, "missing_values")
            self.assertIn(str(result.warnings[-1]), str(result))
            np.testing.assert_array_equal(data.ravel()[result.largest["index"]], result.largest["value"])
        strided = np.ma.array(np.arange(12.0), mask=[i % 4 == 0 for i in range(12)])[::2]
        self.assertEqual(debias.diagnose(strided).mean, (2 + 6 + 10) / 3)
        self.assertEqual(debias.diagnose([1, np.ma.masked, 3]).mean, 2)
        self.assertEqual(debias.diagnose([[1, np.ma.masked], [2, 6]]).mean, 3)
        self.assertEqual(debias.diagnose(np.ma.array([True, False, True], mask=[0, 1, 0])).mean, 1)
        unmasked = debias.diagnose(np.ma.array([1.0, 2.0, 4.0]))
        self.assertEqual(unmasked.to_json(), debias.diagnose([1.0, 2.0, 4.0]).to_json())
        with self.assertRaisesRegex(ValueError, "no value .all 3 are masked"):
            debias.diagnose(np.ma.masked_all(3))
        u = np.ma.array([0.025, 0.5, 7.0], mask=[0, 0, 1])
        self.assertEqual(debias.normal_quantile(u).mask.tolist(), [False, False, True])

    def test_diagnose_honours_missing_values_of_pandas(self):
        class Nullable:  # as pandas' Int64 answers
            class dtype:
                numpy_dtype = np.dtype(np.int64)

            def isna(self):
                return np.array([False, True, False])

            def to_numpy(self, dtype, na_value):
                return np.array([1, na_value, 3], dtype=dtype)

        self.assertEqual(debias.diagnose(Nullable()).mean, 2)
        try:
            import pandas as pd
        except ImportError:
            return
        for kind in ("Int64", "Float64", "boolean", "UInt8"):
            result = debias.diagnose(pd.Series([1, None, 1, 0], dtype=kind))
            self.assertEqual((result["values"], len(result.warnings)), (3, 1), kind)
            self.assertAlmostEqual(result.mean, 2 / 3)
        self.assertEqual(debias.diagnose(pd.Series([1, 0, 2])).mean, 1)
        self.assertTrue(math.isnan(debias.diagnose(pd.Series([1.0, None])).mean))  # a NaN is no mask
        for strange in (pd.Series(["a"]), pd.Series([pd.Timestamp(0)]), pd.Series([1, None], dtype=object)):
            with self.assertRaisesRegex(TypeError, "must be of real numbers"):
                debias.diagnose(strange)

    def test_diagnose_reads_values_as_they_are(self):
        for array, mean in ((np.array([2**53 - 1, 2**53 - 1]), 2.0**53 - 1),
                            (np.array([2**64 - 1] * 3, dtype=np.uint64), 2.0**64),
                            (np.array([100, 100, 100], dtype=np.int8), 100), (np.float16([60000] * 4), 60000),
                            (np.longdouble([1, 2, 3]), 2), (np.arange(24).reshape(2, 3, 4).T[::2, ::-1], 11),
                            (np.array([1, 3], dtype=">i2"), 2), (np.asfortranarray([[1.0, 2.0], [3.0, 6.0]]), 3)):
            self.assertEqual(debias.diagnose(array).mean, mean)
        frozen = np.array([1.0, 2.0, 6.0])
        frozen.flags.writeable = False
        self.assertEqual(debias.diagnose(frozen).mean, 3)
        self.assertEqual(debias.diagnose(np.float64(7)).mean, 7)
        for strange in (np.array([1j]), np.array(["1"]), np.array([1, None]), np.array([2**70]), np.array([{}]),
                        np.array(["2020-01-01"], dtype="M8[D]"), np.array([3], dtype="m8[s]"),
                        np.zeros(2, dtype=[("x", float)]), np.ma.zeros(2, dtype=[("x", float)]), iter([1.0])):
            with self.assertRaisesRegex(TypeError, "must be of real numbers"):
                debias.diagnose(strange)

    @ignoring_doubts
    def test_seed_none_is_a_fresh_one_that_the_result_holds(self):
        runs = [debias.estimate("A10", samples=2000, seed=None) for _ in range(3)]
        self.assertEqual(len({r.seed for r in runs} | {1}), 4)
        self.assertEqual(len({r.mean for r in runs}), 3)
        for r in runs:
            self.assertEqual(debias.estimate("A10", samples=2000, seed=r.seed).mean, r.mean)
        self.assertEqual(debias.estimate("A10", samples=2000).seed, 1)
        self.assertNotIn(debias.samples("A10", 2, seed="random").seed, ("random", 1, runs[0].seed))
        # every function that takes a seed
        for f in (lambda **seed: debias.survey("A10", levels=3, samples=500, **seed),
                  lambda **seed: debias.tradeoff("A10", points=2, samples=500, **seed),
                  lambda **seed: debias.advise("A10", **seed),
                  lambda **seed: debias.estimate("A10", estimator="multilevel", error=0.1, **seed),
                  lambda **seed: debias.estimate(SCALAR, samples=500, estimator="recipe", **seed),
                  lambda **seed: debias.samples("A10", 100, **seed),
                  lambda **seed: debias.samples(VECTOR, 100, pmf=PMF, **seed)):
            fresh, other, again = f(seed=None), f(seed=None), f()
            self.assertEqual(len({fresh.seed, other.seed, 1}), 3)
            self.assertEqual(again.seed, 1)
            same = f(seed=fresh.seed)
            if isinstance(fresh, np.ndarray):
                np.testing.assert_array_equal(fresh, same)
                self.assertEqual(pickle.loads(pickle.dumps(fresh)).seed, fresh.seed)
                self.assertFalse((fresh == other).all())
                self.assertIs(type(fresh.mean()), np.float64)
                self.assertIs(type(2 * fresh), np.ndarray)
                self.assertEqual(fresh[1:].seed, fresh.seed)
            else:
                self.assertEqual(without_times(fresh.to_dict()), without_times(same.to_dict()))
        r = runs[0]
        index = int(r.largest["index"][0])
        self.assertEqual(debias.replay("A10", index, seed=r.seed)["value"], r.largest["value"][0])

    @ignoring_doubts
    def test_seeds_of_numpy(self):
        def seed_of(seed):
            return debias.estimate("A10", samples=100, seed=seed).seed

        a, b = np.random.default_rng(7), np.random.default_rng(7)
        taken = [seed_of(a), seed_of(a)]
        self.assertEqual(taken, [int(x) for x in b.integers(2**64, size=2, dtype=np.uint64)])
        self.assertEqual(a.random(), b.random())
        sequence = np.random.SeedSequence(5)
        self.assertEqual(seed_of(sequence), int(np.random.SeedSequence(5).generate_state(1, np.uint64)[0]))
        self.assertEqual(seed_of(sequence), seed_of(sequence))
        self.assertEqual(len({seed_of(child) for child in sequence.spawn(4)}), 4)
        for same in (3, np.int64(3), np.uint8(3), np.array(3), "3"):
            self.assertEqual(seed_of(same), 3)
        self.assertEqual(seed_of(2**64 - 1), 2**64 - 1)
        self.assertEqual(seed_of(0), 0)

    def test_progress(self):
        seen = []
        debias.estimate("E05", samples=3e5, progress=lambda done, total: seen.append((done, total)))
        self.assertTrue(seen and seen[-1][1] == 3e5, seen)
        debias.estimate("A10", samples=1000, progress=True)


class OwnProblems(unittest.TestCase):
    def test_reciprocal_of_integral(self):
        own = debias.function_of_integral(lambda x: 4 * (1 + np.sin(2 * np.pi * x[:, 0])), "reciprocal", lowest_base=1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", debias.DebiasWarning)
            r = debias.estimate(own, samples=1 << 16, pmf="geometric:r=0.8")
        self.assertLess(abs(r.mean - 0.25), 4.5 * r.standard_error + 1e-12)

    def test_sde(self):
        def differences(level, u):  # Milstein paths of a stock, 2^level steps
            def end(dw, h):
                x = np.full(len(dw), 100.0)
                for w in dw.T:
                    x = x + 0.05 * x * h + 0.2 * x * w + 0.02 * x * (w * w - h)
                return x

            h = 1 / u.shape[1]
            dw = debias.normal_quantile(u) * np.sqrt(h)
            fine = end(dw, h)
            return fine if level == 0 else (fine, end(dw[:, ::2] + dw[:, 1::2], 2 * h))

        own = debias.levels(differences, dimension=lambda k: 2**k, rates=(2, 1))
        r = debias.estimate(own, samples=1 << 16)
        c = debias.estimate("mean-of-gbm", samples=1 << 16)
        self.assertLess(abs(r.mean - c["truth"]), 4.5 * r.standard_error)
        self.assertAlmostEqual(r.mean, c.mean, delta=1e-10)  # the same draws, in other operations
        self.assertEqual(debias.survey(own, levels=4, samples=2000)["pmf_exists"], "yes")

    def test_block_by_block(self):
        calls = []

        def differences(level, u):
            calls.append((level, len(u)))
            return powers(square)(level, u)

        own = debias.levels(differences, dimension=lambda k: 2**k, rates=(2, 1))
        debias.estimate(own, samples=1 << 15, pmf=PMF)
        self.assertLessEqual(len(calls), 20)  # one block
        self.assertEqual(sum(n for level, n in calls if level > 0), 1 << 15)

    def test_recipe_and_advice(self):
        without_rates = debias.levels(powers(square), dimension=lambda k: 2**k)
        r = debias.estimate(without_rates, samples=1 << 16)
        self.assertIsNotNone(r["recipe"])
        self.assertGreaterEqual(r.pilot_work, r["recipe"]["pilot_work"])
        self.assertGreater(r.work, r.pilot_work)
        self.assertGreater(r.seconds, r.pilot_seconds)
        self.assertIn("by the pilot", str(r))
        self.assertEqual(debias.estimate(SCALAR, samples=1000).pilot_work, 0)
        self.assertGreater(debias.estimate(SCALAR, estimator="multilevel", error=0.1).pilot_work, 0)
        self.assertLess(abs(r.mean - 0.25), 4.5 * r.standard_error)
        self.assertEqual(debias.advise(without_rates)["pmf_exists"], "yes")
        alone = debias.levels(lambda k, u: powers(square)(k, u) if k == 0 else
                              np.subtract(*powers(square)(k, u)), dimension=lambda k: 2**k, rates=(2, 1))
        self.assertEqual(debias.estimate(alone, samples=10000, pmf=PMF).mean,
                         debias.estimate(SCALAR, samples=10000, pmf=PMF).mean)
        with self.assertRaisesRegex(ValueError, r"return \(fine, coarse\)"):
            debias.survey(alone)

    def test_points_of_nets(self):
        a = debias.advise("E02", error=0.01, seed=3, points="nets")
        self.assertEqual((a["points"], a["base"]), ("nets", "one_outcome"))
        self.assertIn("as asked", a["why_points"])
        r = debias.estimate("E02", error=0.01, seed=3, estimator="recipe", points="nets")
        same = debias.estimate("E02", samples=r.samples, seed=3, estimator="single_term_outcome", pmf=a["pmf"],
                               base_level=a["base_level"], block=a["block"], points=a["points"])
        self.assertEqual(same.mean, r.mean)
        self.assertEqual(same["points"], "nets")
        self.assertEqual(debias.estimate("E02", samples=20000, estimator="recipe", points="plain")["points"], "plain")
        # A level of one's own: its uniforms are the points.
        own = debias.levels(powers(square), dimension=lambda k: 2**k, rates=(2, 1))
        options = {"seed": 5, "estimator": "single_term_outcome", "pmf": "dyadic:6,4,2;theta=1.25", "points": "nets"}
        r = debias.estimate(own, samples=85 * 64, **options)
        self.assertEqual((r.samples, r.blocks, r.block), (85 * 64, 64, 85))
        self.assertLess(abs(r.mean - 0.25), 4.5 * r.standard_error)
        value = debias.samples(own, 85, **options)
        self.assertEqual(debias.replay(own, 3, **options)["value"], value[0])
        with self.assertRaisesRegex(ValueError, "^points = 'net' .*did you mean 'nets'"):
            debias.estimate("E02", points="net")


class Plots(unittest.TestCase):
    def test_each_takes_and_returns_axes(self):
        try:
            import matplotlib
        except ImportError:
            self.skipTest("no matplotlib")
        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        import debias.plot as plot

        values = debias.samples("A10", 3000)
        runs = {"a": [debias.estimate("A10", samples=n) for n in (1000, 4000)], "b": [(1, 0.1), (2, 0.07)]}
        image = np.ones((4, 5))
        pilot = chains.advise(Chains.SQUARE, chains=100)
        times = chains.meeting_times(Chains.SQUARE, 200)
        _, axes = plt.subplots(3, 3)
        for ax, draw in zip(axes.flat, (
                lambda ax: plot.running_mean(values, truth=1, ax=ax),
                lambda ax: plot.running_mean(debias.diagnose(values), ax=ax),
                lambda ax: plot.tradeoff(debias.tradeoff("A10", points=3, samples=2000), ax=ax),
                lambda ax: plot.speed_against_error(runs, ax=ax),
                lambda ax: plot.tails(values, ax=ax),
                lambda ax: plot.error_map(image + 0.1, image, standard_error=0 * image, ax=ax),
                lambda ax: plot.meeting_times(times, ax=ax),
                lambda ax: plot.meeting_times(pilot, ax=ax),
                lambda ax: plot.distance(pilot, ax=ax))):
            self.assertIs(draw(ax), ax)
            self.assertTrue(ax.get_xlabel() and ax.get_ylabel())
        for problem in ("D03", "A10"):  # polynomial and geometric
            self.assertEqual(plot.levels(debias.survey(problem, levels=5, samples=1000)).shape, (2, 2))
        plot.tails(np.ones(100))  # no tail at all
        masked = np.ma.array(np.append(values, 1e9), mask=[False] * len(values) + [True])
        x = [plot.tails(v).lines[0].get_xdata() for v in (values, masked)]
        np.testing.assert_array_equal(*x)
        pixels = np.ma.array([[1.0, 2.0], [3.0, 1e9]], mask=[[0, 0], [0, 1]])
        shown = plot.error_map(pixels, np.ones((2, 2))).images[0].get_array()
        self.assertEqual(np.isfinite(np.ma.filled(shown, np.nan)).sum(), 3)
        plt.gcf().canvas.draw()
        plt.close("all")


def normal_density(x):
    return -0.5 * (x**2).sum(axis=1)


def wide_start(u):
    return 3 * debias.normal_quantile(u)


def second_moment(x):
    return x[:, 0] ** 2


def ladder(x, u):
    """A walk on 0 ... 4, up with .6 and down with .3: its invariant law is proportional to 2^x."""
    return np.where(u < 0.6, np.minimum(4, x + 1), np.where(u < 0.9, np.maximum(0, x - 1), x))


LADDER = chains.kernel(ladder, lambda x, y, u: (ladder(x, u), ladder(y, u)), uniforms=1)
LADDER_CUBE = (2 * 1 + 4 * 8 + 8 * 27 + 16 * 64) / 31


def cube(x):
    return x[:, 0] ** 3.0


class Chains(unittest.TestCase):
    WALK = chains.random_walk(normal_density, 2.4)
    SQUARE = chains.coupled_chain(WALK, wide_start, second_moment, burn_in=20, length=100, lag=20, truth=1.0)

    def unbiased(self, result, truth, limit=4.5):
        self.assertTrue((np.abs(result.mean - truth) < limit * result.standard_error).all(),
                        f"{result.mean} is not {truth} by {result.standard_error}")

    @staticmethod
    def by_definition(options, seed, index, weight=0):
        """H of one sample of the ladder by the telescoping sums themselves, mean of H_k ... H_m; `weight`: a slip."""
        k, m, lag = options["burn_in"], options["length"], options["lag"]
        numbers = debias._debias.streams(seed, index, 1)
        draw = lambda: float(numbers.uniforms([0], 1)[0, 0])  # noqa: E731
        step = lambda x, u: float(ladder(np.float64(x), u))  # noqa: E731
        x, y = [0.0], [0.0]
        for _ in range(lag):
            x.append(step(x[-1], draw()))
        while x[-1] != y[-1]:
            u = draw()
            x.append(step(x[-1], u))
            y.append(step(y[-1], u))
        meeting = len(x) - 1
        while len(x) <= m:
            x.append(step(x[-1], draw()))
        total = 0.0
        for start in range(k, m + 1):
            total += x[start] ** 3
            for t in range(start + lag, meeting, lag):
                total += (1 + weight) * (x[t] ** 3 - y[t - lag] ** 3)
        return total / (m - k + 1)

    def test_a_sample_is_the_mean_of_the_telescoping_sums(self):
        for options in ({}, {"burn_in": 1, "length": 1}, {"length": 5}, {"burn_in": 3, "length": 4, "lag": 3},
                        {"burn_in": 2, "length": 9, "lag": 2}, {"lag": 4}, {"length": 1, "lag": 5}):
            with self.subTest(**options):
                chain = chains.coupled_chain(LADDER, [0], cube, **options)
                values = debias.samples(chain, 60, seed=5)
                expected = [self.by_definition(chain.options, 5, i) for i in range(60)]
                np.testing.assert_allclose(values, expected, rtol=1e-12)
                wrong = [self.by_definition(chain.options, 5, i, weight=1) for i in range(60)]
                self.assertGreater(np.abs(values - wrong).max(), 0.1)

    @ignoring_doubts
    def test_unbiased_and_a_wrong_coupling_is_not(self):
        for options in ({}, {"length": 5}, {"burn_in": 3, "length": 4, "lag": 3}):
            with self.subTest(**options):
                self.unbiased(debias.estimate(chains.coupled_chain(LADDER, [0], cube, **options), samples=20000, seed=3),
                              LADDER_CUBE)
        # The second chain climbs less often than a step would let it.
        slow = chains.kernel(ladder, lambda x, y, u: (ladder(x, u), np.where(x == y, ladder(y, u), ladder(y, 0.05 + 0.95 * u))),
                             uniforms=1)
        result = debias.estimate(chains.coupled_chain(slow, [0], cube, length=2), samples=20000, seed=3)
        self.assertGreater(abs(result.mean - LADDER_CUBE), 4.5 * result.standard_error)
        self.assertFalse(chains.check_coupling(slow, np.arange(5.0)).passed)
        self.assertTrue(chains.check_coupling(LADDER, np.arange(5.0)).passed)
        # Two uniforms where one decides for both: chains that have met come apart.
        apart = chains.kernel(lambda x, u: ladder(x, u[:, :1]), lambda x, y, u: (ladder(x, u[:, :1]), ladder(y, u[:, 1:])),
                              uniforms=2)
        self.assertGreater(chains.check_coupling(apart, np.arange(5.0)).parted, 0)

    @ignoring_doubts
    def test_kernels_of_the_house(self):
        slope = lambda x: -x  # noqa: E731
        walk, small = (chains.random_walk(normal_density, h) for h in (1.7, 0.5))
        for kernel in (walk, chains.mala(normal_density, slope, 1.2), chains.mixture([2, 1], walk, small),
                       chains.mixture([0.8, 0.2], chains.hamiltonian(normal_density, slope, 0.5, 3), small),
                       chains.mixture([1, 1], walk, chains.mixture([1, 2], small, chains.mala(normal_density, slope, 1.0)))):
            with self.subTest(kernel.name):
                check = chains.check_coupling(kernel, [[-1.0, 0.3], [0.0, 0.0], [1.0, -0.4]], draws=1 << 12)
                self.assertTrue(check.passed, check)
                both = chains.coupled_chain(kernel, lambda u: 2 * debias.normal_quantile(u), lambda x: np.stack(
                    (x[:, 0] ** 2, x[:, 0] * x[:, 1]), axis=1), dimension=2, components=2, burn_in=5, length=50, lag=5)
                self.unbiased(debias.estimate(both, samples=1000, seed=3), [1, 0])
        wrong = chains.random_walk(lambda x: 0.9 * normal_density(x), 2.4)
        result = debias.estimate(chains.coupled_chain(wrong, wide_start, second_moment, burn_in=20, length=200, lag=20),
                                 samples=2000, seed=3)
        self.assertGreater(abs(result.mean - 1), 4.5 * result.standard_error)

    def test_a_sample_is_the_same_in_any_company(self):
        values = debias.samples(self.SQUARE, 300, seed=7)
        np.testing.assert_array_equal(debias.samples(self.SQUARE, 50, seed=7, first=120), values[120:170])
        result = debias.estimate(self.SQUARE, samples=300, seed=7)
        np.testing.assert_allclose(result.mean, values.mean(), rtol=1e-13)
        with self.assertRaisesRegex(ValueError, "threads = 3 .Python functions answer on the thread that called"):
            debias.estimate(self.SQUARE, samples=300, threads=3)
        for index in (0, 123, 299):
            replay = debias.replay(self.SQUARE, index, seed=7)
            self.assertEqual(replay["value"], values[index])
        times = chains.meeting_times(self.SQUARE, 300, seed=7)
        self.assertEqual(debias.replay(self.SQUARE, 123, seed=7)["level"], times[123])
        np.testing.assert_array_equal(chains.meeting_times(self.SQUARE, 20, seed=7, first=100), times[100:120])
        self.assertEqual(result.work, (np.maximum(times, 100) + times - 20).sum())
        self.assertEqual(result.verdict, "finite")
        self.assertEqual(result.grade, "likely")
        self.assertIn("meeting times have a light tail", result.full())
        self.assertLess(abs(debias.estimate(self.SQUARE, error=0.02)["z"]), 4.5)

    def test_advice(self):
        advice = chains.advise(self.SQUARE, chains=400)
        options = advice.options
        self.assertEqual(options["length"], 20 * options["burn_in"])
        self.assertEqual(advice.tail, "light")
        self.assertTrue(0.9 < advice.inefficiency < 1.35)
        self.assertEqual(advice.meetings["chains"].sum(), 400)
        self.assertEqual(json.loads(advice.to_json()), advice.to_dict())
        self.assertIn("inefficiency", str(advice))
        self.assertEqual(chains.advise(self.SQUARE, chains=400).to_dict(), advice.to_dict())
        self.assertNotEqual(chains.advise(self.SQUARE, chains=400, seed=2).to_dict(), advice.to_dict())
        self.unbiased(debias.estimate(self.SQUARE.with_options(**options), samples=1000), 1)
        # Two states: the distance at t is 3/8 ... 5/8 times 0.92^t.
        a, b = 0.03, 0.05
        flip = lambda x, u: np.where(x == 0, u < a, u < 1 - b).astype(float)  # noqa: E731
        two = chains.coupled_chain(chains.kernel(flip, lambda x, y, u: (flip(x, u), flip(y, u)), uniforms=1), [1.0],
                                   lambda x: x[:, 0])
        rows = chains.advise(two, chains=2000).distance
        exact = b / (a + b) * (1 - a - b) ** rows["time"]
        error = 4.5 * np.sqrt(np.maximum(rows["bound"], 1e-3) / 2000)
        self.assertTrue((rows["bound"] > exact - error).all())
        self.assertTrue((rows["bound"] < 1.5 * exact + error).all())
        self.assertTrue(30 < chains.advise(two, chains=2000).burn_in_for(0.01) < 100)

    @ignoring_doubts
    def test_what_does_not_meet_is_called(self):
        two = chains.random_walk(lambda x: -0.5 * (np.abs(x[:, 0]) - 3.5) ** 2, 0.7)
        modes = chains.coupled_chain(two, lambda u: np.where(u < 0.02, 3.5, -3.5), second_moment, limit=2000)
        advice = chains.advise(modes, chains=200, limit=2000)
        self.assertFalse(advice.available)
        self.assertNotEqual(advice.tail, "light")
        with self.assertRaisesRegex(ValueError, "more than 1 % of the chains had not met"):
            advice.options
        result = debias.estimate(modes, samples=500)
        self.assertNotEqual(result.verdict, "finite")
        self.assertIn("truncated", result.full())
        self.assertGreater(chains.meeting_times(modes, 500).max(), 2000)
        never = chains.kernel(lambda x, u: x, lambda x, y, u: (x, y), uniforms=1)
        with warnings.catch_warnings():
            warnings.simplefilter("error", debias.DebiasWarning)
            with self.assertRaisesRegex(debias.DebiasWarning, "3 of 3 chains have not met after 65536 steps"):
                debias.estimate(chains.coupled_chain(never, wide_start, second_moment), samples=3)

    def test_bad_input(self):
        def raises(kind, pattern, called, *arguments, **options):
            with self.subTest(pattern), self.assertRaisesRegex(kind, pattern):
                called(*arguments, **options)

        nan = float("nan")
        one = lambda kernel=self.WALK, start=0.5, f=second_moment, **options: debias.estimate(  # noqa: E731
            chains.coupled_chain(kernel, start, f, **options), samples=10)
        raises(ValueError, "burn_in = -1", one, burn_in=-1)
        raises(ValueError, "length = 4 .must be at least burn_in = 9", one, burn_in=9, length=4)
        raises(ValueError, "lag = 0", one, lag=0)
        raises(ValueError, "limit = 5 .must be at least length = 20", one, length=20, limit=5)
        raises(TypeError, "float", one, burn_in=1.5)
        raises(ValueError, "step = 0.0", chains.random_walk, normal_density, 0.0)
        raises(ValueError, "step = nan", chains.mala, normal_density, lambda x: -x, nan)
        raises(TypeError, "log_density: int", chains.random_walk, 3, 1.0)
        raises(TypeError, "kernel: function", one, ladder)
        raises(TypeError, "f: int", one, f=3)
        raises(TypeError, "start: no point", one, start="a")
        raises(ValueError, "log density is nan at", one, chains.random_walk(lambda x: x[:, 0] * nan, 1.0))
        raises(ValueError, "starts at .* where the density is zero", one,
               chains.random_walk(lambda x: np.where(x[:, 0] > 1, 0.0, -np.inf), 1.0))
        raises(ValueError, r"log_density: returned shape \(10, 1\)", one, chains.random_walk(lambda x: -x * x, 1.0))
        raises(ValueError, "gradient: returned shape", one, chains.mala(normal_density, lambda x: x[:, 0], 1.0))
        raises(ValueError, "gradient is not finite", one, chains.mala(normal_density, lambda x: x * nan, 1.0))
        raises(ValueError, "f: returned shape", one, f=lambda x: x)
        raises(ValueError, "f: returned nan", one, f=lambda x: x[:, 0] * nan)
        raises(ValueError, "moved a chain to .*inf", one,
               chains.kernel(lambda x, u: x + np.inf, lambda x, y, u: (x, y), uniforms=1))
        raises(TypeError, "coupled_step: returned ndarray", one,
               chains.kernel(lambda x, u: x + 1, lambda x, y, u: x, uniforms=1))
        raises(ValueError, "weights", chains.mixture, [0.5, 0.0], self.WALK, self.WALK)
        raises(ValueError, "2 kernels", chains.mixture, [1.0], self.WALK, self.WALK)
        raises(ValueError, "start: returned shape", one, start=lambda u: u[:, 0])
        raises(TypeError, "coupled chains .have no levels", debias.survey, self.SQUARE)
        raises(TypeError, "coupled chains .have no levels", debias.advise, self.SQUARE)
        raises(ValueError, "single_term.*does not apply", debias.estimate, self.SQUARE, estimator="single_term",
               pmf="geometric:r=0.5")
        raises(ValueError, "has no PMF", debias.estimate, self.SQUARE, pmf="geometric:r=0.5")
        raises(TypeError, "chain: str", chains.advise, "K01")
        raises(ValueError, "chains = 99", chains.advise, self.SQUARE, chains=99)
        raises(ValueError, "states of shape", chains.check_coupling, self.WALK, [1.0])

        class Own(Exception):
            pass

        def fails(x):
            raise Own("mine")

        raises(Own, "mine", one, chains.random_walk(fails, 1.0))

    def test_the_examples_of_the_documentation(self):
        for module in (chains,):
            failed, tried = doctest.testmod(module)
            self.assertEqual(failed, 0)
            self.assertGreater(tried, 20)


class BadInput(unittest.TestCase):
    def raises(self, kind, pattern, f, *arguments, **options):
        with self.subTest(pattern), self.assertRaisesRegex(kind, pattern):
            f(*arguments, **options)

    def test_arguments(self):
        e = debias.estimate
        self.raises(ValueError, "is not a problem.*did you mean", e, "A1O")
        self.raises(TypeError, "problem: int", e, 7)
        self.raises(TypeError, "samples: list", e, "A10", samples=[1])
        self.raises(TypeError, "samples: bool", e, "A10", samples=True)
        self.raises(TypeError, "positional", e, "A10", 1000)
        self.raises(ValueError, "samples = '-1'", e, "A10", samples=-1)
        self.raises(ValueError, "samples", e, "A10", samples=2.5)
        self.raises(ValueError, "samples", e, "A10", samples=10**30)
        self.raises(ValueError, "error", e, "A10", error=float("nan"))
        self.raises(ValueError, "^error, relative_error, seconds: more than one", e, "A10", error=1, seconds=1)
        self.raises(ValueError, "seed", e, "A10", seed=-3)
        self.raises(ValueError, "PMF.*did you mean", e, "A10", pmf="geometrc:r=0.5")
        self.raises(ValueError, "base_level", e, "A10", base_level="x")
        self.raises(ValueError, "no PMF|PMF", e, "black-scholes-gamma", estimator="recipe")
        self.raises(ValueError, "^estimator = 'recipe'", debias.samples, "A10", 3, estimator="recipe")
        self.raises(ValueError, "^pmf = 'zeta:s=2' .a recipe chooses it", e, "A10", estimator="recipe", pmf="zeta:s=2")
        without_rates = debias.levels(powers(square), dimension=lambda k: 2**k)
        self.raises(ValueError, "declares no rates", e, without_rates, estimator="independent_sum")
        self.raises(ValueError, "declares no rates", debias.samples, without_rates, 3)
        self.raises(TypeError, "progress", e, "A10", progress=3)
        self.raises(ValueError, "n = 0", debias.samples, "A10", 0)
        self.raises(TypeError, "n: float", debias.samples, "A10", 10.0)
        self.raises(TypeError, "seed", debias.replay, "A10", 3)
        self.raises(TypeError, "complex", debias.diagnose, np.array([1j]))
        self.raises(ValueError, "no value", debias.diagnose, [])
        self.raises(TypeError, "U1|object", debias.diagnose, ["a"])

    @ignoring_doubts
    def test_names_of_0_1_say_what_they_are_now(self):
        for f, *arguments in ((debias.estimate, "A10"), (debias.samples, "A10", 3), (debias.replay, "A10", 3),
                              (debias.survey, "A10"), (debias.tradeoff, "A10"), (debias.advise, "A10")):
            self.raises(ValueError, "^`law=` is `pmf=` since 0.2$", f, *arguments, law="zeta:s=2")
            self.raises(ValueError, "^`law='auto'` is `estimator='recipe'` since 0.2$", f, *arguments, law="auto")
            self.raises(ValueError, "^`time=` is `seconds=` since 0.2$", f, *arguments, time=1)
            self.raises(TypeError, "unexpected keyword argument 'laws'", f, *arguments, laws=1)
        self.raises(ValueError, "^`pmf='auto'` is `estimator='recipe'` since 0.2$", debias.estimate, "A10", pmf="auto")
        self.raises(ValueError, r"^`laws\(\)` is `pmfs\(\)` since 0.2$", lambda: debias.laws())
        self.raises(ValueError, r"^`recipe\(\)` is `advise\(\)` since 0.2$", lambda: debias.recipe("A10"))
        self.raises(AttributeError, "no attribute 'lows'", lambda: debias.lows())
        result = debias.estimate("A10", samples=100)
        self.raises(ValueError, r"`\['law'\]` is `\['pmf'\]` since 0.2", lambda: result["law"])
        self.raises(KeyError, "^'lows'$", lambda: result["lows"])
        self.raises(ValueError, "pmf_exists", lambda: debias.survey("A10", levels=3, samples=100)["law_exists"])

    def test_seeds(self):
        takers = {"estimate": (debias.estimate, "A10"), "samples": (debias.samples, "A10", 3),
                  "survey": (debias.survey, "A10"), "tradeoff": (debias.tradeoff, "A10"),
                  "advise": (debias.advise, "A10"), "replay": (debias.replay, "A10", 3)}
        for name, (f, *arguments) in takers.items():
            for seed, kind in ((1.0, "float"), (np.float64(2), "float64"), (True, "bool"), (np.True_, "bool_?"),
                               ([1], "list"), (np.array([1, 2]), "ndarray"), (1j, "complex"), (b"1", "bytes"),
                               (np.random.RandomState(1), "RandomState"), (np.random, "module")):
                self.raises(TypeError, f"^seed: {kind} .must be a whole number", f, *arguments, seed=seed)
            self.raises(ValueError, "^seed = -1 .must lie in 0", f, *arguments, seed=-1)
            self.raises(ValueError, "^seed = 18446744073709551616 .must lie in 0", f, *arguments, seed=2**64)
            self.raises(ValueError, "^seed = 'two'", f, *arguments, seed="two")
        self.raises(ValueError, "seed = 'random'", debias.replay, "A10", 3, seed="random")
        for seed in (None, np.random.default_rng(1)):
            self.raises(TypeError, "^seed: .*give the `seed` of its result", debias.replay, "A10", 3, seed=seed)
        self.raises(AttributeError, "Diagnosis draws nothing", lambda: debias.diagnose([1.0, 2.0]).seed)

    def test_masks_are_no_answers(self):
        def masked(values):
            return np.ma.array(values, mask=np.arange(values.size).reshape(values.shape) == 3)

        def run(f, **options):
            debias.estimate(debias.levels(f, **{"dimension": 1, "rates": (2, 1), **options}), samples=5000, pmf=PMF)

        sentence = "returned 1 masked or missing values.*would be a bias"
        self.raises(ValueError, "differences: " + sentence, run, lambda k, u: masked(u[:, 0]))
        self.raises(ValueError, sentence, run, lambda k, u: u[:, 0] if k == 0 else (masked(u[:, 0]), u[:, 0]))
        self.raises(ValueError, sentence, run, lambda k, u: u[:, 0] if k == 0 else (u[:, 0], masked(u[:, 0])))
        self.raises(ValueError, sentence, run, lambda k, u: masked(np.repeat(u, 2, axis=1)), components=2)
        self.raises(ValueError, sentence, run, lambda k, u: list(masked(np.repeat(u, 2, axis=1))), components=2)
        self.raises(ValueError, "integrand: " + sentence, debias.estimate,
                    debias.function_of_mean(lambda x: masked(1 + x[:, 0]), "log"), samples=5000)
        self.raises(ValueError, sentence, debias.survey,
                    debias.function_of_integral(lambda x: masked(1 + x[:, 0]), "log"))
        whole = debias.function_of_mean(lambda x: np.ma.array(1 + x[:, 0]), "log")
        plain = debias.function_of_mean(lambda x: 1 + x[:, 0], "log")
        np.testing.assert_array_equal(debias.samples(whole, 500), debias.samples(plain, 500))
        for kind, answer in (("object", lambda u: u[:, 0].astype(object)),
                             ("datetime64", lambda u: u[:, 0].astype("M8[s]")),
                             ("timedelta64", lambda u: u[:, 0].astype("m8[s]")),
                             ("complex128", lambda u: u[:, 0] + 0j), ("U", lambda u: u[:, 0].astype(str))):
            self.raises(TypeError, f"returned .*{kind}", run, lambda k, u: answer(u))
        with np.errstate(over="ignore"):
            self.raises(ValueError, "returned inf", run, lambda k, u: (u[:, 0] * 1e9).astype(np.float16))

        def frozen(u):  # read-only, of another byte order and not contiguous
            y = np.repeat(u[:, 0], 3).astype(">f8")[::3]
            y.flags.writeable = False
            return y

        def values(f):
            own = debias.levels(lambda k, u: f(u) if k == 0 else (f(u), f(u)), dimension=1, rates=(2, 1))
            return debias.samples(own, 100, pmf=PMF)

        np.testing.assert_array_equal(values(frozen), values(lambda u: u[:, 0]))

    def test_own_problems(self):
        def run(f, **options):
            debias.estimate(debias.levels(f, **{"dimension": 1, "rates": (2, 1), **options}), samples=5000, pmf=PMF)

        def mean(f, g="log", **options):
            debias.estimate(debias.function_of_mean(f, g, **options), samples=5000)

        self.raises(ValueError, r"returned shape \(3,\) at level", run, lambda k, u: np.zeros(3))
        self.raises(ValueError, r"returned shape \(\d+, 1\)", run, lambda k, u: u)
        self.raises(ValueError, r"returned shape", run, lambda k, u: u[:, 0], components=2)
        self.raises(TypeError, "returned NoneType", run, lambda k, u: None)
        self.raises(TypeError, "returned complex128", run, lambda k, u: u[:, 0] * 1j)
        self.raises(ValueError, "a tuple of 3", run, lambda k, u: u[:, 0] if k == 0 else (u[:, 0],) * 3)
        self.raises(ValueError, "tuple at level 0", run, lambda k, u: (u[:, 0], u[:, 0]))
        self.raises(ValueError, "returned nan at level", run, lambda k, u: np.where(u[:, 0] < 0.1, np.nan, 1))
        self.raises(ValueError, "returned inf", mean, lambda x: np.full(len(x), np.inf))
        self.raises(ValueError, r"integrand: returned shape \(\)", mean, lambda x: 1.0)
        self.raises(ZeroDivisionError, "division", run, lambda k, u: 1 / 0)
        self.raises(TypeError, "positional", run, lambda k: 1)
        self.raises(ValueError, "dimension = 0", run, powers(square), dimension=0)
        self.raises(TypeError, "dimension: str", run, powers(square), dimension=lambda k: "2")
        self.raises(ValueError, "work = -1", run, powers(square), work=-1)
        self.raises(ValueError, r"2\^24 uniforms", run, lambda k, u: u[:, 0], dimension=lambda k: 10**30)
        self.raises(ValueError, "rates", run, powers(square), rates=(-1, 1))
        self.raises(ValueError, "g = 'logarithm'.*it is one of exp", mean, square, "logarithm")
        self.raises(ValueError, "g = 'power'.*parameter", mean, square, "power")
        self.raises(TypeError, "integrand: int", mean, 3)
        self.raises(TypeError, "differences: str", run, "f")
        self.raises(ValueError, "points", debias.function_of_integral, square, "log", points="combs")
        self.raises(TypeError, "interval: 3", debias.function_of_integral, square, "log", interval=3)
        self.raises(ValueError, "one-dimensional", debias.function_of_integral, square, "log", dimension=2, points="comb")
        self.raises(ValueError, "unit cube", debias.function_of_integral, square, "log", dimension=2, interval=(0, 2))
        unrated = debias.levels(powers(square), dimension=lambda k: 2**k)
        self.raises(ValueError, "pmf: none", debias.samples, unrated, 10)
        self.raises(ValueError, "pmf: none", debias.estimate, unrated, estimator="independent_sum")
        multilevel = debias.estimate(SCALAR, estimator="multilevel", error=0.1)
        self.raises(AttributeError, "multilevel", lambda: multilevel.largest)
        self.raises(ValueError, "does not apply", debias.estimate, SCALAR, estimator="roulette")

    def test_runs_that_cannot_be_drawn_are_refused_before_they_start(self):
        calls = []

        def differences(level, u):
            calls.append(level)
            return powers(square)(level, u)

        def own(**options):
            return debias.levels(differences, **{"dimension": lambda k: 2**k, "rates": (2, 1), **options})

        # Level 25 asks for 2^25 uniforms: for some of a million samples, whatever the seed.
        for seed in 1, 2:
            self.raises(ValueError, r"level beyond 24.* 9(\.\d)? %.*take at most \d+ samples, or the PMF geometric:theta=1\.5 ",
                        debias.estimate, own(), base_level=4, samples=1_000_000, seed=seed)
        self.raises(ValueError, "level beyond 7", debias.estimate, own(deepest_level=7), samples=1_000_000)
        self.raises(ValueError, "level beyond 99", debias.estimate,
                    own(dimension=lambda k: 1 if k < 100 else 2**30, rates=(0.1, 0)), samples=1_000_000)
        self.raises(ValueError, "deepest_level = -1", own, deepest_level=-1)
        self.raises(ValueError, "ask for at most 25", debias.survey, own(), levels=30, samples=10)
        # 2^27 look-ups of one draw are too many at once.
        self.raises(ValueError, "level beyond 26", debias.estimate, debias.function_of_mean(square, "log"),
                    base_level=8, samples=1_000_000)
        self.assertEqual(calls, [])
        self.assertLess(abs(debias.estimate(own(), base_level=4, samples=2000, pmf="geometric:theta=1.5").mean - 0.25),
                        0.05)

    def test_exceptions_are_the_users_own_and_nothing_leaks(self):
        class Own(Exception):
            pass

        class Marker:
            pass

        def once():
            marker = Marker()

            def differences(level, u):
                if level == 3:
                    raise Own(marker)
                return np.zeros(len(u))

            problem = debias.levels(differences, dimension=1, rates=(2, 1))
            try:
                debias.estimate(problem, samples=5000, pmf=PMF)
            except Own as e:
                self.assertIs(e.args[0], marker)
                if sys.version_info >= (3, 11):
                    self.assertIn("seed 1, sample 0", e.__notes__[0])
                return weakref.ref(marker)
            self.fail("nothing raised")

        gone = once()
        gc.collect()
        self.assertIsNone(gone())
        self.assertEqual(debias.estimate(SCALAR, samples=1000, pmf=PMF).samples, 1000)  # and the next run works

    def test_a_problem_runs_once_at_a_time(self):
        own = []

        def differences(level, u):
            debias.estimate(own[0], samples=10)
            return u[:, 0]

        own.append(debias.levels(differences, dimension=1, rates=(2, 1)))
        self.raises(ValueError, "in use by another run", debias.estimate, own[0], samples=10)

    def test_a_callback_may_estimate(self):
        inner = debias.function_of_mean(lambda x: x[:, 0], "square")

        def differences(level, u):
            return np.full(len(u), debias.estimate(inner, samples=100).mean if level == 0 else 0.0)

        with warnings.catch_warnings():
            warnings.simplefilter("ignore", debias.DebiasWarning)
            debias.estimate(debias.levels(differences, dimension=1, rates=(2, 1)), samples=100, pmf=PMF)


class Locales(unittest.TestCase):
    def test_a_host_with_decimal_commas_reads_the_same(self):
        # The interpreter says setlocale(LC_NUMERIC): `tradeoff` died of it, and results held 0,99966708.
        with tempfile.TemporaryDirectory() as folder:
            try:
                subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", folder + "/de_DE.UTF-8"], check=True,
                               capture_output=True)
            except (OSError, subprocess.CalledProcessError):
                self.skipTest("no localedef, or no locale sources (Debian: package locales)")
            script = r"""
import locale, re, sys, warnings
import numpy as np
import debias
if len(sys.argv) > 1:
    locale.setlocale(locale.LC_NUMERIC, sys.argv[1])
    assert locale.localeconv()["decimal_point"] == ","
warnings.simplefilter("ignore", debias.DebiasWarning)
mean = debias.function_of_mean(lambda x: 1 + x[:, 0], "power:1.5", rates=(2, 1), truth=1.8)
says = [debias.estimate("A10", samples=12345), debias.estimate("A01", samples=5000, pmf="geometric:r=0.55"),
        debias.estimate(mean, samples=5000, estimator="recipe"), debias.estimate("A10", error=0.05, confidence=0.9),
        debias.estimate("A10", estimator="multilevel", error=0.05),
        debias.tradeoff("A10", points=3, samples=2000), debias.survey("A10", levels=4, samples=2000),
        debias.advise("A10"), debias.replay("A10", 7, seed=3), debias.diagnose(np.arange(1, 2000) ** 0.5)]
for report in says:  # without what a clock says
    print(re.sub(r'"(seconds|pilot_seconds|efficiency)": .*', "", report.to_json()))
    if "points" not in report.to_dict() and "kurtosis" not in str(report.to_dict().get("levels")):
        print(re.sub(r"(?m)^(seconds|efficiency) .*$", "", str(report)))
for call in (lambda: debias.estimate("A10", pmf="geometric:r=1.5"), lambda: debias.estimate("A10", error=-0.5),
             lambda: debias.samples("A10", 3, pmf="zeta:s=0.5"),
             lambda: debias.estimate("gbm-by-euler", estimator="recipe"),
             lambda: debias.estimate("A10", confidence=1.5)):
    try:
        call()
    except ValueError as e:
        print(e)
print(debias.samples("A10", 5, pmf="geometric:r=0.55"), debias.problems(), debias.pmfs())
"""
            environment = {**os.environ, "LOCPATH": folder}

            def said(*arguments):
                done = subprocess.run([sys.executable, "-c", script, *arguments], capture_output=True, text=True,
                                      env=environment)
                self.assertEqual(done.returncode, 0, done.stderr)
                return done.stdout.splitlines()

            plain = said()
            self.assertGreater(len(plain), 500)
            self.assertEqual(said("de_DE.UTF-8"), plain)


class Interrupts(unittest.TestCase):
    def setUp(self):
        signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell in the background ignores it

    def seconds_to_interrupt(self, f):
        timer = threading.Timer(0.4, lambda: os.kill(os.getpid(), signal.SIGINT))
        timer.start()
        start = time.perf_counter()
        with self.assertRaises(KeyboardInterrupt):
            f()
            time.sleep(1)
        timer.join()
        return time.perf_counter() - start - 0.4

    def test_within_half_a_second(self):
        slow = debias.levels(powers(square), dimension=lambda k: 2**k, rates=(2, 1))
        for name, f in {"catalogue": lambda: debias.estimate("E05", samples=1e9),
                        "samples": lambda: debias.samples("E05", 10**7),
                        "survey": lambda: debias.survey("E05", levels=8, samples=1e8),
                        "own": lambda: debias.estimate(slow, samples=1e9, pmf="geometric:theta=1.9"),
                        "chains": lambda: debias.estimate(Chains.SQUARE, samples=1e9)}.items():
            with self.subTest(name):
                self.assertLess(self.seconds_to_interrupt(f), 0.5)

    def test_deep_in_a_level(self):
        # A level of 2^40 draws takes hours and looks at nothing: the thread is left behind, and the program ends.
        script = ("import debias, os, signal, threading, time\n"
                  "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
                  "threading.Timer(0.4, lambda: os.kill(os.getpid(), signal.SIGINT)).start()\n"
                  "start = time.perf_counter()\n"
                  "try: debias.estimate('A10', estimator='truncated', base_level=40, samples=100)\n"
                  "except KeyboardInterrupt: print(time.perf_counter() - start - 0.4)\n")
        start = time.perf_counter()
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertLess(float(done.stdout), 0.5)
        self.assertLess(time.perf_counter() - start, 10)


if __name__ == "__main__":
    unittest.main()
