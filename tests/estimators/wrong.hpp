#pragma once

// Laws, sequences and estimators that are wrong in one way each: what a test of unbiasedness must reject,
// and the claims that tests of estimators share.

#include <cmath>
#include <cstdint>
#include <utility>

#include <debias/core/estimate.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/sequence.hpp>
#include <debias/pmf/geometric.hpp>

#include "estimators/sequences.hpp"
#include "laws/estimator_laws.hpp"

namespace debias::trial {

/// Weights of the next level.
struct LawOffByOne {
  Geometric law;
  double mass(std::int64_t j) const { return law.mass(j + 1); }
  double tail(std::int64_t j) const { return law.tail(j + 1); }
  std::int64_t sample(double u) const { return law.sample(u); }
};

/// No weights at all.
struct NoReweighting {
  Geometric law;
  double mass(std::int64_t) const { return 1; }
  double tail(std::int64_t) const { return 1; }
  std::int64_t sample(double u) const { return law.sample(u); }
};

/// Cut after level `last` and renormalised: a law that ends, called unbiased.
struct Renormalised {
  Geometric law;
  std::int64_t last;
  double rest() const { return law.tail(last + 1); }
  double mass(std::int64_t j) const { return j > last ? 0 : law.mass(j) / (1 - rest()); }
  double tail(std::int64_t j) const { return j > last ? 0 : (law.tail(j) - rest()) / (1 - rest()); }
  std::int64_t sample(double u) const { return law.sample(rest() + u * (1 - rest())); }
};

/// No base: I_k is taken for zero wherever it stands alone.
template <BiasedSequence S>
struct BaseDropped {
  S sequence;
  Draw<double> operator()(std::int64_t level, Stream& rng) const { return sequence(level, rng); }
  Term<double> value_at(std::int64_t level, Stream& rng) const { return {0, sequence(level, rng).work}; }
};

/// The first term is left out.
template <TermSequence S>
struct FirstTermDropped {
  S terms;
  auto operator()(Stream& rng) const {
    return [cursor = terms(rng), first = true]() mutable {
      auto term = cursor();
      if (first) term.value = 0;
      first = false;
      return term;
    };
  }
};

/// A shared base made of one residue of the comb only: its offset is not uniform.
struct OneResidue : Comb {
  SharedDraw<double> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const {
    Stream copy = rng;
    SharedDraw<double> draw = Comb::shared(level, base_level, rng);
    draw.base = residue(copy.uniform(), std::int64_t{1} << level, std::int64_t{1} << (level - base_level), 0);
    return draw;
  }
};

/// Every sample times a factor.
template <Estimator E>
struct Scaled {
  E estimator;
  double factor;
  template <Record R>
  auto operator()(Stream& rng, R& record) const {
    auto sample = draw_sample(estimator, rng, record);
    sample.value *= factor;
    return sample;
  }
};

/// The estimator scaled by three times the smallest bias that the plan shows at `z_limit` standard errors.
template <Estimator E>
Scaled<E> scaled_detectably(const E& estimator, double truth, const Plan& plan, double z_limit) {
  const double detectable = z_limit * estimate(estimator, plan).standard_error;
  return {estimator, 1 + 3 * detectable / truth};
}

/// Does the law suite see that it is biased?
template <Estimator E>
bool rejected(const E& wrong, double truth) {
  return laws::names(laws::estimator_laws(wrong, truth, {.repeats = 0}), "unbiased");
}

/// The claim that a run has this variance, at 4.5 standard errors.
inline bool has_variance(const Statistics& s, double exact) {
  const double error = exact * std::sqrt((s.moments.kurtosis() - 1) / static_cast<double>(s.samples));
  return std::abs(s.moments.variance() - exact) <= 4.5 * error;
}

}  // namespace debias::trial
