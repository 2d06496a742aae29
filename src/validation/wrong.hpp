#pragma once

// PMFs, sequences and estimators that are wrong in one way each: what a test of unbiasedness must reject.

#include <algorithm>
#include <cstdint>

#include <debias/core/estimator.hpp>
#include <debias/core/sequence.hpp>
#include <debias/pmf/geometric.hpp>

namespace debias::trial {

/// Weights of the next level.
struct PmfOffByOne {
  Geometric pmf;
  double mass(std::int64_t j) const { return pmf.mass(j + 1); }
  double tail(std::int64_t j) const { return pmf.tail(j + 1); }
  std::int64_t sample(double u) const { return pmf.sample(u); }
};

/// No weights at all.
struct NoReweighting {
  Geometric pmf;
  double mass(std::int64_t) const { return 1; }
  double tail(std::int64_t) const { return 1; }
  std::int64_t sample(double u) const { return pmf.sample(u); }
};

/// Cut after level `last` and renormalised: a PMF that ends, called unbiased.
struct Renormalised {
  Geometric pmf;
  std::int64_t last;
  double rest() const { return pmf.tail(last + 1); }
  double mass(std::int64_t j) const { return j > last ? 0 : pmf.mass(j) / (1 - rest()); }
  double tail(std::int64_t j) const { return j > last ? 0 : (pmf.tail(j) - rest()) / (1 - rest()); }
  std::int64_t sample(double u) const { return pmf.sample(rest() + u * (1 - rest())); }
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

/// Weights that are cut at `most`.
struct WeightsCapped {
  Geometric pmf;
  double most;
  double mass(std::int64_t j) const { return std::max(pmf.mass(j), 1 / most); }
  double tail(std::int64_t j) const { return std::max(pmf.tail(j), 1 / most); }
  std::int64_t sample(double u) const { return pmf.sample(u); }
};

/// Level and difference from the same numbers.
template <BiasedSequence S>
struct LevelFromItsOwnDraws {
  S sequence;
  Geometric pmf;
  Sample<double> operator()(Stream& rng) const {
    Stream own(rng);
    const std::int64_t level = 1 + pmf.sample(rng.uniform());
    Stream base = split_level(own, 0);
    const auto draw = sequence(level, own);
    return {sequence(0, base).value + draw.difference / pmf.mass(level - 1), draw.work, level};
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

}  // namespace debias::trial
