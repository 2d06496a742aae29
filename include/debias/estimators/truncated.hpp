#pragma once

// The biased baseline: the estimate of one level, cut off there.
//
//   Z = I_m,   E Z - I = -sum_{k > m} E D_k
//
// What everybody does without debiasing, kept to be compared with. Its standard error knows nothing of its bias.

#include <cstdint>
#include <string>
#include <utility>

#include <debias/core/estimator.hpp>
#include <debias/core/reach.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/estimators/common.hpp>

namespace debias {

template <BiasedSequence S>
class Truncated {
 public:
  using value_type = sequence_value_t<S>;

  /// Throws std::invalid_argument for a negative level.
  Truncated(S sequence, std::int64_t level) : sequence_(std::move(sequence)), level_(level) {
    detail::check_base_level("truncated", level);
  }

  template <Record R>
  Sample<value_type> operator()(Stream& rng, R& record) const {
    Stream level_stream = split_level(rng, level_);
    auto term = debias::value_of(sequence_, level_, level_stream);
    record.base(level_, debias::as_scalar(term.value), term.work);
    return {std::move(term.value), term.work, level_};
  }

  [[nodiscard]] Reach reach(std::int64_t /*last*/) const { return detail::reach_of_level(sequence_, level_); }
  [[nodiscard]] std::string describe() const { return "truncated (biased), level " + std::to_string(level_); }

 private:
  S sequence_;
  std::int64_t level_;
};

/// The estimate I_level of `sequence`, bias and all.
template <BiasedSequence S>
Truncated<S> truncated(S sequence, std::int64_t level) {
  return {std::move(sequence), level};
}

template <class S>
requires(!BiasedSequence<S>) auto truncated(const S& /*sequence*/, std::int64_t /*level*/) {
  return detail::refuse<detail::mistake_in_levels<S>(), S>();
}

}  // namespace debias
