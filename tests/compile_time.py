#!/usr/bin/env python3
"""Where the compile time goes: processor seconds (user + system) of each object of a build folder, largest first.

  python3 tests/compile_time.py BUILD [PART OF AN OBJECT'S NAME]...

Runs ninja's own commands one after another, without a compiler cache; objects go to a file that is thrown away.
"""
import collections
import json
import os
import shlex
import subprocess
import sys
import tempfile

build, parts = sys.argv[1], sys.argv[2:]
commands = json.loads(subprocess.run(["ninja", "-C", build, "-t", "compdb"], capture_output=True, text=True, check=True).stdout)
seconds = {}
with tempfile.TemporaryDirectory() as scratch:
    for c in commands:
        words = shlex.split(c["command"])
        if "-c" not in words or "-o" not in words or (parts and not any(p in c["output"] for p in parts)):
            continue
        words = words[1:] if words[0].endswith("ccache") else words
        words[words.index("-o") + 1] = os.path.join(scratch, "object.o")
        if "-MF" in words:
            words[words.index("-MF") + 1] = os.path.join(scratch, "object.d")
        process = subprocess.Popen(words, cwd=c["directory"], env=os.environ | {"CCACHE_DISABLE": "1"},
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            sys.exit(f"{c['output']}: the compiler failed (build the folder once, for what it generates)")
        seconds[c["output"]] = used.ru_utime + used.ru_stime

targets = collections.Counter()
for name, s in sorted(seconds.items(), key=lambda item: -item[1]):
    print(f"{s:8.1f}  {name}")
    targets[name.partition("CMakeFiles/")[2].partition("/")[0]] += s
print()
for target, s in targets.most_common():
    print(f"{s:8.1f}  {target}")
print(f"{sum(targets.values()):8.1f}  in all")
