#pragma once

// Is a coupling of two chains one? Its marginals and its staying together, at states of the user's.
//
//   for all pairs (x, y) of states:  coupled_step moves x as step does, and y as step does;  equal states stay equal
//
// Marginals are compared by z-tests on f(x') and its square, component by component, of `draws` coupled steps against as many
// plain ones, and on how often a point stays where it is; the threshold is that of one false alarm in a million checks. Equal
// states must stay so, bit by bit, over 64 steps of each of many chains.
// Fails where the states given are not those at which the coupling is wrong, or the error is below what so many draws see:
// give pairs that are near and far, and such as chains have met from.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <debias/chains/coupled_chain.hpp>
#include <debias/chains/kernel.hpp>
#include <debias/core/accumulator.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>

namespace debias {

struct CouplingCheckOptions {
  std::int64_t draws = 1 << 14;  ///< of a step at each pair of states
  std::uint64_t seed = 1;
};

/// What check_coupling found.
struct CouplingCheck {
  double worst = 0;        ///< of all z-scores of marginals
  double threshold = 0;    ///< a family of so many is above it once in a million
  std::int64_t tests = 0;  ///< z-scores
  std::size_t worst_x = 0;
  std::size_t worst_y = 0;      ///< the pair of states where it is, by index
  bool first_chain = true;      ///< x is moved otherwise than by a step; else y
  std::int64_t parted = 0;      ///< chains of equal states that came apart
  std::int64_t met_before = 0;  ///< of so many
  std::int64_t meetings = 0;    ///< of different states, in one step: none at all is no coupling that meets, perhaps

  [[nodiscard]] bool keeps_marginals() const { return worst <= threshold; }
  [[nodiscard]] bool stays_together() const { return parted == 0; }
  [[nodiscard]] bool passed() const { return keeps_marginals() && stays_together(); }
  /// "the coupling keeps both marginals (24 tests, the largest 2.1 standard errors) and stays together".
  [[nodiscard]] std::string sentence() const;
};

namespace detail {

/// z-scores of what a coupled step does to one of its chains, beside plain steps.
class StepMoments {
 public:
  void add(const std::vector<double>& x);
  /// The largest |z| of the difference of two; `tests` counts them.
  static double worst_of(const StepMoments& a, const StepMoments& b, std::int64_t& tests);

 private:
  std::vector<Moments> sums_;  // central sums, one value at a time
};

double threshold_of(std::int64_t tests);
void check_coupling_options(std::size_t states, std::int64_t draws);

}  // namespace detail

/// Checks a kernel at all ordered pairs of `states` (points). `f(point)` is a Value that tells what a step does.
/// Throws std::invalid_argument for fewer than two states or 100 draws.
template <class K, class Point, class F>
CouplingCheck check_coupling(const K& kernel, const std::vector<Point>& states, const F& f,
                             const CouplingCheckOptions& options = {}) {
  detail::check_coupling_options(states.size(), options.draws);
  const auto begin = [&](std::size_t i) { return detail::begin_state(kernel, states[i]); };
  const auto point = [&](const auto& state) -> decltype(auto) { return detail::point_of(kernel, state); };
  std::vector<double> features;
  const auto look = [&](const auto& state, const auto& before) -> const std::vector<double>& {
    const auto value = f(point(state));
    features.clear();
    for (std::size_t c = 0; c < component_count(value); ++c) {
      const double x = component(value, c);
      features.push_back(x);
      features.push_back(x * x);
    }
    features.push_back(detail::same_point(point(state), point(before)) ? 1 : 0);
    return features;
  };
  // Streams of their own for each purpose and pair.
  std::uint64_t branch = 0;
  const auto stream = [&](std::int64_t i) { return Stream(options.seed, static_cast<std::uint64_t>(i)).split(branch); };

  std::vector<detail::StepMoments> plain(states.size());
  for (std::size_t i = 0; i < states.size(); ++i, ++branch) {
    const auto before = begin(i);
    for (std::int64_t d = 0; d < options.draws; ++d) {
      Stream rng = stream(d);
      auto state = before;
      kernel.step(state, rng);
      plain[i].add(look(state, before));
    }
  }
  CouplingCheck check;
  for (std::size_t i = 0; i < states.size(); ++i) {
    for (std::size_t j = 0; j < states.size(); ++j, ++branch) {
      const auto x_before = begin(i);
      const auto y_before = begin(j);
      detail::StepMoments of_x;
      detail::StepMoments of_y;
      for (std::int64_t d = 0; d < options.draws; ++d) {
        Stream rng = stream(d);
        auto x = x_before;
        auto y = y_before;
        kernel.coupled_step(x, y, rng);
        of_x.add(look(x, x_before));
        of_y.add(look(y, y_before));
        if (i != j && detail::same_point(point(x), point(y))) ++check.meetings;
      }
      for (const bool first : {true, false}) {
        const double z = detail::StepMoments::worst_of(first ? of_x : of_y, plain[first ? i : j], check.tests);
        if (std::isnan(check.worst) || z <= check.worst) continue;  // a NaN stays
        check.worst = z;
        check.worst_x = i;
        check.worst_y = j;
        check.first_chain = first;
      }
    }
  }
  constexpr int steps = 64;
  for (std::size_t i = 0; i < states.size(); ++i, ++branch) {
    for (std::int64_t d = 0; d < options.draws / steps + 1; ++d) {
      Stream rng = stream(d);
      auto x = begin(i);
      auto y = x;
      ++check.met_before;
      for (int s = 0; s < steps; ++s) {
        kernel.coupled_step(x, y, rng);
        if (detail::same_point(point(x), point(y))) continue;
        ++check.parted;
        break;
      }
    }
  }
  check.threshold = detail::threshold_of(check.tests);
  return check;
}

}  // namespace debias
