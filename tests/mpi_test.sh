#!/bin/sh
# Under mpirun: the bits of one process on any ranks, a rank that is killed, and one message for one error.
#   MPIEXEC=mpirun sh tests/mpi_test.sh PROGRAM     skipped (exit code 77) without MPIEXEC
. "$(dirname -- "$0")/checks.sh"
[ -n "${MPIEXEC:-}" ] && command -v "$MPIEXEC" > /dev/null || { echo "skipped: no MPI"; exit 77; }
# Open MPI asks for these where there are few cores, or for the root of a container; MPICH does not.
# A rank that waits gives way to one that works.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1
export OMPI_MCA_mpi_yield_when_idle=1

# on RANKS WORDS...   `debias WORDS` on that many
on() { ranks=$1; shift; timeout 60 "$MPIEXEC" -n "$ranks" "$debias" "$@" < /dev/null; }
lasting() { sed -E '/"(seconds|pilot_seconds|efficiency)":/d'; }
answer() { "$@" --json 2>/dev/null | lasting > answer.json; cat answer.json; }

# ---- the library: bits, goals, failures, interrupts, checked on every rank
for ranks in 1 2 5; do
  timeout 100 "$MPIEXEC" -n $ranks "${debias%/*}/debias_ranks" > out 2> err
  check "the library on $ranks ranks" same "$(grep failures out)" "0 failures on $ranks ranks"
done

# ---- the program
check "a run on 2 ranks, 3 threads on each" same "$(answer on 2 run A03 --samples 1e5 --threads 3)" \
  "$(answer "$debias" run A03 --samples 1e5)"
check "a recipe on 3 ranks" same "$(answer on 3 run A03 --estimator recipe --error 1e-3)" \
  "$(answer "$debias" run A03 --estimator recipe --error 1e-3)"
on 2 run E02 --estimator recipe --samples 1e6 --checkpoint recipe > /dev/null 2>&1
cp recipe alone
check "and it can grow" same "$(answer on 3 resume recipe --samples 5e3)" "$(answer "$debias" resume alone --samples 5e3)"
on 2 run E02 --estimator multilevel --error 1 --checkpoint m > m.err 2>&1
check "levels of multilevel are not kept by ranks" has "without mpirun" m.err
check "a seed that is drawn is one" same "$(on 3 run A03 --samples 1e3 --seed random | grep -c '^samples .*, seed ')" 1
on 2 run A03 --samples 2e4 --checkpoint finished -o out.txt > out 2> err
check "a run ends" same $? 0
check "and is written once" same "$(grep -c ^mean out.txt)" 1
on 3 resume finished --samples 3e4 --json -o grown.json > out 2> err
check "and can grow" same "$(lasting < grown.json)" "$(answer "$debias" run A03 --samples 3e4)"

# ---- one rank is killed
whole=$(answer "$debias" run E02 --samples 5000000)
on 2 run E02 --samples 5000000 --threads 1 --checkpoint k > /dev/null 2>&1 &
launcher=$!
tries=0
while [ $tries -lt 80 ] && ! { [ -f k ] && [ "$(wc -c < k)" -gt 20000 ]; }; do sleep 0.1; tries=$((tries + 1)); done
kill -9 "$(pgrep -f "^$debias run E02 --samples 5000000" | tail -1)" 2> /dev/null
wait $launcher
check "a job without one of its ranks ends" [ $? -ne 0 ]
check "and goes on with another number of them" same "$(answer on 3 resume k)" "$whole"
check "or without mpirun" same "$(answer "$debias" resume k)" "$whole"

# ---- chains that meet: each rank has others, of other lengths
chains="run K01 --estimator coupled_chain --samples"
whole=$(answer "$debias" $chains 400000)
check "coupled chains on 3 ranks, 2 threads on each" same "$(answer on 3 $chains 400000 --threads 2)" "$whole"
on 2 $chains 400000 --threads 1 --checkpoint c > /dev/null 2>&1 &
launcher=$!
tries=0
while [ $tries -lt 80 ] && ! { [ -f c ] && [ "$(wc -c < c)" -gt 20000 ]; }; do sleep 0.1; tries=$((tries + 1)); done
kill -9 "$(pgrep -f "^$debias run K01 --estimator coupled_chain --samples 400000" | tail -1)" 2> /dev/null
wait $launcher
check "a job of chains without one of its ranks ends" [ $? -ne 0 ]
check "and goes on, with the same bits" same "$(answer on 3 resume c)" "$whole"

# ---- one message for one error, and nobody waits for a rank that has it alone
refused_on_ranks() {
  code=$1
  word=$2
  shift 2
  on 2 "$@" > out 2> err
  check "exit code on 2 ranks of: debias $*" same $? "$code"
  check "empty stdout on 2 ranks of: debias $*" same "$(lines out)" 0
  check "one message on 2 ranks of: debias $*" same "$(grep -c '^debias: ' err)" 1
  check "helpful line of: debias $*" has "^debias: .*$word" err
}
refused_on_ranks 2 "not a number" run A03 --samples nan
refused_on_ranks 2 "without mpirun" validate A03
refused_on_ranks 5 "No such file" run A03 --samples 1e3 -o no/file
refused_on_ranks 5 "debias resume finished" run A03 --samples 3e4 --checkpoint finished
refused_on_ranks 5 "No such file" resume no-file
refused_on_ranks 2 "did you mean" run A03 --sampels 5
PMI_SIZE=2 PMI_RANK=0 OMPI_COMM_WORLD_SIZE=2 OMPI_COMM_WORLD_RANK=0 "$debias" list > out 2> err
check "a launcher of another MPI" same $? 2
check "which is said" has "another MPI" err
end_checks
