#!/usr/bin/env python3
"""The folders of the house and which includes which, drawn for CONTRIBUTING.md.

  python3 tests/arrows.py            prints the drawing
  python3 tests/arrows.py --write    puts it into CONTRIBUTING.md, between its marks
  python3 tests/arrows.py --check    exit code 1 where CONTRIBUTING.md shows another, or where arrows form a ring

A room is a folder of include/debias and of src with the same name; headers and sources that stand in no folder are
the room `modules`; `core` stands for core and statistics, which judge each other's results. An arrow that follows from two
others is not drawn.
"""
import pathlib
import re
import sys

root = pathlib.Path(__file__).resolve().parent.parent
begin, end = "<!-- arrows: python3 tests/arrows.py --write -->\n", "<!-- end of arrows -->\n"
module_folders = {"function_of_mean", "taylor", "sde", "derivative", "series", "functions", "operators", "chains"}
entry = {"debias.hpp"}  # the umbrella includes everything


def room_of(path):
    parts = path.split("/")
    if len(parts) == 1:
        return pathlib.Path(path).stem if pathlib.Path(path).stem in rooms else "modules"
    return "modules" if parts[0] in module_folders else "core" if parts[0] == "statistics" else parts[0]


files = [p for top in ("include/debias", "src") for p in sorted((root / top).rglob("*.[hc]pp"))]
name_of = {p: str(p.relative_to(root / ("include/debias" if "include" in p.relative_to(root).parts else "src")))
           for p in files}
rooms = {name.split("/")[0] for name in name_of.values() if "/" in name} - module_folders

arrows = {}
for path, name in name_of.items():
    if name in entry:
        continue
    here = room_of(name)
    arrows.setdefault(here, set())
    for quote, target in re.findall(r'^ *# *include *([<"])([^>"]*)', path.read_text(), re.M):
        if quote == "<" and not target.startswith("debias/"):
            continue
        target = target.removeprefix("debias/")
        if quote == '"' and (path.parent / target).is_file():
            target = str((path.parent / target).resolve().relative_to(root / "src"))
        if target not in entry and room_of(target) != here:
            arrows[here].add(room_of(target))


def reached(start, skip=None):
    seen, todo = set(), [t for t in arrows.get(start, ()) if t != skip]
    while todo:
        room = todo.pop()
        if room not in seen:
            seen.add(room)
            todo += arrows.get(room, ())
    return seen


rings = sorted(room for room in arrows if room in reached(room))
lines = ["```text\n"]
height = {}


def height_of(room):
    if room not in height:
        height[room] = 1 + max((height_of(t) for t in arrows.get(room, ())), default=-1)
    return height[room]


if not rings:
    for room in sorted(arrows, key=lambda r: (-height_of(r), r)):
        direct = sorted((t for t in arrows[room] if t not in reached(room, skip=t)), key=lambda r: (-height_of(r), r))
        lines.append(f"{room:<12} -> {', '.join(direct)}\n" if direct else f"{room}\n")
drawing = begin + "".join(lines) + "```\n" + end
page = root / "CONTRIBUTING.md"
if rings:
    sys.exit("includes form a ring through " + ", ".join(rings))
if sys.argv[1:] == ["--write"]:
    text = page.read_text()
    page.write_text(text[:text.index(begin)] + drawing + text[text.index(end) + len(end):])
elif sys.argv[1:] == ["--check"]:
    if drawing not in page.read_text():
        sys.exit("CONTRIBUTING.md shows other arrows than the code has: python3 tests/arrows.py --write")
else:
    print(drawing, end="")
