#!/bin/sh
# The program says the same bytes in a host whose locale writes 1.234.567,89. The program itself asks for no locale: a
# library that is loaded before it plays the host, and says setlocale and std::locale::global.
#   sh tests/locale_test.sh PROGRAM      one line for each check that failed, then their number
# Skipped (exit 77) without localedef, its sources (Debian: package locales) or a compiler for the host.
program=$1
. "$(dirname -- "$0")/checks.sh"

compiler=$(command -v "${CXX:-g++}" || command -v clang++ || true)
mkdir locales
LOCPATH=$here/locales
export LOCPATH
[ -n "$compiler" ] && localedef -i de_DE -f UTF-8 "$LOCPATH/de_DE.UTF-8" > /dev/null 2>&1 &&
  localedef -i tr_TR -f UTF-8 "$LOCPATH/tr_TR.UTF-8" > /dev/null 2>&1 ||
  { echo "locale_test.sh: no localedef, locale sources or compiler; skipped"; exit 77; }

cat > host.cpp <<'EOF'
#include <clocale>
#include <cstdio>
#include <cstdlib>
#include <locale>
#include <sstream>
// Says on demand what the host's locale makes of numbers, so that the test knows that there is one.
static const struct Host {
  Host() {
    const char* name = std::getenv("HOST_LOCALE");
    if (name == nullptr) return;
    if (std::setlocale(LC_ALL, name) == nullptr) std::_Exit(99);
    std::locale::global(std::locale(name));
    if (std::getenv("HOST_SPEAKS") == nullptr) return;
    std::ostringstream text;
    text << 1234567 << ' ' << 0.5;
    std::fprintf(stderr, "%s %.1f\n", text.str().c_str(), 0.5);
  }
} host;
EOF
"$compiler" -std=c++20 -shared -fPIC -o libhost.so host.cpp || exit 1

# said LOCALE COMMAND...: what the program says in that locale (none: C), without what a clock measures
said() {
  where=$1
  shift
  [ -n "$where" ] && HOST_LOCALE=$where
  export HOST_LOCALE
  ASAN_OPTIONS=verify_asan_link_order=0:${ASAN_OPTIONS-} LD_PRELOAD=$here/libhost.so "$debias" "$@" 2>&1 < numbers
  echo "exit code $?"
  unset HOST_LOCALE
}
# Without times: lines, and columns of a survey (microseconds), a tradeoff (efficiency) and validate (both).
steady() {
  sed -E -e '/^(seconds|efficiency)/d' -e '/"(seconds|efficiency)"/d' -e 's/, [0-9.e+-]+ s$//' "$@" |
    awk '$1 ~ /^[0-9]+$/ && NF > 10 { $11 = "" } $1 ~ /^geometric:/ { $9 = "" }
      $1 ~ /^(pass|fail|biased)$/ { i = $4 ~ /,$/; $(11 + i) = $(12 + i) = "" } { print }'
}

seq 1 0.25 2000 > numbers
HOST_SPEAKS=yes said de_DE.UTF-8 --version > out
check "the host's locale writes decimal commas and groups" has '^1[.]234[.]567 0,5 0,5$' out

# compared COMMAND...: once in each locale
compared() {
  said '' "$@" | steady > expected
  for locale in de_DE.UTF-8 tr_TR.UTF-8; do
    said $locale "$@" | steady > out
    check "the same bytes in $locale of: debias $*" cmp -s expected out
  done
}
compared list
compared list problems --json
compared run A01 --samples 20000
compared run A01 --samples 20000 --json
compared run A10 --samples 1234567 --threads 2
compared run A01 --estimator recipe --samples 20000
compared run A01 --samples 20000 --error 0.5
compared run A01 --error 0.01
compared run A01 --estimator multilevel --error 0.01
compared run furnace --estimator roulette --pmf geometric:r=0.5 --samples 20000
compared replay A10 --seed 3 --sample 7
compared survey A10 --levels 4 --samples 2000
compared survey E05 --levels 1
compared tradeoff A10 --points 3 --samples 2000
compared tradeoff A10 --points 3 --samples 2000 --json
compared validate A01 A10 --samples 20000
compared diagnose -
compared diagnose - --json
compared diagnose - --column 2
# refusals with a number in them
compared run A01 --pmf geometric:r=1.5
compared run A01 --pmf zeta:s=0,5
compared run E06
compared run A01 --samples 1.5
compared run A01 --confidence 95
compared run A01 --error -0.5
compared validate --confidence 0.9
# names know no Turkish i
compared run 'İ01'
compared run A01 --estimator INDEPENDENT_SUM

# Files of one locale are read in another.
said de_DE.UTF-8 run A10 --samples 20000 --json -o german.json > out
said '' run A10 --samples 20000 --json -o plain.json > out
check "a file of results is the same" eval 'steady german.json > a; steady plain.json > b; cmp -s a b'
said de_DE.UTF-8 run A10 --samples 1e5 --checkpoint saved -q > out
said '' run A10 --samples 1e5 -q | steady > expected
said '' resume saved -q | steady > out
check "a checkpoint of a German host is resumed by another" cmp -s expected out
end_checks
