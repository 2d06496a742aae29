"""What the tests of the Python package share: levels whose bits C++ gives too."""

import os
import subprocess
import warnings

import numpy as np

import debias


PROGRAM = os.environ["DEBIAS_PROGRAM"]
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
