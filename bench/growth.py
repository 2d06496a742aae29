#!/usr/bin/env python3
"""What a run costs as it grows: processor time and peak memory against samples, levels, components of a value, threads, ranks
and the size of a block. Fits the exponent of each, without what it costs to start, and names those above what is expected.

    python3 bench/growth.py BUILD [--most 1e7] [--rounds 3] [--only AXIS] [--write]

--write puts table and picture into bench/README.md and bench/growth.png. Each point is a process of its own, the least of the
rounds: processor seconds, since other guests come and go (threads and ranks also by the clock). Fails where an exponent is too
large. AXIS: samples, levels, survey, components, threads, ranks, block. A run of 1e9 samples (--most 1e9) takes ten minutes.
"""
import argparse
import math
import os
import pathlib
import re
import resource
import subprocess
import sys
import tempfile
import time

root = pathlib.Path(__file__).resolve().parent.parent
SLACK = 0.12  # of an exponent, beside what is expected

OWN = """
import sys, numpy as np, debias
c = int(sys.argv[1])
p = debias.function_of_mean(lambda u: u * np.arange(1, c + 1), lambda m: m * m, inputs=c, components=c)
debias.estimate(p, samples=512)
"""


def peak_of(pid):
    """KiB that a process, or the largest of those below it, has had at most; what it was before it began does not count, as it
    does in rusage."""
    largest = 0
    try:
        pids = [pid]
        for p in pids:
            pids += [int(x) for x in pathlib.Path(f"/proc/{p}/task/{p}/children").read_text().split()]
            found = re.search(r"VmHWM:\s+(\d+)", pathlib.Path(f"/proc/{p}/status").read_text())
            largest = max(largest, int(found[1]) if found else 0)
    except OSError:
        pass
    return largest


def measure(words, environment):
    """Processor seconds, peak MiB and seconds by the clock of a command."""
    with tempfile.TemporaryFile() as said:
        start, peak, done = time.perf_counter(), 0, 0
        process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT, env=os.environ | environment)
        while not done:
            peak = max(peak, peak_of(process.pid))
            time.sleep(0.005)
            done, status, used = os.wait4(process.pid, os.WNOHANG)
        process.returncode = os.waitstatus_to_exitcode(status)
        clock = time.perf_counter() - start
        if process.returncode != 0:
            said.seek(0)
            sys.exit(f"growth: {' '.join(map(str, words))} ended with {process.returncode}: {said.read().decode()[-300:]}")
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return used.ru_utime + used.ru_stime, (used.ru_maxrss if used.ru_maxrss > 1.05 * own else peak) / 1024, clock


def powers(first, last, base):
    count = round(math.log(last / first, base))
    return [round(first * base**i) for i in range(count + 1)]


def exponent(points):
    """Slope of log(y - y of the smallest) over log x between the last two points: without what it costs to start. 0 where y
    grows by less than a tenth in all."""
    (_, start), (x1, y1), (x2, y2) = points[0], points[-2], points[-1]
    if y2 < 1.1 * start:
        return 0.0
    if len(points) < 4:  # none to spare for the start
        return math.log(y2 / start) / math.log(x2 / points[0][0])
    return math.log((y2 - start) / max(y1 - start, 0.02 * y2)) / math.log(x2 / x1)


class Axis:
    def __init__(self, name, what, unit, values, words, time_expected, memory_expected, note=""):
        self.name, self.what, self.unit, self.values, self.words = name, what, unit, values, words
        self.expected = {"time": time_expected, "memory": memory_expected}
        self.note, self.points = note, []  # (x, cpu, MiB, clock)

    def run(self, rounds, environment):
        for x in self.values:
            seen = [measure(self.words(x), environment) for _ in range(rounds)]
            self.points.append((x, *(min(column) for column in zip(*seen))))
            print(f"{self.name:11}{x:>12}{self.points[-1][1]:10.3f} s{self.points[-1][2]:9.1f} MiB{self.points[-1][3]:9.3f} s by the clock", flush=True)

    def exponents(self):
        return {"time": exponent([(x, cpu) for x, cpu, _, _ in self.points]),
                "memory": exponent([(x, size) for x, _, size, _ in self.points])}

    def too_steep(self):
        return [f"{what} ~ {self.unit}^{e:.2f}, at most {self.expected[what]} was expected" for what, e in self.exponents().items()
                if e > self.expected[what] + SLACK]


def axes(build, most):
    program = str(build / "bin/debias")
    ranked = lambda r: ["mpirun", "-n", str(r)] if r > 1 else []
    run = lambda *words: [program, "run", *map(str, words), "-q"]
    return [
        Axis("samples", "`run A03`, one thread", "N", powers(1000, most, 10), lambda n: run("A03", "--samples", n, "--threads", 1), 1, 0),
        Axis("levels", "`run D01 --estimator roulette --base-level L`, 1e5 samples", "L", powers(4, 1024, 4),
             lambda k: run("D01", "--estimator", "roulette", "--base-level", k, "--samples", 100000, "--threads", 1), 1, 0,
             "each sample adds L terms"),
        Axis("survey", "`survey D01 --levels L`, 1000 samples a level", "L", powers(8, 128, 2),
             lambda k: [program, "survey", "D01", "--levels", str(k), "--samples", "1000", "--threads", "1", "-q"], 2, 1,
             "not linear: the value of level k is a sum of k terms, so all levels are L^2 / 2 of them"),
        Axis("components", "own values in Python, 512 samples", "d", powers(1, 10000, 10),
             lambda d: [sys.executable, "-c", OWN, str(d)], 1, 1),
        Axis("threads", "`run E02`, 2e6 samples", "threads", [1, 2], lambda t: run("E02", "--samples", 2000000, "--threads", t), 0, 0.5,
             "processor time, of all threads"),
        Axis("ranks", "`mpirun -n R debias run E02`, 2e6 samples", "R", [1, 2, 4],
             lambda r: ranked(r) + run("E02", "--samples", 2000000, "--threads", 1), 0.6, 0.5,
             "each rank starts MPI and waits for others in a loop; memory is of the largest process"),
        Axis("block", "`run E02 --block b`, 1e6 samples", "b", powers(1, 4096, 4),
             lambda b: run("E02", "--block", b, "--samples", 1048576, "--threads", 1), 0, 0),
    ]


def table(done, commit):
    lines = ["## Cost of growth", "",
             f"`python3 bench/growth.py BUILD --write`, commit {commit}, {time.strftime('%Y-%m-%d', time.gmtime())}: processor seconds and peak",
             "memory of whole processes, from the smallest to the largest; exponents are of the last step, less what the smallest takes.", "",
             "| | from ... to | seconds | time ~ | MiB | memory ~ | |", "|---|---|---|---|---|---|---|"]
    for a in done:
        (x0, t0, m0, _), (x1, t1, m1, _) = a.points[0], a.points[-1]
        e = a.exponents()
        word = "; ".join(["**steeper**: " + problem for problem in a.too_steep()] + ([a.note] if a.note else []))
        lines.append(f"| {a.what} | {a.unit} = {x0:g} ... {x1:g} | {t0:.3g} ... {t1:.3g} | {a.unit}^{e['time']:.2f} | {m0:.0f} ... {m1:.0f} | "
                     f"{a.unit}^{e['memory']:.2f} | {word} |")
    return "\n".join(lines + ["", "![Processor time and memory against each of these](growth.png)", ""])


def picture(done, path):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4), dpi=80)
    for a in done:
        xs = [p[0] / a.points[0][0] for p in a.points]
        left.loglog(xs, [p[1] for p in a.points], "o-", label=a.name, markersize=3)
        right.loglog(xs, [p[2] for p in a.points], "o-", label=a.name, markersize=3)
    for axis, name in ((left, "processor seconds"), (right, "peak MiB")):
        axis.set_xlabel("over its smallest value")
        axis.set_ylabel(name)
        axis.grid(alpha=0.3)
    left.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, metadata={"Software": None})


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("build", type=pathlib.Path)
    arguments.add_argument("--most", type=float, default=1e7)
    arguments.add_argument("--rounds", type=int, default=3)
    arguments.add_argument("--only", action="append", default=[])
    arguments.add_argument("--write", action="store_true")
    options = arguments.parse_args()
    environment = {"PYTHONPATH": str(options.build.resolve() / "python"), "OMPI_ALLOW_RUN_AS_ROOT": "1",
                   "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1"}
    done = [a for a in axes(options.build.resolve(), options.most) if not options.only or a.name in options.only]
    if not done:
        sys.exit(f"growth: no axis {options.only[0]!r}")
    for a in done:
        a.run(options.rounds, environment)
    commit = subprocess.run(["git", "-C", str(root), "rev-parse", "--short", "HEAD"], stdout=subprocess.PIPE, text=True).stdout.strip()
    text = table(done, commit)
    print("\n" + text)
    if options.write:
        page = root / "bench/README.md"
        old = page.read_text()
        section = re.compile(r"## Cost of growth\n.*?(?=\n## |\Z)", re.S)
        page.write_text(section.sub(lambda _: text.rstrip("\n") + "\n", old) if section.search(old) else old.rstrip("\n") + "\n\n" + text)
        picture(done, root / "bench/growth.png")
    return any(a.too_steep() for a in done)


if __name__ == "__main__":
    sys.exit(main())
