"""What a sample of a NumPy function costs, against the same problem of the C++ catalogue, in alternating runs.

    PYTHONPATH=BUILD/python python3 tests/python/cost.py
"""

import warnings

import numpy as np

import debias

warnings.simplefilter("ignore", debias.DebiasWarning)


def product(dw, h):
    return 100 * np.prod(1 + 0.05 * h + 0.2 * dw + 0.02 * (dw * dw - h), axis=1)


def loop(dw, h):
    x = np.full(len(dw), 100.0)
    for w in dw.T:
        x = x + 0.05 * x * h + 0.2 * x * w + 0.02 * x * (w * w - h)
    return x


def milstein(end):
    def differences(level, u):
        h = 1 / u.shape[1]
        dw = debias.normal_quantile(u) * np.sqrt(h)
        fine = end(dw, h)
        return fine if level == 0 else (fine, end(dw[:, ::2] + dw[:, 1::2], 2 * h))

    return debias.levels(differences, dimension=lambda k: 2**k, rates=(2, 1))


def integrand(x):
    return 4 * (1 + np.sin(2 * np.pi * x[:, 0]))


pairs = (("reciprocal of an integral", debias.function_of_integral(integrand, "reciprocal", lowest_base=1),
          "reciprocal-of-integral", "geometric:r=0.8"),
         ("stock, a product over steps", milstein(product), "mean-of-gbm", "geometric:r=0.6"),
         ("stock, a loop over steps", milstein(loop), "mean-of-gbm", "geometric:r=0.6"))
for samples in (1 << 12, 1 << 16, 1 << 18):
    for name, own, catalogue, pmf in pairs:
        seconds = [[], []]
        for seed in range(9):
            for side, problem in enumerate((own, catalogue)):
                seconds[side].append(debias.estimate(problem, samples=samples, pmf=pmf, threads=1, seed=seed).seconds)
        mine, cpp = (1e6 * min(s) / samples for s in seconds)
        print(f"{samples:7} samples, {name:28} {mine:6.3f} us a sample, C++ {cpp:6.3f} us: {mine / cpp:5.2f} times")
