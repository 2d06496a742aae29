#pragma once

// The runs of a problem whose samples Python answers in batches: each draws its samples twice, first for what they ask.
//
//   set_runs(user, with, collection)    with(choice, use) calls use(estimator); collection as in collecting.hpp

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>

#include <debias/core/estimate.hpp>

#include "collecting.hpp"
#include "problem.hpp"

namespace debias::python {

template <class With, class Collection>
void set_runs(UserProblem& user, const With& with, const std::shared_ptr<Collection>& collection) {
  using catalog::Choice;
  user.problem.run = [with, collection](const Choice& choice, const Plan& plan) {
    Statistics result;
    with(choice, [&](const auto& e) { result = estimate_collected(*collection, e, plan); });
    return result;
  };
  user.problem.trace = [with, collection](const Choice& choice, std::uint64_t seed, std::int64_t index) {
    Trace<double> result;
    with(choice, [&](const auto& e) {
      collection->collect_queries([&] { trace(e, seed, index); });
      auto t = trace(e, seed, index);
      result = {
          {as_scalar(t.sample.value), t.sample.work, t.sample.level}, std::move(t.levels), t.block, t.first, t.member};
    });
    return result;
  };
  user.samples = [with, collection](const Choice& choice, std::uint64_t seed, std::int64_t first,
                                    std::span<double> out) {
    with(choice, [&](const auto& e) {
      const auto draw_all = [&] {
        NullRecord record;
        std::size_t filled = 0;
        for (std::int64_t i = first; filled < out.size(); ++i) {
          Stream rng(seed, static_cast<std::uint64_t>(i));
          const auto value = draw_sample(e, rng, record).value;
          for (std::size_t j = 0; j < component_count(value); ++j) out[filled++] = component(value, j);
        }
      };
      collection->collect_queries(draw_all);
      draw_all();
    });
  };
}

}  // namespace debias::python
