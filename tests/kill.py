"""Kills `debias run --checkpoint` at random times, resumes it until it ends, and holds the result against that of the
uninterrupted run, bit for bit; no finished sample on disk may be lost. With RANKS each start is on 1 to that many ranks of
$MPIEXEC, of which one is killed. By hand, some minutes:
    python3 tests/kill.py PROGRAM [KILLS=300] [RUNS=40] [SEED=1] [RANKS=1]
"""

import collections
import difflib
import os
import pathlib
import random
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
import zlib

program = os.path.abspath(sys.argv[1])
kills_wanted, runs_wanted, seed, most_ranks = [int(x) for x in sys.argv[2:]] + [300, 40, 1, 1][len(sys.argv) - 2:]
rng = random.Random(seed)
for name in ("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe"):
    os.environ.setdefault(name, "1")
cases = [  # and about as many samples as one thread draws in a second
    ("A03", 13e6), ("E02 --block 64", 5e6), ("D01 --estimator roulette", 25e6), ("B02 --block 256", 20e6),
    ("C01 --estimator independent_sum", 16e6), ("F01", 5.5e6), ("A10 --estimator single_term_outcome", 13e6),
    ("E03", 2.5e6), ("H01", 11e6), ("D11", 11e6), ("B12 --estimator independent_sum", 14e6), ("E10", 1.3e6),
    ("E02 --estimator recipe", 24e6)]

def start(words):
    out = tempfile.TemporaryFile()
    ranks = rng.randint(1, most_ranks) if most_ranks > 1 else 1
    launcher = [os.environ.get("MPIEXEC", "mpirun"), "-n", str(ranks)] if ranks > 1 else []
    options = ["--threads", str(rng.randint(1, 3)), "--json", "-q"]
    process = subprocess.Popen([*launcher, program, *words, *options], stdout=out, stderr=subprocess.DEVNULL)
    process.ranks = ranks
    return process, out

def ranks_of(process):
    """The processes of a program, which is itself or what it has launched; none yet, or any more."""
    if process.args[0] == program:
        return [process.pid]
    try:
        below = [process.pid]  # that of MPICH has another launcher in between
        for pid in below:
            below += [int(x) for x in pathlib.Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
        return [p for p in below if os.path.realpath(f"/proc/{p}/exe") == os.path.realpath(program)]
    except OSError:
        return []

def kill(process):
    """One rank, as soon as all are there; the launcher ends the others. Their number; 0 where they had ended before."""
    while process.poll() is None:
        pids = ranks_of(process)
        if len(pids) == process.ranks:
            os.kill(rng.choice(pids), signal.SIGKILL)
            return len(pids)
        time.sleep(0.001)
    return 0

def answer(process, out):
    try:
        code = process.wait(timeout=60)
    except subprocess.TimeoutExpired:
        pids = ranks_of(process)
        if pids:
            failures.append(f"hangs: {process.args}")
        else:  # mpirun of Open MPI, where a rank is killed while it starts the others
            launched["stuck"] += 1
        for pid in [*pids, process.pid]:
            os.kill(pid, signal.SIGKILL)
        code = process.wait()
    out.seek(0)
    # Without times, and without what a pilot says: the run under its PMF is what is resumed.
    differing = re.compile(r'^[^\n]*"(seconds|pilot_seconds|efficiency)":[^\n]*\n|^  "recipe": (null|\{.*?^  \}),\n', re.M | re.S)
    return code, re.sub(differing, "", out.read().decode())

class Bytes:
    """The numbers of a record, one after another: src/core/run_state_bytes.cpp says which."""
    def __init__(self, data):
        self.data, self.at = data, 0

    def skip(self, size):
        self.at += size

    def number(self, form="q"):
        self.at += struct.calcsize(form)
        return struct.unpack_from("<" + form, self.data, self.at - struct.calcsize(form))[0]

    def skip_list(self, size):
        self.skip(self.number("Q") * size)

    def skip_optional(self, size):
        self.skip(1 + size)

def samples_of(record):
    """How many samples a record holds: the sum over its nodes, each of which says first, last, and as many values."""
    b = Bytes(record)
    b.skip_list(1)  # name of the part
    b.number()  # chunk
    block = b.number()
    b.skip(8)  # seconds
    b.skip_list(1)  # estimator
    b.skip_list(1)  # its name
    b.skip_optional(8)  # seed
    b.skip(16)  # work and seconds of the pilot
    b.skip_list(11 * 8 + 1)  # its levels
    b.skip_optional(17)  # declared rates
    b.skip_optional(8)  # exact from
    b.skip(1)  # what else is stated
    total = 0
    for _ in range(b.number("Q")):
        first, last = b.number(), b.number()
        b.skip(8)  # chunks
        values = b.number()
        assert values * block == last - first, (values, block, first, last)
        total += last - first
        b.skip(5 * 8 + 8)  # other moments and work; number of components
        b.skip_list(16)
        b.skip(8 + 48)  # base level and its sums
        b.skip_list(48)
        for _ in range(3):
            b.skip_list(96)  # coupling
    return total

def look(path):
    """Samples of each whole record, read independently of the program, and the bytes behind the last one."""
    data = pathlib.Path(path).read_bytes() if os.path.exists(path) else b""
    at, records = 32 + struct.unpack_from("<Q", data.ljust(32, b"\0"), 20)[0], []
    while len(data) - at >= 16:
        end = at + 12 + struct.unpack_from("<Q", data, at + 4)[0]
        if len(data) < end + 4 or zlib.crc32(data[at:end]) != struct.unpack_from("<I", data, end)[0]:
            break
        records.append(samples_of(data[at + 12:end]))
        at = end + 4
    return records, len(data) - at

def state(path):
    """Inode and size of the file and of its successor, which may go at any moment."""
    found = []
    for p in (path, path + ".debias-new"):
        try:
            found.append(os.stat(p)[1::5])
        except FileNotFoundError:
            found.append(None)
    return found

def wait_to_kill(process, path):
    """Early, somewhere, or as soon as the file or its successor changes."""
    kind = rng.random()
    if kind < 0.6:
        return time.sleep(rng.uniform(0, 0.05 if kind < 0.3 else 1))
    time.sleep(0.3 if kind < 0.85 else 0)
    before, end = state(path), time.monotonic() + 3
    while process.poll() is None and state(path) == before and time.monotonic() < end:
        pass
    time.sleep(rng.choice([0, 0, rng.uniform(0, 0.003)]))

launched = collections.Counter()  # kills by the number of ranks
kills = runs = torn = successors = with_records = 0
failures = []
with tempfile.TemporaryDirectory() as folder:
    while runs < runs_wanted or kills < kills_wanted:
        words, rate = cases[runs % len(cases)]
        words = ["run", *words.split(), "--seed", str(rng.randint(1, 10**6)),
                 "--samples", str(int(rate * rng.uniform(1, 2.5)))]
        expected, path, held, runs = answer(*start(words)), os.path.join(folder, str(runs)), 0, runs + 1
        quota = max(kills_wanted * runs // runs_wanted, kills + 1)
        while True:
            inode = os.stat(path).st_ino if os.path.exists(path) else None
            process, out = start(["resume", path] if inode else [*words, "--checkpoint", path])
            ranks = 0
            if kills < quota:
                wait_to_kill(process, path)
                ranks = kill(process)
            ended = answer(process, out)
            records, rest = look(path)
            first, last = (records or [0])[0], (records or [0])[-1]
            if last < held or (inode and os.stat(path).st_ino != inode and first < held):
                failures.append(f"lost: {words}, {held} samples on disk before, now {records}")
            held = last
            if ended[0] == 0 or ranks == 0:
                break
            launched.update([ranks])
            kills, torn, with_records = kills + 1, torn + (rest > 0), with_records + (held > 0)
            successors += os.path.exists(path + ".debias-new")
        if ended != expected or expected[0] != 0:
            texts = [text.splitlines() for _, text in (expected, ended)]
            failures.append("\n".join([f"another result: {words}, exit code {ended[0]} for {expected[0]}",
                                       *difflib.unified_diff(*texts, lineterm="", n=0)]))
stuck = launched.pop("stuck", 0)
if most_ranks > 1:
    print(*(f"{n} of {r} ranks" for r, n in sorted(launched.items())), f"launchers that did not end: {stuck}", sep="; ")
print(f"seed {seed}: {kills} kills ({with_records} with records on disk, {torn} left a torn tail, {successors} an "
      f"unfinished new file) of {runs} runs, {len(failures)} failures", *failures, sep="\n")
sys.exit(len(failures) > 0)
