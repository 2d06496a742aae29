#!/bin/sh
# Includes point downward only: program -> catalogue -> recipe -> modules -> core. Names each one that does not, and calls
# that are not for threads.
set -eu
here=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)

# What a file may include: one extended regular expression for each file, by its path without include/debias/
# or src/ and without its suffix. A new module falls under the last line.
no_runner='core/(refusals|stream|stream_batch|vector_math|value|rates|sequence|pmf|estimator|accumulator|bias)'
may_include() {
  case $1 in
    core/*) echo 'core/.*' ;;
    pmf/any) echo 'core/.*|pmf/.*' ;;
    pmf/*) echo 'core/.*' ;;
    estimators/*) echo 'core/.*|pmf/geometric|estimators/common' ;;
    function_of_mean | function_of_mean/*) echo "$no_runner|function_of_mean/points" ;;
    taylor | taylor/*) echo "$no_runner|taylor/(terms|sum)" ;;
    functions) echo "$no_runner|power_series" ;;
    derivative/*) echo "$no_runner|derivative" ;;
    linear_operators) echo "$no_runner|series" ;;
    sde | sde/*) echo "$no_runner|sde|sde/summaries" ;;
    nested) echo "$no_runner|function_of_mean" ;;
    reciprocal) echo "$no_runner|series|taylor|function_of_mean|functions" ;;
    # the laws of published schedules
    transmittance) echo "$no_runner|taylor|function_of_mean|functions|pmf/bhanot_kennedy" ;;
    photon) echo "$no_runner|pmf/(geometric|radius)" ;;
    survey | survey/*) echo 'core/.*|survey|survey/levels' ;;
    diagnostics) echo 'core/.*' ;;
    multilevel) echo 'core/.*|survey/levels|diagnostics' ;;
    mpi) echo 'core/.*' ;;
    recipe | recipe/*) echo 'recipe/.*|core/.*|pmf/.*|estimators/.*|survey|diagnostics' ;;
    debias) echo '(core|pmf|estimators|derivative)/.*|[a-z_]*' ;;
    catalog | catalog/*) echo '(core|pmf|estimators|survey|catalog|sde)/.*|[a-z_]*' ;;
    cli/* | render/* | mpi/* | python/*) echo '.*' ;;
    *) echo "$no_runner" ;;
  esac
}

# check ROOT: prints what is not allowed in a tree: includes, and calls that write what other threads read.
check() {
  cd "$1"
  grep -rnE '^[^/]*\bstd::(lgamma|rand|strtok|setlocale)\(' include src || true
  find include src -name '*.hpp' -o -name '*.cpp' | sort | while read -r file; do
    name=${file#include/debias/}
    name=${name#src/}
    name=${name%.?pp}
    allowed=$(may_include "$name")
    # debias headers are included as <debias/...>, those of src/ as "...", from src/ or from the same folder
    sed -n -E 's|^ *# *include *<(debias/[^>]*)[.]hpp>.*|\1|p; s|^ *# *include *"([^"]*)[.]hpp".*|"\1|p' "$file" |
      while read -r include; do
        case $file:$include in
          include/*:\"*) echo "$file includes ${include#?} in quotes: use <debias/...>"; continue ;;
          *:debias/*) target=${include#debias/} ;;
          *) target=${include#?}; [ ! -f "${file%/*}/$target.hpp" ] || target=${name%"${name##*/}"}$target ;;
        esac
        [ "$target" = "$name" ] || printf '%s\n' "$target" | grep -qxE "$allowed" ||
          echo "$file may not include $target.hpp (allowed: $allowed)"
      done
  done
}

# The check itself can fail: every arrow of this tree points upward.
wrong=$(mktemp -d)
trap 'rm -rf "$wrong"' EXIT
arrow() { mkdir -p "$wrong/$(dirname "$1")" && echo "#include $2" > "$wrong/$1"; }
arrow include/debias/core/stream.hpp '<debias/series.hpp>'
arrow include/debias/core/value.hpp '"value.hpp"'
arrow include/debias/pmf/zeta.hpp '<debias/pmf/geometric.hpp>'
arrow include/debias/estimators/roulette.hpp '<debias/estimators/single_term.hpp>'
arrow include/debias/series.hpp '<debias/core/estimate.hpp>'
arrow include/debias/new_module.hpp '<debias/estimators/single_term.hpp>'
arrow src/series.cpp '"catalog.hpp"'
arrow src/catalog/integrals.cpp '"cli/parse.hpp"'
echo 'double x = std::lgamma(3);' > "$wrong/src/catalog/sums.cpp"
found=$(check "$wrong" | wc -l)
[ "$found" -eq 9 ] || { echo "the check found $found of 8 upward includes and a shared state"; check "$wrong"; exit 1; }

bad=$(check "$here")
[ -z "$bad" ] || { printf '%s\n' "$bad"; exit 1; }
