"""Own functions in Python against plain NumPy: processor seconds to a relative error, pilots counted, alternating.

    PYTHONPATH=BUILD/python python3 tests/python/against_numpy.py [RELATIVE_ERROR ...]

Each way runs to the error that it is asked for by a pilot of its own, five times; its true error is that of the five answers from
the truth, shown beside the seconds. The NumPy side is what one writes by hand: the same functions, coupled the same way, with a
pilot of 1000 draws.

  single      a vectorised single-term estimate, geometric PMF by the declared rates, levels grouped
  multilevel  Giles' driver: pilot of 1000, optimal numbers of draws, levels until the bias is below half of the error
"""

import sys
import time
import warnings

import numpy as np

import debias

warnings.simplefilter("ignore", debias.DebiasWarning)


# ---- the problems: (levels in NumPy: f(k, rng, n) -> fine, coarse, work), the debias problem, truth, beta


def doubling(draw, g):
    """g of the mean of 2^k draws: fine, and the average over both halves."""

    def level(k, rng, n):
        y = draw(rng, n << k).reshape(n, 1 << k, -1)
        fine = g(y.mean(axis=1))
        coarse = np.zeros_like(fine) if k == 0 else (g(y[:, ::2].mean(axis=1)) + g(y[:, 1::2].mean(axis=1))) / 2
        return fine, coarse

    return level


def reciprocal():
    """1 / E X, X = 1 + U^2."""

    def draw(u):
        return 1 + u[:, 0] ** 2

    own = debias.function_of_mean(draw, "reciprocal")
    return doubling(lambda r, n: draw(r.random((n, 1)))[:, None], lambda m: 1 / m), own, np.array([0.75]), 2.0, 0


def evidence():
    """log E L(theta) and its gradient in a shift of the data, logistic regression with 20 data, theta normal."""
    rng = np.random.default_rng(5)
    x = rng.normal(size=20)
    y = np.sign(x + rng.logistic(size=20))

    def likelihood(theta):  # (n, 2): L and dL
        z = y * (x + theta[:, :1])
        p = 1 / (1 + np.exp(-z))
        value = np.prod(2 * p, axis=1)
        return np.stack((value, value * (y * (1 - p)).sum(axis=1)), axis=1)

    def g(m):
        return np.stack((np.log(m[:, 0]), m[:, 1] / m[:, 0]), axis=1)

    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    exact = likelihood(nodes[:, None] * 0.5).T @ weights / weights.sum()
    own = debias.function_of_mean(lambda z: likelihood(0.5 * z), g, normals=True, inputs=2, components=2, lowest_base=2)
    return doubling(lambda r, n: likelihood(0.5 * r.normal(size=(n, 1))), g), own, g(exact[None])[0], 2.0, 2


def information():
    """E log E[p(y | theta') given y] of a normal model: the costly part of the expected information gain."""

    def density(y, theta):
        return np.exp(-0.5 * (y - theta) ** 2)

    def level(k, rng, n):
        y = rng.normal(size=(n, 1)) + rng.normal(size=(n, 1))
        p = density(y, rng.normal(size=(n, 1 << k)))
        fine = np.log(p.mean(axis=1))
        coarse = np.zeros(n) if k == 0 else (np.log(p[:, ::2].mean(axis=1)) + np.log(p[:, 1::2].mean(axis=1))) / 2
        return fine[:, None], coarse[:, None]

    own = debias.nested(lambda z: z[:, 0] + z[:, 1], lambda y, z: density(y, z[:, 0]), np.log, outer_dimension=2, normals=True,
                        lowest_base=2)
    return level, own, np.array([-0.5 * np.log(2) - 0.5]), 1.5, 2


def call():
    """A European call on geometric Brownian motion by Milstein's scheme."""
    s0, strike, r, sigma = 100.0, 100.0, 0.05, 0.2

    def end(dw, h):
        x = np.full(len(dw), s0)
        for w in dw.T:
            x = x * (1 + r * h + sigma * w + 0.5 * sigma**2 * (w * w - h))
        return np.exp(-r) * np.maximum(x - strike, 0)

    def both(k, z):
        h = 1 / z.shape[1]
        dw = z * np.sqrt(h)
        return (end(dw, h), end(dw[:, ::2] + dw[:, 1::2], 2 * h)) if k else (end(dw, h), np.zeros(len(z)))

    def level(k, rng, n):
        fine, coarse = both(k, rng.normal(size=(n, 1 << k)))
        return fine[:, None], coarse[:, None]

    def differences(k, z):
        return both(k, z) if k else both(k, z)[0]

    own = debias.levels(differences, dimension=lambda k: 2**k, rates=(2, 1), normals=True)
    return level, own, np.array([10.450583572185565]), 2.0, 0


def subsampling():
    """exp(-U), U the mean of 10000 data, each draw one of them."""
    data = np.random.default_rng(7).gamma(2.0, size=10_000) / 2

    def draw(u):
        return data[(u[:, 0] * len(data)).astype(int)]

    def g(m):
        return np.exp(-m)

    own = debias.function_of_mean(draw, "exp-minus")
    return doubling(lambda r, n: draw(r.random((n, 1))), g), own, np.array([np.exp(-data.mean())]), 2.0, 0


def pareto():
    """The ratio of two means of Pareto(5) variables, one scaled."""

    def draw(u):
        return u ** (-1 / 5.0) * np.array([1.0, 2.0])

    def g(m):
        return (m[:, 0] / m[:, 1])[:, None]

    own = debias.function_of_mean(draw, lambda m: m[:, 0] / m[:, 1], dimension=2, inputs=2)
    return doubling(lambda r, n: draw(r.random((n, 2))), g), own, np.array([0.5]), 2.0, 0


def elliptic():
    """-(a u')' = 1 on (0, 1), a = exp of three random modes, u(0) = u(1) = 0: the integral of u on grids of 2^(k + 2) cells."""
    modes = np.arange(1, 4)

    def solved(z, cells):
        x = (np.arange(cells) + 0.5) / cells
        a = np.exp(0.5 * (z / modes) @ np.cos(np.pi * modes[:, None] * x))
        h = 1 / cells
        nodes = np.arange(cells + 1) * h  # the flux is c - x: c from u(1) = 0, trapezoids for the integral of u
        mid = (nodes[1:] + nodes[:-1]) / 2
        c = ((mid / a).sum(axis=1) / (1 / a).sum(axis=1))[:, None]
        u = np.cumsum((c - mid) / a * h, axis=1)
        return u.sum(axis=1) * h

    def level(k, rng, n):
        z = rng.normal(size=(n, 3))
        return solved(z, 4 << k)[:, None], (solved(z, 2 << k) if k else np.zeros(n))[:, None]

    def differences(k, z):
        return (solved(z, 4 << k), solved(z, 2 << k)) if k else solved(z, 4)

    own = debias.levels(differences, dimension=3, work=lambda k: 2.0**k, rates=(4, 1), normals=True, deepest_level=18)
    rng = np.random.default_rng(3)
    nodes, weights = np.polynomial.hermite_e.hermegauss(16)
    grid = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    w = np.prod(np.stack(np.meshgrid(weights, weights, weights, indexing="ij"), axis=-1).reshape(-1, 3), axis=1)
    del rng
    return level, own, np.array([solved(grid, 4096) @ w / w.sum()]), 4.0, 0


PROBLEMS = {"1 / E X": reciprocal, "log evidence, gradient": evidence, "information gain": information, "call": call,
            "exp(-U)": subsampling, "ratio of Pareto": pareto, "elliptic": elliptic}


# ---- NumPy by hand


def blocks(level, k, rng, n):
    """Of n draws: fine and coarse, some at a time."""
    some = max(1, (1 << 18) >> k)
    parts = [level(k, rng, min(some, n - i)) for i in range(0, n, some)]
    return tuple(np.concatenate(p) for p in zip(*parts))


def single(level, beta, base, wanted, seed):
    rng = np.random.default_rng(seed)
    r = 1 - 2 ** (-(beta + 1) / 2)

    def run(n):
        counts = np.bincount(rng.geometric(r, n))
        fine, _ = blocks(level, base, rng, n)
        z = fine
        at = 0
        for j, m in enumerate(counts):
            if m:
                f, c = blocks(level, base + j, rng, m)
                z[at:at + m] += (f - c) / (r * (1 - r) ** (j - 1))
                at += m
        return z

    pilot = run(1000)
    n = int(1.1 * (np.sqrt((pilot.var(axis=0) / 1).sum()) / wanted) ** 2) + 1
    return run(n).mean(axis=0)


def multilevel(level, beta, base, wanted, seed):
    rng = np.random.default_rng(seed)
    drawn = []
    for k in range(base, base + 3):
        drawn.append(list(blocks(level, k, rng, 1000)))
    while True:
        d = [f - c if j else f for j, (f, c) in enumerate(drawn)]
        v = np.array([x.var(axis=0).sum() for x in d])
        cost = 2.0 ** np.arange(len(d))
        need = np.ceil(2 / wanted**2 * np.sqrt(v / cost) * np.sqrt(v * cost).sum()).astype(int)
        for j, want in enumerate(need):
            more = want - len(drawn[j][0])
            if more > 0:
                drawn[j] = [np.concatenate(p) for p in zip(drawn[j], blocks(level, base + j, rng, more))]
        d = [f - c if j else f for j, (f, c) in enumerate(drawn)]
        alpha = max(beta / 2, 0.5)
        bias = max(np.linalg.norm(d[-1].mean(axis=0)), np.linalg.norm(d[-2].mean(axis=0)) / 2**alpha) / (2**alpha - 1)
        if bias < wanted / np.sqrt(2):
            return sum(x.mean(axis=0) for x in d)
        drawn.append(list(blocks(level, base + len(drawn), rng, 1000)))


def main():
    errors = [float(x) for x in sys.argv[1:]] or [1e-2, 1e-3]
    for relative in errors:
        print(f"relative error {relative:g}: processor seconds, median of 5 (true error / wanted)")
        for name, make in PROBLEMS.items():
            level, own, truth, beta, base = make()
            wanted = relative * np.linalg.norm(truth)
            options = {} if own.declares_rates else {"estimator": "recipe"}
            if base:
                options["base_level"] = base
            ways = {"debias": lambda s: debias.estimate(own, error=wanted, seed=s, **options).mean,
                    "recipe": lambda s: debias.estimate(own, error=wanted, seed=s, estimator="recipe").mean,
                    "single": lambda s: single(level, beta, base, wanted, s),
                    "multilevel": lambda s: multilevel(level, beta, base, wanted, s)}
            seconds, off = {w: [] for w in ways}, {w: [] for w in ways}
            for seed in range(5):
                for way, f in ways.items():
                    start = time.process_time()
                    try:
                        answer = f(seed + 1)
                    except ValueError:  # the PMF would need levels too deep to draw
                        continue
                    seconds[way].append(time.process_time() - start)
                    off[way].append(np.linalg.norm(np.atleast_1d(answer) - truth))
            line = f"  {name:24}"
            for way in ways:
                if len(seconds[way]) < 5:
                    line += f"  {way} refused       "
                    continue
                ratio = np.sqrt(np.mean(np.square(off[way]))) / wanted
                line += f"  {way} {np.median(seconds[way]):7.3f} ({ratio:.2f})"
            print(line, flush=True)


if __name__ == "__main__":
    main()
