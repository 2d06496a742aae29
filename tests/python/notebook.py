"""Runs notebooks from top to bottom, and compares what they give with what they keep.

    PYTHONPATH=BUILD/python python3 tests/python/notebook.py            a check of all, in the tests; or of those named
    PYTHONPATH=BUILD/python python3 tests/python/notebook.py --write    runs all of them again and keeps what they give

A check fails with the first cell that raises, that writes to stderr, or whose outputs are not those that are kept:

  texts     are equal, but for the width of blanks
  numbers   in them are equal, or differ by 1e-6 of themselves (another processor), or are both below 1e-15 (rounding)
  times     are not compared: numbers of a line that speaks of seconds, ms, us or of the efficiency, or of a cell with
            the tag "times"
  pictures  are there, and of a size within a factor of two; what is drawn in them stands as text behind each figure,
            one line for each of its axes, and is compared as text: labels and the numbers of curves

Then the check is checked: it must see one digit changed, a line and a picture gone.
"""

import copy
import os
import re
import sys
import tempfile
import time
from pathlib import Path

os.environ["PYDEVD_DISABLE_FILE_VALIDATION"] = "1"  # a debugger's warning in every kernel

import nbformat  # noqa: E402
from nbclient import NotebookClient  # noqa: E402

# In every kernel: a figure says what is drawn in it.
STARTUP = r'''
def _drawn(figure, printer, cycle):
    import numpy as np

    def span(x):
        x = np.ma.masked_invalid(np.asarray(x, dtype=float).ravel()).compressed()
        return f"{x.min():.6g} ... {x.max():.6g}, mean {x.mean():.6g}" if x.size else "nothing"

    printer.text(repr(figure))
    for axes in figure.axes:
        parts = [f"{len(line.get_xdata())} points x {span(line.get_xdata())} y {span(line.get_ydata())}"
                 for line in axes.lines]
        parts += [f"image {image.get_array().shape} {span(image.get_array())}" for image in axes.images]
        parts += [f"points {span(points.get_offsets())}, areas {span(np.concatenate(shapes))}"
                  for points in axes.collections
                  for shapes in [[path.vertices.ravel() for path in points.get_paths()]] if shapes]
        parts += [f"shape {span(patch.get_path().transformed(patch.get_patch_transform()).vertices)}"
                  for patch in axes.patches]
        said = " ".join(f"{axes.get_title()} | {axes.get_xlabel()} | {axes.get_ylabel()}".split())
        printer.text(f"\n{said}: " + "; ".join(parts))


import matplotlib.figure

matplotlib.figure.Figure._repr_pretty_ = _drawn  # a formatter would be taken away by the inline backend
'''
NUMBER = re.compile(r"(?<![A-Za-z_])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
TIMES = re.compile(r"\bseconds?\b|\befficiency\b|\d ?(?:s|ms|us|µs)\b|\((?:s|ms|us|µs)\)")


def run(path):
    """The notebook as it comes out, and the seconds that it takes."""
    notebook = nbformat.read(path, as_version=4)
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        startup = Path(folder) / "profile_default" / "startup"
        startup.mkdir(parents=True)
        (startup / "drawn.py").write_text(STARTUP)
        os.environ["IPYTHONDIR"] = folder
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
    return notebook, time.perf_counter() - start


def same_number(kept, given):
    a, b = float(kept), float(given)
    return kept == given or abs(a - b) <= 1e-6 * max(abs(a), abs(b)) or max(abs(a), abs(b)) < 1e-15


def text_differences(kept, given, timed):
    kept, given = ([line.rstrip() for line in text.rstrip("\n").split("\n")] for text in (kept, given))
    if len(kept) != len(given):
        yield f"{len(kept)} lines are kept, {len(given)} are given: {kept[:1]} and {given[:1]}"
        return
    for a, b in zip(kept, given):
        words = [re.sub(r"[-\s]+", " ", NUMBER.sub(" # ", line)) for line in (a, b)]
        numbers = [NUMBER.findall(line) for line in (a, b)]
        exempt = timed or TIMES.search(a)
        if words[0] != words[1] or (not exempt and not all(map(same_number, *numbers))):
            yield f"kept: {a!r}\n    given: {b!r}"


def output_differences(kept, given, timed):
    if kept.output_type != given.output_type:
        yield f"{kept.output_type} is kept, {given.output_type} is given"
    elif kept.output_type == "stream":
        yield from text_differences(kept.text, given.text, timed)
    else:
        if set(kept.data) != set(given.data):
            yield f"{sorted(kept.data)} is kept, {sorted(given.data)} is given"
        for kind in set(kept.data) & set(given.data):
            a, b = kept.data[kind], given.data[kind]
            if kind.startswith("text/"):
                yield from text_differences(a, b, timed)
            elif not len(a) / 2 <= len(b) <= 2 * len(a):
                yield f"{kind}: {len(a)} bytes are kept, {len(b)} are given"


def differences(kept, given):
    """What is kept and not given, or the other way round: one sentence each."""
    for i, (a, b) in enumerate(zip(kept.cells, given.cells)):
        timed = "times" in a.metadata.get("tags", [])
        olds, news = a.get("outputs", []), b.get("outputs", [])
        if len(olds) != len(news):
            yield f"cell {i}: {len(olds)} outputs are kept, {len(news)} are given"
        for old, new in zip(olds, news):
            yield from (f"cell {i}: {text}" for text in output_differences(old, new, timed))


def check_the_check(notebook):
    """Each small change of what is kept must be seen, and times must not."""
    def digit(other):
        for cell in other.cells:
            for output in cell.get("outputs", []):
                text = output.get("text", "")
                match = next((m for m in NUMBER.finditer(text) if not TIMES.search(text)), None)
                if match:
                    last = str((int(match[0][0 if match[0][0].isdigit() else 1]) + 1) % 10)
                    at = match.start() + (0 if match[0][0].isdigit() else 1)
                    output.text = text[:at] + last + text[at + 1:]
                    return True
        return False

    def drawn(other):
        for cell in other.cells:
            for output in cell.get("outputs", []):
                text = output.get("data", {}).get("text/plain", "")
                if " mean " in text and not TIMES.search(text):
                    output.data["text/plain"] = re.sub(r" mean ([-\d])", r" mean 3\1", text, count=1)
                    return True
        return False

    def line(other):
        for cell in other.cells:
            for output in cell.get("outputs", []):
                if "\n" in output.get("text", "").strip():
                    output.text = output.text[output.text.index("\n") + 1:]
                    return True
        return False

    def picture(other):
        for cell in other.cells:
            for output in cell.get("outputs", []):
                if output.get("data", {}).pop("image/png", None):
                    return True
        return False

    for change in (digit, drawn, line, picture):
        other = copy.deepcopy(notebook)
        if change(other) and not list(differences(other, notebook)):
            raise SystemExit(f"the check does not see a change of: {change.__name__}")
    if list(differences(notebook, notebook)):
        raise SystemExit("the check sees a change where there is none")
    for kept, given, is_seen in (("seconds 0.3", "seconds 0.41", False), ("mean   0.5", "mean 0.5", False),
                                 ("a 0.5", "b 0.5", True), ("mean 0.5", "mean 0.6", True), ("1 2", "1", True),
                                 ("level 10", "level 11", True), ("8.1e-33", "7.9e-33", False),
                                 ("0.123456789", "0.123456788", False), ("nan", "0.5", True)):
        if bool(list(text_differences(kept, given, False))) != is_seen:
            raise SystemExit(f"the check is wrong about {kept!r} and {given!r}")


def main(arguments):
    write = "--write" in arguments
    names = [Path(name).resolve() for name in arguments if name != "--write"]
    for path in names or sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb")):
        notebook, seconds = run(path)
        size = len(nbformat.writes(notebook))
        print(f"{path.name}: {seconds:.1f} s, {size / 1000:.0f} kB", flush=True)
        if size > 500_000:
            raise SystemExit(f"{path}: {size} bytes (at most 500 kB)")
        if write:
            nbformat.write(notebook, path)
            continue
        wrong = list(differences(nbformat.read(path, as_version=4), notebook))
        if wrong:
            raise SystemExit("\n".join(wrong[:20]) + f"\n{path.name} keeps outputs that it does not give, "
                             f"{len(wrong)} in all; if they are meant, keep the new ones:\n  "
                             f"PYTHONPATH=BUILD/python python3 {sys.argv[0]} --write {path}")
        check_the_check(notebook)


if __name__ == "__main__":
    main(sys.argv[1:])
