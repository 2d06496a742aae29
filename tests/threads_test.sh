#!/bin/sh
# Where the machine, or a limit, grants fewer threads than were asked for: fewer threads, and a word.
#   sh tests/threads_test.sh PROGRAM
. "$(dirname -- "$0")/checks.sh"

# limited KIBIBYTES WORDS...   with so much address space, of which each thread takes 8 MiB
limited() { limit=$1; shift; (ulimit -v "$limit"; exec "$debias" "$@"); }
numbers() { grep -E '^(mean|samples|work|verdict)' "$1"; }

# A sanitizer's shadow takes more than any of these limits.
(ulimit -v 400000; exec "$debias" --version > /dev/null 2>&1) || { echo "skipped: the program does not start in 400 MB"; exit 77; }

"$debias" run A03 --samples 3e5 > whole
# A thread that has no memory gives its chunk back: none may be lost, at any limit.
for limit in 250000 300000 300100 330000 360000 400000 430000 470000 520000 600000; do
  limited $limit run A03 --samples 3e5 --threads 100 > out 2> err
  check "a run with an address space of $limit KiB" same $? 0
  check "its bits are those of any threads" same "$(numbers out)" "$(numbers whole)"
  check "it says how many threads it had" has '^warning  *only [0-9]* threads* could be had' out
done
limited 400000 run A03 --samples 3e5 --threads 100 --json > out 2> err
check "and so does its JSON" has 'could be had' out
limited 400000 run E02 --estimator multilevel --error 0.1 --threads 100 > out 2> err
check "multilevel runs" same $? 0
check "and says so" has 'could be had' out
limited 400000 render transmittance --size 64x64 --spp 16 --threads 64 -o image.pfm > out 2> err
check "an image is drawn" same $? 0
"$debias" render transmittance --size 64x64 --spp 16 -o whole.pfm > /dev/null 2>&1
check "the same one" cmp -s image.pfm whole.pfm
"$debias" run A03 --samples 3e5 --threads 2 > out 2> err
check "enough threads take no word" same "$(grep -c 'could be had' out)" 0
end_checks
