// Random numbers and PMFs, nanoseconds for one (`ns`): stream/..., pmf/...

#include <array>
#include <cstdint>
#include <random>
#include <span>
#include <string>

#include <benchmark/benchmark.h>

#include <debias/core/instructions.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/vector_math.hpp>
#include <debias/pmf/any.hpp>

#include "paired.hpp"

namespace debias::bench {
namespace {

std::array<double, 4096> numbers;

/// `work` makes `count` numbers.
template <class Work>
void time(const std::string& name, double count, const Work& work) {
  benchmark::RegisterBenchmark(name.c_str(), [count, work](benchmark::State& state) {
    std::uint64_t i = 0;
    const double seconds = seconds_of([&] {
      for (auto _ : state) {
        work(i++);
        benchmark::ClobberMemory();
      }
    });
    state.counters["ns"] = 1e9 * seconds / (count * static_cast<double>(state.iterations()));
    state.SetLabel(name_of(instructions()));
  });
}

/// 64 fresh streams with two uniforms each.
void fresh(std::uint64_t i) {
  for (std::size_t k = 0; k < 64; ++k) {
    Stream rng(i, k);
    numbers[2 * k] = rng.uniform();
    numbers[2 * k + 1] = rng.uniform();
  }
}

const bool registered = [] {
  time("stream/fill", 4096, [](std::uint64_t i) { Stream(1, i).fill(numbers); });
  time("stream/uniform", 4096, [](std::uint64_t i) {
    Stream rng(1, i);
    for (double& u : numbers) u = rng.uniform();
  });
  time("stream/fresh_and_two_uniforms", 64, fresh);
  time("stream/batch_and_two_uniforms", 64, [](std::uint64_t i) {
    StreamBatch batch(Stream(1, i), 0, 64, 3);
    batch.uniforms(std::span(numbers).first(128));
  });
  time("stream/batch_split_twice", 64, [](std::uint64_t i) {  // the keys alone
    StreamBatch batch(Stream(1, i), 0, 64, 3);
    benchmark::DoNotOptimize(batch);
  });
  time("stream/normal", 4096, [](std::uint64_t i) {
    Stream rng(1, i);
    for (double& z : numbers) z = rng.normal();
  });
  time("stream/batch_normals", 1024, [](std::uint64_t i) {
    StreamBatch batch(Stream(1, i), 0, 64, 3);
    batch.normals(std::span(numbers).first(1024));
  });
  time("stream/mt19937_64", 4096, [](std::uint64_t i) {  // of the standard library, one generator a run
    static std::mt19937_64 rng(i);
    for (double& u : numbers) u = static_cast<double>(rng() >> 11) * 0x1p-53;
  });
  time("stream/fresh_mt19937_64", 1, [](std::uint64_t i) {
    std::mt19937_64 rng(i);
    numbers[0] = static_cast<double>(rng() >> 11) * 0x1p-53;
  });
  time("stream/vector_exp", 4096, [](std::uint64_t i) {
    Stream(1, i).fill(numbers);
    vector_math::exp(numbers);
  });
  time("stream/vector_sin", 4096, [](std::uint64_t i) {
    Stream(1, i).fill(numbers);
    vector_math::sin(numbers);
  });
  for (const char* spec : {"geometric:r=0.6", "zeta:s=2.5", "poisson:lambda=4", "tabulated:0.5,0.3,0.2;tail=0.4"}) {
    const AnyPmf pmf = AnyPmf::parse(spec);
    time(std::string("pmf/") + spec, 4096, [pmf](std::uint64_t i) {
      static std::array<double, 4096> u;
      Stream(1, i).fill(u);
      for (std::size_t k = 0; k < u.size(); ++k) numbers[k] = static_cast<double>(pmf.sample(u[k]));
    });
  }
  return true;
}();

}  // namespace
}  // namespace debias::bench
