#pragma once

// A stated bias: what a sequence that ends somewhere leaves out, carried into the result of the run.
//
//   |E estimate - I| <= size, under the assumption that the sentence names
//
// Optional member of a sequence, forwarded by the estimators: `bias_bound(levels) -> BiasBound`, where `levels`
// holds the moments of the unweighted differences of the run. For a value with several components the bound is
// on the norm. Nothing is ever subtracted from a mean: the bound stands beside it.

#include <concepts>
#include <string>

#include <debias/core/accumulator.hpp>

namespace debias {

struct BiasBound {
  double size = 0;       ///< 0: no bias is known of
  std::string sentence;  ///< where it comes from, and what has to hold for it
};

/// A sequence, or an estimator of one, that knows a bound on its bias.
template <class T>
concept StatesBias = requires(const T& t, const LevelTable& levels) {
  { t.bias_bound(levels) } -> std::same_as<BiasBound>;
};

}  // namespace debias
