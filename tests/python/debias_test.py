"""The Python package: the bits of the program and of C++.

    PYTHONPATH=BUILD/python DEBIAS_PROGRAM=BUILD/bin/debias DEBIAS_SAME_BITS=BUILD/bin/debias_same_bits \
        /usr/bin/python3 tests/python/debias_test.py
"""

import contextlib
import io
import json
import os
import re
import subprocess
import unittest
import warnings
from pathlib import Path

import numpy as np

import debias

from shared import PMF, PROGRAM, SCALAR, VECTOR, ignoring_doubts, powers, program, square


SAME_BITS = os.environ["DEBIAS_SAME_BITS"]


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


if __name__ == "__main__":
    unittest.main()
