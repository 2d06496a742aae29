#!/bin/sh
# sh tests/plot_test.sh PROGRAM: --plot writes whole pictures, or says why not.
program=$1
. "$(dirname -- "$0")/checks.sh"
command -v python3 > /dev/null || { echo "plot_test.sh: no Python; skipped"; exit 77; }

# Well-formed, with these texts, and no number that is none. Prints what is wrong.
cat > look.py << 'END'
import re, sys, xml.etree.ElementTree as tree
try:
    root = tree.parse(sys.argv[1]).getroot()
except (tree.ParseError, OSError) as e:
    sys.exit(f"{sys.argv[1]}: {e}")
texts = ["".join(t.itertext()) for t in root.iter("{http://www.w3.org/2000/svg}text")]
for label in sys.argv[2:]:
    if not any(label in text for text in texts):
        sys.exit(f"{sys.argv[1]}: no {label!r}")
for node in root.iter():
    for name, value in node.attrib.items():
        if re.search(r"\b(nan|inf)\b", value):
            sys.exit(f"{sys.argv[1]}: {name}={value!r}")
END
look() { python3 look.py "$@"; }
fails() { ! "$@" 2> /dev/null; }
bare() { cut -d , -f 1-6 "$1"; }  # without the efficiency, which a clock measures

for name in A10 C03 E06; do  # geometric rates; differences that are no numbers at some level; no PMF with a finite variance
  "$debias" tradeoff $name --points 5 --samples 1000 --plot $name.svg > out 2> err
  check "tradeoff $name" look $name.svg "$name" "exponent rho" "variance x work" "predicted from the levels"
done
check "tradeoff says where the variance is infinite" look A10.svg "variance infinite" "measured" "best of the family"
check "tradeoff says where the work is infinite" look A10.svg "work infinite"
"$debias" tradeoff A10 --points 3 --samples 1000 --family poisson --plot poisson.svg > out 2> err
check "a PMF that has no exponent" look poisson.svg "exponent rho"
"$debias" tradeoff A10 --points 3 --samples 1000 --csv --plot again.svg > with.csv
"$debias" tradeoff A10 --points 3 --samples 1000 --csv > without.csv
check "a picture changes nothing of the result" same "$(bare with.csv)" "$(bare without.csv)"
for name in A01 D03; do  # exact zeros and a power law
  "$debias" survey $name --samples 500 --plot $name.svg > out 2> err
  check "survey $name" look $name.svg "level k" "E D_k^2" "kurtosis" "standard errors" "work"
done
"$debias" run A10 --samples 20000 --plot run.svg > out 2> err
check "run" look run.svg "samples" "exact value" "95 % interval" "slope -1/2"
"$debias" run A10 --samples 20000 --json --plot again.svg > with.json
"$debias" run A10 --samples 20000 --json > without.json
check "run says the same with a picture" same "$(grep -E '"(mean|standard_error|work)"' with.json)" \
  "$(grep -E '"(mean|standard_error|work)"' without.json)"
"$debias" run A10 --estimator recipe --error 0.01 --plot goal.svg > out 2> err
check "run to a goal" look goal.svg "samples" "exact value"
"$debias" run A10 --samples 3 --plot few.svg > out 2> err
check "run of three samples" look few.svg "samples"

refused_by 2 "--plot picture.svg" run A10 --samples 100 --plot picture.png
refused_by 2 "one file for two things" run A10 --samples 100 --plot a.svg -o a.svg
refused_by 2 "one file for two things" survey A10 --samples 100 --plot a.svg -o ./a.svg
refused_by 2 "one file for two things" tradeoff A10 --samples 100 --plot a.svg --checkpoint a.svg
refused_by 2 "multilevel has no samples" run A10 --estimator multilevel --error 0.1 --plot a.svg
for command in 'run A10 --samples 1e12' 'survey A10 --samples 1e12' 'tradeoff A10 --samples 1e12'; do  # before the run
  refused_by 5 "--plot 'nowhere/a.svg': No such file" $command --plot nowhere/a.svg
done
if [ -w /dev/full ]; then
  ln -s /dev/full full.svg
  refused_by 5 "--plot 'full.svg': No space left" run A10 --samples 100 --plot full.svg
fi

# The test itself: what it must not let pass.
head -c 2000 run.svg > cut.svg
check "a cut picture is seen" fails look cut.svg
check "a missing label is seen" fails look run.svg "no such label"
sed 's/x1="[0-9.]*"/x1="nan"/' run.svg > nan.svg
check "a NaN is seen" fails look nan.svg
end_checks
