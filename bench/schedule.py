"""What heavy-tailed work does to many ranks: a simulation of the groups of src/core/chunks.hpp, one thread a rank, with the
times of samples as measured. Levels beyond those that the measured run reached go on at its last ratios.
    /usr/bin/python3 bench/schedule.py PROGRAM "E02 --pmf geometric:r=0.6464" [SECONDS=600] [SEEDS=5]
"""

import heapq
import json
import subprocess
import sys

import numpy

program, words = sys.argv[1:3]
wanted_seconds, seeds = [float(x) for x in sys.argv[3:]] + [600.0, 5.0][len(sys.argv) - 3:]
fetch = 1e-3  # seconds that a rank waits for a group: rank 0 looks for messages at least that often
chunk = 512

def measured():
    """Probabilities of the levels, and seconds of a sample that ends there."""
    run = json.loads(subprocess.run([program, "run", *words.split(), "--samples", "1e6", "--threads", "1", "--json"],
                                    check=True, capture_output=True).stdout)
    unit = run["seconds"] / run["work"]
    base = sum(x["work"] for x in run["levels"] if x["is_base"])
    levels = [(x["probability"], x["work"]) for x in run["levels"] if not x["is_base"] and x["probability"]]
    levels = [x for x in levels if x[0] * run["samples"] > 100]
    (p, work), ratio = levels[-1], [b / a for a, b in zip(levels[-2], levels[-1])]
    while p > 1e-18:
        p, work = p * ratio[0], work * ratio[1]
        levels.append((p, work))
    p, work = numpy.array(levels).T
    return p / p.sum(), unit * (base + work), numpy.log(ratio[0]) / -numpy.log(ratio[1])

def groups(chunks, ranks):
    """Chunks of each group, in order."""
    at, sizes = 0, []
    while at < chunks:
        size = 1 << (max(1, (chunks - at) // (2 * ranks)).bit_length() - 1)
        size = min(size, at & -at) if at else size
        sizes.append(size)
        at += size
    return numpy.array(sizes)

p, seconds, tail = measured()
mean = float(p @ seconds)
print(f"{words}: {mean * 1e9:.0f} ns a sample, tail index of the work {tail:.2f}; {wanted_seconds:g} s on each rank")
print("   ranks    samples  groups a rank  fetches/s  longest sample  efficiency, median and worst of", int(seeds))
for ranks in (2, 16, 100, 1000, 10_000):
    sizes = groups(int(ranks * wanted_seconds / mean) // chunk, ranks)
    efficiencies, longest = [], []
    for seed in range(int(seeds)):
        rng = numpy.random.default_rng(seed)
        busy, deepest = [], 0
        for part in numpy.array_split(sizes, max(1, len(sizes) // 20_000)):
            counts = rng.multinomial(part * chunk, p)
            busy.append(counts @ seconds)
            deepest = max(deepest, numpy.nonzero(counts.sum(axis=0))[0][-1])
        busy = numpy.concatenate(busy)
        free = [0.0] * ranks
        for time in busy:
            heapq.heapreplace(free, free[0] + time + fetch)
        efficiencies.append(busy.sum() / (ranks * max(free)))
        longest.append(seconds[deepest])
    print(f"{ranks:8d} {float(sizes.sum() * chunk):10.1e} {len(sizes) / ranks:14.1f} {len(sizes) / max(free):10.0f} "
          f"{numpy.median(longest):13.3g} s  {numpy.median(efficiencies):.3f} {min(efficiencies):.3f}")
