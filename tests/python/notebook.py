"""Runs notebooks from top to bottom, and fails with the first cell that fails.

    PYTHONPATH=BUILD/python python3 tests/python/notebook.py notebooks/*.ipynb            a check, in the tests
    PYTHONPATH=BUILD/python python3 tests/python/notebook.py --write notebooks/*.ipynb    keeps what they print
"""

import os
import sys
import time
from pathlib import Path

os.environ["PYDEVD_DISABLE_FILE_VALIDATION"] = "1"  # a debugger's warning in every kernel

import nbformat  # noqa: E402
from nbclient import NotebookClient  # noqa: E402


def run(path, write):
    notebook = nbformat.read(path, as_version=4)
    start = time.perf_counter()
    NotebookClient(notebook, timeout=120, kernel_name="python3", record_timing=False,
                   resources={"metadata": {"path": str(path.parent)}}).execute()
    for cell in notebook.cells:
        joined = []
        for output in cell.get("outputs", []):
            if output.get("name") == "stderr":
                raise SystemExit(f"{path}: a cell wrote to stderr: {output['text']}")
            if joined and output.output_type == joined[-1].output_type == "stream":
                joined[-1].text += output.text  # in how many pieces it arrives is a matter of time
            else:
                joined.append(output)
        if "outputs" in cell:
            cell.outputs = joined
    size = len(nbformat.writes(notebook))
    print(f"{path.name}: {time.perf_counter() - start:.1f} s, {size / 1000:.0f} kB")
    if size > 500_000:
        raise SystemExit(f"{path}: {size} bytes (at most 500 kB)")
    if write:
        nbformat.write(notebook, path)


if __name__ == "__main__":
    arguments = sys.argv[1:]
    write = "--write" in arguments
    for name in arguments:
        if name != "--write":
            run(Path(name).resolve(), write)
