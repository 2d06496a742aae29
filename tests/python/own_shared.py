"""What the tests of own problems share: functions that another process imports by name, and the test of an estimate."""

import os
import unittest
import warnings

import numpy as np

import debias

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
