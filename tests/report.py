"""The page of reliability: what `debias validate --report` measures of itself, and what takes other programs: kills,
fuzzing, sanitizers, coverage, ranks. Each row is a command that ends with its figure. By hand, an hour and more:
    python3 tests/report.py PROGRAM PAGE.md [ROW...]     some rows only: the others stay as PAGE.json has them
"""

import json
import os
import pathlib
import subprocess
import sys
import time

root = pathlib.Path(__file__).resolve().parent.parent
program, page = os.path.abspath(sys.argv[1]), pathlib.Path(sys.argv[2]).with_suffix(".json")


def preset(name):
    """Configures, builds and runs the quick tests of a preset; the last lines are ctest's summary."""
    test = f"ctest --test-dir build/{name} -L quick -j2 --no-tests=error"
    return f"cmake --preset {name} > /dev/null && cmake --build build/{name} > /dev/null && {test} | grep 'tests passed'"


rows = {  # name: command, demanded
    "self": (f"'{program}' validate --report --samples 1e6 --json", ""),
    "kills": (f"python3 tests/kill.py '{program}' 300 40", "0 failures"),
    "kills of one of 1, 2, 3 MPI ranks": (f"python3 tests/kill.py '{program}' 60 8 1 3", "0 failures"),
    "two MPI ranks against one process": (f"python3 bench/ranks.py '{program}'", "1.85 times, heavy-tailed work"),
    "fuzzing": ("sh tests/fuzz/run.sh 1000000 | sed 's/; .*//'", "a million inputs per target, clean"),
    "address and undefined-behaviour sanitizers": (preset("asan"), "100% tests passed"),
    "thread sanitizer": (preset("tsan"), "100% tests passed"),
    "memory sanitizer": ("sh tests/msan.sh | grep 'tests passed'", "100% tests passed"),
    "line coverage": ("sh tests/coverage.sh | tail -1", "above 90 %"),
    "tests": ("sh tests/run.sh | grep -E 'tests passed|Total Test time'", "100% tests passed"),
}


def measure(name):
    command, demanded = rows[name]
    start = time.time()
    run = subprocess.run(["bash", "-o", "pipefail", "-c", command], cwd=root, stdout=subprocess.PIPE, text=True)
    if name == "self":
        return json.loads(run.stdout)
    holds = run.returncode == 0 and run.stdout.strip() != "" and "FAILED" not in run.stdout
    if demanded.startswith("100%"):
        holds = holds and "100% tests passed" in run.stdout
    measured = "; ".join(line.strip() for line in run.stdout.strip().splitlines())
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=root, stdout=subprocess.PIPE, text=True)
    return {"name": name, "measured": measured, "demanded": demanded, "holds": holds,
            "command": command.replace(program, "PROGRAM"), "seconds": round(time.time() - start),
            "when": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()), "commit": commit.stdout.strip()}


def text(report):
    lines = ["# Reliability of debias, measured", ""]
    lines += [f"- {name}: {fact}" for name, fact in report["self"].get("facts", {}).items()]
    lines += ["", "| figure | measured | demanded | |", "|---|---|---|---|"]
    others = [row for name, row in report.items() if name != "self"]
    for f in report["self"].get("figures", []) + others:
        by = f" (`{f['command']}`, {f['when']}, commit {f['commit']}, {f['seconds']} s)" if "command" in f else ""
        word = "" if not f["demanded"] else "holds" if f["holds"] else "**FAILS**"
        lines.append(f"| {f['name']} | {f['measured']}{by} | {f['demanded']} | {word} |")
    return "\n".join(lines) + "\n"


unknown = [name for name in sys.argv[3:] if name not in rows]
if unknown:
    sys.exit(f"report.py: no row {unknown[0]!r}; there are: {', '.join(rows)}")
report = json.loads(page.read_text()) if page.exists() else {"self": {}}
for name in sys.argv[3:] or rows:
    report[name] = measure(name)
    page.write_text(json.dumps(report, indent=1) + "\n")  # an hour of figures is not lost with the last one
    page.with_suffix(".md").write_text(text(report))
failed = [f["name"] for f in report["self"].get("figures", []) if not f["holds"]]
failed += [name for name, row in report.items() if name != "self" and not row["holds"]]
print(page.with_suffix(".md"), "all hold" if not failed else "failing: " + ", ".join(failed))
sys.exit(len(failed) > 0)
