#!/usr/bin/env python3
"""Mutants: one-line faults of tests/mutants.txt, each of which some test must see. A fault is put into a copy of the tree
under BUILD/mutants, never into the tree itself; of a source its object alone is compiled and linked before the library, of a
header the test files that are named for it (and the sources under `also`). Needs a finished build folder that compiles each
file alone (not DEBIAS_UNITY): cmake --preset mutants && cmake --build --preset mutants

    python3 tests/mutants.py [BUILD]              all faults whose outcome is not known yet (default: build/mutants)
    python3 tests/mutants.py [BUILD] --only NAME  those whose name begins so, again; may be given several times
    python3 tests/mutants.py --status             the outcomes so far; fails unless all are killed, or survive with a reason
    python3 tests/mutants.py --check              the list alone: each line stands exactly once, each test exists (a second)

Options: --list FILE (default: tests/mutants.txt), --minutes M (starts no fault after them).
KILLED: a named case fails, crashes or takes a minute and three times the processor time that it takes on the sound code. SURVIVED: all pass.
Named cases that fail on the sound code are an error, as is a fault that does not compile. Outcomes are kept in
BUILD/mutants/outcomes.json and hold as long as include, src, the fault and its test files have not changed.
"""
import argparse
import hashlib
import json
import os
import pathlib
import resource
import shlex
import shutil
import subprocess
import sys
import time

root = pathlib.Path(__file__).resolve().parent.parent
KEYS = {"name", "file", "was", "now", "seen by", "cases", "also", "survives"}


class Broken(Exception):
    """What makes a fault no fault: a line that is gone, a test that is not there, code that does not compile."""


def read_list(path):
    mutants, here = [], {}
    for number, line in enumerate([*path.read_text().splitlines(), ""], 1):
        if line.startswith("#"):
            continue
        if line.strip():
            key, colon, value = line.partition(":")
            if not colon or key not in KEYS:
                raise Broken(f"{path}:{number}: no such key: {key}")
            here[key] = value.strip()
        elif here:
            for key in ("name", "file", "was", "now", "seen by"):
                if key not in here:
                    raise Broken(f"{path}:{number}: the fault {here.get('name')!r} has no '{key}'")
            mutants.append(here)
            here = {}
    return mutants


def faulty_text(m):
    """The file with the fault in it."""
    path = root / m["file"]
    if not path.is_file():
        raise Broken(f"{m['name']}: there is no {m['file']}")
    lines = path.read_text().split("\n")
    found = [i for i, line in enumerate(lines) if line.strip() == m["was"]]
    if len(found) != 1:
        raise Broken(f"{m['name']}: {m['file']} has the line {len(found)} times, not once: {m['was']}")
    if m["now"] == m["was"]:
        raise Broken(f"{m['name']}: the line is not changed")
    lines[found[0]] = lines[found[0]].replace(m["was"], m["now"])
    return "\n".join(lines)


def tests_of(m):
    return ["tests/" + name for name in m["seen by"].split()]


def check(mutants):
    problems = []
    for i, m in enumerate(mutants):
        try:
            faulty_text(m)
            if any(other["name"] == m["name"] for other in mutants[:i]):
                raise Broken(f"{m['name']}: two faults have this name")
            for name in [*tests_of(m), *m.get("also", "").split()]:
                if not (root / name).is_file():
                    raise Broken(f"{m['name']}: there is no {name}")
        except Broken as problem:
            problems.append(str(problem))
    return problems


def fingerprint(paths):
    digest = hashlib.sha256()
    for path in sorted(paths):
        digest.update(f"{path.relative_to(root)}\0".encode() + path.read_bytes() + b"\0")
    return digest.hexdigest()


class Build:
    """What ninja would do, done to a copy of the tree."""

    def __init__(self, folder):
        self.folder = folder.resolve()
        self.work = self.folder / "mutants"
        self.tree, self.objects = self.work / "tree", self.work / "objects"
        if not (self.folder / "debias_tests").is_file():
            raise Broken(f"{folder} is no finished build folder: cmake --preset mutants && cmake --build --preset mutants")
        text = subprocess.run(["ninja", "-C", str(self.folder), "-t", "compdb"], capture_output=True, text=True, check=True).stdout
        self.compile, link = {}, None
        for c in json.loads(text):
            words = c["command"]
            if c["output"] == "debias_tests":
                link = shlex.split(words.split("&&")[1])
            elif " -c " in words:
                source = os.path.relpath(os.path.join(c["directory"], c["file"]), root)
                self.compile.setdefault(source, (shlex.split(words), c["output"]))
        mine = "tests/CMakeFiles/debias_tests.dir/"
        self.linker = link[:link.index("-o")] if "-o" in link else link[:1]
        self.linker = [w for w in self.linker if not w.endswith(".o")]
        self.libraries = [w for w in link[link.index("-o") + 2:] if not w.endswith(".o")]
        self.helpers = [w for w in link if w.startswith(mine) and not w.endswith("_test.cpp.o")]
        shutil.rmtree(self.tree, ignore_errors=True)
        for part in ("include", "src"):
            shutil.copytree(root / part, self.tree / part)
        shutil.copytree(root / "tests", self.tree / "tests", ignore=shutil.ignore_patterns("corpus", "__pycache__"))
        self.objects.mkdir(exist_ok=True)

    def object_of(self, source):
        if source not in self.compile:
            raise Broken(f"the build does not compile {source} (alone: no build with DEBIAS_UNITY does)")
        return self.compile[source][1]

    def compiled(self, source):
        """The object of a source of the copied tree."""
        self.object_of(source)
        words = list(self.compile[source][0])
        for option in ("-MD", "-Winvalid-pch"):  # a header with a fault is not in the precompiled one
            words = [w for w in words if w != option]
        for option in ("-MT", "-MF", "-include", "-o"):
            if option in words:
                at = words.index(option)
                del words[at:at + 2]
        out = self.objects / (source.replace("/", "_") + ".o")
        words = [w.replace(f"{root}/", f"{self.tree}/") if not w.startswith(str(self.folder)) else w for w in words]
        words += ["-O1", "-w", "-o", str(out)]
        run = subprocess.run(words, cwd=self.folder, capture_output=True, text=True)
        if run.returncode != 0:
            raise Broken(f"{source} does not compile: {run.stderr.strip()[:600]}")
        return str(out)

    def run(self, objects, cases, limit):
        """Exit code of the cases and their processor seconds; no code after `limit` of them."""
        program = self.work / "tests"
        words = [*self.linker, *objects, *self.helpers, "-o", str(program), *self.libraries]
        run = subprocess.run(words, cwd=self.folder, capture_output=True, text=True)
        if run.returncode != 0:
            raise Broken(f"does not link: {run.stderr.strip()[-600:]}")
        cpu = int(limit) + 1
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        limits = lambda: resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu + 5))
        try:
            words = [str(program), cases, "--abort", "--warn", "NoTests"]
            run = subprocess.run(words, cwd=self.work, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                                 stdin=subprocess.DEVNULL, preexec_fn=limits, timeout=100 * limit)  # a hang: what runs ends by its processor time
            code, text = run.returncode, run.stdout
        except subprocess.TimeoutExpired:
            code, text = None, ""
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return (None if used >= limit and code != 0 else code), used, text


def first_failure(text):
    """The case that a run of Catch2 names first."""
    lines = text.splitlines()
    for i, line in enumerate(lines):
        if line.startswith("-----") and i + 1 < len(lines) and lines[i + 1].strip():
            return lines[i + 1].strip()
    return ""


def judge(m, build, baselines, code_print):
    tests, cases = tests_of(m), m.get("cases", "~[stat]~[.]")
    key = fingerprint([root / t for t in tests]) + code_print + cases
    if key not in baselines:
        code, used, text = build.run([build.object_of(t) for t in tests], cases, 600)
        if code != 0:
            raise Broken(f"{m['name']}: the cases {cases} of {' '.join(tests)} do not pass without it: {first_failure(text) or text[-300:]}")
        baselines[key] = used
    limit = max(60.0, 3 * baselines[key])
    (build.tree / m["file"]).write_text(faulty_text(m))
    try:
        in_source = m["file"].endswith(".cpp")
        sources = ([m["file"]] if in_source else []) + m.get("also", "").split()
        objects = [] if in_source and not m["file"].startswith("tests/") else [build.compiled(t) for t in tests]
        objects += [build.object_of(t) for t in tests] if in_source else []
        code, used, text = build.run([build.compiled(s) for s in sources] + objects, cases, limit)
    finally:
        shutil.copyfile(root / m["file"], build.tree / m["file"])
    if code == 0:
        return {"outcome": "SURVIVED"}
    by = "took too long" if code is None else first_failure(text) or f"ended with {code}"
    return {"outcome": "killed", "by": by}


def print_table(mutants, outcomes):
    print("| fault | line | outcome | first case that fails, or why none does |", "|---|---|---|---|", sep="\n")
    for m in mutants:
        o = outcomes.get(m["name"], {"outcome": "not run"})
        word = "survives" if o["outcome"] == "SURVIVED" and "survives" in m else o["outcome"]
        cell = lambda text: text.replace("|", "\\|")
        print(f"| {m['name']} | `{cell(m['now'])}` in {m['file']} | {word} | {cell(m['survives'] if word == 'survives' else o.get('by', ''))} |")


def summary(mutants, outcomes):
    """The line, and whether it is green."""
    words = [outcomes.get(m["name"], {"outcome": "not run"})["outcome"] for m in mutants]
    explained = sum(w == "SURVIVED" and "survives" in m for w, m in zip(words, mutants))
    left, unrun = words.count("SURVIVED") - explained, words.count("not run")
    broken = words.count("BROKEN")
    line = f"{len(mutants)} faults: {words.count('killed')} killed, {explained} survive with a reason, {left} survive, {broken} broken, {unrun} not run"
    return line, left + broken + unrun == 0


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("build", nargs="?", default=str(root / "build/mutants"))
    arguments.add_argument("--list", default=str(root / "tests/mutants.txt"), type=pathlib.Path)
    arguments.add_argument("--only", action="append", default=[])
    arguments.add_argument("--minutes", type=float, default=float("inf"))
    arguments.add_argument("--check", action="store_true")
    arguments.add_argument("--status", action="store_true")
    options = arguments.parse_args()
    mutants = read_list(options.list)
    problems = check(mutants)
    if problems or options.check:
        print(*problems, f"{len(mutants)} faults, {len(problems)} that are none", sep="\n")
        return len(problems) > 0

    kept = pathlib.Path(options.build) / "mutants/outcomes.json"
    held = json.loads(kept.read_text()) if kept.exists() else {"baselines": {}, "outcomes": {}}
    code_print = fingerprint([p for part in ("include", "src") for p in (root / part).rglob("*") if p.suffix in (".hpp", ".cpp")])
    prints = {m["name"]: hashlib.sha256((code_print + fingerprint([root / t for t in tests_of(m)]) +
                                         json.dumps({k: v for k, v in m.items() if k != "survives"}, sort_keys=True)).encode()).hexdigest() for m in mutants}
    outcomes = {name: o for name, o in held["outcomes"].items() if prints.get(name) == o["print"]}
    if options.status:
        print_table(mutants, outcomes)
    else:
        build, start = Build(pathlib.Path(options.build)), time.time()
        commit = subprocess.run(["git", "-C", str(root), "rev-parse", "--short", "HEAD"], stdout=subprocess.PIPE, text=True).stdout.strip()
        asked = [m for beginning in options.only for m in mutants if m["name"].startswith(beginning)]
        if options.only and not asked:
            raise Broken(f"no fault begins with {' or '.join(options.only)}")
        for m in asked or [m for m in mutants if m["name"] not in outcomes]:
            name = m["name"]
            if time.time() - start > 60 * options.minutes:
                break
            begun = time.time()
            try:
                o = judge(m, build, held["baselines"], code_print)
            except Broken as problem:
                o = {"outcome": "BROKEN", "by": str(problem)}
            o |= {"print": prints[name], "commit": commit, "seconds": round(time.time() - begun, 1)}
            print(f"{o['outcome']:8}  {name}  {o['seconds']:.0f} s  {o.get('by', '')}", flush=True)
            outcomes[name] = o
            held["outcomes"] = outcomes
            kept.write_text(json.dumps(held, indent=1) + "\n")
    line, green = summary(mutants, outcomes)
    print(line)
    return not green


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Broken as problem:
        sys.exit(f"mutants.py: {problem}")
