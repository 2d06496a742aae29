#!/bin/sh
# Includes point downward only: cli, python -> commands -> validation, catalog, render -> recipe, modules -> core. Names each
# one that does not, sources that do not include their header first, calls that are not for threads, texts of numbers that ask
# the locale, and names of tests that CMake cuts.
#   sh tests/include_rules_test.sh [PROGRAM]
set -eu
here=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)

# What a file may include: one extended regular expression for each file, by its path without include/debias/
# or src/ and without its suffix. A new module falls under the last line.
no_runner='core/(refusals|stream|stream_batch|vector_math|text|value|rates|sequence|pmf|estimator|accumulator|bias)'
may_include() {
  case $1 in
    core/verdict | core/plan) echo 'core/.*|statistics/(evidence|meeting|posterior)' ;;
    core/*) echo 'core/.*' ;;
    statistics/*) echo 'core/.*|statistics/.*' ;;
    pmf/any | pmf/dyadic) echo 'core/.*|pmf/.*' ;;
    pmf/*) echo 'core/.*' ;;
    estimators/*) echo 'core/.*|pmf/geometric|estimators/common' ;;
    function_of_mean | function_of_mean/*) echo "$no_runner|core/student|function_of_mean/.*" ;;
    taylor | taylor/*) echo "$no_runner|taylor/(terms|sum)" ;;
    functions | functions/*) echo "$no_runner|functions/.*" ;;
    derivative | derivative/*) echo "$no_runner|derivative/.*" ;;
    linear_operators) echo "$no_runner|series" ;;
    operators | operators/*) echo "$no_runner|linear_operators|functions/elementary|operators/.*" ;;
    sde | sde/*) echo "$no_runner|core/points|sde|sde/.*" ;;
    nested) echo "$no_runner|function_of_mean" ;;
    chains | chains/*) echo "$no_runner|core/report|chains/.*|function_of_mean|statistics/(evidence|meeting)" ;;
    reciprocal) echo "$no_runner|series|taylor|function_of_mean|functions" ;;
    # the laws of published schedules
    transmittance) echo "$no_runner|core/text|taylor|function_of_mean|functions|pmf/bhanot_kennedy" ;;
    photon) echo "$no_runner|pmf/(geometric|radius)" ;;
    survey | survey/*) echo 'core/.*|statistics/(evidence|posterior)|survey|survey/.*' ;;
    diagnostics) echo 'core/.*' ;;
    multilevel) echo 'core/.*|survey/levels|diagnostics' ;;
    mpi) echo 'core/.*' ;;
    numbers/*) echo 'numbers/.*' ;;
    recipe | recipe/*) echo 'recipe|recipe/.*|core/.*|statistics/.*|pmf/.*|estimators/.*|survey|survey/(pilot|resonance)|diagnostics' ;;
    debias) echo '(core|pmf|estimators|derivative|recipe|chains)/.*|[a-z_]*' ;;
    catalog | catalog/*) echo '(core|pmf|estimators|survey|catalog|sde|chains)/.*|[a-z_]*' ;;
    validation/*) echo '(core|pmf|estimators|survey|catalog|validation|sde)/.*|[a-z_]*' ;;
    render/*) echo '(core|estimators|render)/.*|diagnostics|photon|transmittance' ;;
    commands/*) echo '(core|statistics|numbers|pmf|survey|recipe|validation|render|commands)/.*|[a-z_]*' ;;
    # siblings: neither sees the other
    cli/*) echo '(core|numbers|commands|validation|render|cli)/.*|[a-z_]*' ;;
    python/*) echo '(core|pmf|estimators|survey|catalog|commands|python)/.*|[a-z_]*' ;;
    mpi/*) echo 'core/.*|mpi|mpi/.*' ;;
    *) echo "$no_runner" ;;
  esac
}

# What writes or reads numbers as the locale of the process likes. The house has detail::format, to_text, parse_double
# and parse_count; a string stream that only texts go into says so.
asks_locale='\b(v?(f|s|sn|as|d)?w?printf|v?(f|s)?scanf|strto(d|f|ld)|atof|sto(d|f|ld)|setprecision|put_money)\('
asks_locale="$asks_locale"'|\b(is|to)(lower|upper|digit|alpha|alnum|space|print|punct)\(|\b(o|i)?stringstream\b'
asks_locale="$asks_locale"'|[.](precision|imbue)\(|\bstd::(fixed|scientific|locale)\b|#include <(locale|iomanip)>'

# check ROOT: prints what is not allowed in a tree: includes, calls that write what other threads read, and numbers in
# the hands of the locale.
check() {
  cd "$1"
  grep -rnE '^[^/]*\bstd::(lgamma|rand|strtok|setlocale)\(' include src || true
  grep -rnE "^([^/]|/[^/])*($asks_locale)" include src | grep -v '// only texts$' || true
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
    # A public header is shown to compile alone by its source, if it has one, or by a file made for it (tests/CMakeLists.txt).
    case $file in src/*.cpp)
      [ ! -f "include/debias/$name.hpp" ] || grep -m1 '^#include' "$file" | grep -qxF "#include <debias/$name.hpp>" ||
        echo "$file does not include <debias/$name.hpp> first" ;;
    esac
  done
  # CMake cuts a list there, and the case is not found.
  [ ! -d tests ] || grep -rnE '^TEST_CASE\("[^"]*;' tests || true
}

# check_objects LIBRARY...: std::to_string of a double is vsnprintf, which only the object files can tell from that of a
# whole number; numbers in a stream are members of std::ostream. (Boost.Math and nlohmann_json bring their own: of those
# only what they do not use is asked for; Boost.Random's engine, in sobol, could be written to a stream, and is not.)
into_a_stream='.*_M_insert<(unsigned )?long>'
check_objects() {
  nm -AC --undefined-only "$@" 2> /dev/null | grep -v ':sobol.cpp.o:' |
    grep -E " U (vsnprintf|std::ostream::operator<<\((int|double|float|bool|short|unsigned|long)|$into_a_stream)" || true
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
arrow src/catalog/means.cpp '"validation/validation.hpp"'
arrow src/validation/hard.cpp '"commands/run.hpp"'
arrow src/render/cloud.cpp '"catalog.hpp"'
arrow src/commands/run.cpp '"cli/output.hpp"'
arrow src/commands/survey.cpp '"python/problem.hpp"'
arrow src/cli/run.cpp '"python/problem.hpp"'
arrow src/python/module.cpp '"cli/requests.hpp"'
mkdir "$wrong/tests" && echo 'TEST_CASE("one; two", "[x]") {}' > "$wrong/tests/x_test.cpp"
echo 'double x = std::lgamma(3);' > "$wrong/src/catalog/sums.cpp"
cat > "$wrong/src/locale.cpp" << 'EOF'
std::snprintf(text, sizeof text, "%.3g", x);
double x = std::stod(text);  // 0.5
std::ostringstream text;
out << std::setprecision(3) << x;
text.precision(3);
// printf(x) in a comment is allowed, as are std::to_string(3) and
std::ostringstream names;  // only texts
EOF
found=$(check "$wrong" | wc -l)
[ "$found" -eq 23 ] ||
  { echo "the check found $found of 15 upward includes, 1 not first, 1 name, a shared state, 5 locales"; check "$wrong"; exit 1; }

bad=$(check "$here")
[ -z "$bad" ] || { printf '%s\n' "$bad"; exit 1; }

# Of the objects, where they and the tools are.
[ $# -eq 1 ] && command -v nm > /dev/null || exit 0
compiler=$(command -v "${CXX:-g++}" || command -v clang++) || exit 0
cat > "$wrong/numbers.cpp" << 'EOF'
#include <ostream>
#include <string>
std::string whole(long x) { return std::to_string(x); }
void text(std::ostream& out, const std::string& x) { out << x << '\n'; }
#ifdef WRONG
std::string fraction(double x) { return std::to_string(x); }
void number(std::ostream& out, int x, long y) { out << x << y; }
#endif
EOF
"$compiler" -std=c++20 -O1 -c "$wrong/numbers.cpp" -o "$wrong/right.o"
"$compiler" -std=c++20 -O1 -DWRONG -c "$wrong/numbers.cpp" -o "$wrong/wrong.o"
if [ -n "$(check_objects "$wrong/right.o")" ] || [ "$(check_objects "$wrong/wrong.o" | wc -l)" -lt 2 ]; then
  echo "the check does not tell numbers that ask the locale from those that do not"
  check_objects "$wrong/right.o" "$wrong/wrong.o"
  exit 1
fi
built=$(dirname "$(dirname "$1")")
bad=$(check_objects "$built"/libdebias.a "$built"/libdebias_catalog.a "$built"/libdebias_validation.a \
  "$built"/libdebias_commands.a)
[ -z "$bad" ] || { printf '%s\n' "$bad"; exit 1; }
