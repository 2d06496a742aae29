#!/bin/sh
# The vector instructions change no bit of a problem without calls of the C library's mathematics, alone or in blocks.
#   sh tests/instructions_test.sh PROGRAM
. "$(dirname "$0")/checks.sh"

# run PROBLEM BLOCK: the result without what depends on the clock.
run() {
  "$debias" run "$1" --block "$2" --samples $((4096 * $2)) --json -o result.json -q && sed -E '/"(seconds|efficiency|pilot_seconds)"/d' result.json
}
for problem in A03 A10 B01 B14 C09 D01 E02 E04 F02 H01; do
  for block in 1 64; do
    DEBIAS_INSTRUCTIONS=sse2 run "$problem" "$block" > sse2
    DEBIAS_INSTRUCTIONS=avx2 run "$problem" "$block" > avx2
    run "$problem" "$block" > widest
    check "$problem, block $block: a result" [ -s widest ]
    check "$problem, block $block: AVX2 gives the bits of SSE2" cmp -s sse2 avx2
    check "$problem, block $block: the widest vectors give the bits of SSE2" cmp -s sse2 widest
  done
done
end_checks
