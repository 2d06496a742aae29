"""The pictures of README.md: PYTHONPATH=build/release/python /usr/bin/python3 notebooks/pictures/draw.py"""

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
