#!/bin/sh
# README shows the program of tests/consumer and what it prints (times aside). sh tests/readme_test.sh PROGRAM
set -eu
root=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)
example=$(dirname -- "$1")/debias_readme
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# block LANGUAGE: the first fenced block of that language.
block() { sed -n "/^\`\`\`$1\$/,/^\`\`\`\$/p" "$root/README.md" | sed '1d;/^```$/,$d'; }
without_times() { sed -E '/^(seconds|efficiency) /d'; }

block cpp > "$work/shown.cpp"
diff "$root/tests/consumer/main.cpp" "$work/shown.cpp" || { echo "README's program is not tests/consumer/main.cpp"; exit 1; }
block text | without_times > "$work/shown.txt"
"$example" | without_times > "$work/printed.txt"
diff "$work/shown.txt" "$work/printed.txt" || { echo "README's output is not what the program prints"; exit 1; }
grep -q '^mean ' "$work/printed.txt"
