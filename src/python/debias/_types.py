"""Types that several modules write."""

from __future__ import annotations

from typing import Any, Dict

import numpy as np

Array = np.ndarray[Any, Any]
#: What is known of a problem beside its functions.
Facts = Dict[str, Any]
