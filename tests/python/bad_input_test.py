"""One clear exception for each kind of bad input, and none of a host's locale or of Ctrl-C.

    PYTHONPATH=BUILD/python DEBIAS_PROGRAM=BUILD/bin/debias /usr/bin/python3 tests/python/bad_input_test.py
"""

import gc
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import warnings
import weakref
from concurrent.futures import ThreadPoolExecutor
from decimal import Decimal
from fractions import Fraction

import numpy as np

import debias

import chains_test
from shared import PMF, SCALAR, VECTOR, ignoring_doubts, powers, square


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
        for n in (2**48, 2**58, 2**61):  # std::bad_alloc, vector::_M_default_append
            self.raises(MemoryError, f"^n = {n} .numbers do not fit", debias.samples, "A10", n)
        self.assertEqual(e(SCALAR, samples=100, pmf=PMF, threads=None).samples, 100)
        self.raises(TypeError, "seed", debias.replay, "A10", 3)
        self.raises(TypeError, "complex", debias.diagnose, np.array([1j]))
        self.raises(ValueError, "no value", debias.diagnose, [])
        self.raises(TypeError, "U1|object", debias.diagnose, ["a"])

    @ignoring_doubts
    def test_shards_that_do_not_exist(self):
        """(3, 2) drew samples outside the run, and (1, 0) killed the interpreter."""
        e = debias.estimate
        own = debias.levels(powers(square), dimension=lambda k: 2**k, rates=(2, 1))
        for problem in ("A10", own):
            for shard in ((3, 2), (0, 2), (-1, 2), (1, 0), (1, -2), (1, 2**21), (2**62, 2**62), (1, 2**70), [np.int64(3), 2]):
                self.raises(ValueError, r"^shard = .*\(must be one of .*the first of four$", e, problem, samples=20_000, shard=shard)
            for shard in (2, "x", "12", (1.5, 2), ("1", 2), (1, 2, 3), (1,), ()):
                self.raises(TypeError, r"^shard: .*\(must be two whole numbers, \(i, n\)\)", e, problem, samples=20_000, shard=shard)
            self.raises(ValueError, "^shard .a goal fixes the samples late", e, problem, error=0.1, shard=(1, 2))

    @ignoring_doubts
    def test_what_was_accepted_though_wrong(self):
        e = debias.estimate
        for block in (2**40, 20_001):
            self.raises(ValueError, f"^block = '{block}' .*only 20000.; take a smaller one, or more samples$", e, "A10",
                        samples=20_000, block=block)
            self.raises(ValueError, f"^block = '{block}'", debias.tradeoff, "A10", samples=20_000, block=block)
        with ThreadPoolExecutor(1) as pool:
            for shards in (-3, 0):
                self.raises(ValueError, f"^shards = {shards} .must be at least 1", e, "A10", executor=pool, shards=shards)
            for shards in ("x", 1.5, True):
                self.raises(TypeError, "^shards: .*must be a whole number", e, "A10", executor=pool, shards=shards)
        for seconds in (-1, 0, "x", float("nan"), float("inf")):  # also where the pilot meets the goal
            self.raises(ValueError, "^max_seconds", e, "A10", error=10, max_seconds=seconds)
        self.raises(TypeError, "^max_seconds: list", e, "A10", error=10, max_seconds=[1])
        self.assertTrue(e("A10", error=0.1, max_seconds="10s").samples > 0)

    def test_what_is_no_pmf_says_what_is(self):
        # 'int' object is not iterable; and of bytes, keys and sets masses were made.
        for pmf in (3, True, 0.5, 1j, np.float32(0.5), np.array(0.5), b"geometric", {0: 0.5, 1: 0.25}, {0.5, 0.25}, int, object()):
            for f, *arguments in ((debias.estimate, "A10"), (debias.samples, "A10", 3), (debias.estimate, SCALAR)):
                self.raises(TypeError, "^pmf: .* .must be a name .*debias.pmfs.*the masses.*or a function", f, *arguments, pmf=pmf)
        for pmf, said in ((["a", "b"], "0 is 'a', str"), ([0.5, None], "1 is None"), ([[0.5, 0.2]], "0 is .0.5, 0.2., list"),
                          (lambda j: "x", "0 is 'x', str"), ([True, False], "0 is True, bool")):
            self.raises(TypeError, f"^pmf: mass {said}.*must be a number", debias.estimate, "A10", pmf=pmf)
        for pmf, said in (([], "none"), ([1], "1"), ([0.5, np.nan], "0.5, nan"), ([5, 4, 3, 2, 0], "5, 4, 3, 2, ...")):
            self.raises(ValueError, f"^pmf: masses {said} .must be two or more", debias.estimate, "A10", pmf=pmf)
        same = [debias.samples("A10", 20, pmf=p) for p in ([0.75, 0.1875], (Fraction(3, 4), Decimal("0.1875")), np.float32([0.75, 0.1875]))]
        for other in same[1:]:
            np.testing.assert_array_equal(same[0], other)

    @ignoring_doubts
    def test_the_words_of_the_program(self):
        words = {"samples": "auto", "base_level": "auto", "points": "auto", "pmf": "declared", "error": "none", "relative_error": "none",
                 "seconds": "none", "max_seconds": "none"}
        for problem in ("A10", SCALAR):
            plain, said = debias.estimate(problem, samples=2000), debias.estimate(problem, **{**words, "samples": 2000})
            self.assertEqual(said.mean, plain.mean)
            self.assertEqual(debias.estimate(problem, **{**words, "error": 0.1}).mean, debias.estimate(problem, error=0.1).mean)
            shape = {name: words[name] for name in ("base_level", "points", "pmf")}
            np.testing.assert_array_equal(debias.samples(problem, 20, **shape), debias.samples(problem, 20))
            self.assertEqual(debias.replay(problem, 3, seed=1, **shape)["value"], debias.replay(problem, 3, seed=1)["value"])
            self.assertEqual(debias.extend(plain, samples=4000, error="none").samples, 4000)
            self.assertEqual(debias.survey(problem, levels=3, samples="auto").levels["draws"][0], 10_000)
            advice = {name: word for name, word in words.items() if name not in ("pmf", "max_seconds")}
            self.assertEqual(debias.advise(problem, **advice)["pmf"], debias.advise(problem)["pmf"])
            for name, word in words.items():  # of another option it is none
                if name not in ("points", "pmf"):
                    self.raises(ValueError, f"^{name} = '{'none' if word == 'auto' else 'auto'}'", debias.estimate, problem,
                                **{name: "none" if word == "auto" else "auto"})
        unrated = debias.levels(powers(square), dimension=lambda k: 2**k)
        self.raises(ValueError, "^pmf: none .*declares no rates", debias.estimate, unrated, samples=2000, pmf="declared")
        self.raises(ValueError, "^'recipes' is not an estimator", debias.estimate, unrated, estimator="recipes")
        for estimator in (3, True, ["recipe"]):
            self.raises(TypeError, "^estimator: .*must be a name, see debias.estimators", debias.estimate, "A10", estimator=estimator)

    @ignoring_doubts
    def test_numbers_of_any_kind(self):
        """An array of no dimension, or a Decimal, was no number."""
        for kind in (np.array, np.int32, np.float32, np.float64, Fraction, Decimal, int, str):
            with self.subTest(kind):
                self.assertEqual(debias.estimate("A10", samples=kind(2000), seed=3, confidence=0.5).samples, 2000)
                self.assertEqual(debias.survey("A10", levels=kind(3), samples=kind(100)).levels["level"].tolist(), [0, 1, 2])
        for kind in (np.array, np.int32, np.uint8, int):
            self.assertEqual(len(debias.samples("A10", kind(3), first=kind(2))), 3)
        for kind in (np.array, np.float32, Fraction, Decimal):
            result = debias.estimate("A10", samples=2000, confidence=kind(0.75))
            self.assertEqual(result.confidence_interval(kind(0.5)), result.confidence_interval(0.5))
            self.assertEqual(result.confidence_interval, result.confidence_interval(0.75))
        for x in (True, np.True_, np.array(True), [2000], np.array([2000]), 2000j, b"2000"):
            self.raises(TypeError, "^samples: .*must be a number", debias.estimate, "A10", samples=x)

    def test_numbers_that_are_none_say_which(self):
        # "bad operand type for abs(): 'str'", and a gap, a shared base or a `normals` that was a text
        x = lambda u: 1 + u[:, 0] ** 2  # noqa: E731
        a, spd = np.array([[0.2, 0.1], [0.1, 0.3]]), np.array([[2.0, 0.5], [0.5, 1.0]])
        walk = debias.chains.random_walk(lambda x: -0.5 * x[:, 0] ** 2, 2.4)
        chain = debias.chains.coupled_chain(walk, lambda u: 6 * u - 3, lambda x: x[:, 0])
        takers = {"ratio": lambda v: debias.series(lambda k: 0.5**k, ratio=v), "exponent": lambda v: debias.series(lambda k: 1, exponent=v),
                  "at": lambda v: debias.taylor(x, "exp", v), "mean_square": lambda v: debias.taylor(x, "log", 1.4, mean_square=v),
                  "length": lambda v: debias.transmittance(x, v, 2), "control": lambda v: debias.transmittance(x, 1, v),
                  "radius": lambda v: debias.neumann(a, [1, 1], [1, 1], radius=v),
                  "lower": lambda v: debias.solve(spd, [1, 1], [1, 1], lower=v, upper=3),
                  "upper": lambda v: debias.log_determinant_spd(spd, lower=0.5, upper=v), "bound": lambda v: debias.reciprocal_trials(x, v),
                  "interval": lambda v: debias.function_of_integral(x, "log", interval=(0, v)),
                  "horizon": lambda v: debias.brownian_increments([[1]], v),
                  "step": lambda v: debias.chains.random_walk(x, v), "burn_in": lambda v: debias.chains.coupled_chain(walk, x, x, burn_in=v),
                  "normals": lambda v: debias.function_of_mean(x, "log", normals=v), "rng": lambda v: debias.levels(x, rng=v),
                  "polynomial": lambda v: debias.levels(x, rates=(2, 1), polynomial=v), "gap": lambda v: debias.function_of_mean(x, x, gap=v),
                  "shared": lambda v: debias.levels(x, shared=v)}
        for name, f in takers.items():
            for v in ("x", [0.5], 1j, b"x", {}, (1, 2, 3)):
                self.raises(TypeError, f"^{name}: .*must be", f, v)
        for name in ("at", "control", "exponent", "length", "bound"):
            self.raises(ValueError, f"^{name} = nan .must be finite", takers[name], float("nan"))
        arrays = {"uniforms": debias.normal_quantile, "normals": debias.brownian_increments, "at": lambda v: debias.gradient(lambda x: x[0], v),
                  "b": lambda v: debias.neumann(a, v, [1, 1], radius=0.5), "c": lambda v: debias.solve(spd, [1, 1], v, lower=0.5, upper=3),
                  "weights": lambda v: debias.chains.mixture(v, walk)}
        for name, f in arrays.items():
            for v in ("x", ["a", "b"], [1j, 1], np.array([1j, 1]), None, [None, 1], [[1], [1, 2]], {}):
                self.raises(TypeError, f"^{name}: .*must be an array of real numbers", f, v)
        self.raises(ValueError, r"^b: of shape \(3,\) .must have 2 numbers", arrays["b"], [1, 2, 3])
        self.raises(TypeError, "^operator: .*real numbers", debias.estimate, debias.neumann(a * 1j, [1, 1], [1, 1], radius=0.5), samples=100)
        self.raises(ValueError, "^radius = 1.5 .must lie in .0, 1", takers["radius"], 1.5)
        self.raises(ValueError, "^kind = .*must be forward, central or second", lambda: debias.finite_difference(np.sin, 1, kind=["central"]))
        self.raises(ValueError, "^seed = 'x' .not a number", debias.chains.advise, chain, seed="x")
        self.raises(TypeError, "^sample: NoneType .must be the index", debias.replay, "A10", None, seed=1)
        self.assertEqual(debias.normal_quantile([Fraction(1, 2), Decimal("0.5")]).tolist(), [0, 0])

    @ignoring_doubts
    def test_intervals_of_no_level(self):
        # A second argument was taken for nothing, or for a problem without a word.
        for report in (debias.estimate("A10", samples=2000), debias.estimate(VECTOR, samples=2000), debias.diagnose([1.0, 2.0, 3.0])):
            interval = report.confidence_interval
            for level in (95, 0, 1, -0.1, float("nan"), "95%"):
                self.raises(ValueError, "^confidence = ", interval, level)
            for level in (None, True, [0.9], 1j, np.array([0.9])):
                self.raises(TypeError, "^confidence: .*must be a number", interval, level)
            self.raises(TypeError, "^problem: int .must be a name", interval, 0.9, 1)
            self.raises(TypeError, "^problem: float .must be a name", interval, 0.95, 0.5)
        self.raises(TypeError, "^problem: of a diagnosis", interval, 0.9, "A10")

    def test_no_words_of_c_or_of_the_inside(self):
        own = powers(square)
        for rates in ((1,), (1, 2, 3), 5, "21", ("2", "1"), (None, 1), {"beta": 1}):
            self.raises(TypeError, r"^rates: .*\(must be two numbers, \(beta, gamma\)", debias.levels, own,
                        dimension=lambda k: 2**k, rates=rates)
        for rates in ((0, 1), (-1, 1), (float("nan"), 1), (2, float("inf"))):
            self.raises(ValueError, "^rates = .*positive, and the growth", debias.levels, own, dimension=lambda k: 2**k, rates=rates)
        self.raises(TypeError, "^truth: str", debias.levels, own, dimension=lambda k: 2**k, truth="x")
        for at in (float("inf"), float("nan")):
            self.raises(ValueError, f"^at = {at} .must be finite", debias.finite_difference, np.sin, at)
            self.raises(ValueError, f"^at = {at} .must be finite", debias.gradient, lambda x: x[0], [1, at])
        self.raises(TypeError, "^at: str", debias.finite_difference, np.sin, "x")
        for name in ("first_step", "ratio"):
            self.raises(TypeError, f"^{name}: str", debias.finite_difference, np.sin, 1, **{name: "x"})
        with self.assertRaisesRegex(ValueError, "^pmf: Geometric: r = 2 ") as refused:
            debias.estimate("A10", pmf="geometric:r=2")
        self.assertNotIn("::", str(refused.exception))

    def test_lists_of_names_are_those_of_python(self):
        self.raises(ValueError, r"^'A1O' is not a problem \(see debias.problems\(\)\); did you mean", debias.estimate, "A1O")
        self.raises(ValueError, r"^'single_trem' is not an estimator \(see debias.estimators\(\)\); did you mean",
                    debias.estimate, "A10", estimator="single_trem")

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
        self.raises(ValueError, r"shape \(\d+, 1\) .*; take a column, x\[:, 0\]$", mean, lambda x: 1 + x)
        self.raises(ValueError, r"shape \(\) .*axis=1$", mean, np.sum)
        self.raises(ValueError, r"shape \(2, \d+\) at level 1 .*are a tuple, \(fine, coarse\)$", run,
                    lambda k, u: u[:, 0] if k == 0 else [u[:, 0], u[:, 0]])
        self.raises(TypeError, "^integrand: returned list of rows of different lengths", mean, lambda x: [[1.0], [1.0, 2.0]])
        self.raises(TypeError, "^values: list of rows of different lengths", debias.diagnose, [[1.0], [1.0, 2.0]])
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
                    self.assertIn("at level 3, of an array of", e.__notes__[0])
                    self.assertIn("seed 1, sample 0", e.__notes__[1])
                return weakref.ref(marker)
            self.fail("nothing raised")

        gone = once()
        gc.collect()
        self.assertIsNone(gone())
        self.assertEqual(debias.estimate(SCALAR, samples=1000, pmf=PMF).samples, 1000)  # and the next run works

    @unittest.skipIf(sys.version_info < (3, 11), "exceptions have no notes")
    def test_an_exception_of_a_pilot_says_its_level_too(self):
        def differences(level, u):
            if level >= 2:
                raise ArithmeticError("deep")
            return powers(square)(level, u)

        def term(k, u):
            if k >= 2:
                raise ArithmeticError("deep")
            return u[:, 0] * 0.5**k

        levels = debias.levels(differences, dimension=lambda k: 2**k, rates=(2, 1))
        series = debias.series(term, ratio=0.5, dimension=1)
        for own in (levels, series):
            for f, options in ((debias.estimate, {"samples": 5000}), (debias.estimate, {"error": 0.01}), (debias.advise, {}),
                               (debias.estimate, {"estimator": "recipe", "samples": 5000}), (debias.survey, {}), (debias.tradeoff, {}),
                               (debias.samples, {"n": 500}), (debias.replay, {"sample": 3, "seed": 1, "estimator": "truncated", "base_level": 2})):
                with self.subTest(own, f=f, **options):
                    with self.assertRaisesRegex(ArithmeticError, "^deep$") as raised:
                        f(own, **options)
                    self.assertRegex(raised.exception.__notes__[0], "^debias: at level [2-9], of an array of [0-9]+ rows$")
        mean = debias.function_of_mean(lambda x: 1 / 0, "log")  # one array for all levels
        with self.assertRaises(ZeroDivisionError) as raised:
            debias.estimate(mean, samples=500)
        self.assertNotIn("level", "".join(raised.exception.__notes__))

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
                        "chains": lambda: debias.estimate(chains_test.Chains.SQUARE, samples=1e9)}.items():
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
