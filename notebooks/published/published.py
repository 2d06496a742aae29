#!/usr/bin/env python3
"""Figures that others have published, and the library's beside them: python3 notebooks/published/published.py

The figures are in tables.json; debias_published (options.cpp) and debias compute them anew, a seed for each row. A row agrees
within 4.5 standard errors: the library's, that of the published figure where it is a Monte Carlo estimate, and its rounding. The
sum of z^2 of a table is judged against chi^2, at 1e-6. Needs Python alone, and the two programs of build/release/bin.
"""
import argparse
import cmath
import concurrent.futures
import json
import math
import os
import pathlib
import random
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
LIMIT = 4.5

# ---- statistics


def rounding(text):
    """Standard deviation of what the rounding of a printed number has taken away."""
    mantissa, _, exponent = text.lower().partition("e")
    decimals = len(mantissa.partition(".")[2]) - int(exponent or 0)
    return 10.0**-decimals / math.sqrt(12)


def normal_of_student(t, freedom):
    """The normal deviate of the probability of a t, after Wallace (1959)."""
    if not math.isfinite(freedom):
        return t
    size = math.sqrt(freedom * math.log1p(t * t / freedom)) * (8 * freedom + 1) / (8 * freedom + 3)
    return math.copysign(size, t)


def chance(square, freedom):
    """P(chi^2 > square), after Wilson and Hilferty (1931)."""
    spread = 2 / (9 * freedom)
    return math.erfc(((square / freedom) ** (1 / 3) - 1 + spread) / math.sqrt(2 * spread)) / 2


def compare(published, known, ours, error, freedom):
    """z of a difference. `known`: error of the published figure beside its rounding. Only `error` is estimated, with `freedom`."""
    total = math.hypot(error, known, rounding(published))
    share = (error / total) ** 2
    return normal_of_student((ours - float(published)) / total, freedom / share**2 if share > 0 else math.inf)


def compare_sizes(published, replicates):
    """z of one figure among replicates of the same number of draws, by their logarithms where all are positive."""
    positive = float(published) > 0 and min(replicates) > 0
    scale = math.log if positive else float
    numbers = [scale(x) for x in replicates]
    n = len(numbers)
    mean = sum(numbers) / n
    deviation = math.sqrt(sum((x - mean) ** 2 for x in numbers) / (n - 1))
    z = (mean - scale(float(published))) / (deviation * math.sqrt(1 + 1 / n))
    return normal_of_student(z, n - 1)


# ---- other ways to the same numbers


def asian_by_equation(spot, strike, rate, volatility, horizon, points=400, steps=200):
    """Vecer's equation u_t + sigma^2 (q - z)^2 u_zz / 2 = 0, q = (1 - exp(-r (T - t))) / (r T), u(T) = max(z, 0): price = S u(0, q(0) -
    exp(-r T) K / S). Crank-Nicolson from four half-steps of the implicit scheme, on z = c sinh(x).  [Vecer, Risk 15 (2002)]"""
    reach = 6 * volatility * math.sqrt(horizon)
    width = 0.05 * volatility * math.sqrt(horizon)
    edge = math.asinh(reach / width)
    z = [width * math.sinh(edge * (2 * i / points - 1)) for i in range(points + 1)]
    u = [max(x, 0.0) for x in z]
    inner = range(1, points)
    down = [0.0] + [1 / ((z[i] - z[i - 1]) * (z[i + 1] - z[i - 1])) for i in inner]
    up = [0.0] + [1 / ((z[i + 1] - z[i]) * (z[i + 1] - z[i - 1])) for i in inner]
    h = horizon / steps
    moves = [(0.5 * h, 1.0)] * 4 + [(h, 0.5)] * (steps - 2)
    left = horizon
    for length, implicit in moves:

        def diffusion(t):
            q = -math.expm1(-rate * (horizon - t)) / (rate * horizon)
            return [volatility**2 * (q - x) ** 2 for x in z]

        a = diffusion(left) if implicit < 1 else None
        left -= length
        b = diffusion(max(left, 0.0))
        right = u[:]
        if a:
            for i in inner:
                lower, upper = a[i] * down[i], a[i] * up[i]
                right[i] += (1 - implicit) * length * (lower * (u[i - 1] - u[i]) + upper * (u[i + 1] - u[i]))
        c = [0.0] * (points + 1)  # Thomas' algorithm; u(z_0) = 0 and u(z_n) = z_n stay
        for i in inner:
            lower, upper = implicit * length * b[i] * down[i], implicit * length * b[i] * up[i]
            pivot = 1 + lower + upper - lower * c[i - 1]
            c[i] = upper / pivot
            right[i] = (right[i] + lower * right[i - 1]) / pivot
        for i in reversed(inner):
            right[i] += c[i] * right[i + 1]
        u = right
    at = -math.expm1(-rate * horizon) / (rate * horizon) - math.exp(-rate * horizon) * strike / spot
    i = max(j for j in range(1, points - 1) if z[j] <= at)
    nodes = range(i - 1, i + 3)
    return spot * sum(u[j] * math.prod((at - z[k]) / (z[j] - z[k]) for k in nodes if k != j) for j in nodes)


def asian_by_equation_extrapolated(**option):
    """On two grids, and what their difference leaves."""
    coarse = asian_by_equation(**option, points=200, steps=100)
    fine = asian_by_equation(**option, points=400, steps=200)
    return fine + (fine - coarse) / 3


def heston_by_fourier(spot, strike, rate, horizon, variance, reversion, mean, volatility, correlation):
    """Call = S - sqrt(S K) exp(-r T / 2) / pi * integral over u > 0 of Re[exp(i u k) phi(u - i / 2)] / (u^2 + 1/4)
    [Lewis 2000], phi of log(S_T / forward) in the form without jumps of the logarithm [Albrecher et al. 2007]."""
    k = math.log(spot / strike) + rate * horizon

    def phi(u):
        beta = reversion - 1j * correlation * volatility * u
        d = cmath.sqrt(beta * beta + volatility**2 * (u * u + 1j * u))
        g = (beta - d) / (beta + d)
        fall = cmath.exp(-d * horizon)
        drift = (beta - d) * horizon - 2 * cmath.log((1 - g * fall) / (1 - g))
        return cmath.exp(reversion * mean / volatility**2 * drift + variance / volatility**2 * (beta - d) * (1 - fall) / (1 - g * fall))

    n, end = 20000, 400.0  # the midpoint rule
    total = 0.0
    for j in range(n):
        u = (j + 0.5) * end / n
        total += (cmath.exp(1j * u * k) * phi(u - 0.5j)).real / (u * u + 0.25) * end / n
    return spot - math.sqrt(spot * strike) * math.exp(-rate * horizon / 2) / math.pi * total


def r_exponentials(seed, n):
    """set.seed(seed); rexp(n) of R: its Mersenne Twister, and algorithm SA of Ahrens & Dieter, Comm. ACM 15 (1972)."""
    word = seed
    for _ in range(50):
        word = (69069 * word + 1) & 0xFFFFFFFF
    words = []
    for _ in range(625):
        word = (69069 * word + 1) & 0xFFFFFFFF
        words.append(word)
    twister = random.Random()
    twister.setstate((3, tuple(words[1:]) + (624,), None))

    def uniform():
        return twister.getrandbits(32) * 2.3283064365386963e-10

    q = [math.log(2)]  # sums of log(2)^k / k!
    term = q[0]
    for k in range(2, 17):
        term *= math.log(2) / k
        q.append(q[-1] + term)

    def exponential():
        whole = 0.0
        u = 2 * uniform()
        while u <= 1:
            whole += q[0]
            u *= 2
        u -= 1
        if u <= q[0]:
            return whole + u
        least = min(uniform(), uniform())
        i = 1
        while u > q[i]:
            least = min(least, uniform())
            i += 1
        return whole + least * q[0]

    return [exponential() for _ in range(n)]


# ---- the library


def parameters(table, row):
    words = dict(word.split("=") for word in table["common"].split())
    words.update(zip(table["columns"], map(str, row)))
    return words


def ask(bin_folder, words, error):
    """What the library says to a row."""
    kind = words["kind"]
    if kind == "problem":
        command = [bin_folder / "debias", "run", words["problem"], "--estimator", "recipe", "--error", repr(error), "--seed",
                   words["seed"], "--threads", "1", "--json"]
        text = ""
    else:
        command = [bin_folder / "debias_published"]
        if kind == "pareto":
            words = {"kind": kind, "values": ",".join(map(repr, r_exponentials(123, 100)))}
        elif kind != "levels":
            words = {**words, "error": repr(error)}
        text = " ".join(f"{key}={value}" for key, value in words.items()) + "\n"
    done = subprocess.run(command, input=text, capture_output=True, text=True)
    if not done.stdout:  # a goal that was missed is an answer, with the error that it has
        raise RuntimeError(f"{' '.join(map(str, command))}: {text}{done.stderr}")
    answer = json.loads(done.stdout)
    answer.setdefault("error", answer.get("standard_error"))
    answer["warnings"] = [w["text"] if isinstance(w, dict) else w for w in answer.get("warnings", [])]
    return answer


def judge(table, row, answer, published):
    """(what, published text, ours, error, z) of each published figure of a row."""
    words = parameters(table, row)
    kind = words["kind"]
    for name, text in zip(table.get("published", [""]), published):
        if kind == "levels":
            numbers = answer[name]
            mean = sum(numbers) / len(numbers)
            deviation = math.sqrt(sum((x - mean) ** 2 for x in numbers) / (len(numbers) - 1))
            yield name, text, mean, deviation / math.sqrt(len(numbers)), compare_sizes(text, numbers)
        elif kind == "pareto":
            ours = (100 * answer["k"] + 5) / 110 if name == "k" else answer["sigma"]
            yield name, text, ours, 0.0, (ours - float(text)) / (1e-13 * abs(float(text)))
        else:
            known = float(words.get("published_error", 0))
            z = compare(text, known, answer["mean"], answer["error"], answer["blocks"] - 1)
            yield name, text, answer["mean"], answer["error"], z


def digits(x, error):
    """Two digits of the error, and as many decimals of the number."""
    if not error:
        return f"{x:.16g}", "0"
    decimals = max(0, 1 - math.floor(math.log10(error)))
    return f"{x:.{decimals}f}", f"{error:.{decimals}f}"


def threads_of(options):
    return options.threads or os.cpu_count()


def run(options):
    """The tables, and (table, row, its judged figures, warnings) of each row that was asked for."""
    data = json.loads(options.tables.read_text())
    jobs = {}
    plan = []
    for table in data["tables"]:
        rows = table["rows"][: options.rows] if options.rows else table["rows"]
        for i, row in enumerate(rows):
            figures = row[len(table["columns"]):]
            words = parameters(table, row[: len(table["columns"])])
            words.pop("published_error", None)
            words["seed"] = str(table["seed"] + i)
            key = json.dumps(words)
            jobs[key] = (words, float(words.get("goal", table.get("error", 0))) * options.coarser)
            plan.append((table, row[: len(table["columns"])], figures, key))
    with concurrent.futures.ThreadPoolExecutor(threads_of(options)) as pool:
        asked = {key: pool.submit(ask, options.bin, *job) for key, job in jobs.items()}
        answers = {key: future.result() for key, future in asked.items()}
    return data, [(table, row, list(judge(table, row, answers[key], figures)), answers[key]["warnings"])
                  for table, row, figures, key in plan]


# ---- the page

HEAD = """# Published figures, and the library's

`{command}`, at commit {commit}: {cpu} of processor, {seconds} on {threads} threads of a shared machine.

Each figure stands in a paper, a test suite or a package's manual, as its table says; `debias` is this library's answer with its standard
error, by `recipe` to a stated error, from a seed of its own for each row. The library's side uses no closed form: steps in time and
inner samples are debiased away. z is the difference in units of both errors: the library's (Student's t), that of a published Monte Carlo
estimate as stated, and the rounding of the printed digits. A figure agrees below {limit}; the sum of z^2 of a table is held against
chi^2 at 1e-6, for what no single figure shows.

Parameters that all rows of a table share are in the line above it. `yield` is that of the dividends, `seen` the extreme of the past. A
lookback pays S_T - min (call) or max - S_T (put), with a fixed strike (max - K)+ or (K - min)+. The rebate of a knock-in is paid at the
end. Left out: Haug's knock-outs, whose rebate is paid at the touch (a time that no summary of a path here knows without bias), and
Beaglehole's lookback at 5.477, whose goal was refused when these tables were made.

**Levels.** Tables of multilevel runs give mean, variance and kurtosis of D_l over 20,000 or 200,000 draws. The library draws as many, 12
or 24 times over, and the published figure has to be one more of these repetitions (by logarithms, where all are positive); `debias` is
their mean. Kurtosis is central there, E(D - E D)^4 / Var(D)^2, and in these tables; surveys of the library print the raw E D^4 / (E D^2)^2.

**Wrong where published.** Two tables, named so, disagree; their rows stay in, marked. One finds out by two ways that share nothing: the
library's paths, and a differential equation (`equation`; Vecer's, by finite differences in the script). Where these two agree and the
published figure does not, it is the published one that is wrong. The equation also gives Linetsky's figures, within 3e-7, and his
are for the very parameters of Geman's table.

"""


def is_wrong(table):
    return table.get("wrong", False)


def equation_for(table, row):
    words = parameters(table, row)
    return asian_by_equation_extrapolated(**{key: float(words[key]) for key in ("spot", "strike", "rate", "volatility", "horizon")})


def section(table, entries, with_equation):
    """Lines of a table, (figures that agree, that differ, sum of z^2, its chance), and what was not expected."""
    surprises = []
    has_names = "published" in table
    header = table["columns"] + ["figure"] * has_names + ["published", "debias", "+-", "z"] + ["equation"] * with_equation + [""]
    quoted = f", as quoted in {table['quoted']}" if table["quoted"] else ""
    lines = [f"## {table['name']}", "", f"{table['source']}{quoted}. `{table['common']}`; seeds from {table['seed']}.", "",
             "| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    square, agree, differ = 0.0, 0, 0
    for row, figures, _ in entries:
        exact = equation_for(table, row) if with_equation else None
        ours, error = figures[0][2:4]
        if with_equation and abs(exact - ours) > LIMIT * error + 1e-6 * ours:
            surprises.append(f"{table['name']} {row}: equation {exact:.7g}, debias {ours:.7g} +- {error:.2g}")
        for name, text, ours, error, z in figures:
            shown, bar = digits(ours, error)
            good = abs(z) < LIMIT
            agree, differ, square = agree + good, differ + (not good), square + z * z
            if not good and not is_wrong(table):
                surprises.append(f"{table['name']} {row} {name}: published {text}, debias {shown} +- {bar}, z {z:.1f}")
            cells = [*map(str, row), *[name] * has_names, text, shown, bar, f"{z:.2f}" if abs(z) < 100 else f"{z:.0f}"]
            cells += [f"{exact:.7g}"] if with_equation else []
            cells.append("" if good else f"off by {100 * (float(text) / ours - 1):+.2g} %")
            lines.append("| " + " | ".join(cells) + " |")
    for row, _, warnings in entries:
        lines += [f"\nThe library warns at {', '.join(map(str, row))}: {warning.rstrip('.')}." for warning in warnings]
    p = chance(square, agree + differ)
    if with_equation and not differ:
        surprises.append(f"{table['name']}: nothing differs")
    if not is_wrong(table) and p < 1e-6:
        surprises.append(f"{table['name']}: sum of z^2 is {square:.1f} for {agree + differ} figures")
    if table["common"] == "kind=pareto":
        lines += ["", "Here z is in units of 1e-13 of the figure: both sides evaluate one formula in doubles. k has the weak prior, (n k + 5) / (n + 10)."]
    return lines + [""], (agree, differ, square, p), surprises


def costs_section(data, options):
    """Steps to an error: published, of fine paths; with the coarse ones; and the library's, of both and of the pilot."""
    lines = ["## Costs", "", "Steps of paths to an error, nothing to agree on. Published: of the fine paths, and with the coarse ones, by its numbers of",
             "draws; a root mean square error. The recipe's: all steps of pilot and run, for a standard error of that size.", "",
             "| problem | error | published | with coarse paths | recipe |", "|---|---|---|---|---|"]
    for problem, error, fine, draws in data["costs"]:
        both = draws[0] + 1.5 * sum(n * 2**level for level, n in enumerate(draws) if level)
        ours = ask(options.bin, {"kind": "problem", "problem": problem, "seed": "1"}, error)["work"]
        lines.append(f"| {problem} | {error} | {fine} | {both:.3e} | {ours:.3e} |")
    return lines + [""]


def page(data, judged, options):
    lines, surprises, total = [], [], [0, 0]
    summary = ["| table | figures | differ | sum of z^2 | chance of more |", "|---|---|---|---|---|"]
    for table in data["tables"]:
        entries = [rest for of, *rest in judged if of is table]
        text, (agree, differ, square, p), unexpected = section(table, entries, is_wrong(table) and not options.quick)
        lines += text
        surprises += unexpected
        total = [total[0] + agree, total[1] + differ]
        summary.append(f"| {table['name']} | {agree + differ} | {differ} | {square:.3g} | {p:.2g} |")
    if not options.quick:
        lines += costs_section(data, options)
    return summary + [""] + lines, total, surprises


def commit():
    done = subprocess.run(["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True)
    return done.stdout.strip() or "unknown"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the page, README.md of this folder")
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build/release/bin", help="the folder of debias and debias_published")
    parser.add_argument("--threads", type=int, default=0, help="as many as the machine has")
    parser.add_argument("--rows", type=int, default=0, help="only the first rows of each table")
    parser.add_argument("--coarser", type=float, default=1, help="errors so many times as large")
    parser.add_argument("--quick", action="store_true", help="no equation, no costs")
    parser.add_argument("--tables", type=pathlib.Path, default=HERE / "tables.json", help="the published figures")
    options = parser.parse_args()
    for program in ("debias", "debias_published"):
        if not (options.bin / program).exists():
            sys.exit(f"{options.bin / program} is not there: build it (README.md of the project), or say --bin FOLDER")
    start = time.monotonic()
    data, judged = run(options)
    lines, (agree, differ), surprises = page(data, judged, options)
    print("\n".join(lines))
    for line in surprises:
        print("unexpected:", line)
    print(f"{agree} figures agree, {differ} differ; {len(surprises)} surprises")
    if options.write:
        used = os.times()
        head = HEAD.format(command=" ".join(["python3 notebooks/published/published.py", *sys.argv[1:]]), commit=commit(),
                           cpu=f"{sum(used[:4]):.0f} s", seconds=f"{time.monotonic() - start:.0f} s",
                           threads=threads_of(options), limit=LIMIT)
        (HERE / "README.md").write_text(head + "\n".join(lines))
    return 1 if surprises else 0


if __name__ == "__main__":
    sys.exit(main())
