#!/bin/sh
# `debias diagnose` on good, bad and hostile files: exit codes, streams, and that nothing is left out in silence.
#   sh tests/diagnose_test.sh PROGRAM      one line for each check that failed, then their number
. "$(dirname -- "$0")/checks.sh"

# diagnosed CODE ARGUMENTS...: that exit code; the result is in out, complaints are in err
diagnosed() {
  code=$1
  shift
  "$debias" diagnose "$@" > out 2> err
  check "exit code of: debias diagnose $*" same $? "$code"
}
# refused CODE WORD ARGUMENTS...
refused() {
  wanted=$1
  expected=$2
  shift 2
  refused_by "$wanted" "$expected" diagnose "$@"
}

# ---- good numbers: 1 ... 1000
seq 1000 > numbers
diagnosed 0 numbers
check "the count" has '^values *1000$' out
check "the mean, of values that a trend ties together" has '^mean *500(160)' out
check "which is said" has '^warning *values depend on their neighbours: the standard error is [0-9.]* times' out
check "one line of verdict: of one trend nothing is known" same "$(grep -c '^verdict *variance open' out)" 1
check "no more than the file, how it was read, values, mean, verdict and doubt" same "$(lines out)" 6
diagnosed 0 numbers --full
check "the count, in full" has '^values *1000$' out
check "both tails are light" same "$(grep -c 'tail *k = -' out)" 2
check "the verdict" has '^verdict *variance open' out
check "a doubling" has '^ *512 *256.5 ' out
check "nothing on stderr" same "$(lines err)" 0
diagnosed 0 numbers --json
check "the mean in JSON" has '"mean": 500.5' out
check "the verdict in JSON" has '"variance": "undecided"' out
check "the status in JSON" has '"status": "ok"' out
check "the largest in JSON" has '"row": 1000' out
cp out expected
"$debias" diagnose - --json < numbers | sed "s/standard input/numbers/" > piped
check "a pipe gives what a file gives" cmp piped expected
diagnosed 0 numbers --json -o result
check "-o writes the file" cmp result expected
check "-o writes nothing else" same "$(lines out)" 0

# ---- columns
{ echo 'index,"a, b",flux'; seq 1000 | sed 's/.*/7,"x,y", & /'; } > table.csv
diagnosed 0 table.csv --column flux
check "a column by name" has '^mean *500(160)' out
check "the column is named" has 'column flux' out
diagnosed 0 table.csv --column 3
check "a column by number" has '^mean *500(160)' out
refused 2 "3 columns.*index, a, b, flux" table.csv
refused 2 "column 'fluxx' (no such name: index, a, b, flux); .*--column" table.csv --column fluxx
refused 2 "column '4' (a number from 1 to 3" table.csv --column 4
refused 2 "column '0' (a number from 1 to 3" table.csv --column 0
diagnosed 5 table.csv --column 2 2> /dev/null
check "a column of words has no value" has "1000 bad rows; row 2: 'x,y'" err
{ printf '\357\273\277value\r\n'; seq 1000 | sed 's/$/\r/'; } > windows.csv
diagnosed 0 windows.csv
check "byte order mark and carriage returns" has '^mean *500(160)' out
check "a header alone names the column" has 'column value' out
{ seq 1000; echo; echo; } > trailing
diagnosed 0 trailing
check "blank rows at the end are none" lacks 'bad rows' out

# ---- few or equal values
refused 5 "no value" /dev/null
echo name > header
refused 5 "no value" header
echo 3 > one
diagnosed 0 one
check "one value has a mean and no error" has '^mean *3$' out
check "and a warning" has 'no standard error' out
diagnosed 0 one --json
check "its code in JSON" has '"code": "one_sample"' out
check "one value in JSON" has '"standard_error": null' out
yes 7 | head -100 > equal
diagnosed 0 equal
check "equal values" has 'all values are equal' out
diagnosed 0 equal --json
check "equal values in JSON" has '"status": "zero_variance"' out
printf '1e308\n-1e308\n3\n' > huge
diagnosed 0 huge
check "squares of 1e308 have a standard error" has '^mean *1 +- 5.8e+307' out
check "an interval that no double holds is said in words" has 'beyond -1.8e308, beyond 1.8e308' out
diagnosed 0 huge --json
check "its standard error in JSON" has '"standard_error": 5.7735026918962.*e+307' out
check "and its status" has '"status": "ok"' out
seq 3 > three
diagnosed 0 three
check "three values show no tail" has 'variance open: no tail to be seen' out
printf '1\n2' > unfinished
diagnosed 0 unfinished
check "the last row needs no newline" has '^values *2$' out

# ---- values that are not finite: exit code 6, and no mean
for bad in nan NaN inf -inf Infinity; do
  { seq 10; echo "$bad"; seq 10; } > nonfinite
  diagnosed 6 nonfinite
  check "$bad makes the mean no number" has '^mean *not a number: 1 value is not finite, the first in row 11' out
  check "$bad is complained about" has 'debias: .*not finite.*row 11' err
  diagnosed 6 nonfinite --json
  check "$bad in JSON" has '"mean": null' out
  check "$bad in the status" has '"status": "nonfinite"' out
  check "no nan in JSON" same "$(grep -ci '[:,] *-\{0,1\}\(nan\|inf\)' out)" 0
done

# ---- rows that are no numbers: counted, named, exit code 5
{ seq 10; echo abc; echo; echo 0x10; echo 1e999; echo '+5'; echo '1 2'; seq 10; } > words
diagnosed 5 words
check "good rows are used, a plus is no fault" has '^values *21$' out
check "the report leads with the rows that are left out" same "$(head -1 out)" \
  'bad rows      5 of 26 hold no number; everything below is without them'
check "and no mean is printed as if nothing were" has '^mean .*(without 5 bad rows)' out
check "bad rows are named" has "row 11: 'abc': not a number" out
check "empty rows are named" has "row 12: empty" out
check "numbers beyond double are named" has "row 14: '1e999'" out
check "bad rows are complained about" has 'debias: .*5 bad rows, the first is row 11' err
refused 5 "row 11: 'abc': not a number; .*--strict" words --strict
diagnosed 5 words --json
check "bad rows in JSON" has '"status": "bad_rows"' out
printf 'some\nwords\nonly\n' > prose
refused 5 "no value, 2 bad rows; row 2: 'words'" prose
printf '1\n\377\376\n2\n' > bytes
diagnosed 5 bytes --json
check "bytes that are no text" has '"bad_rows": 1' out
{ echo value; seq 5; head -c 3000000 /dev/zero | tr '\0' 7; echo; seq 5; } > long
diagnosed 5 long
check "an endless row is one bad row" has 'row 7: longer than' out
check "and what follows is read" has '^values *10$' out

# ---- doubles: 0.5 and 2.0
for i in 1 2 3 4 5 6 7 8; do printf '\0\0\0\0\0\0\340\077\0\0\0\0\0\0\0\100'; done > doubles
diagnosed 0 doubles --format f64
check "doubles" has '^mean *1.25(19)' out
check "sixteen of them" has '^values *16$' out
{ cat doubles; printf abc; } > cut
diagnosed 5 cut --format f64
check "a cut double" has '3 bytes at the end' out
{ cat doubles; printf '\0\0\0\0\0\0\370\177'; } > nan
diagnosed 6 nan --format f64
check "a double that is no number" has 'value 17' out
refused 2 "must be text, npy, f64, f32" numbers --format f16
refused 2 "a column (raw numbers have none)" doubles --format f64 --column 1
for i in 1 2 3 4; do printf '\077\340\0\0\0\0\0\0\100\0\0\0\0\0\0\0'; done > doubles.be
diagnosed 0 doubles.be --format f64be
check "big-endian doubles" has '^mean *1.25(28)' out
printf '\0\0\0\077\0\0\0\100' > floats
diagnosed 0 floats --format f32
check "floats" has '^mean *1.25(75)' out
printf '\077\0\0\0\100\0\0\0' > floats.be
diagnosed 0 floats.be --format f32be
check "big-endian floats" has '^mean *1.25(75)' out

# ---- values of any scale
printf '1e-170\n5e-170\n2e-171\n' > tiny
diagnosed 0 tiny
check "squares that underflow have a standard error" has '^mean *2.06666666666667e-170 +- 1.5e-170' out
diagnosed 0 tiny --json
check "all its digits" has '"standard_error": 1.4847371634213[0-9]*e-170' out
printf '5e-324\n1e-323\n15e-324\n' > subnormal
diagnosed 0 subnormal
check "subnormal values" has '^mean *9.88131291682493e-324 +- 4.9e-324' out
# an autoregression of coefficient 0.99 by a simple generator, and the same times 1e200
chain() {
  awk -v scale="$1" 'BEGIN { s = 1; x = 0; for (i = 0; i < 4000; ++i) { g = -6; for (k = 0; k < 12; ++k) {
    s = (s * 16807) % 2147483647; g += s / 2147483647 } x = 0.99 * x + g; printf "%.17g\n", x * scale } }'
}
chain 1 > chain.1
diagnosed 0 chain.1 --json
grep '"cutoff"' out | sed 's/[^0-9.]//g' | cut -c 1-12 > wanted
chain 1e200 > chain
diagnosed 0 chain --json
grep '"cutoff"' out | sed 's/e+200//' | sed 's/[^0-9.]//g' | cut -c 1-12 > got
check "cutoffs in the unit of the values" [ -s got ]
check "cutoffs have the scale" has '"cutoff": .*e+200' out
for scale in 1e200 1e-200 1e-300; do
  chain $scale > chain
  diagnosed 0 chain.1 --full
  grep -o 'error is [0-9.]* times' out > wanted
  grep -o 'k = .*' out >> wanted
  diagnosed 0 chain --full
  grep -o 'error is [0-9.]* times' out > got
  grep -o 'k = .*' out >> got
  check "a chain times $scale is judged as the chain itself" cmp wanted got
  check "a width in numbers: $scale" has 'times that of independent' out
  check "no nan of a chain times $scale" lacks 'nan' out
done
awk 'BEGIN { s = 1; for (i = 0; i < 3000; ++i) { s = (s * 16807) % 2147483647; printf "%.3fe%d\n", 1 + s / 1e10, s % 601 - 300 } }' > span
diagnosed 0 span
check "values from 1e-300 to 1e300" has '^values *3000' out
check "no nan of them" lacks '[^a-z]nan\|[^a-z]inf[^i]' out

# ---- values that depend on their neighbours: an error that fits the interval, and a word, however few blocks there are
for rho in 0.8 0.9 0.95; do
  for n in 1000 2000 4000; do
    awk -v rho=$rho -v n=$n 'BEGIN { srand(7); for (i = 0; i < n; ++i) {
      x = rho * x + sqrt(-2 * log(1 - rand())) * cos(6.283185307179586 * rand()); print x } }' > tied
    diagnosed 0 tied --json
    # 1 / (1 - rho) / sqrt(n) is the error; single values say sqrt((1 - rho) / (1 + rho)) times as much. Fewer than 50 effective
    # values, n (1 - rho) / (1 + rho), do not know it, and say so.
    if [ "$(echo $rho $n | awk '{ print $2 * (1 - $1) / (1 + $1) < 50 }')" = 1 ]; then
      diagnosed 0 tied
      check "$n values of a chain of $rho are too few" has 'unreliable, see verdict' out
      diagnosed 0 tied --json
    else
      awk -F '[:,]' -v rho=$rho -v n=$n '/"standard_error":/ && !seen++ { r = $2 * (1 - rho) * sqrt(n)
        exit !(r > 0.55 && r < 2) }' out && fits=1 || fits=0
      check "the error of a chain of $rho, $n values" [ $fits = 1 ]
    fi
    check "and its word" has '"code": "dependence"' out
  done
done
seq 1000 | awk 'BEGIN { srand(5) } { print rand() }' > free
diagnosed 0 free
check "none of independent values" lacks 'neighbours' out

# ---- the first row
{ echo 0; seq 1001 1100; } > zero
diagnosed 0 zero
check "a header of digits is doubted" has "^warning *row 1, '0', was taken as values.*--no-header" out
diagnosed 0 zero --header
check "and is one where it is said to be" has '^values *100$' out
check "without a doubt" lacks '^warning *row' out
diagnosed 0 zero --no-header
check "or none" has '^values *101$' out
check "nor here" lacks '^warning *row' out
refused 5 "--no-header" zero --strict
refused 2 "--header and --no-header" zero --header --no-header
printf 'NA\n1\n2\n3\n' > missing
diagnosed 5 missing
check "a missing first value is no header" has "row 1: 'NA': a missing value" out
check "and what was taken is said" has '^read as .*no header (guessed)' out

# ---- rows and columns
printf 'id,flux\n1,0,5\n' > commas
refused 5 "row 2: '1,0,5' has 3 fields, the first row has 2: 'id,flux'" commas --column flux
printf 'x,x\n1,2\n' > doubled
refused 2 "columns 1 and 2 are both named 'x'" doubled --column x
printf 'id;flux\n1;0,5\n2;1,5\n' > german
refused 5 "row 2: '0,5': a comma within a number; write --decimal ," german --column flux
diagnosed 0 german --column flux --decimal ,
check "decimal commas" has '^mean *1.00(50)' out
check "the separator is said" has "between ';' (guessed)" out
diagnosed 0 german --column flux --decimal , --separator semicolon --json
check "and is not guessed" has '"separator_guessed": false' out
refused 2 "did you mean 'semicolon'" german --separator semicolom
refused 2 "must be . or ," german --decimal x

# ---- other formats, by their first bytes
seq 1000 | gzip > numbers.gz
refused 5 'gzip' numbers.gz
refused 5 'gzip' numbers.gz --format f64
printf '\376\377\0001\0\n\0002\0\n' > utf16
refused 5 'UTF-16' utf16
printf "\223NUMPY\001\000\070\000{'descr': '<f4', 'fortran_order': False, 'shape': (2,)}\n" > floats.npy
cat floats >> floats.npy
diagnosed 0 floats.npy
check ".npy by its first bytes" has '^mean *1.25(75)' out
check "and what it is" has "^read as *.npy, type <f4, shape (2,)" out
printf "\223NUMPY\001\000\072\000{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2)}\n" > pairs.npy
cat floats >> pairs.npy
refused 2 "2 columns .*; write --column with a number from 1$" pairs.npy
refused 5 "is .npy of NumPy.*--format npy" floats.npy --format f64

# ---- files and pipes
refused 2 FILE
refused 5 "'no/such/file': No such file" no/such/file
refused 5 "'/': Is a directory" /
refused 2 "'more'" numbers more
"$debias" diagnose numbers > /dev/full 2> err
check "exit code on a full disk" same $? 5
{ sleep 0.1; "$debias" diagnose numbers 2> err; echo $? > code; } | true
check "exit code on a closed pipe" same "$(cat code)" 5

# ---- bounded memory: forty million bytes in an address space of sixty
seq 5000000 > many
memory=60000
# a sanitizer reserves terabytes of addresses: its program can't start under the limit and runs without
{ (ulimit -v "$memory" && "$debias" --version); } > /dev/null 2>&1 || memory=unlimited
(ulimit -v "$memory" && "$debias" diagnose many > out 2> err)
check "millions of rows in little memory" same $? 0
check "and all of them" has '^values *5000000$' out
head -c 100000000 /dev/zero | (ulimit -v "$memory" && "$debias" diagnose - > out 2> err)
check "a row of 100 MB in little memory" same $? 5
check "and it is named" has 'row 1: longer than' err

end_checks
