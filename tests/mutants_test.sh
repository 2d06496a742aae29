#!/bin/sh
# Each fault of tests/mutants.txt is one still: its line stands once where it says, and the tests that should see it exist.
# That they do see it: tests/mutants.py, by hand.
set -eu
command -v python3 >/dev/null || { echo "mutants_test.sh: no Python; skipped"; exit 77; }
here=$(CDPATH= cd -- "$(dirname -- "$0")" && pwd)
wrong=$(mktemp)
trap 'rm -f "$wrong"' EXIT
# The check itself can fail: a line that is gone, one that stands twice, a test that is not there, a name that is taken.
cat > "$wrong" << 'EOF'
name: gone
file: src/core/run_state.cpp
was: return the_line_that_is_gone;
now: return 0;
seen by: core/estimate_test.cpp

name: twice
file: src/core/run_state.cpp
was: position = node.last;
now: position = node.last + 1;
seen by: core/estimate_test.cpp

name: unseen
file: src/core/run_state.cpp
was: extremes.merge(other.extremes);
now: ;
seen by: core/no_such_test.cpp

name: unseen
file: src/core/run_state.cpp
was: extremes.merge(other.extremes);
now: ;
seen by: core/estimate_test.cpp
EOF
found=$(python3 "$here/mutants.py" --check --list "$wrong" | grep -cE '^(gone|twice|unseen): ' || true)
[ "$found" -eq 4 ] || { echo "the check found $found of 4 faults that are none"; exit 1; }
python3 "$here/mutants.py" --check
