"""The pictures of README.md and bench/README.md: PYTHONPATH=build/release/python /usr/bin/python3 notebooks/pictures/draw.py

With the files that `sh bench/goals.sh build/release/debias_bench FOLDER` writes as arguments, `slope` alone.
"""

import json
import sys
import warnings
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

import debias  # noqa: E402
import debias.plot  # noqa: E402

warnings.simplefilter("ignore", debias.DebiasWarning)
here = Path(__file__).parent


def save(name, figure):
    figure.savefig(here / f"{name}.png", dpi=90, metadata={"Software": None})


def draw_slopes(paths):
    """Error against work of ten problems, each by four methods: 64 runs a point of the recipe's, 32 of the others'.

    Prints slopes and last points as a table.
    """
    methods = {"recipe": "recipe", "plain": "recipe without nets", "multilevel": "multilevel (biased)",
               "multilevel_nets": "multilevel with nets, by hand (biased)"}
    names = {p["id"]: p["name"].replace("-", " ") for p in debias.problems()}
    rows = [r for path in paths for r in json.loads(Path(path).read_text())["benchmarks"]]
    runs = {tuple(r["name"].split("/")[1:3]): r for r in rows if r["name"].startswith("goals/")}
    problems = sorted({problem for problem, _ in runs})
    figure, axes = plt.subplots(2, -(-len(problems) // 2), figsize=(12, 6), layout="constrained", squeeze=False)
    figure.suptitle("\n")  # room for the legend
    print("| slope: error at work |", " | ".join(methods.values()), "|")
    print("|---" * (len(methods) + 1) + "|")
    lines = {}
    for ax, problem in zip(axes.flat, problems):
        cells = [f"{problem} {names[problem]}"]
        for method, color, marker in zip(methods, ("C3", "C1", "C0", "C2"), "os^v"):
            run = runs.get((problem, method))
            if run is None:
                cells.append("")
                continue
            count = sum(key.startswith("work_") for key in run)
            works = [run[f"work_{i}"] for i in range(count)]
            errors = [run[f"error_{i}"] for i in range(count)]
            lines[method] = ax.loglog(works, errors, color=color, marker=marker, markersize=4)[0]
            cells.append(f"{run['slope']:.2f}: {errors[-1]:.2g} at {works[-1]:.2g}")
        recipe = runs.get((problem, "recipe"), {})
        ax.set_title(f"{names[problem]}\nslope {recipe.get('slope', np.nan):.2f}", fontsize=10)
        ax.grid(alpha=0.3)
        print("|", " | ".join(cells), "|")
    for ax in axes[:, 0]:
        ax.set_ylabel("rms error")
    for ax in axes[-1]:
        ax.set_xlabel("work, pilots included")
    figure.legend(lines.values(), [methods[method] for method in lines], loc="upper center", ncol=len(lines))
    save("slope", figure)


if len(sys.argv) > 1:
    draw_slopes(sys.argv[1:])
    sys.exit()

figure, ax = plt.subplots(figsize=(6.5, 4.2), layout="constrained")
errors = (0.2, 0.1, 0.05, 0.025, 0.0125)
mlmc = [debias.estimate("european-call", estimator="multilevel", error=e) for e in errors]
debias.plot.speed_against_error({
    "multilevel, its bias included": [(r.work, np.hypot(r.standard_error, r["bias"])) for r in mlmc],
    "single term, r = 0.65 by hand": [debias.estimate("european-call", pmf="geometric:r=0.65", error=e)
                                      for e in errors],
    "recipe": [debias.estimate("european-call", estimator="recipe", error=e) for e in errors],
}, time="work", title="european-call: error against work", ax=ax)
save("speed_against_error", figure)

figure, ax = plt.subplots(figsize=(6.5, 4.2), layout="constrained")
debias.plot.tradeoff(debias.tradeoff("square-of-mean", points=25, samples=200_000), ax=ax)
save("tradeoff", figure)
