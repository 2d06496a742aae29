"""Own problems of all kinds: unbiased, and refused in one sentence.

    PYTHONPATH=BUILD/python /usr/bin/python3 tests/python/own_test.py

Fixed seeds; an estimate may be 4.5 standard errors off its truth, and each family has a wrong relative that must be further off.
"""

import math
import unittest

import numpy as np

import debias

from own_shared import Quiet, scipy, start, x_squared


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

    def test_functions_are_called_no_more_often_than_needed(self):
        # The chunks of a pilot asked one by one, an array once more for its first sample, a recipe 32 times for the work of a level.
        rows = []

        def counted(u):
            rows.append(len(u))
            return x_squared(u)

        own = debias.function_of_mean(counted, "reciprocal")
        debias.estimate(own, error=0.0075)
        self.assertEqual(len(rows), 2)  # of the pilot, and of the run
        rows.clear()
        debias.estimate(own, error=0.0075, estimator="recipe")
        self.assertLess(len(rows), 20)
        asked = []

        def squares(level, u):
            asked.append(level)
            halves = np.stack((u[:, ::2].mean(axis=1), u[:, -1::-2].mean(axis=1)))
            fine = np.repeat(((halves[0] + halves[1]) / 2)[:, None], 2, axis=1)
            return (fine**2, np.repeat((halves**2).mean(axis=0)[:, None], 2, axis=1)) if level else fine**2

        pairs = debias.levels(squares, dimension=lambda level: 2**level, components=2, rates=(2, 1))
        debias.estimate(pairs, samples=3000)
        self.assertEqual(len(asked), len(set(asked)))
        asked.clear()
        debias.survey(pairs, levels=4, samples=400)
        self.assertEqual(sorted(asked), sorted(set(asked)))

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


    def test_functions_may_write_into_what_they_see_or_give(self):
        """One array for all answers, or a step in place: other numbers, without a word."""
        held = {}

        def one_array(f):
            def g(*arguments):
                out = np.asarray(f(*arguments))
                array = held.setdefault((g, out.shape), np.empty(out.shape))
                array[...] = out
                return array

            return g

        def in_place(f):
            def g(*arguments):
                out = np.array(f(*arguments))
                for x in arguments:
                    if isinstance(x, np.ndarray):
                        x[...] = -7
                return out

            return g

        def of_rng(f):
            return debias.levels(f(lambda level, rng: rng.random(2) * 0.5**level), rng=True, components=2, rates=(2, 1), work=1)

        def chain(f):
            walk = debias.chains.mala(f(lambda x: -0.5 * x[:, 0] ** 2), f(lambda x: -x), 1.2)
            return debias.chains.coupled_chain(walk, start, f(lambda x: x[:, 0] ** 2), burn_in=5, length=20, lag=3)

        def own_chain(f):
            def step(x, u):
                return np.where(x == 0, u < 0.3, u < 0.8).astype(float)

            both = f(lambda x, y, u: np.stack((step(x, u), step(y, u))))
            flip = debias.chains.kernel(f(step), lambda x, y, u: tuple(both(x, y, u)), uniforms=1)
            return debias.chains.coupled_chain(flip, lambda u: np.floor(2 * u), f(lambda x: x[:, 0]), burn_in=5, length=20, lag=3)

        problems = {"block": lambda f: debias.function_of_mean(f(x_squared), "reciprocal", block=64), "rng": of_rng, "chain": chain,
                    "kernel": own_chain, "g": lambda f: debias.function_of_mean(x_squared, f(lambda m: 1 / m)),
                    "gradient": lambda f: debias.gradient(f(lambda x, u: u[:, 0] * x[0] * x[1]), [1.0, 2.0], dimension=1)}
        for kind in ("central", "forward", "second"):
            problems[kind] = lambda f, kind=kind: debias.finite_difference(f(lambda x, u: np.exp(x * u[:, 0])), 0.3, dimension=1, kind=kind)
        for name, problem in problems.items():
            expected = debias.samples(problem(lambda f: f), 100)
            for wrapped in (one_array, in_place):
                with self.subTest(name, wrapped=wrapped.__name__):
                    np.testing.assert_array_equal(debias.samples(problem(wrapped), 100), expected)
        a, b = np.array([[0.1, 0.2], [0.3, 0.1]]), np.array([1.0, 1.0])
        late = debias.neumann(a, b, [1, 1], radius=0.4)
        b[:] = 100
        self.close(late, 2.3 / 0.75)

    def test_masks_are_no_answers_in_blocks(self):
        def masked(u):
            return np.ma.array(x_squared(u), mask=u[:, 0] > 0.9)

        own = debias.function_of_mean(masked, "log", block=64)
        self.raises(ValueError, "^integrand: returned .* masked", debias.estimate, own, samples=1000)
        for answer, kind, said in ((None, TypeError, "NoneType"), (1.0, ValueError, r"shape \(\)")):
            own = debias.levels(lambda k, u, answer=answer: answer, dimension=1, rates=(2, 1), block=64)
            self.raises(kind, f"^differences: returned {said} at level 0", debias.estimate, own, samples=1000)

    def test_work_beyond_any_number_is_no_limit(self):
        problem = debias.levels(lambda level, u: u[:, 0] * 2.0**-level, dimension=1, rates=(2, 1), work=lambda k: 2**k)
        self.assertGreater(debias.estimate(problem, samples=1000).work, 1000)  # made, after asking for no 2**(2**28)

    def test_whole_samples_have_no_levels(self):
        trials = debias.reciprocal_trials(x_squared, bound=2.0)
        for refused in (lambda: debias.estimate(trials, estimator="recipe"), lambda: debias.advise(trials), lambda: debias.survey(trials),
                        lambda: debias.estimate(trials, estimator="multilevel", error=0.1)):
            self.raises(ValueError, "has no levels", refused)


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


if __name__ == "__main__":
    unittest.main()
