"""Chains that meet: expectations under the invariant law of a Markov kernel, without the bias of a burn-in.

Two copies of a chain, one `lag` steps behind the other, take coupled steps until they meet; what they differ by until then
takes the bias of the start away (Jacob, O'Leary, Atchade 2020). Kernels and densities are NumPy functions over blocks of chains:
points are arrays (n, dimension), one row a chain, and thousands of chains take each step together.

    >>> import numpy as np
    >>> import debias
    >>> from debias import chains
    >>> walk = chains.random_walk(lambda x: -0.5 * x[:, 0] ** 2, step=2.4)
    >>> start = lambda u: 3 * debias.normal_quantile(u)
    >>> square = chains.coupled_chain(walk, start, lambda x: x[:, 0] ** 2)
    >>> advice = chains.advise(square)
    >>> result = debias.estimate(square.with_options(**advice.options), samples=2000)
    >>> bool(abs(result.mean - 1) < 4 * result.standard_error)
    True

`debias.estimate`, `samples` and `replay` take a coupled chain like any problem: sample i of a seed is the same whatever else is
drawn, as far as NumPy gives a row the same numbers in another block (matrix products may differ in the last digit).
"""

from __future__ import annotations

from typing import Any, Callable, Dict, Optional, Sequence, Tuple  # noqa: F401  annotations of classes name them

import numpy as np  # noqa: F401  likewise

from .._options import Seed  # noqa: F401  likewise
from .._types import Array, Facts  # noqa: F401  likewise
from ._advice import ChainAdvice, CouplingCheck, advise, check_coupling
from ._coupled import CoupledChain, coupled_chain, meeting_times
from ._kernels import Kernel, hamiltonian, kernel, mala, mixture, random_walk

__all__ = ["ChainAdvice", "CoupledChain", "CouplingCheck", "Kernel", "advise", "check_coupling", "coupled_chain", "hamiltonian",
           "kernel", "mala", "meeting_times", "mixture", "random_walk"]

for _name in __all__:
    globals()[_name].__module__ = "debias.chains"
