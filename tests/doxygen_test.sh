#!/bin/sh
# The reference builds without a warning from a fresh clone. sh tests/doxygen_test.sh [PROGRAM, which it does not need]
set -eu
root=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)
command -v doxygen > /dev/null || { echo "skipped: no doxygen"; exit 77; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The files of a clone, without those that builds leave.
mkdir "$work/clone" "$work/clone/src"
cp -R "$root/include" "$root/README.md" "$work/clone"
cp "$root/src/Doxyfile" "$root/src/doxygen.awk" "$work/clone/src"
cd "$work/clone"
doxygen src/Doxyfile > "$work/said" 2>&1 || { cat "$work/said"; exit 1; }
[ ! -s "$work/said" ] || { cat "$work/said"; exit 1; }
[ -f build/doxygen/index.html ]
# A header of each kind is there with its head, and what is the library's own affair is not.
grep -q 'sequences of biased estimates' -i build/doxygen/sequence_8hpp.html
[ ! -f build/doxygen/structdebias_1_1detail_1_1Refused.html ]

# The test can fail: a link that leads nowhere is an error.
printf '\n\\ref no_such_page\n' >> README.md
! doxygen src/Doxyfile > /dev/null 2>&1 || { echo "a link that leads nowhere is no error"; exit 1; }
