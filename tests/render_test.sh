#!/bin/sh
# `debias render`: exit codes, files, equal bits, interrupts.
#   sh tests/render_test.sh PROGRAM      one line for each check that failed, then their number
. "$(dirname -- "$0")/checks.sh"

# rendered ARGUMENTS...: exit code 0
rendered() {
  "$debias" render "$@" > out 2> err
  check "exit code of: debias render $*" same $? 0
}
# refused CODE WORD ARGUMENTS...
refused() {
  wanted=$1
  expected=$2
  shift 2
  refused_by "$wanted" "$expected" render "$@"
}

# ---- wrong command lines
refused 2 "debias render --help"
refused 2 "debias render --help" nothing
refused 2 "output" transmittance
refused 2 "did you mean '--spp'" transmittance --sp 3 -o x.png
refused 2 "must end in .png or .pfm" transmittance -o x.jpg
refused 2 "did you mean 'ratio_tracking'" transmittance --estimator ratio-tracking -o x.png
refused 2 "--spp = '0'" transmittance --spp 0 -o x.png
refused 2 "--size = '64'" transmittance --size 64 -o x.png
refused 2 "--size = '0'" transmittance --size 64x0 -o x.png
refused 2 "--size" transmittance --size 1x2x3 -o x.png
refused 2 "--exposure = '-1'" transmittance --exposure -1 -o x.png
refused 2 "--density = '0'" transmittance --density 0 -o x.png
refused 2 "--equal-time = 'soon'" transmittance --equal-time soon -o x.png
refused 2 "--spp = '9' (--compare takes" transmittance --compare --spp 9 -o folder
refused 2 "--compare takes all" transmittance --compare --estimator telescoping -o folder
refused 2 "add --volume" transmittance --dims 2x2x2 -o x.png
refused 2 "add --dims" transmittance --volume v.raw -o x.png
refused 5 "v.raw" transmittance --volume v.raw --dims 2x2x2 -o x.png
refused 5 "no/such/folder" transmittance -o no/such/folder/x.png
head -c 32 /dev/zero > v.raw
refused 2 "32 bytes" transmittance --volume v.raw --dims 2x2x3 -o x.png
refused 2 "nothing to see" transmittance --volume v.raw --dims 2x2x2 -o x.png
printf '\000\000\200\277' > v.raw  # -1
refused 2 "number 0 is -1" transmittance --volume v.raw --dims 1x1x1 -o x.png
refused 2 "output" photons
refused 2 "did you mean 'balanced'" photons --estimator balancd -o x.png
refused 2 "E|Z| is infinite.*--allow-infinite-mean" photons --estimator alpha -o x.png
refused 2 "--photons = '0'" photons --photons 0 -o x.png
refused 2 "did you mean 'sphere'" photons --scene spere -o x.png
refused 2 "'--spp'" photons --spp 4 -o x.png

# ---- images
rendered transmittance --size 32x24 --spp 8 -o image.png --threads 1
check "a PNG" has PNG image.png
check "the linear image beside it" eval 'head -n 2 image.pfm | tail -n 1 | grep -q "^32 24$"'
for threads in 2 3 7; do
  rendered transmittance --size 32x24 --spp 8 -o again.pfm --threads $threads
  check "the same image on $threads threads" cmp -s image.pfm again.pfm
done
rendered transmittance --size 32x24 --spp 8 --seed 2 -o again.pfm
check "another image for another seed" eval '! cmp -s image.pfm again.pfm'
printf '\000\000\200\077' > v.raw  # 1
rendered transmittance --volume v.raw --dims 1x1x1 --size 16x16 --spp 4 --json -o volume.pfm
check "JSON names the estimator" has '"name": "telescoping_2"' out
check "a constant cloud has no noise" eval '"$debias" render transmittance --volume v.raw --dims 1x1x1 --size 16x16 \
  --spp 1 --seed 9 -o once.pfm > out && cmp -s once.pfm volume.pfm'
for scene in transmittance photons; do
  refused_by 2 "--exposure = '2' (it is of a PNG" render $scene --size 8x8 --exposure 2 -o image.pfm
  refused_by 2 "--exposure = '2' (it is of a PNG" render $scene --size 8x8 --exposure 2 --compare -o folder
done
refused_by 2 "--spp = '4' (--equal-time takes as many" render transmittance --size 8x8 --spp 4 --equal-time 1 -o image.pfm
rendered transmittance --size 32x32 --compare --equal-time 0.02s -o folder
check "a folder of all estimators" [ "$(ls folder/*.pfm | wc -l)" -eq 14 ]
check "and their index" has '"scene": "transmittance"' folder/index.json
for estimator in balanced progressive; do
  rendered photons --estimator $estimator --size 32x32 --photons 1e5 --threads 1 -o photons.png
  check "a PNG of photons" has PNG photons.png
  rendered photons --estimator $estimator --size 32x32 --photons 1e5 --threads 3 -o again.pfm
  check "the same photons on 1 and 3 threads" cmp -s photons.pfm again.pfm
done
check "the verdict is printed" eval '"$debias" render photons --size 16x16 --photons 1e4 -o x.pfm |
  grep -q "^balanced  *variance INFINITE"'
rendered photons --scene direct --size 32x32 --photons 1e5 --compare --allow-infinite-mean -o lamp
check "a folder of all estimators of photons" [ "$(ls lamp/*.pfm | wc -l)" -eq 7 ]
check "and their errors against photons" [ "$(lines lamp/curves.csv)" -eq 25 ]

# ---- an interrupt leaves what there is
for scene in 'transmittance --spp 100000000' 'photons --photons 1e12'; do
  rm -f part.png
  "$debias" render $scene --size 128x128 -o part.png > out 2> err &
  process=$!
  sleep 2
  kill -INT $process 2> /dev/null
  wait $process
  check "exit code of an interrupted image: $scene" same $? 130
  check "an interrupted image is there: $scene" has PNG part.png
  check "and says so: $scene" has 'interrupted; what there is of the image is written' err
done

if command -v python3 > /dev/null && python3 -c '' 2> /dev/null; then
  check "valid JSON" python3 -c 'import json, sys; json.load(open("folder/index.json"))'
  check "valid JSON of photons" python3 -c 'import json, sys; json.load(open("lamp/index.json"))'
fi

end_checks
