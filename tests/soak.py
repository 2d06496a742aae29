#!/usr/bin/env python3
"""Long mixed work: kills, runs that grow, shards that merge, replays, numbers through pipes, full disks, and beside them one
Python process that works for the whole time. No bit may differ, no finished record may be lost, nothing may leak.

    python3 tests/soak.py PROGRAM [MINUTES=50] [HOURS=10]     until MINUTES are over; exit code 75 while HOURS are not reached
    python3 tests/soak.py --status [HOURS=10]                 the hours so far

Each round is a line of build/soak/rounds.jsonl, with the commit whose code ran; hours are those of this code alone, so that
work which is stopped goes on where it was. A disk that is full is a small tmpfs for root, else a limit on the size of files.
The Python package is looked for beside the program (PYTHONPATH, or ../python of PROGRAM).
"""
import json
import os
import pathlib
import random
import re
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
import time

root = pathlib.Path(__file__).resolve().parent.parent
record = root / "build/soak/rounds.jsonl"
only_times = re.compile(r'^[^\n]*"(seconds|pilot_seconds|efficiency)":[^\n]*\n', re.M)
cases = ["A03", "E02 --block 64", "D01 --estimator roulette", "C01 --estimator independent_sum", "F01", "H01", "B12", "E10"]
unfinished = 75


def code_of_tree():
    """The last commit that changed more than the record of tests/all.sh; with a mark where the tree has changes."""
    no_page = ["--", ".", ":(exclude)tests/trust.jsonl", ":(exclude)tests/TRUST.md"]
    git = lambda *words: subprocess.run(["git", "-C", str(root), *words, *no_page], capture_output=True, text=True).stdout.strip()
    return git("log", "-1", "--format=%h", "--abbrev=10") + ("+" if git("status", "--porcelain") else "")


class Wrong(Exception):
    pass


class Rounds:
    def __init__(self, program, rng, folder):
        self.program, self.rng, self.folder = program, rng, pathlib.Path(folder)

    def debias(self, *words, stdin=subprocess.DEVNULL, limit=None):
        """Exit code, stdout without times, stderr."""
        bounded = None if limit is None else lambda: (signal.signal(signal.SIGXFSZ, signal.SIG_IGN),
                                                     resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
        run = subprocess.run([self.program, *map(str, words)], stdin=stdin, capture_output=True, text=True, timeout=900, preexec_fn=bounded)
        return run.returncode, only_times.sub("", run.stdout), run.stderr

    def answer(self, *words):
        code, out, err = self.debias(*words, "--json")
        if code != 0:
            raise Wrong(f"{words} ended with {code}: {err.strip()[:200]}")
        return out

    def demand(self, holds, what):
        if not holds:
            raise Wrong(what)

    def some_run(self):
        words = ["run", *self.rng.choice(cases).split(), "--seed", self.rng.randint(1, 10**6), "--threads", self.rng.randint(1, 3)]
        return words, 64 * self.rng.randint(500, 20000)

    def kills(self):
        ranks = "3" if os.environ.get("MPIEXEC") and self.rng.random() < 0.5 else "1"
        words = [sys.executable, str(root / "tests/kill.py"), self.program, "6", "2", str(self.rng.randint(1, 10**6)), ranks]
        run = subprocess.run(words, capture_output=True, text=True)
        self.demand(run.returncode == 0, f"{' '.join(words[1:])}: {(run.stdout + run.stderr).strip()[-300:]}")

    def growth(self):
        words, n = self.some_run()
        path = self.folder / "grows"
        self.answer(*words, "--samples", n, "--checkpoint", path)
        for _ in range(3):
            n += 64 * self.rng.randint(1, 10000)
            grown = self.answer("resume", path, "--samples", n, "--threads", self.rng.randint(1, 3))
        self.demand(grown == self.answer(*words, "--samples", n), f"{words}: grown to {n} samples it is another result")

    def shards(self):
        words, n = self.some_run()
        count = self.rng.randint(2, 5)
        parts = [self.folder / f"part{i}" for i in range(count)]
        for i, part in enumerate(parts):
            self.answer(*words, "--samples", n, "--shard", f"{i + 1}/{count}", "--checkpoint", part)
        self.rng.shuffle(parts)
        merged = json.loads(self.answer("merge", *parts, "--checkpoint", self.folder / "whole"))
        whole = json.loads(self.answer(*words, "--samples", n))
        same = [key for key in ("mean", "standard_error", "samples", "work", "largest") if merged[key] != whole[key]]
        self.demand(not same, f"{words}, {n} samples in {count} shards: another {' and '.join(same)}")
        self.demand(json.loads(self.answer("resume", self.folder / "whole"))["mean"] == whole["mean"], f"{words}: merged, then read: another mean")

    def replay(self):
        words, n = self.some_run()
        run = json.loads(self.answer(*words, "--samples", n))
        name, seed = words[1], words[words.index("--seed") + 1]
        options = [w for w in words[2:words.index("--seed")] if str(w) not in ("--block", "64")]
        if run["block"] > 1:
            return  # a replay names block and member; its value is no sample
        for sample in run["largest"][:3]:
            again = json.loads(self.answer("replay", name, *options, "--seed", seed, "--sample", sample["index"]))
            self.demand(again["value"] == sample["value"] and again["level"] == sample["level"],
                        f"{words}: sample {sample['index']} is {sample['value']}, replayed {again['value']}")

    def pipes(self):
        numbers = [self.rng.gauss(0, 1) ** 3 for _ in range(self.rng.randint(1000, 60000))]
        text = "".join(f"{x!r}\n" for x in numbers).encode()
        (self.folder / "numbers").write_bytes(text)
        expected = self.answer("diagnose", self.folder / "numbers")
        process = subprocess.Popen([self.program, "diagnose", "-", "--json", "-q"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=False)
        at = 0
        while at < len(text):
            size = self.rng.choice([1, 7, 511, 4096, 65536, 300000])
            process.stdin.write(text[at:at + size])
            process.stdin.flush()
            at += size
        process.stdin.close()
        got = only_times.sub("", process.stdout.read().decode())
        self.demand(process.wait() == 0, f"diagnose of {len(numbers)} numbers from a pipe ended with {process.returncode}")
        differing = [a for a, b in zip(expected.splitlines(), got.splitlines()) if a != b and "numbers" not in a and '"file"' not in a and '"source"' not in a]
        self.demand(not differing, f"numbers from a pipe say another thing than from a file: {differing[:2]}")

    def full_disk(self):
        words, n = self.some_run()
        n *= 8
        expected = self.answer(*words, "--samples", n)
        code, _, err = self.debias(*words, "--samples", n, "-o", "/dev/full")
        self.demand(code == 5 and err.strip(), f"{words} -o /dev/full ended with {code}, not 5: {err[:100]}")
        disk = self.folder / "disk"
        disk.mkdir(exist_ok=True)
        size = self.rng.choice([8, 16, 24, 40, 64])  # KiB; a first record has some
        mounted = os.geteuid() == 0 and subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}k", "tmpfs", str(disk)],
                                                       capture_output=True).returncode == 0
        try:
            path = disk / "run"
            code, out, err = self.debias(*words, "--samples", n, "--checkpoint", path, "--json", "-q", limit=None if mounted else size * 1024)
            self.demand(code in (0, 5), f"{words} on a full disk ended with {code}: {err[:200]}")
            self.demand(code == 5 or out == expected, f"{words} on a nearly full disk: another result")
            if mounted:
                subprocess.run(["mount", "-o", "remount,size=64m", str(disk)], check=True)
            if path.exists():
                self.demand(self.answer("resume", path) == expected, f"{words} after a full disk of {size} KiB: another result")
        finally:
            if mounted:
                subprocess.run(["umount", str(disk)], check=False)


class Companion:
    """One Python process for all the rounds; it tells its resident memory after each batch."""

    batch = r'''
import gc, os, sys
import debias
def once(i):
    r = debias.estimate(debias.function_of_mean(lambda x: 1 + x[:, 0] ** 2, "reciprocal"), samples=20000, seed=i)
    s = debias.estimate("E02", samples=40000, seed=i)
    try:
        debias.estimate(debias.function_of_mean(lambda x: 1 / 0, "reciprocal"), samples=1000, seed=i)
    except Exception:
        pass
    d = debias.diagnose([0.1 * k for k in range(2000)])
    assert r.mean == r.mean and s.mean == s.mean
for line in sys.stdin:
    for i in range(4):
        once(int(line) * 4 + i + 1)
    gc.collect()
    pages = int(open("/proc/self/statm").read().split()[1])
    print(pages * os.sysconf("SC_PAGE_SIZE") // 1024, flush=True)
'''

    def __init__(self, program):
        place = os.environ.get("PYTHONPATH") or str(pathlib.Path(program).resolve().parent.parent / "python")
        self.process = subprocess.Popen([sys.executable, "-c", self.batch], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": place})
        self.memory = []  # KiB, after each batch

    def work(self):
        if self.process.poll() is None:
            self.process.stdin.write(f"{len(self.memory)}\n")
            self.process.stdin.flush()
            line = self.process.stdout.readline()
            if line:
                self.memory.append(int(line))
                return
        raise Wrong(f"the Python process has ended: {self.process.stderr.read().strip()[-300:]}")

    def leak(self):
        """KiB that the later half of its batches has more than the earlier, without the first ones; None of too few."""
        m = self.memory[2:]
        if len(m) < 8:
            return None
        return statistics.median(m[-len(m) // 4:]) - statistics.median(m[:len(m) // 4 + 1])

    def end(self):
        self.process.stdin.close()
        self.process.wait()


def lines_of(code):
    if not record.exists():
        return []
    return [line for line in map(json.loads, record.read_text().splitlines()) if line["commit"] == code]


def status(hours, code):
    rounds = lines_of(code)
    done = sum(r["seconds"] for r in rounds) / 3600
    failures = [r for r in rounds if r["failure"]]
    for r in failures[-5:]:
        print(f"{r['date']} {r['kind']}, seed {r['seed']}: {r['failure']}")
    print(f"{done:.2f} of {hours:g} hours in {len(rounds)} rounds at {code}, {len(failures)} failures")
    return 1 if failures else 0 if done >= hours else unfinished


def main():
    words = [w for w in sys.argv[1:] if w != "--status"]
    if "--status" in sys.argv:
        return status(float(words[0]) if words else 10, code_of_tree())
    program, minutes, hours = os.path.abspath(words[0]), *[float(x) for x in (words[1:] + ["50", "10"][len(words) - 1:])]
    code, begun = code_of_tree(), time.time()
    record.parent.mkdir(parents=True, exist_ok=True)
    companion = Companion(program)
    kinds = ["kills", "growth", "shards", "replay", "pipes", "full_disk", "python"]

    def keep(kind, seed, seconds, failure):
        line = {"commit": code, "date": time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime()), "kind": kind, "seed": seed,
                "seconds": round(seconds, 2), "failure": failure}
        with open(record, "a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        print(kind, f"{seconds:.1f} s", failure or "", flush=True)

    number = len(lines_of(code))
    while time.time() - begun < 60 * minutes:
        kind, seed, start = kinds[number % len(kinds)], number + 1, time.time()
        number += 1
        failure = ""
        try:
            with tempfile.TemporaryDirectory() as folder:
                companion.work() if kind == "python" else getattr(Rounds(program, random.Random(seed), folder), kind)()
        except (Wrong, subprocess.SubprocessError, OSError, KeyError, ValueError) as problem:
            failure = f"{type(problem).__name__}: {problem}"
        keep(kind, seed, time.time() - start, failure)
    leak = companion.leak()
    companion.end()
    if leak is not None:
        grown = leak > 4096 and leak > 0.02 * companion.memory[2]  # KiB
        keep("memory of the Python process", 0, 0, f"grew by {leak:.0f} KiB over {len(companion.memory)} batches" if grown else "")
        print(f"the Python process: {leak:.0f} KiB more at its end than at its beginning, {len(companion.memory)} batches, {companion.memory[-1]} KiB")
    return status(hours, code)


if __name__ == "__main__":
    sys.exit(main())
