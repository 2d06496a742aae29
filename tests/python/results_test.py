"""What results, reports and diagnoses say, and the pictures of them.

    PYTHONPATH=BUILD/python DEBIAS_PROGRAM=BUILD/bin/debias /usr/bin/python3 tests/python/results_test.py
"""

import json
import math
import pickle
import re
import time
import unittest
import warnings

import numpy as np

import debias
from debias import chains

import chains_test
from shared import PMF, SCALAR, VECTOR, ignoring_doubts, without_times


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

    def test_intervals_of_any_level_of_a_diagnosis(self):
        values = np.array([1.0, 2.0, 5.0])
        found = debias.diagnose(values)
        interval = found.confidence_interval
        self.assertEqual(interval(0.95), tuple(interval))
        for level in (0.5, 0.9, 0.99):
            half = level * np.sqrt(2 / (1 - level**2)) * found.standard_error  # Student's t of two degrees of freedom
            np.testing.assert_allclose(interval(level), (found.mean - half, found.mean + half), rtol=1e-12)
        # The unit changes nothing, and squares do not overflow.
        large = debias.diagnose(values * 2.0**600).confidence_interval(0.9)
        np.testing.assert_array_equal(large, np.multiply(interval(0.9), 2.0**600))
        # As wide as what neighbours say, as the one of 95 % is.
        rng = np.random.default_rng(1)
        moving = np.convolve(rng.normal(size=20_000), np.ones(50) / 50, "valid")
        walk = debias.diagnose(moving)
        self.assertIn("dependence", [w.code for w in walk.warnings])
        ratio = (walk.confidence_interval(0.99).high - walk.mean) / (walk.confidence_interval.high - walk.mean)
        self.assertGreater(walk.standard_error, 5 * moving.std() / np.sqrt(len(moving)))
        self.assertTrue(1.95 < (walk.confidence_interval.high - walk.mean) / walk.standard_error < 2.2)
        self.assertTrue(1.31 < ratio < 1.4, ratio)  # 1.314 of a normal law, and a little more of few degrees of freedom
        again = pickle.loads(pickle.dumps(found))
        self.assertEqual(again, found)
        self.assertEqual(again.confidence_interval(0.5), interval(0.5))
        for nothing in ([1.0], [1.0, np.inf, 2.0]):
            self.assertTrue(np.isnan(debias.diagnose(nothing).confidence_interval(0.9)).all())
        for wrong in (0, 1, 2, -0.5, "a", float("nan")):
            with self.assertRaisesRegex(ValueError, "confidence = "):
                interval(wrong)

    def test_warnings(self):
        with self.assertWarns(debias.InfiniteVarianceWarning):
            debias.estimate("furnace", estimator="roulette", pmf="geometric:r=0.5", samples=1e5)
        with warnings.catch_warnings():
            warnings.simplefilter("error", debias.DebiasWarning)
            with self.assertRaises(debias.InfiniteVarianceWarning):
                debias.estimate("furnace", estimator="roulette", pmf="geometric:r=0.5", samples=1e5)
            debias.estimate("A10", samples=1e5)

    def test_warnings_are_those_of_the_text(self):
        """A doubt of the recipe stood in the text alone."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            r = debias.estimate("A08", samples=20_000, estimator="recipe", seed=1)
        printed = [line[14:].strip() for line in str(r).splitlines() if line.startswith("warning ")]
        self.assertEqual([w.text for w in r.warnings], printed)
        self.assertTrue(set(r.warnings) <= {w.message for w in caught})
        of_recipe = [w["text"] for w in r["recipe"]["warnings"]]
        self.assertTrue(of_recipe and set(of_recipe) <= set(printed))
        self.assertEqual([w.text for w in r.remarks], [w["text"] for w in r["recipe"]["remarks"]])
        self.assertEqual(debias.estimate("A10", samples=1000, seed=1).remarks, [])

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

    @ignoring_doubts
    def test_what_a_report_does_not_have(self):
        # `"mean" in result` was a KeyError of 0, and so was hasattr(diagnosis, "levels") of 'levels'.
        result, multilevel = debias.estimate("A10", samples=1000), debias.estimate("A10", estimator="multilevel", error=0.2)
        self.assertTrue("mean" in result and "means" not in result and 0 not in result)
        self.assertEqual(list(result), list(result.to_dict()))
        for report in (debias.diagnose([1.0, 2.0]), debias.advise("A10"), debias.tradeoff("A10", points=2, samples=1000)):
            self.assertFalse(hasattr(report, "levels"))
            with self.assertRaisesRegex(AttributeError, "^levels .this .* has none"):
                report.levels
        with self.assertRaisesRegex(AttributeError, "^confidence_interval .a result of multilevel"):
            multilevel.confidence_interval

    def test_progress(self):
        seen = []
        debias.estimate("E05", samples=3e5, progress=lambda done, total: seen.append((done, total)))
        self.assertTrue(seen and seen[-1][1] == 3e5, seen)
        debias.estimate("A10", samples=1000, progress=True)

    @ignoring_doubts
    def test_progress_is_a_share_that_rises_to_one(self):
        # To a goal the total stayed 0, and no run told its end.
        def slow(u):
            time.sleep(0.05)
            return 1 + u[:, 0] ** 2

        own = debias.function_of_mean(slow, "reciprocal")
        seen = []

        def told(done, total):
            self.assertTrue(0 <= done and (total == 0 or done <= total), (done, total))
            seen.append((done, total))

        def ends(result):
            shares = [done / total for done, total in seen if total]
            self.assertEqual(seen[-1], (result.samples, result.samples))
            self.assertEqual(shares, sorted(shares))
            seen.clear()
            return shares

        shares = ends(debias.estimate(own, error=2.25e-4, progress=told))  # more than a second after its pilots
        self.assertLess(shares[0], 1)
        for problem in ("A10", SCALAR):
            for options in ({"samples": 1000}, {"samples": 60_000}, {"error": 0.03}, {"seconds": 0.2}, {"estimator": "recipe", "error": 0.03},
                            {"error": 1e-3, "max_seconds": 0.3}, {"samples": 60_000, "shard": (2, 3)}):
                with self.subTest(problem=problem, **options):
                    ends(debias.estimate(problem, progress=told, **options))
        short = debias.estimate("A10", samples=1000)
        ends(debias.extend(short, error=0.03, progress=told))
        with self.assertRaisesRegex(ZeroDivisionError, "division"):  # of the function's own
            debias.estimate("A10", samples=1000, progress=lambda done, total: 1 / 0)


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
        pilot = chains.advise(chains_test.Chains.SQUARE, chains=100)
        times = chains.meeting_times(chains_test.Chains.SQUARE, 200)
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
        plt.close("all")
        lines = plot.tails(np.random.default_rng(3).standard_t(3, 20_000)).lines
        self.assertFalse([line for line in lines if line.get_label().startswith("_")])
        border = next(line for line in lines if "border" in line.get_label())
        upper = next(line for line in lines if line.get_label().startswith("upper"))
        self.assertGreater(border.get_xdata().min(), 1)  # among the data of the tail, not at the median
        self.assertLessEqual(border.get_xdata().max(), upper.get_xdata().max())
        swept = plot.tradeoff(debias.tradeoff("A10", points=3, samples=2000))
        markers = [line for line in swept.lines if line.get_marker() in ("o", "*")]
        low, high = swept.get_xlim()
        self.assertTrue(all(((line.get_xdata() > low) & (line.get_xdata() < high)).all() for line in markers))  # none is cut
        masked = np.ma.array(np.append(values, 1e9), mask=[False] * len(values) + [True])
        x = [plot.tails(v).lines[0].get_xdata() for v in (values, masked)]
        np.testing.assert_array_equal(*x)
        pixels = np.ma.array([[1.0, 2.0], [3.0, 1e9]], mask=[[0, 0], [0, 1]])
        shown = plot.error_map(pixels, np.ones((2, 2))).images[0].get_array()
        self.assertEqual(np.isfinite(np.ma.filled(shown, np.nan)).sum(), 3)
        plt.gcf().canvas.draw()
        plt.close("all")


if __name__ == "__main__":
    unittest.main()
