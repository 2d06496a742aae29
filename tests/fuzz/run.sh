#!/bin/sh
# Builds the fuzz targets with clang and gives each N inputs, a million when there is no N.
#   sh tests/fuzz/run.sh [N [TARGET...]]    BUILD_DIR: where, default build/fuzz; findings stay in BUILD_DIR/found
#   sh tests/fuzz/run.sh merge [TARGET...]  takes from those what reaches further into the corpus, and little else
# A finding is run again by BUILD_DIR/fuzz_TARGET FILE; there it also says where memory was allocated.
set -eu
root=$(CDPATH= cd -- "$(dirname -- "$0")/../.." && pwd)
build_dir=${BUILD_DIR:-$root/build/fuzz}
inputs=${1:-1000000}
[ $# -eq 0 ] || shift
[ $# -gt 0 ] || set -- $(ls "$root/tests/fuzz/corpus")
cmake --preset fuzz -S "$root" -B "$build_dir" > /dev/null
cmake --build "$build_dir" --target fuzz
export ASAN_OPTIONS="${ASAN_OPTIONS:-malloc_context_size=0:quarantine_size_mb=4:max_malloc_fill_size=0}"
[ ! -d /dev/shm ] || export TMPDIR="${TMPDIR:-/dev/shm}"  # what the commands write
failed=0
for target in "$@"; do
  corpus=$root/tests/fuzz/corpus/$target
  work=$build_dir/found/$target
  mkdir -p "$work/corpus"
  case $target in
    checkpoint) options=-max_len=4096 ;;
    command) options="-max_len=512 -dict=$root/tests/fuzz/command.dict" ;;
    *) options=-max_len=512 ;;
  esac
  options="$options -timeout=20 -report_slow_units=1 -entropic=0 -detect_leaks=0 -rss_limit_mb=2048 -close_fd_mask=3 -artifact_prefix=$work/"
  start=$(date +%s)
  if [ "$inputs" = merge ]; then
    rm -rf "$work/small"
    mkdir "$work/small"
    "$build_dir/fuzz_$target" -set_cover_merge=1 -use_counters=0 $options "$work/small" "$work/corpus" "$corpus" > "$work/log" 2>&1 < /dev/null
    rm -rf "$corpus"
    cp -r "$work/small" "$corpus"
    echo "$target: $(ls "$corpus" | wc -l) files, $(du -sb "$corpus" | cut -f 1) bytes"
    continue
  fi
  if "$build_dir/fuzz_$target" -runs="$inputs" $options "$work/corpus" "$corpus" > "$work/log" 2>&1 < /dev/null; then
    word=clean
  else
    word=FAILED
  fi
  # what took a second by the clock, on a machine that others use, may not take one of the processor
  for slow in "$work"/slow-unit-*; do
    [ ! -f "$slow" ] || (ulimit -t 1; "$build_dir/fuzz_$target" "$slow") > /dev/null 2>&1 < /dev/null || word="FAILED: $slow"
  done
  [ "$word" = clean ] || failed=1
  echo "$target: $inputs inputs, $(($(date +%s) - start)) s, $word; $work/log"
done
exit $failed
