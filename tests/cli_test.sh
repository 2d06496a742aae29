#!/bin/sh
# The program as a user meets it: exit codes, what is on which stream, and that results can be trusted.
#   sh tests/cli_test.sh PROGRAM      one line for each check that failed, then their number
. "$(dirname -- "$0")/checks.sh"

# ---- wrong command lines
refused_by 2 'write list, run'
refused_by 2 'see `debias --help`' walk
refused_by 2 "did you mean 'validate'" valdate
refused_by 2 "did you mean '--version'" --versoin
refused_by 2 PROBLEM run
refused_by 2 "did you mean 'exp-of-mean'" run exp-of-maen
refused_by 2 "'A99' is not a problem" run A99
refused_by 2 "'' is not a problem" run ''
refused_by 2 "'A03'" run A01 A03
refused_by 2 "'validate'" run A01 validate
refused_by 2 "did you mean '--samples'" run A01 --sampels 10
refused_by 2 "did you mean '--samples'" run --sampels 10 A01
refused_by 2 "'-x'" run A01 -x
refused_by 2 "--json" run A01 --json=perhaps
refused_by 2 "--samples" run A01 --samples
refused_by 2 "--samples = '' (empty)" run A01 --samples ''
refused_by 2 "--samples = 'nan'" run A01 --samples nan
refused_by 2 "--samples = 'inf'" run A01 --samples inf
refused_by 2 "--samples = '-1' .*did you mean '1'" run A01 --samples -1
refused_by 2 "--samples = '0' .*did you mean '1'" run A01 --samples 0
refused_by 2 "--samples = '010' .*did you mean '10'" run A01 --samples 010
refused_by 2 "--samples = '1e6x' .*did you mean '1e6'" run A01 --samples 1e6x
refused_by 2 "--samples = '1.5'" run A01 --samples 1.5
refused_by 2 "--samples = '1,000' .*did you mean '1000'" run A01 --samples 1,000
refused_by 2 "--samples = '1e30' .*did you mean '9223372036854775807'" run A01 --samples 1e30
refused_by 2 "--samples" run A01 --samples 10 --samples 20
refused_by 2 "--seed = '-1' .*did you mean '1'" run A01 --seed -1
refused_by 2 "--seed = '18446744073709551616'" run A01 --seed 18446744073709551616
refused_by 2 "--seed = '0x10'" run A01 --seed 0x10
refused_by 2 "--seed = 'randm' .*did you mean 'random'" run A01 --seed randm
refused_by 2 "--threads = '1025' .*did you mean '1024'" run A01 --threads 1025
refused_by 2 "--threads = 'two'" run A01 --threads two
refused_by 2 "--confidence = '95' .*did you mean '0.95'" run A01 --confidence 95
refused_by 2 "--confidence = 'nan'" run A01 --confidence nan
refused_by 2 "--confidence = '1'" run A01 --confidence 1
refused_by 2 "--pmf: .*did you mean 'geometric'" run A01 --pmf geometrc:r=0.5
refused_by 2 "--pmf: .*r = 1.5" run A01 --pmf geometric:r=1.5
refused_by 2 "--pmf: .*follows the number" run A01 --pmf geometric:r=0.5x
refused_by 2 "--pmf: " run A01 --pmf ''
refused_by 2 "--pmf = 'zeta:s=2'" run A01 --estimator truncated --pmf zeta:s=2
refused_by 2 "did you mean 'single_term'" run A01 --estimator single-term
refused_by 2 "--estimator = 'roulette' (does not apply" run A01 --estimator roulette
refused_by 2 "--base-level = '-1'" run A01 --base-level -1
for estimator in single_term recipe truncated independent_sum; do
  refused_by 2 "--base-level = '99' (levels are drawn from" run A01 --estimator $estimator --base-level 99
done
refused_by 2 "--base-level = '99' (levels are drawn from 100 on" replay A01 --base-level 99 --seed 1 --sample 1
refused_by 2 "--base-level = '9223372036854775807' (levels" tradeoff A01 --base-level 9223372036854775807
refused_by 2 "no PMF has both" run E06
refused_by 2 "no PMF has finite variance and finite work (shown)" run C12 --estimator recipe
refused_by 2 "the run has printed" replay A01 --estimator recipe --seed 1 --sample 1
refused_by 2 "a sweep is for" tradeoff A01 --estimator recipe
refused_by 2 "--pmf = 'zeta:s=2' (a recipe chooses it)" run A01 --estimator recipe --pmf zeta:s=2
refused_by 2 "--block = '8' (a recipe chooses it)" run A01 --estimator recipe --block 8
# ---- names of 0.1, to be removed at 0.3
for typed in 'run A01 --law geometric:r=.5' 'run A01 --law=zeta:s=2' 'replay --law poisson:lambda=1 A01 --seed 1 --sample 1' \
  'resume file --law zeta:s=2'; do
  refused_by 2 '`--law` is `--pmf` since 0.2$' $typed
done
for typed in '--law auto' '--law=auto'; do
  refused_by 2 '`--law auto` is `--estimator recipe` since 0.2$' run A01 $typed --samples 100
done
for typed in '--pmf auto' '--pmf=auto'; do
  refused_by 2 '`--pmf auto` is `--estimator recipe` since 0.2$' run A01 $typed
done
refused_by 2 '`--pmf auto` is `--estimator recipe` since 0.2$' replay A01 --pmf auto --seed 1 --sample 1
refused_by 2 '`--time` is `--seconds` since 0.2$' run A01 --time 10s
refused_by 2 '`--time` is `--seconds` since 0.2$' resume file --time=1
refused_by 2 '`list laws` is `list pmfs` since 0.2$' list laws
refused_by 2 '`list laws` is `list pmfs` since 0.2$' list --json laws
refused_by 2 "'--laws' (no option" run A01 --laws 3
# with --json a program reads the refusal, which a typing error has not
for words in 'E06' 'C12 --estimator recipe'; do
  "$debias" run $words --json > out 2> err
  check "exit code of no PMF in JSON: $words" same $? 2
  check "one line on stderr of it: $words" same "$(lines err)" 1
  check "its kind: $words" has '"kind": "no_pmf"' out
  check "its decay: $words" has '"variance_decay": [-0-9.]*,' out
  check "its reason: $words" has '"reason": "E D_k^2 ' out
done
"$debias" run E06 --json > out 2> err
check "declared rates are exact" has '"grade": "declared"' out
"$debias" run C12 --json > out 2> err
check "what grows is not said to fall" has '"reason": "E D_k^2 grows like 2^(1 k)' out
refused_by 2 "did you mean" run E06 --pmf geometrc:r=0.5 --json
refused_by 2 "--block = '0'" run A01 --block 0
refused_by 2 "strata need a single term" run A01 --block 4 --estimator independent_sum
refused_by 2 "takes its draws from --error" run A01 --estimator multilevel
refused_by 2 "no PMF, base level or block" run A01 --estimator multilevel --error 0.1 --pmf zeta:s=2
refused_by 2 "--confidence = '0.99' (multilevel has no interval" run A01 --estimator multilevel --error 0.1 --confidence 0.99
refused_by 2 "--error = '0'" run A01 --error 0
for goal in error relative-error seconds; do
  refused_by 2 "--$goal = '1e-320' (must be positive, and" run A01 --$goal 1e-320
done
refused_by 2 "--error = ''" run A01 --error ''
refused_by 2 "--seconds = 'soon'" run A01 --seconds soon
refused_by 2 "a goal fixes the samples" run A01 --error 0.1 --samples 10
refused_by 2 "keep one" run A01 --error 0.1 --seconds 1s
refused_by 2 "64 bits); ask for a larger error" run A01 --error 1e-300
refused_by 2 "64 bits); ask for fewer seconds" run A01 --seconds 1e19
refused_by 2 "ask for fewer seconds" run A01 --estimator recipe --seconds 1e19
refused_by 2 "first = 62 (the deepest .* take a lower one" survey A01 --first 62
refused_by 2 "first = 100 (the deepest .* take a lower one" survey A01 --first 100
# an option whose value is empty: of a variable that is not set
for typed in '--estimator' '--shard' '--seed' '--confidence' '--base-level' '--points' '--threads' '--seconds'; do
  refused_by 2 "$typed.*''" run A01 $typed ''
done
refused_by 2 "--unseen = '' (empty)" validate --unseen ''
refused_by 2 "--column = '' (empty)" diagnose file --column ''
refused_by 2 "--exposure = ''" render photons --exposure '' -o x.png
refused_by 2 "--levels = '1'" survey A01 --levels 1
refused_by 2 "did you mean 'geometric'" tradeoff A01 --family geometrc
refused_by 2 "--points = '0'" tradeoff A01 --points 0
refused_by 2 "a sweep is for" tradeoff A01 --estimator truncated
refused_by 2 "--output" run A01 -o ''
refused_by 2 "--output" run A01 -o -q
refused_by 2 "a short option takes no =" run A01 -o=x
refused_by 2 "a short option takes no =" run A01 -o= x
refused_by 5 "'no/such/folder/file'" run A01 -o no/such/folder/file
refused_by 5 "'/'" run A01 -o /
refused_by 2 "'--samples'" --samples 10 run A01
refused_by 2 "--seed" replay A01 --sample 1
refused_by 2 "--sample" replay A01 --seed 1
refused_by 2 "--seed = 'random'" replay A01 --seed random --sample 1
refused_by 2 "--sample = '-1'" replay A01 --seed 1 --sample -1
refused_by 2 "'exp_of_mean'.*did you mean 'exp-of-mean'" validate A01 exp_of_mean
refused_by 2 "--samples = '1'" validate --samples 1
refused_by 2 "--samples = '1'" validate --hard --samples 1
refused_by 2 "'A01' is a problem" validate --hard A01
refused_by 2 "'A01': it is of all" validate --report A01
refused_by 2 "both" validate --report --hard
refused_by 2 "--seed = '3' (the seed of unseen problems" validate --unseen 7 --seed 3
refused_by 2 "leave it out" validate --report --checkpoint c
refused_by 2 "--confidence" validate A01 --confidence 0.9
refused_by 2 "write problems, estimators or pmfs" list everything
refused_by 2 "did you mean 'pmfs'" list PMF
refused_by 2 "'problems'" list pmfs problems
refused_by 2 "is not a problem" run 'A01
A03'

# ---- files, full disks and readers that have gone
for command in 'list' 'list --json' 'run A01 --samples 100' 'replay A01 --seed 1 --sample 1' \
  'validate A01 --samples 100' 'survey A01 --samples 100' 'tradeoff A01 --samples 100' '--help' '--version'; do
  "$debias" $command > /dev/full 2> err
  check "exit code on a full disk: $command" same $? 5
  check "one line on a full disk: $command" same "$(lines err)" 1
  { sleep 0.1; "$debias" $command 2> err; echo $? > code; } | true
  check "exit code on a closed pipe: $command" same "$(cat code)" 5
done
for command in 'run A01 --samples 100' 'validate A01 --samples 100'; do
  "$debias" $command -o /dev/full > out 2> err
  check "exit code of a full -o: $command" same $? 5
  check "no result of a full -o: $command" same "$(lines out)" 0
  "$debias" $command --json -o result > out 2> err
  check "exit code of -o: $command" same $? 0
  check "a short summary of -o: $command" [ "$(lines out)" -ge 1 -a "$(lines out)" -le 3 ]
  touch result
  check "the result of -o: $command" has '"seed": *1' result
  "$debias" $command --json -o result -q > out 2> err
  check "silence of -o -q: $command" same "$(cat out err)" ''
  "$debias" $command -q > out 2> err
  check "nothing but the result of -q: $command" same "$(lines err)" 0
  check "the result of -q: $command" has A01 out
done

# ---- signals
# A level of 2^40 draws cannot be stopped politely. The thread sanitizer holds signals back until it is over.
endless='--base-level 40 --samples 1'
if TSAN_OPTIONS=help=1 "$debias" --version 2>&1 | grep -q ThreadSanitizer; then endless='--samples 1e15'; fi
for signal in INT TERM; do
  case $signal in
    INT) "$debias" run A01 --samples 1e15 > out 2> err & ;;
    *) "$debias" run A01 $endless > out 2> err & ;;
  esac
  process=$!
  sleep 1
  kill -$signal $process 2> /dev/null
  wait $process
  check "exit code after SIG$signal" same $? 130
  check "one line after SIG$signal" same "$(lines err)" 1
  check "no result after SIG$signal" same "$(lines out)" 0
done

# ---- results
without_time() { grep -v -e '"seconds"' -e '"efficiency"'; }
"$debias" run A01 --samples 20000 --seed 5 --threads 1 --json | without_time > one
for threads in 2 3 7; do
  "$debias" run A01 --samples 20000 --seed 5 --threads $threads --json | without_time > many
  check "the same JSON on 1 and $threads threads" cmp -s one many
done
"$debias" run exp-of-mean --samples 2e4 --seed 5 --json | without_time > many
check "the same JSON by name" cmp -s one many
"$debias" run A01 --samples 20_000 --seed 6 --json | without_time > many
check "another JSON for another seed" eval '! cmp -s one many'

# value_of KEY: of a JSON text with one key per line, the first one
value_of() { sed -n "s/^ *\"$1\": \(.*[^,]\),*\$/\1/p" | head -n 1; }
for options in '' '--block 16 --pmf geometric:r=0.6' '--estimator independent_sum --pmf geometric:r=0.6' \
  '--estimator single_term_outcome --base-level 2'; do
  "$debias" run A01 $options --samples 5000 --seed 9 --json > run.json
  sed -n '/"largest"/,$p' run.json > largest
  sample=$(value_of index < largest)
  "$debias" replay A01 $options --seed 9 --sample "$sample" --json > replay.json
  check "replay equals the largest sample: $options" \
    same "$(value_of value < replay.json)" "$(value_of value < largest)"
  check "replay reaches the level of the largest sample: $options" \
    same "$(value_of level < replay.json)" "$(value_of level < largest)"
done

"$debias" run A01 --samples 100 --seed random --json > random1
"$debias" run A01 --samples 100 --seed random --json > random2
check "two random seeds differ" eval '[ "$(value_of seed < random1)" != "$(value_of seed < random2)" ]'
"$debias" run A01 --samples 100 --seed "$(value_of seed < random1)" --json | without_time > again
without_time < random1 > random
check "a random seed is printed and can be used again" cmp -s random again

"$debias" run A01 --samples 1 --json > out
check "a single sample has no error" has '"standard_error": null' out
check "a single sample says so" has '"status": "one_sample"' out
"$debias" run E06 --pmf geometric:theta=0.9 --samples 100 --json > out 2> err
check "an explicit PMF runs where none is good" same $? 0
check "and the verdict says so" has 'INFINITE' out

# ---- recipes, goals, surveys and sweeps
"$debias" run A10 --estimator recipe --samples 1e5 --seed 4 --json > run.json 2> err
check "a recipe runs" same $? 0
check "a recipe says what it chose" has '"recipe": {' run.json
for key in pmf estimator; do eval "$key=\$(value_of $key < run.json | tr -d '\"')"; done
sed -n '/"largest"/,$p' run.json > largest
"$debias" replay A10 --estimator "$estimator" --pmf "$pmf" --base-level "$(value_of base_level < run.json)" \
  --points "$(value_of points < run.json | tr -d '"')" --block "$(value_of block < run.json)" --seed 4 --sample "$(value_of index < largest)" --json > replay.json
check "the PMF of a recipe replays" same "$(value_of value < replay.json)" "$(value_of value < largest)"
"$debias" run A10 --estimator recipe --samples 1e4 --full > run.txt
largest=$(sed -n 's/^largest  *\([^ ]*\) (sample \([0-9]*\),.*/\1 \2/p' run.txt)
eval "'$debias' $(sed -n "s/^replay  *debias \(.*\) I\$/\1 ${largest#* }/p" run.txt)" > out
check "the replay that a recipe prints is a command" \
  same "$(sed -n 's/^value  *//p' out | xargs printf '%.6g')" "${largest% *}"
"$debias" run E02 --estimator recipe --error 0.01 --points nets --seed 2 --json > nets.json
check "a recipe takes the points that are asked for" has '"points": "nets"' nets.json
for key in pmf estimator block; do eval "$key=\$(value_of $key < nets.json | tr -d '\"')"; done
"$debias" run E02 --estimator "$estimator" --pmf "$pmf" --points nets --samples "$(value_of samples < nets.json)" --seed 2 \
  --json > same.json
check "its run is the run of what it names" same "$(value_of mean < same.json)" "$(value_of mean < nets.json)"
sed -n '/"largest"/,$p' nets.json > largest
"$debias" replay E02 --estimator "$estimator" --pmf "$pmf" --points nets --seed 2 --sample "$(value_of index < largest)" \
  --json > replay.json
check "a block of nets replays" same "$(value_of value < replay.json)" "$(value_of value < largest)"
"$debias" run E02 --estimator recipe --samples 1e5 --points auto > out
check "a recipe says which points it took, where it chose them" has '^points  *\(plain\|nets\): ' out
refused_by 2 "--points = 'nets' (a point has the numbers of one stream" run E02 --points nets --block 64
refused_by 2 "--points = 'nets' (there is no block" run E02 --estimator single_term_outcome --points nets
refused_by 2 "is made for blocks of 6" run E02 --estimator single_term_outcome --pmf 'dyadic:2,0;theta=1.25' --points nets \
  --block 8
"$debias" run A01 --samples 1000 --confidence 0.9 > out
check "another confidence has a line of its own" has '^interval  *90 % \[' out
"$debias" run B01 --estimator ratio_tracking --samples 1000 > out
check "an estimator of one problem says what it is" has '^declared  *one term of the power series about a majorant' out
"$debias" run A01 --error 0.001 --json > out
check "a goal is met" same $? 0
check "a goal says so" has '"met": true' out
"$debias" run E02 --estimator multilevel --error 0.1 > out
check "multilevel states its bias" has '^bias' out
"$debias" run A01 --seconds 1e-9 > out 2> err
check "exit code of a missed goal" same $? 3
check "a missed goal prints its result" has 'NOT met' out
check "one line on a missed goal" same "$(lines err)" 1
"$debias" survey A10 --levels 6 --samples 1000 > out
check "a survey ends in an answer" has 'exists: yes' out
check "a brief survey has no kurtosis" lacks kurtosis out
"$debias" survey A01 --samples 1000 --full > out 2> err
check "a full survey has" has kurtosis out
"$debias" run A10 --samples 20000 > brief 2> err
"$debias" run A10 --samples 20000 --full > out 2> err
check "a brief run is brief" [ "$(lines brief)" -le 8 ]
check "with one line of verdict" same "$(grep -c '^verdict' brief)" 1
for word in efficiency coupling 'upper tail' largest 'E D^2' '^pmf  ' '^replay  '; do
  check "a full run has $word" has "$word" out
  check "a brief one has not: $word" lacks "$word" brief
done
"$debias" run A10 --samples 1 --json > out 2> err
check "warnings have codes" has '"code": "one_sample"' out
refused_by 2 "'--full'" list --full
"$debias" run A08 --seed 1 --estimator recipe --samples 2e4 --full > out
check "a doubt of a pilot ends in a full stop" has '^warning  *some levels may have no second moment\.$' out
check "and is said once" same "$(grep -c 'some levels may have no second moment' out)" 1
"$debias" run A03 --block 64 --samples 64 > out
check "a number and its noun agree" has '^samples  *64 in 1 block of 64,' out
"$debias" tradeoff A10 --points 5 --samples 1000 > out 2> err
check "a sweep has its best and its bound" eval 'grep -q "best of the family" out && grep -q "^bound" out'
"$debias" tradeoff A10 --points 5 --samples 1000 --csv > out
check "a sweep as CSV" same "$(lines out)" 6
"$debias" survey A10 --levels 20 --samples 1e5 > out 2> err &
process=$!
sleep 2
kill -INT $process 2> /dev/null
wait $process
check "exit code of an interrupted survey" same $? 130
check "an interrupted survey prints what it has" has 'interrupted: [0-9]* of 20 levels' out

"$debias" validate A01 A03 --samples 2e4 > out 2> err
check "validation passes" same $? 0
check "nothing on stderr of validate" same "$(lines err)" 0
check "a summary of validate" has '^[0-9]* cells: [0-9]* passed, 0 failed' out
"$debias" validate A01 E06 --samples 2e4 --json > cells.jsonl
check "a refused cell says why" has '"status":"refused","reason":"..*"' cells.jsonl
check "the summary is the last line" eval 'tail -n 1 cells.jsonl | grep -q "\"max_abs_z\""'

"$debias" validate --report --samples 500 -o report.md 2> err  # too few to see all wrong estimators
check "a report with a figure that fails" same $? 4
check "names it on stderr" has "^debias: figures that fail: .*wrong on purpose" err
check "the page says so" has "FAILS" report.md
check "the page knows its command" has "command: debias validate --report --samples 500 --seed 1" report.md
"$debias" validate --hard --samples 1e4 > out 2> err
check "hard cases say what is wrong with them" same $? 0
check "and are counted" has '^[0-9]* cases, 0 wrong without a word' out
"$debias" validate --hard --samples 1e4 --json > hard.jsonl
check "a hard case in JSON" has '"status":"said"' hard.jsonl

for topic in problems estimators pmfs; do
  "$debias" list $topic > out 2> err
  check "list $topic" [ "$(lines out)" -ge 4 -a "$(lines err)" -eq 0 ]
done
check "--version names the stream layout" eval '"$debias" --version | grep -q "stream layout [0-9]"'
for command in '' list run replay validate survey tradeoff; do
  check "debias $command --help" eval '"$debias" $command --help > out 2> err && [ "$(lines out)" -ge 5 ]'
done

if command -v python3 > /dev/null && python3 -c '' 2> /dev/null; then
  strict='import json, sys
def refuse(word): raise ValueError(word)
for text in sys.stdin if sys.argv[1] == "lines" else [sys.stdin.read()]:
  json.loads(text, parse_constant=refuse)'
  for command in 'list' 'list estimators' 'list pmfs' 'run A01 --samples 1000' 'run A01 --samples 1' \
    'run M02 --estimator truncated --samples 10' 'replay A01 --seed 1 --sample 3' 'survey B01 --samples 100' \
    'survey A01 --samples 100' 'run A01 --estimator recipe --samples 1e4' 'run E02 --estimator multilevel --error 0.5' 'tradeoff A01 --samples 100' \
    'tradeoff E06 --samples 100' 'tradeoff D03 --family zeta --samples 100'; do
    "$debias" $command --json > out
    check "valid JSON: $command" python3 -c "$strict" whole < out 2> err
  done
  check "valid JSON lines: validate" python3 -c "$strict" lines < cells.jsonl 2> err
  check "valid JSON: validate --report" python3 -c "$strict" whole < report.json 2> err
  check "valid JSON lines: validate --hard" python3 -c "$strict" lines < hard.jsonl 2> err
fi

end_checks
