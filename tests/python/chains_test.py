"""Coupled chains of Python: unbiased, the same in any company, refused in one sentence.

    PYTHONPATH=BUILD/python DEBIAS_PROGRAM=BUILD/bin/debias /usr/bin/python3 tests/python/chains_test.py
"""

import doctest
import json
import unittest
import warnings

import numpy as np

import debias
from debias import chains

from shared import ignoring_doubts


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


if __name__ == "__main__":
    unittest.main()
