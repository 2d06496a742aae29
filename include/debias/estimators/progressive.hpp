#pragma once

// A base level that grows with the sample index: consistent whatever the PMF, and its biased classic.
//
//   progressive          Z_i = I_m(i) + D_N / p(N - m(i) - 1): unbiased at every i               [Misso et al. 2022]
//   biased_progressive   Z_i = I_m(i): biased at every i, the average converges        [Knaus & Zwicker 2011]
//   m(i) = base_level + floor(log2(1 + i / first_step) / doublings)
//
//   Notation: i = Stream::index().
// Samples are not identically distributed. The means of `progressive` are equal, so that its standard error is right
// all the same, and stays right for any schedule; that of `biased_progressive` knows nothing of its bias. Where no PMF has
// finite variance and finite work, growing bases still bring the answer, at a slower rate than 1 / sqrt(work).
// A sample past 2^30 first_step of work 2^m(i) costs what its base costs: choose `doublings` for that.

#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

#include <debias/core/bias.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/pmf.hpp>
#include <debias/core/reach.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/resonance.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/text.hpp>
#include <debias/estimators/common.hpp>

namespace debias {

/// m(i): one level more for every `doublings` doublings of the index, beginning at `first_step`.
struct Schedule {
  std::int64_t base_level = 0;
  double first_step = 1024;
  double doublings = 2;

  [[nodiscard]] std::int64_t level(std::uint64_t index) const {
    return base_level + static_cast<std::int64_t>(std::log2(1 + static_cast<double>(index) / first_step) / doublings);
  }
  /// The first index with this level: samples of one level are identically distributed, and
  /// {.first = first_index(m), .samples = first_index(m + 1) - first_index(m)} runs them alone.
  [[nodiscard]] std::int64_t first_index(std::int64_t wanted) const {
    const double steps = std::exp2(static_cast<double>(wanted - base_level) * doublings) - 1;
    auto index = static_cast<std::int64_t>(std::floor(steps * first_step));
    while (index > 0 && level(static_cast<std::uint64_t>(index) - 1) >= wanted) --index;
    while (level(static_cast<std::uint64_t>(index)) < wanted) ++index;
    return index;
  }
  void check(const char* estimator) const {
    detail::check_base_level(estimator, base_level);
    if (first_step > 0 && doublings > 0 && std::isfinite(first_step) && std::isfinite(doublings)) return;
    throw std::invalid_argument(std::string(estimator) + ": first_step = " + detail::format("%f", first_step) +
                                ", doublings = " + detail::format("%f", doublings) + " (must be positive and finite)");
  }
  [[nodiscard]] std::string describe() const {
    return "base level " + std::to_string(base_level) + " + floor(log2(1 + i / " + detail::format("%f", first_step) +
           ") / " + detail::format("%f", doublings) + ")";
  }
};

template <BiasedSequence S, Pmf P>
class Progressive {
 public:
  using value_type = sequence_value_t<S>;

  Progressive(S sequence, P pmf, const Schedule& schedule)
      : sequence_(std::move(sequence)), pmf_(std::move(pmf)), schedule_(schedule) {
    schedule_.check("progressive");
  }

  template <Record R>
  Sample<value_type> operator()(Stream& rng, R& record) const {
    const std::int64_t m = schedule_.level(rng.index());
    Stream pmf_stream = split(rng, Branch::pmf);
    const std::int64_t j = pmf_.sample(pmf_stream.uniform());
    const std::int64_t level = m + 1 + j;
    return detail::base_and_difference(sequence_, m, level, inverse_weight(pmf_.mass(j), level), rng, record);
  }

  [[nodiscard]] BiasBound bias_bound(const LevelTable& levels) const requires StatesBias<S> {
    return sequence_.bias_bound(levels);
  }
  [[nodiscard]] auto missed(std::int64_t level, std::int64_t draws, Stream& rng) const requires ChecksPoints<S> {
    return sequence_.missed(level, draws, rng);
  }
  /// As if every sample had the base level of the last one.
  [[nodiscard]] Reach reach(std::int64_t last) const {
    const std::int64_t m = schedule_.level(static_cast<std::uint64_t>(last));
    return detail::reach_of(sequence_, pmf_, m, m + 1);
  }

  [[nodiscard]] std::string describe() const {
    std::string name = "user-defined PMF";
    if constexpr (DescribedPmf<P>) name = pmf_.spec();
    return "progressive, " + name + ", " + schedule_.describe();
  }

 private:
  S sequence_;
  P pmf_;
  Schedule schedule_;
};

template <BiasedSequence S>
class BiasedProgressive {
 public:
  using value_type = sequence_value_t<S>;

  BiasedProgressive(S sequence, const Schedule& schedule) : sequence_(std::move(sequence)), schedule_(schedule) {
    schedule_.check("biased_progressive");
  }

  template <Record R>
  Sample<value_type> operator()(Stream& rng, R& record) const {
    const std::int64_t m = schedule_.level(rng.index());
    Stream base_stream = split_level(rng, m);
    auto base = debias::value_of(sequence_, m, base_stream);
    record.base(m, debias::as_scalar(base.value), base.work);
    return {std::move(base.value), base.work, m};
  }

  [[nodiscard]] Reach reach(std::int64_t last) const {
    return detail::reach_of_level(sequence_, schedule_.level(static_cast<std::uint64_t>(last)));
  }
  [[nodiscard]] std::string describe() const { return "biased_progressive, " + schedule_.describe(); }

 private:
  S sequence_;
  Schedule schedule_;
};

/// The consistent and unbiased form. Both throw std::invalid_argument for an impossible schedule.
template <BiasedSequence S, Pmf P>
Progressive<S, P> progressive(S sequence, P pmf, const Schedule& schedule = {}) {
  return {std::move(sequence), std::move(pmf), schedule};
}

/// The consistent and biased classic: plain averages at growing levels.
template <BiasedSequence S>
BiasedProgressive<S> biased_progressive(S sequence, const Schedule& schedule = {}) {
  return {std::move(sequence), schedule};
}

// What is neither.
template <class S, class P>
requires(!(BiasedSequence<S> && Pmf<P>)) auto progressive(const S& /*sequence*/, const P& /*pmf*/,
                                                          const Schedule& /*schedule*/ = {}) {
  return detail::refuse<detail::mistake_in_levels_and_pmf<S, P>(), S, P>();
}
template <class S>
requires(!BiasedSequence<S>) auto biased_progressive(const S& /*sequence*/, const Schedule& /*schedule*/ = {}) {
  return detail::refuse<detail::mistake_in_levels<S>(), S>();
}

}  // namespace debias
