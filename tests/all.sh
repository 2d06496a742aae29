#!/bin/sh
# Everything by which the library is judged, in pieces of at most an hour. Each leaves one line (commit, date, outcome, seconds,
# what it said) in tests/trust.jsonl; tests/TRUST.md is made of the lines of one commit and quotes none of another. A line holds
# as long as nothing but these two files has changed since its commit; what git does not know or has not committed is refused.
#   sh tests/all.sh            the pieces that have not passed at this commit, one after another
#   sh tests/all.sh PIECE...   these, again
#   sh tests/all.sh --status   what has passed, and what has not; fails unless all have. Writes the page
#   sh tests/all.sh --list     the pieces
#   sh tests/all.sh --clean    removes their build folders
# A piece that is cut after an hour is `unfinished`: run again, it goes on where it was. JOBS: how many at a time; PYTHON: one
# that has NumPy.
# Needs clang, gcovr, libbenchmark-dev, MPI and, for msan, sources of Debian; a night and a day of two cores.
set -eu
root=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)
cd "$root"
record=tests/trust.jsonl
page=tests/TRUST.md
work=build/all
jobs=${JOBS:-$(nproc)}
python=${PYTHON:-python3}
unfinished=75
hour=3600

# Name, and what it is. `piece NAME` below runs it.
pieces() {
  cat << 'EOF'
tree            nothing in the tree that git does not know
gcc             g++, all targets, warnings are errors
gcc-tests       quick and statistical tests, g++
consumers       projects of a user, on the installed package and as a subdirectory
notebooks       every notebook, cell by cell
clang           clang++, all targets, warnings are errors
clang-tests     quick and statistical tests, clang++
assertions      g++ with _GLIBCXX_ASSERTIONS, all targets
assertions-tests quick and statistical tests with _GLIBCXX_ASSERTIONS
asan            address and undefined-behaviour sanitizers: builds
asan-quick      quick tests under them
asan-stat       statistical tests under them
tsan            thread sanitizer: builds
tsan-quick      quick tests under it
tsan-stat-1     statistical tests under it, the odd ones
tsan-stat-2     statistical tests under it, the even ones
msan            memory sanitizer: builds, and the quick tests
msan-stat       statistical tests under it
coverage        lines that the quick tests run, at least 90 %
fuzz-checkpoint a million inputs
fuzz-command    a million inputs
fuzz-diagnose   a million inputs
fuzz-numbers    a million inputs
fuzz-text       a million inputs
fuzz-volume     a million inputs
kills           300 kills of a run with a checkpoint, resumed to the same bits
kills-ranks     300 kills of one of 1, 2 or 3 MPI ranks
mutants         one-line faults, each seen by a test
reliability     what `debias validate --report` measures of itself
unseen          400 families of problems, by ten seeds that nobody chose: those from the commit's
long            tests that are tagged [.long], one by one
published       figures of papers and public test suites, each beside the library's
numpy2          the Python package under NumPy 2
soak            mixed work, kills and full disks, 50 minutes at a time until ten hours are over
EOF
}
names() { pieces | sed 's/ .*//'; }

fail() { echo "all.sh: $1" >&2; exit 2; }
within() { timeout --kill-after=30 "$@"; }  # 124 where it is cut

# ---- of what: a commit, and nothing else
# The last commit that changed more than the lines and their page.
commit() { git log -1 --format=%h --abbrev=10 -- . ":(exclude)$record" ":(exclude)$page"; }
changed() { git status --porcelain -- . ":(exclude)$record" ":(exclude)$page"; }
# holds COMMIT: that commit has the code of this one
holds() { git diff --quiet "$1" HEAD -- . ":(exclude)$record" ":(exclude)$page" 2> /dev/null; }

# ---- pieces
configured() { cmake --preset "$1" > "$work/$1.configured" 2>&1 || { tail -5 "$work/$1.configured"; return 1; }; }
# builds PRESET [TARGET...]: ninja goes on where it was cut
builds() {
  preset=$1
  shift
  configured "$preset" || return 1
  targets=${*:-all}
  # shellcheck disable=SC2086
  within $hour cmake --build "build/$preset" --parallel "$jobs" --target $targets > "$work/$preset.built" 2>&1 && code=0 || code=$?
  [ $code -ne 124 ] || return $unfinished
  [ $code -eq 0 ] || { grep -E 'error|FAILED' "$work/$preset.built" | head -3; return 1; }
  echo "builds without a warning"
}
# tests PRESET LABELS [CTEST ARGUMENTS...]
tests() {
  preset=$1 labels=$2
  shift 2
  within $hour ctest --test-dir "build/$preset" -L "$labels" --parallel "$jobs" --no-tests=error "$@" \
    > "$work/$preset.tests" 2>&1 && code=0 || code=$?
  grep -E '^[0-9]+% tests passed' "$work/$preset.tests" || true
  [ $code -eq 0 ] || sed -n '/^The following tests FAILED/,$p' "$work/$preset.tests" | grep -E '^[[:space:]]+[0-9]+ - ' | head -5
  [ $code -ne 124 ] || echo "cut after an hour"
  return $code
}
last_line() { within $hour "$@" > "$work/said" 2>&1 && code=0 || code=$?; tail -1 "$work/said"; return $code; }

# The long tests one by one; those that have passed at this commit are not run again.
long() {
  done_ones=$work/long-$(commit)
  touch "$done_ones"
  end=$(($(date +%s) + hour))
  build/dev/debias_tests --list-test-names-only "[long]" > "$work/long" || true  # Catch2 2: their number
  failures=0
  while IFS= read -r name; do
    ! grep -qxF -- "$name" "$done_ones" || continue
    left=$((end - $(date +%s)))
    [ $left -gt 0 ] || { echo "$(wc -l < "$done_ones") of $(wc -l < "$work/long")"; return $unfinished; }
    words=$(printf '%s' "$name" | sed 's/[],\\[]/\\&/g')
    within $left build/dev/debias_tests "$words" --warn NoTests > "$work/long.said" 2>&1 < /dev/null && code=0 || code=$?
    case $code in
      0) printf '%s\n' "$name" >> "$done_ones" ;;
      124) echo "$(wc -l < "$done_ones") of $(wc -l < "$work/long"), cut: $name"
           [ $left -gt 3000 ] && return 1 || return $unfinished ;;
      *) failures=$((failures + 1)); echo "FAILED: $name" ;;
    esac
  done < "$work/long"
  echo "$(wc -l < "$done_ones") of $(wc -l < "$work/long") passed"
  return $((failures > 0))
}

piece() {
  program=build/dev/bin/debias
  case $1 in
    gcc-tests | consumers | notebooks | kills* | reliability | unseen | long | published | numpy2 | soak)
      [ -x $program ] || { echo "first: sh tests/all.sh gcc"; return 1; } ;;
  esac
  case $1 in
    tree) echo "$(git ls-files | wc -l) files, none of them changed" ;;
    gcc) builds dev all debias_headers ;;
    gcc-tests) tests dev '^(quick|stat)$' -E '^(install|consumer_.*|notebook_.*)$' ;;
    consumers) tests dev quick -R '^(install|consumer_.*)$' ;;
    notebooks) tests dev stat -R '^notebook_' ;;
    clang) builds clang all debias_headers ;;
    clang-tests) tests clang '^(quick|stat)$' -E '^notebook_' ;;
    assertions) builds assertions ;;
    assertions-tests) tests assertions '^(quick|stat)$' -E '^(install|consumer_.*|notebook_.*)$' ;;
    asan | tsan) builds "$1" ;;
    asan-quick) UBSAN_OPTIONS=print_stacktrace=1 tests asan '^quick$' -E '^(install|consumer_.*)$' ;;
    asan-stat) tests asan '^stat$' ;;
    tsan-quick) tests tsan '^quick$' -E '^(install|consumer_.*)$' ;;
    tsan-stat-1) tests tsan '^stat$' -I 1,,2 ;;
    tsan-stat-2) tests tsan '^stat$' -I 2,,2 ;;
    msan)
      JOBS=$jobs within $hour sh tests/msan.sh > "$work/said" 2>&1 && code=0 || code=$?
      grep -E '^[0-9]+% tests passed' "$work/said" || tail -1 "$work/said"
      [ $code -ne 124 ] || return $unfinished
      return $code ;;
    msan-stat) tests msan '^stat$' ;;
    coverage)
      last_line sh tests/coverage.sh && code=0 || code=$?
      [ $code -ne 124 ] || return $unfinished
      return $code ;;
    fuzz-*)
      [ -f build/fuzz/CMakeCache.txt ] || rm -rf build/fuzz
      BUILD_DIR=build/fuzz last_line sh tests/fuzz/run.sh 1000000 "${1#fuzz-}" && code=0 || code=$?
      [ $code -ne 124 ] || return $unfinished  # the build goes on, the inputs begin again with what was found
      return $code ;;
    kills) last_line "$python" tests/kill.py $program 300 40 ;;
    kills-ranks) last_line "$python" tests/kill.py $program 300 40 1 3 ;;
    mutants)
      builds mutants debias_tests > /dev/null || return $?
      last_line "$python" tests/mutants.py build/mutants --minutes 50 && code=0 || code=$?
      case $(cat "$work/said") in *" 0 not run"*) return $code ;; *) return $unfinished ;; esac ;;
    reliability)
      within $hour $program validate --report --samples 1e6 -o "$work/reliability.md" > "$work/said" 2>&1 && code=0 || code=$?
      echo "$(grep -c '| holds |$' "$work/reliability.md") figures hold, $(grep -c 'FAILS' "$work/reliability.md") fail"
      return $code ;;
    unseen)  # ten seeds: of one, some lines rest on a family or two
      seed=$(printf '%d' "0x$(commit | cut -c1-7)")
      rm -f "$work"/unseen-*.json
      for i in 0 1 2 3 4 5 6 7 8 9; do
        within $hour $program validate --unseen $((seed + i)) --samples 65536 -q --json -o "$work/unseen-$i.json" > "$work/said" 2>&1 \
          || [ $? -eq 4 ] || { tail -1 "$work/said"; return 1; }
      done
      last_line "$python" src/validation/pool.py "$work"/unseen-?.json && code=0 || code=$?
      grep ' FAILS' "$work/said" || true
      return $code ;;
    long) long ;;
    published) last_line sh tests/published_test.sh $program all ;;
    numpy2) tests dev long -C long -R '^python_numpy2$' ;;
    soak) last_line "$python" tests/soak.py $program 50 10 ;;
  esac
}

# ---- lines
field() { printf '%s\n' "$2" | sed -n "s/.*\"$1\": *\"\{0,1\}\([^\"]*\)\"\{0,1\}[,}].*/\1/p"; }
# line_of PIECE: its last one that holds for this commit
line_of() {
  [ -f $record ] || return 0
  grep "\"piece\": \"$1\"," $record | tac | while IFS= read -r line; do
    if holds "$(field commit "$line")"; then
      printf '%s\n' "$line"
      break
    fi
  done
}
outcome_of() {
  line=$(line_of "$1")
  [ -n "$line" ] && field outcome "$line" || echo "not run"
}

run() {
  changes=$(changed)
  [ -z "$changes" ] || fail "a line is of a commit, and these are in none: $(printf '%s' "$changes" | head -3 | tr '\n' ' ')"
  before=$(git rev-parse HEAD)
  mkdir -p $work
  start=$(date +%s)
  what=$(piece "$1") && code=0 || code=$?
  case $code in 0) outcome=passed ;; $unfinished) outcome=unfinished ;; *) outcome=FAILED ;; esac
  [ "$(git rev-parse HEAD)" = "$before" ] && [ -z "$(changed)" ] || fail "$1: the tree has changed meanwhile; its outcome is of no commit"
  what=$(printf '%s' "$what" | tr '\n\t"\\' "; '/" | cut -c1-400)
  printf '{"piece": "%s", "commit": "%s", "date": "%s", "outcome": "%s", "seconds": %d, "what": "%s"}\n' "$1" "$(commit)" \
    "$(date -u '+%Y-%m-%d %H:%M')" $outcome $(($(date +%s) - start)) "$what" >> $record
  echo "$1: $outcome, $(($(date +%s) - start)) s; $what"
  [ $outcome = passed ]
}

write_page() {
  {
    echo "# All checks, of one commit"
    echo
    echo "Written by \`sh tests/all.sh --status\` from the lines of tests/trust.jsonl that are of commit $(commit), or of one with the"
    echo "same code. What has no line was not run on this code, whatever was run on another."
    echo
    echo "| piece | what it is | outcome | what it said | commit | date (UTC) | seconds |"
    echo "|---|---|---|---|---|---|---|"
    pieces | while read -r name about; do
      line=$(line_of "$name")
      if [ -n "$line" ]; then
        echo "| $name | $about | $(field outcome "$line") | $(field what "$line" | tr '|' '/') | $(field commit "$line") |" \
          "$(field date "$line") | $(field seconds "$line") |"
      else
        echo "| $name | $about | not run | | | | |"
      fi
    done
  } > $page
}

case ${1-} in
  --list) [ $# -eq 1 ] && pieces ;;
  --clean) for p in dev clang assertions asan tsan msan coverage fuzz mutants all; do rm -rf "build/$p"; done ;;
  --status)
    write_page
    left=0
    for name in $(names); do
      outcome=$(outcome_of "$name")
      [ "$outcome" = passed ] || left=$((left + 1))
      printf '%-17s%s\n' "$name" "$outcome"
    done
    changes=$(changed)
    [ -z "$changes" ] || echo "and the tree has changes that are in no commit"
    echo "$left of $(names | wc -l) pieces have not passed at $(commit); $page"
    [ $left -eq 0 ] && [ -z "$changes" ] ;;
  -*) sed -n '5,9s/^# *//p' "$0" >&2; exit 2 ;;
  *)
    for name in "$@"; do names | grep -qxF -- "$name" || fail "no piece '$name'; sh tests/all.sh --list"; done
    failures=0
    for name in ${*:-$(names)}; do
      [ $# -gt 0 ] || [ "$(outcome_of "$name")" != passed ] || continue
      run "$name" || failures=$((failures + 1))
    done
    write_page
    [ $failures -eq 0 ] ;;
esac
