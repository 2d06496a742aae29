"""`python -m debias` is the program `debias`."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import Iterator


def _places() -> Iterator[str]:
    here = Path(__file__).resolve().parent
    yield os.environ.get("DEBIAS_PROGRAM", "")
    yield str(here / "bin" / "debias")  # of a wheel
    yield str(here.parents[1] / "bin" / "debias")  # of a build tree: BUILD/python/debias
    yield shutil.which("debias") or ""


def main() -> int:
    for program in _places():
        if program and os.access(program, os.X_OK) and os.path.isfile(program):
            os.execv(program, ["debias", *sys.argv[1:]])
    print("debias: the program is not here (this package was built without it); install it with "
          "`pip install . -C cmake.define.DEBIAS_BUILD_TOOLS=ON`, or set DEBIAS_PROGRAM", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
