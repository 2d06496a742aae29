#!/bin/sh
# Hostile files, full disks, closed streams and signals, for every command that reads or writes: a message, the right
# exit code, an end, and no piece of a result that could pass for a whole one.
#   sh tests/bad_input_test.sh PROGRAM      one line for each check that failed, then their number
. "$(dirname -- "$0")/checks.sh"

# ended CODE WORD COMMAND...: within 10 seconds, with that exit code and a line with WORD on standard error
ended() {
  code=$1
  word=$2
  shift 2
  timeout 10 "$debias" "$@" > out 2> err < /dev/null
  check "exit code of: debias $*" same $? "$code"
  check "message of: debias $*" has "^debias: .*$word" err
}
without_time() { grep -v -e '"seconds"' -e '"efficiency"' "$1"; }
same_result() { without_time "$1" > left; without_time "$2" > right; cmp left right; }

# ---- samples that a run has not
for shard in 3/2 0/2 1/0 1/2000000; do
  ended 2 "--shard = '$shard' (must be one of" run A10 --samples 20000 --shard $shard --checkpoint no-shard
done
check "nothing is kept of them" [ ! -e no-shard ]
for command in run tradeoff; do
  ended 2 'only 20000); take a smaller one' $command A10 --samples 20000 --block 1099511627776
done

# ---- names that are none: of a variable that is not set, and the option that comes behind
for name in --checkpoint --plot -o; do ended 2 'no file name' run A10 --samples 2000 $name ''; done
for name in --checkpoint --plot; do ended 2 'no file name' run A10 --samples 2000 $name= --json; done
check "no file has the name of an option" [ ! -e ./--json ]

# ---- files that are none
mkdir folder
ln -s loop loop
ln -s nowhere dangling
mkfifo pipe
seq 100 > numbers
truncate -s 1T sparse
head -c 4 /dev/zero > short
printf 'DEBIASCP' > magic
"$debias" run A03 --samples 1e4 --checkpoint whole --json > whole.json
cp whole grown
truncate -s 1T grown
for reader in 'resume FILE' 'merge FILE' 'merge whole FILE' 'diagnose FILE' 'diagnose --format f64 FILE' \
  'render transmittance --volume FILE --dims 1x1x1 -o image.pfm'; do
  for file in nothing folder loop dangling folder/nothing short/nothing "$(printf '%300s' | tr ' ' x)"; do
    # shellcheck disable=SC2046
    ended 5 "$file" $(echo "$reader" | sed "s|FILE|$file|")
  done
done
for reader in resume merge; do
  for file in /dev/null short magic /dev/zero pipe sparse; do ended 5 "$file" $reader "$file"; done
done
ended 5 pipe render transmittance --volume pipe --dims 1x1x1 -o image.pfm
ended 5 /dev/zero render transmittance --volume /dev/zero --dims 1x1x1 -o image.pfm
ended 2 sparse render transmittance --volume sparse --dims 1x1x1 -o image.pfm
# a sanitizer has no addresses left, and dies of an allocation that is too large
if { (ulimit -v 100000 && "$debias" --version); } > /dev/null 2>&1; then
  ended 1 'out of memory' render transmittance --volume sparse --dims 8192x8192x4096 -o image.pfm
fi
check "nothing is written of them" [ ! -s image.pfm ]
ended 0 'no whole record' resume grown --json
check "a tail of a terabyte is left out" same_result out whole.json
for writer in 'run A01 --samples 100 -o' 'validate A01 --samples 100 -o' 'survey A01 --samples 100 -o' \
  'tradeoff A01 --samples 100 -o' 'diagnose numbers -o' 'resume whole -o' 'merge whole -o' \
  'run A01 --samples 100 --checkpoint' 'merge whole --checkpoint'; do
  for file in folder loop folder/no/file short/file; do ended 5 "$file" $writer "$file"; done
done
for writer in 'run A01 --samples 100 --checkpoint' 'merge whole --checkpoint'; do ended 5 pipe $writer pipe; done
for writer in 'render transmittance --size 8x8 --spp 1' 'render photons --size 8x8 --photons 100'; do
  for file in folder.pfm/a.pfm short/a.pfm a/b.png; do ended 5 "$file" $writer -o "$file"; done
done
for scene in transmittance photons; do ended 5 short render $scene --size 8x8 --compare -o short; done
ended 2 'one file' run A01 --samples 100 --checkpoint both -o both
ended 2 'one file' run A01 --samples 100 --checkpoint ./both -o both
ended 2 'one file' run A01 --samples 100 --plot both.svg -o folder/../both.svg
ended 2 'one file' survey A01 --samples 100 --plot both.svg -o ./both.svg
ended 2 'one file' resume whole -o whole
ended 2 'one file' resume whole -o ./whole
ended 2 'one file' merge whole -o whole
ended 2 'one file' diagnose numbers -o numbers
check "the input is as it was" eval '"$debias" resume whole --json > out && same_result out whole.json'

# ---- files that vanish while they are written, to be looked at below
mkdir vanished
"$debias" run E02 --samples 1e12 --checkpoint gone > gone.out 2> gone.err &
gone=$!
"$debias" run E02 --samples 1e12 --checkpoint vanished/gone > vanished.out 2> vanished.err &
vanished=$!
sleep 0.5
rm -r gone vanished

# ---- the other byte order
printf '\077\340\0\0\0\0\0\0\100\0\0\0\0\0\0\0\077\360\0\0\0\0\0\0' > swapped  # 0.5, 2, 1
"$debias" diagnose --format f64 swapped > out
check "doubles of the other byte order are suspected" has 'byte order' out
printf '\077\200\0\0' > swapped  # 1
ended 2 'byte order' render transmittance --volume swapped --dims 1x1x1 -o image.pfm

# ---- a disk that is full after 512 or 4096 bytes
small_disk() {
  blocks=$1
  shift
  # the counters of a coverage build would be cut as well: they go elsewhere
  (export GCOV_PREFIX="$here/counters"; ulimit -f "$blocks"; timeout 10 "$debias" "$@" > /dev/null 2> err < /dev/null)
}
for command in 'run A01 --samples 100 --json' 'survey A01 --samples 100' 'tradeoff A10 --samples 100 --csv' \
  'diagnose numbers --json' 'merge whole --json' \
  'render transmittance --size 16x16 --spp 1' 'render photons --size 16x16 --photons 100'; do
  case $command in
    render*) file=disk.pfm ;;
    *) file=disk ;;
  esac
  echo before > $file
  small_disk 1 $command -o $file
  check "exit code on a disk of 512 bytes: $command" same $? 5
  check "the reason: $command" has '^debias: .*File too large' err
  check "no piece of a result: $command" same "$(wc -c < $file)" 0
done
small_disk 1 run A01 --samples 100 --json -o new
check "a new file that the disk does not hold is not there" [ ! -e new ]
small_disk 1 validate A01 --samples 100 -o rows
check "exit code of rows on a small disk" same $? 5
check "rows are whole or not there" same "$(tail -c 1 rows | wc -l)" "$([ -s rows ] && echo 1 || echo 0)"
small_disk 8 run E02 --samples 1e12 --checkpoint part
check "exit code of a checkpoint on a small disk" same $? 5
check "and the reason" has '^debias: --checkpoint.*File too large' err
"$debias" run E02 --samples 1e5 --checkpoint kept --json > kept.json
size=$(wc -c < kept)
small_disk 8 resume kept --samples 1e12
check "exit code of a resumed run on a small disk" same $? 5
check "the file is the one before" same "$(wc -c < kept)" "$size"
"$debias" resume kept --json > out
check "and still good" same_result out kept.json

# ---- files that vanish, from above
kill -INT $gone $vanished 2> /dev/null
wait $gone
check "a checkpoint that is deleted while it is written comes back" [ $? -eq 130 -a -s gone ]
wait $vanished
check "without its folder it can not" same $? 5
check "and that is said" has 'vanished.*No such file' vanished.err

# ---- streams that are closed
"$debias" run A01 --samples 100 --json -q > expected
for command in list 'run A01 --samples 100' 'replay A01 --seed 1 --sample 1' 'validate A01 --samples 100' \
  'survey A01 --samples 100' 'tradeoff A01 --samples 100' 'diagnose numbers' 'resume whole' 'merge whole' \
  'render transmittance --size 8x8 --spp 1 -o image.pfm' --help; do
  "$debias" $command >&- 2> err
  check "exit code without standard output: $command" same $? 5
  check "and the reason: $command" has '^debias: standard output: ' err
done
rm -f result
"$debias" run A01 --samples 100 --json -o result >&- 2>&- <&-
check "exit code without any stream" same $? 5
check "the file has the result and nothing else" same_result result expected
"$debias" run A01 --samples 100 --json -q -o result >&- 2>&- <&-
check "exit code of a quiet run without any stream" same $? 0
check "the file has the result" same_result result expected
rm -f silent
"$debias" run A03 --samples 1e4 --checkpoint silent --json > out 2>&-
check "a result without standard error" same_result out whole.json
cp silent before
"$debias" run A03 --samples 1e4 --checkpoint silent > out 2>&-
check "exit code without standard error" same $? 5
check "the checkpoint has no message in it" cmp silent before
ended_on_stdin() { "$debias" diagnose - > out 2> err <&-; check "exit code without standard input" same $? 5; }
ended_on_stdin
check "and the reason" has '^debias: standard input: ' err
{ timeout 10 "$debias" validate 2> err; echo $? > code; } | head -1 > out
check "validate ends with its reader" same "$(cat code)" 5

# ---- a pipe to write into
mkfifo into
cat into > read &
timeout 10 "$debias" run A01 --samples 100 --json -q -o into
check "a result goes into a pipe" same $? 0
wait $!
check "and is whole" same_result read expected

# ---- killed: nothing of it is left
"$debias" run A01 --samples 1e15 -o killed.result --plot killed.svg > /dev/null 2>&1 &
killed=$!
sleep 0.5
kill -KILL $killed
wait $killed 2> /dev/null
for file in killed.result killed.svg; do check "no file $file of a run that was killed" [ ! -e $file ]; done

# ---- signals: exit code 130 within seconds, and what is finished is kept
start() {
  name=$1
  shift
  "$debias" "$@" > "$name.out" 2> "$name.err" &
  processes="$processes $name:$!"
}
processes=
start run run A01 --samples 1e15 -o run.result --plot run.svg
echo before > older
cp older older.svg
ln -s nowhere.result link
start older run A01 --samples 1e15 -o older --plot older.svg
start link run A01 --samples 1e15 -o link
start goal run A01 --error 1e-12
start recipe run A10 --estimator recipe --samples 1e15
start multilevel run E02 --estimator multilevel --error 1e-6
start resume resume whole --samples 1e15
start validate validate --samples 1e4
start hard validate --hard --samples 1e7
start survey survey A10 --levels 20 --samples 1e5
start tradeoff tradeoff A10 --samples 100 --points 10000 --csv --checkpoint points
start picture render transmittance --spp 1e8 --size 128x128 -o picture.png
start photons render photons --photons 1e12 --size 128x128 -o photons.png
"$debias" diagnose - > diagnose.out 2> diagnose.err < pipe &
processes="$processes diagnose:$!"
exec 3> pipe
sleep 1
tries=0  # until something is finished
while [ $tries -lt 100 ] && ! { grep -q '^pass' validate.out && [ "$(wc -c < points)" -gt 1000 ]; } 2> /dev/null; do
  sleep 0.1
  tries=$((tries + 1))
done
signal=INT
for p in $processes; do
  kill -$signal "${p#*:}"
  case $signal in INT) signal=TERM ;; *) signal=INT ;; esac
done
since=$(date +%s)
for p in $processes; do
  wait "${p#*:}"
  check "exit code of ${p%:*} after a signal" same $? 130
  check "a word of ${p%:*} after a signal" has '^debias: .*interrupted' "${p%:*}.err"
done
exec 3>&-
check "a signal ends them in seconds" [ $(($(date +%s) - since)) -le 10 ]
for name in run goal recipe multilevel resume diagnose; do check "no result of $name" [ ! -s $name.out ]; done
for file in run.result run.svg nowhere.result; do check "no file $file of a run that ended early" [ ! -e $file ]; done
check "a link is still one" [ -L link ]
for file in older older.svg; do check "$file is as it was" same "$(cat $file)" before; done
check "validate keeps its finished rows" has '^pass' validate.out
check "and whole ones" same "$(tail -c 1 validate.out | wc -l)" 1
check "and no summary" lacks ' cells: ' validate.out
check "survey keeps its finished levels" has 'interrupted' survey.out
check "tradeoff keeps its finished points" [ "$(lines tradeoff.out)" -ge 2 ]
for name in picture photons; do check "an image of $name" has PNG $name.png; done

end_checks
