#!/bin/sh
# Each program of notebooks/cpp prints its answers within 4.5 standard errors of the exact ones. sh tests/examples_test.sh PROGRAM
set -eu
root=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)
bin=$(dirname -- "$1")

# judge NAME: every line "what value +- error, exact truth" of standard input holds, and there is one.
judge() {
  awk -v name="$1" '
    $3 != "+-" || $5 != "exact" { print name ": not an answer: " $0; bad = 1; next }
    { n++; z = ($2 - $6) / $4; if (!(z < 4.5 && z > -4.5)) { print name ": " $0 " (" z " standard errors off)"; bad = 1 } }
    END { if (n == 0) { print name ": no answer"; bad = 1 } exit bad }' -
}

# The check can fail.
if echo "x 1.5 +- 0.1, exact 1" | judge wrong >/dev/null; then echo "judge lets 5 standard errors pass"; exit 1; fi
if echo "x nan +- 0.1, exact 1" | judge wrong >/dev/null; then echo "judge lets nan pass"; exit 1; fi
if : | judge wrong >/dev/null; then echo "judge lets nothing pass"; exit 1; fi

number=0
for source in "$root"/notebooks/cpp/*.cpp; do
  name=$(basename "$source" .cpp)
  "$bin/example_$name" | judge "$name"
  number=$((number + 1))
done
[ "$number" -ge 10 ] || { echo "only $number examples"; exit 1; }
echo "$number examples"
