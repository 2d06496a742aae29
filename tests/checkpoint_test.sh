#!/bin/sh
# Checkpoints: the bits of an uninterrupted run after a kill, a torn tail, in shards and with more samples; and what is
# refused.
#   sh tests/checkpoint_test.sh PROGRAM
. "$(dirname -- "$0")/checks.sh"

# The result without its times.
answer() { "$debias" "$@" --json 2>/dev/null | sed -E '/"(seconds|pilot_seconds|efficiency)":/d' > answer.json; cat answer.json; }

whole=$(answer run A03 --samples 2e5)
check "a run says the same with a checkpoint" same "$(answer run A03 --samples 2e5 --checkpoint a)" "$whole"
check "a finished run is said again" same "$(answer resume a)" "$whole"
check "a finished run grows" same "$(answer resume a --samples 300001 --threads 1)" "$(answer run A03 --samples 300001)"
check "and grows again" same "$(answer resume a --samples 4e5)" "$(answer run A03 --samples 4e5)"
check "a stratified run grows from within a chunk" same \
  "$(answer run E02 --block 64 --samples 64064 --checkpoint b >/dev/null; answer resume b --samples 192000)" \
  "$(answer run E02 --block 64 --samples 192000)"
check "samples of a stratified run are rounded up to whole blocks, again when it goes on" same \
  "$(answer run E02 --block 64 --samples 1000 --checkpoint w >/dev/null; answer resume w --samples 1000 | grep -E '"(samples|blocks|block)":')" \
  '  "block": 64,
  "samples": 1024,
  "blocks": 16,'
check "and none is thrown away" refused_by 2 "holds 1024 samples" resume w --samples 960
# It writes what it was first asked for, where it was first asked to.
answer run A03 --samples 2e4 > said.json
"$debias" run A03 --samples 2e4 --json -o kept.json --checkpoint j -q
rm kept.json
"$debias" resume j > out 2>&1
check "a resumed run writes its file again, in the form that was asked for" same \
  "$(sed -E '/"(seconds|pilot_seconds|efficiency)":/d' kept.json)" "$(cat said.json)"
check "and a line on what it is" same "$(lines out)" 1
"$debias" resume j -o other --full -q
check "into another file, in another form, where it is asked to" has '^replay  ' other
"$debias" run A03 --samples 2e4 --full --checkpoint f > full.txt
"$debias" resume f > out
check "a full text is resumed as one" same "$(grep -v '^seconds\|^efficiency' out)" "$(grep -v '^seconds\|^efficiency' full.txt)"
"$debias" run A03 --samples 2e4 --plot kept.svg --checkpoint pl > /dev/null
rm kept.svg
"$debias" resume pl > /dev/null
check "and a picture is drawn again" has '</svg>' kept.svg
check "a run with a goal says the same" same "$(answer run A03 --error 2e-3 --checkpoint g)" "$(answer run A03 --error 2e-3)"
check "and again" same "$(answer resume g)" "$(answer run A03 --error 2e-3)"
# A goal asked for twice took two pilots.
without_work() { sed -E '/^  "(work|pilot_work)":/d'; }
check "a tighter goal is the run of that goal" same "$(answer resume g --error 1e-3 | without_work)" \
  "$(answer run A03 --error 1e-3 | without_work)"

answer run A03 --samples 2000 --base-level 12 --checkpoint gp > /dev/null
held=$(answer resume gp)
"$debias" resume gp --error 1e-6 > /dev/null 2>err &
pid=$!
sleep 0.3
kill -TERM $pid
wait $pid
check "a goal tightened is stopped in its pilot" same $? 130
check "and has to be asked for again" has "the new goal again" err
check "what was there is there" same "$(answer resume gp)" "$held"

# ---- killed
long=$(answer run E02 --samples 3000000)
"$debias" run E02 --samples 3000000 --checkpoint k --threads 1 >/dev/null 2>&1 &
pid=$!
tries=0
while [ $tries -lt 50 ] && ! { [ -f k ] && [ "$(wc -c < k)" -gt 20000 ]; }; do sleep 0.1; tries=$((tries + 1)); done
kill -9 $pid 2>/dev/null
wait $pid 2>/dev/null
check "a killed run goes on" same "$(answer resume k --threads 2)" "$long"

"$debias" run E02 --samples 1e9 --checkpoint s >/dev/null 2>err &
pid=$!
sleep 0.5
kill -TERM $pid
wait $pid
check "SIGTERM exits 130" same $? 130
check "and says how to go on" has "debias resume s" err
check "what was finished is on disk" [ "$(wc -c < s)" -gt 20000 ]

# ---- torn and broken files
small=$(answer run A03 --samples 1e3)
answer run A03 --samples 1e3 --checkpoint t > /dev/null
size=$(wc -c < t)
header=$(grep -abo RECD t | head -1 | cut -d: -f1)
cut=$header
while [ "$cut" -lt "$size" ]; do
  head -c "$cut" t > torn
  check "torn at byte $cut" same "$(answer resume torn)" "$small"
  cut=$((cut + 1 + (size - header) / 5))
done
head -c $((size - 1)) t > torn
"$debias" resume torn > /dev/null 2> err
check "a torn tail is named" has "no whole record" err
{ cat t; echo rest; } > torn
check "rubbish behind the last record" same "$(answer resume torn)" "$small"
cut=0
while [ "$cut" -lt "$header" ]; do
  head -c "$cut" t > torn
  check "cut within the header at byte $cut" refused_by 5 "no checkpoint" resume torn
  cut=$((cut + 61))
done
: > empty
check "an empty file" refused_by 5 "no checkpoint" resume empty
check "another kind of file" refused_by 5 "no checkpoint" resume "$debias"
{ head -c 12 t; printf '\001\002\003\004'; tail -c +17 t; } > swapped
check "the other byte order" refused_by 5 "byte order" resume swapped
check "no file" refused_by 5 "No such file" resume nothing
check "a folder" refused_by 5 "directory" resume .
check "a folder to write" refused_by 5 "directory" run A03 --checkpoint .
check "a folder that is not there" refused_by 5 "No such file" run A03 --checkpoint no/file
check "a device" refused_by 5 "checkpoint" run A03 --checkpoint /dev/full
check "a run is not overwritten" refused_by 5 "debias resume t" run A03 --samples 1e3 --checkpoint t
check "nor is another one" refused_by 5 "choose another name" run A03 --samples 1e3 --seed 2 --checkpoint t
check "nor is one with a goal" refused_by 5 "debias resume g" run A03 --error 2e-3 --checkpoint g
check "nor is a file of another kind" refused_by 5 "no checkpoint" run A03 --checkpoint empty
check "samples are not thrown away" refused_by 2 "ask for more" resume t --samples 500
check "two wishes" refused_by 2 "leave one out" resume t --samples 5000 --error 1

# ---- a pilot chooses the PMF: the file is that of the very run, once it has begun
without_recipe() { sed -E '/^  "recipe": \{/,/^  \}/d; /^  "recipe": null/d'; }
word() { grep -a "^$1=" "$2" | cut -d= -f2-; }
chosen() {
  shape="--estimator $(word estimator "$1") --pmf $(word pmf "$1") --base-level $(word base_level "$1") --block $(word block "$1") --points $(word points "$1")"
}
recipe=$(answer run A03 --estimator recipe --samples 2e5)
check "a recipe says the same with a checkpoint" same "$(answer run A03 --estimator recipe --samples 2e5 --checkpoint r)" "$recipe"
check "it is said again, but for its pilot" same "$(answer resume r | without_recipe)" "$(echo "$recipe" | without_recipe)"
chosen r
# Of a run without a pilot the sums are the same; its interval knows less of the levels.
sums() { grep -E '^  "(mean|standard_error|samples|blocks)":|^ *"(count|second_moment)":'; }
check "it grows under its PMF" same "$(answer resume r --samples 3e5 | sums)" "$(answer run A03 $shape --samples 3e5 | sums)"
check "and its pilot still counts" same "$(answer resume r | grep '^  "pilot_work"')" "$(echo "$recipe" | grep '^  "pilot_work"')"
answer run E02 --estimator recipe --error 0.1 --checkpoint rg > /dev/null
chosen rg
check "a recipe with a goal is tightened" same "$(answer resume rg --error 0.01 | sums)" \
  "$(answer run E02 $shape --error 0.01 | sums)"
for i in 1 2; do answer run A03 --estimator recipe --samples 2e5 --shard $i/2 --checkpoint r$i > /dev/null; done
check "a recipe in shards" same "$(answer merge r2 r1 | without_recipe | without_work)" \
  "$(echo "$recipe" | without_recipe | without_work)"
for doubt in "A08 1 no_second_moment" "I05 1 declared_rates"; do # of the pilot, which is not made again
  set -- $doubt
  recipe=$(answer run $1 --seed $2 --estimator recipe --samples 2e4 --checkpoint d$1)
  check "and is resumed with its doubt" same "$(answer resume d$1 | without_recipe)" "$(echo "$recipe" | without_recipe)"
  check "which stands in its JSON" has "\"$3\"" answer.json
  "$debias" resume d$1 --full > out 2> err
  check "and in its text" has "^warning .*\.$" out
  for i in 1 2; do answer run $1 --seed $2 --estimator recipe --samples 2e4 --shard $i/2 --checkpoint d$1$i > /dev/null; done
  check "its shards have it, too" same "$(answer merge d${1}1 d${1}2 | without_recipe | without_work)" \
    "$(echo "$recipe" | without_recipe | without_work)"
done
recipe=$(answer run E02 --estimator recipe --samples 2e7)
"$debias" run E02 --estimator recipe --samples 2e7 --checkpoint rk --threads 1 >/dev/null 2>&1 &
pid=$!
tries=0
while [ $tries -lt 100 ] && ! grep -aq "^pmf=tabulated" rk 2>/dev/null; do sleep 0.02; tries=$((tries + 1)); done
kill -9 $pid 2>/dev/null
wait $pid 2>/dev/null
check "a recipe killed in its run goes on" same "$(answer resume rk --threads 2 | without_recipe)" "$(echo "$recipe" | without_recipe)"

# ---- shards
for samples in 1000 4096 4097 50000 200000; do
  expected=$(answer run A03 --samples $samples)
  for n in 1 2 5; do
    case $samples/$n in 1000/5 | 4*/1 | ?0000*/1) continue ;; esac
    files=
    i=1
    while [ $i -le $n ]; do
      rm -f part$i
      answer run A03 --samples $samples --shard $i/$n --checkpoint part$i > /dev/null
      files="part$i $files"
      i=$((i + 1))
    done
    check "$n shards of $samples" same "$(answer merge $files)" "$expected"
  done
done
check "in another order" same "$(answer merge part3 part1 part5 part2 part4 --checkpoint union)" "$expected"
check "a union is not put over a run" refused_by 5 "choose another name" merge part3 part1 part5 part2 part4 --checkpoint t
echo precious > notes
check "nor over anything else" refused_by 5 "no checkpoint" merge part3 part1 part5 part2 part4 --checkpoint notes
check "which stays" same "$(cat notes)" precious
check "the union is a run like any other" same "$(answer resume union --samples 3e5)" "$(answer run A03 --samples 3e5)"
check "a shard that is missing" refused_by 5 "are missing: shard 3/5;" merge part1 part2 part4 part5
check "shards that are missing" refused_by 5 "are missing: shard 2/5, shard 3/5, shard 5/5;" merge part4 part1
check "a shard twice" refused_by 5 "'part1': given twice" merge part1 part1
check "a shard twice, among others" refused_by 5 "'part2': given twice, so that both results hold sample" merge part1 part2 part3 part2
cp part2 copy2
check "a copy of a shard" refused_by 5 "'copy2': holds samples of 'part2'" merge part1 part2 copy2 part3 part4 part5
"$debias" run E02 --samples 1e9 --shard 1/2 --checkpoint half1 > /dev/null 2>&1 &
pid=$!
sleep 0.5
kill -TERM $pid
wait $pid
check "a shard that is not finished" refused_by 5 "are missing: unfinished 'half1', shard 2/2;" merge half1
check "another run" refused_by 5 "of another run" merge part1 t
check "a shard does not grow" refused_by 2 "merge the shards" resume part1 --samples 2e6
check "too many shards" refused_by 2 "only 2 chunks" run A03 --samples 1e3 --shard 5/5 --checkpoint p

# ---- the other commands
bare() { sed -E 's/"(seconds|pilot_seconds|efficiency)": ?[^,}]*//g' "$1"; }
# A command without a checkpoint, and the same one with one, interrupted after 0.4 s (if it runs so long) and resumed.
interrupted_twin() {
  name=$1
  shift
  "$debias" "$@" --json -q > "$name.whole" 2>/dev/null
  [ ! -f "$name.pfm" ] || mv "$name.pfm" "$name.whole.pfm"
  "$debias" "$@" --checkpoint "$name" --json -q > /dev/null 2>&1 &
  pid=$!
  sleep 0.4
  kill -TERM $pid 2>/dev/null
  wait $pid
  "$debias" resume "$name" --threads 1 --json -q > "$name.resumed" 2>/dev/null
}
interrupted_twin v validate A01 B02 --samples 6e5
check "validate goes on" same "$(bare v.resumed)" "$(bare v.whole)"
check "with all its cells" same "$(lines v.resumed)" "$(lines v.whole)"
interrupted_twin m run E02 --estimator multilevel --error 0.01
check "multilevel goes on" same "$(bare m.resumed)" "$(bare m.whole)"
check "its levels are not merged" refused_by 5 "multilevel" merge m m
check "and do not grow" refused_by 2 "only a run" resume m --error 0.001
check "nor have they shards" refused_by 2 "multilevel decides" run E02 --estimator multilevel --error 1 --shard 1/2 --checkpoint p
interrupted_twin sweep tradeoff A10 --samples 4e5 --points 5
check "tradeoff goes on" same "$(bare sweep.resumed)" "$(bare sweep.whole)"
interrupted_twin c render transmittance --size 64x64 --spp 400 -o c.pfm
check "an image of a cloud goes on" cmp c.pfm c.whole.pfm
interrupted_twin l render photons --size 64x64 --photons 1e6 -o l.pfm
check "an image of photons goes on" cmp l.pfm l.whole.pfm
for byte in '\077' '\100'; do  # 64 times 1, and 64 times 4, as floats
  for i in 1 2 3 4; do for j in 1 2 3 4; do for k in 1 2 3 4; do printf "\\000\\000\\200$byte"; done; done; done > volume$byte
done
mv 'volume\077' volume.raw
"$debias" render transmittance --size 8x8 --spp 4 --volume volume.raw --dims 4x4x4 --checkpoint z -o z.pfm -q > /dev/null
mv 'volume\100' volume.raw
check "another volume" refused_by 5 "not the values" resume z
check "cells do not grow" refused_by 2 "only a run" resume v --samples 1e6
check "cells are not merged" refused_by 5 "debias validate" merge v v
check "a command is not overwritten" refused_by 5 "debias resume v" validate A01 B02 --samples 6e5 --json -q --checkpoint v
check "nor is another one" refused_by 5 "another command" validate A01 --checkpoint v
check "hard cases keep nothing" refused_by 2 "leave it out" validate --hard --checkpoint h
check "a shard without a file" refused_by 2 "write --checkpoint" run A03 --shard 1/2
end_checks
