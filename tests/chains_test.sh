#!/bin/sh
# Coupled chains: the bits of one thread on any threads, in shards, with more samples, and after a kill.
#   sh tests/chains_test.sh PROGRAM
. "$(dirname -- "$0")/checks.sh"

# The result of a run by coupled chains without its times; `problem` and the rest of the words.
answer() { "$debias" "$@" --json 2>/dev/null | sed -E '/"(seconds|pilot_seconds|efficiency)":/d' > answer.json; cat answer.json; }
chains() { problem=$1; shift; answer run "$problem" --estimator coupled_chain "$@"; }

for problem in K01 K02 K03 K04; do
  whole=$(chains $problem --samples 2049 --threads 1)
  check "$problem answers" has '"variance": "finite"' answer.json
  for threads in 2 3; do
    check "$problem on $threads threads" same "$(chains $problem --samples 2049 --threads $threads)" "$whole"
  done
  check "$problem of another seed is another run" [ "$(chains $problem --samples 2049 --seed 2 | grep '"mean"')" != "$(echo "$whole" | grep '"mean"')" ]
  for i in 1 2 3; do chains $problem --samples 2049 --shard $i/3 --threads $i --checkpoint $problem.$i > /dev/null; done
  check "$problem in three shards" same "$(answer merge $problem.3 $problem.1 $problem.2)" "$whole"
  check "$problem without one of them" refused_by 5 "are missing" merge $problem.1 $problem.3
  chains $problem --samples 1000 --checkpoint $problem.grows > /dev/null
  check "$problem grows" same "$(answer resume $problem.grows --samples 2049 --threads 2)" "$whole"
done
check "K05 on 3 threads" same "$(answer run K05 --estimator taylor --samples 5000 --threads 3)" \
  "$(answer run K05 --estimator taylor --samples 5000 --threads 1)"
check "chains of two problems do not merge" refused_by 5 "of another run" merge K01.1 K02.2

# ---- a sample alone is the one of the run
"$debias" run K01 --estimator coupled_chain --samples 2049 --full > full.txt 2> /dev/null
check "the verdict speaks of meeting times" has "meeting times have a light tail" full.txt
"$debias" replay K01 --estimator coupled_chain --seed 1 --sample 77 > replay.txt
check "a sample is replayed" has "^value " replay.txt
check "the same each time" same "$("$debias" replay K01 --estimator coupled_chain --seed 1 --sample 77)" "$(cat replay.txt)"

# ---- killed
long=$(chains K01 --samples 400000)
"$debias" run K01 --estimator coupled_chain --samples 400000 --checkpoint k --threads 1 > /dev/null 2>&1 &
pid=$!
tries=0
while [ $tries -lt 100 ] && ! { [ -f k ] && [ "$(wc -c < k)" -gt 20000 ]; }; do sleep 0.05; tries=$((tries + 1)); done
check "the run is at work when it is killed" kill -9 $pid
wait $pid 2> /dev/null
cp k again
check "a killed run goes on, on two threads" same "$(answer resume k --threads 2)" "$long"
check "and on one" same "$(answer resume again --threads 1)" "$long"

"$debias" run K04 --estimator coupled_chain --samples 1e8 --checkpoint s > /dev/null 2> err &
pid=$!
tries=0
while [ $tries -lt 200 ] && ! { [ -f s ] && [ "$(wc -c < s)" -gt 20000 ]; }; do sleep 0.05; tries=$((tries + 1)); done
kill -TERM $pid
wait $pid
check "SIGTERM exits 130" same $? 130
check "and says how to go on" has "debias resume s" err
check "a goal says the same on one thread and on three" same "$(chains K03 --error 0.02 --threads 1)" \
  "$(chains K03 --error 0.02 --threads 3)"
end_checks
