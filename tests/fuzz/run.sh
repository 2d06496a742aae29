#!/bin/sh
# Builds the fuzz targets with clang and gives each N inputs, a million when there is no N.
#   sh tests/fuzz/run.sh [N]       BUILD_DIR: where, default build/fuzz; findings stay in BUILD_DIR/found
set -eu
root=$(CDPATH= cd -- "$(dirname -- "$0")/../.." && pwd)
build_dir=${BUILD_DIR:-$root/build/fuzz}
inputs=${1:-1000000}
cmake --preset fuzz -S "$root" -B "$build_dir" > /dev/null
cmake --build "$build_dir" --target fuzz
failed=0
for corpus in "$root"/tests/fuzz/corpus/*; do
  target=$(basename "$corpus")
  work=$build_dir/found/$target
  mkdir -p "$work/corpus"
  start=$(date +%s)
  if "$build_dir/fuzz_$target" -runs="$inputs" -timeout=5 -rss_limit_mb=2048 -max_len=512 -close_fd_mask=3 -artifact_prefix="$work/" \
    "$work/corpus" "$corpus" > "$work/log" 2>&1; then
    word=clean
  else
    word=FAILED
    failed=1
  fi
  echo "$target: $inputs inputs, $(($(date +%s) - start)) s, $word; $work/log"
done
exit $failed
