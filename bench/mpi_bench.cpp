// What a rank costs the others: its sums as a message, and the group of chunks that it asks for.
// Counters: bytes of the message.

#include <cstdint>
#include <span>
#include <utility>

#include <benchmark/benchmark.h>

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/reciprocal.hpp>

#include "core/chunks.hpp"
#include "core/run_state_bytes.hpp"

namespace debias::bench {
namespace {

// The sums of a rank at the end: full tails, and `range` groups that are no neighbours.
RunState sums_of_rank(std::int64_t groups) {
  const auto x = [](Stream& rng) { return 1 + rng.uniform(); };
  const auto draw = single_term(reciprocal(x));
  RunState sums;
  for (std::int64_t i = 0; i < groups; ++i) {
    sums.merge(estimate(draw, {.samples = default_chunk, .first = 2 * i * default_chunk}).state);
  }
  sums.merge(estimate(draw, {.samples = 256 * default_chunk, .first = 512 * default_chunk}).state);
  return sums;
}

void receive_and_merge(benchmark::State& state) {
  const Bytes bytes = encode(sums_of_rank(state.range(0)));
  for (auto _ : state) {
    RunState all;
    all.merge(decode(bytes));
    benchmark::DoNotOptimize(all);
  }
  state.counters["bytes"] = static_cast<double>(bytes.size());
}
BENCHMARK(receive_and_merge)->Name("mpi/receive_and_merge")->Arg(1)->Arg(45);

void encode_sums(benchmark::State& state) {
  const RunState sums = sums_of_rank(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(encode(sums));
}
BENCHMARK(encode_sums)->Name("mpi/encode")->Arg(1)->Arg(45);

void next_group(benchmark::State& state) {
  constexpr std::int64_t samples = std::int64_t{1} << 44;
  detail::Chunks chunks(default_chunk);
  for (auto _ : state) {
    if (chunks.empty()) chunks.give({0, samples});
    const auto [first, last] = chunks.take_share(state.range(0), 1);
    benchmark::DoNotOptimize(first);
  }
}
BENCHMARK(next_group)->Name("mpi/next_group")->Arg(100)->Arg(10'000);

}  // namespace
}  // namespace debias::bench
