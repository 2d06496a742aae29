#!/bin/sh
# Line coverage of include and src by the quick tests: the files below 90 %, and the figure of all; fails below 90 %.
# src/python is not counted: the package has its own tests, and is not built here.
#   sh tests/coverage.sh       BUILD_DIR: where, default build/coverage; JOBS: how many at a time
set -eu
root=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)
build_dir=${BUILD_DIR:-$root/build/coverage}
jobs=${JOBS:-$(nproc)}
command -v gcovr > /dev/null || { echo "gcovr is missing (Debian: gcovr)" >&2; exit 2; }
cmake --preset coverage -S "$root" -B "$build_dir" > /dev/null
cmake --build "$build_dir" --parallel "$jobs"

find "$build_dir" -name '*.gcda' -delete
ctest --test-dir "$build_dir" -L quick -E '^(install|consumer_.*)$' --parallel "$jobs" --output-on-failure \
  > "$build_dir/tests.log" 2>&1 || grep '(Failed)\|(Timeout)' "$build_dir/tests.log"
# Threads race for counters, and a few come out negative.
gcovr -r "$root" --object-directory "$build_dir" --gcov-ignore-parse-errors --filter "$root/include/" \
  --filter "$root/src/" --exclude "$root/src/python/" --csv "$build_dir/lines.csv" --txt "$build_dir/lines.txt" \
  -j "$jobs" "$build_dir" > "$build_dir/gcovr.log" 2>&1
awk -F, 'NR > 1 { lines += $2; covered += $3; if ($3 < 0.9 * $2) printf "%5.1f %%  %4d of %4d  %s\n", 100 * $3 / $2, $3, $2, $1 }
  END { printf "%.2f %% of %d lines\n", 100 * covered / lines, lines; exit covered < 0.9 * lines }' "$build_dir/lines.csv"
