// Density look-ups a second of the renderer, against a bare loop over the same cloud: every pixel's path at
// equidistant points, as many as the estimator looks up on average, nothing else. Alternating in one run.

#include <benchmark/benchmark.h>

#include <cmath>
#include <string>

#include "paired.hpp"
#include "render/cloud.hpp"
#include "render/transmittance.hpp"

namespace debias::bench {
namespace {

void lookups(benchmark::State& state, const render::TransmittanceMethod& method) {
  const render::Cloud cloud(8);
  render::RenderPlan plan;
  plan.width = 96;
  plan.height = 96;
  plan.samples = 32;
  plan.threads = 1;
  double looked_up = 0;
  const auto ours = [&] { looked_up = render::render(cloud, method, plan).lookups(); };
  ours();
  double crossed = 0;
  for (int i = 0; i < plan.width * plan.height; ++i) {
    if (render::look(cloud, i % plan.width, i / plan.width, plan.width, plan.height).path.length() > 0) ++crossed;
  }
  const auto in_path = static_cast<int>(std::ceil(looked_up / crossed));
  const auto bare = [&] {
    for (int i = 0; i < plan.width * plan.height; ++i) {
      const render::Path path = render::look(cloud, i % plan.width, i / plan.width, plan.width, plan.height).path;
      if (path.length() == 0) continue;
      double sum = 0;
      for (int k = 0; k < in_path; ++k) sum += path(path.length() * (k + 0.5) / in_path);
      benchmark::DoNotOptimize(sum);
    }
  };
  for (auto _ : state) {
    const Ratio r = paired_ratio(ours, bare);
    const double bare_rate = in_path * crossed / r.theirs;
    state.counters["lookups_per_second"] = looked_up / r.ours;
    state.counters["bare_per_second"] = bare_rate;
    state.counters["ratio"] = looked_up / (in_path * crossed) / r.ratio;  // of rates: above 1, ours is faster
  }
}

[[maybe_unused]] const bool registered = [] {
  for (const render::TransmittanceMethod& method : render::transmittance_methods()) {
    const auto run = [&method](benchmark::State& state) { lookups(state, method); };
    benchmark::RegisterBenchmark(("render/lookups/" + std::string(method.name)).c_str(), run)->Iterations(1);
  }
  return true;
}();

}  // namespace
}  // namespace debias::bench
