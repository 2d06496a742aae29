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
# The second program is in the first test of the recipe, line by line.
unqualified() { sed 's/debias:://g; s/^ *//' "$@"; }
unqualified "$root/tests/recipe_test.cpp" > "$work/tested"
awk '/^```cpp$/ { n++; inside = 1; next } /^```/ { inside = 0 } inside && n == 2' "$root/README.md" | unqualified > "$work/second"
[ -s "$work/second" ] || { echo "README has no second program"; exit 1; }
while IFS= read -r line; do
  grep -qxF -- "$line" "$work/tested" || { echo "README's second program is not tested: $line"; exit 1; }
done < "$work/second"
block text | without_times > "$work/shown.txt"
"$example" | without_times > "$work/printed.txt"
diff "$work/shown.txt" "$work/printed.txt" || { echo "README's output is not what the program prints"; exit 1; }
grep -q '^mean ' "$work/printed.txt"
