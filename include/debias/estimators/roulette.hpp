#pragma once

// Russian roulette, the coupled sum: the terms of a series in order along one path, up to a random one.
//
//   Z = sum_{k=0}^{m} T_k + sum_{j=1}^{J} T_(m+j) / P(J' >= j),   J ~ pmf    [McLeish 2011; Rhee & Glynn 2015 (3)]
//
//   Notation: m = base_level (the terms 0 ... m are always taken), P(J' >= j) = pmf.tail(j).
// E Z = sum E T_k for every PMF that reaches every term, if sum E|T_k| < infinity. Finite variance needs the
// tail of the PMF to fall slower than E T_k^2 (more precisely, sum nu_k / tail_k < infinity with
// nu_k = ||I - I_(k-1)||^2 - ||I - I_k||^2), finite work needs it to be summable against the work of a term.
// Instead of a PMF a policy may decide from term to term: IndexRoulette before a term is drawn, RunningWeight
// after, by its size. With a base level they make a deterministic prefix ("CMF") [Georgiev et al. 2019].
// A probability that is negative or not finite throws std::domain_error; one above 1 keeps the term as 1 does.

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include <debias/core/estimator.hpp>
#include <debias/core/pmf.hpp>
#include <debias/core/reach.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/text.hpp>
#include <debias/estimators/common.hpp>
#include <debias/pmf/geometric.hpp>

namespace debias {

struct RouletteOptions {
  std::int64_t base_level = 0;
};

template <TermSequence S, Pmf P>
class Roulette {
 public:
  using value_type = decltype(std::declval<const S&>()(std::declval<Stream&>())().value);

  /// Throws std::invalid_argument for a negative base level, or a PMF that the terms refuse (`require`).
  Roulette(S terms, P pmf, const RouletteOptions& options)
      : terms_(std::move(terms)), pmf_(std::move(pmf)), base_level_(options.base_level) {
    detail::check_base_level("roulette", base_level_);
    if constexpr (DescribedPmf<P> && requires { terms_.require(pmf_.tail_exponent()); }) {
      terms_.require(pmf_.tail_exponent());
    }
  }

  template <Record R>
  Sample<value_type> operator()(Stream& rng, R& record) const {
    Stream pmf_stream = split(rng, Branch::pmf);
    return draw(level_at(pmf_stream.uniform()), rng, record);
  }

  /// The last level, for a uniform in (0, 1]; deep levels lie at small ones.
  [[nodiscard]] std::int64_t level_at(double u) const { return base_level_ + pmf_.sample(u); }

  /// The sample that ends at `last`.
  template <Record R>
  Sample<value_type> draw(std::int64_t last, const Stream& rng, R& record) const {
    Stream path = split_level(rng, 0);
    return draw_from(last, path, record);
  }

  /// One stream has all numbers of a sample, so it can be a point of a net.
  [[nodiscard]] static bool draws_from_one_stream() { return true; }

  /// The sample that ends at `last`, along the path of these numbers.
  template <Record R>
  Sample<value_type> draw_from(std::int64_t last, Stream& path, R& record) const {
    auto cursor = terms_(path);
    auto term = cursor();
    Sample<value_type> sample{std::move(term.value), term.work, last};
    detail::check_work(0, term.work);
    for (std::int64_t k = 1; k <= base_level_; ++k) {
      term = cursor();
      detail::check_work(k, term.work);
      sample.value = debias::sum(std::move(sample.value), term.value);
      sample.work += term.work;
    }
    record.base(base_level_, debias::as_scalar(sample.value), sample.work);
    for (std::int64_t level = base_level_ + 1; level <= last; ++level) {
      term = cursor();
      record.difference(level, debias::as_scalar(term.value), term.work);
      sample.value = debias::sum(std::move(sample.value),
                                 debias::scaled(std::move(term.value), inverse_weight(probability(level), level)));
      sample.work += term.work;
    }
    return sample;
  }

  /// What the term of a level is divided by.
  [[nodiscard]] double probability(std::int64_t level) const { return pmf_.tail(level - base_level_); }
  [[nodiscard]] SequenceFacts facts() const { return debias::facts_of(terms_); }
  [[nodiscard]] Reach reach(std::int64_t /*last*/) const {
    return detail::reach_of(terms_, pmf_, base_level_, base_level_);
  }
  /// Terms that are long paths ask for small chunks.
  [[nodiscard]] std::int64_t chunk() const requires StatesChunk<S> { return terms_.chunk(); }
  [[nodiscard]] const P& pmf() const { return pmf_; }
  [[nodiscard]] std::string describe() const { return detail::describe("roulette", pmf_, base_level_); }

 private:
  S terms_;
  P pmf_;
  std::int64_t base_level_;
};

/// Roulette estimator of the sum of `terms`; `pmf` is that of the number of terms beyond the base.
template <TermSequence S, Pmf P>
Roulette<S, P> roulette(S terms, P pmf, const RouletteOptions& options = {}) {
  return {std::move(terms), std::move(pmf), options};
}

/// The same with the PMF that the declared rates of the terms ask for.
/// Throws std::invalid_argument when there is none, or when it is not geometric.
template <TermSequence S>
requires DeclaresRates<S> Roulette<S, Geometric> roulette(S terms, const RouletteOptions& options = {}) {
  const Rates rates = terms.rates;
  return {std::move(terms), detail::default_pmf(rates), options};
}

// ---- policies: one decision a term

/// `policy(level)`, before the term of a level is drawn, or `policy(level, size)`, after it, with its
/// absolute value over the probability so far: the probability to keep the term, above 0 wherever it or a
/// later one is not zero.
template <class C>
concept EarlyPolicy = requires(const C& c, std::int64_t level) {
  { c(level) } -> std::same_as<double>;
};
template <class C>
concept LatePolicy = requires(const C& c, std::int64_t level, double size) {
  { c(level, size) } -> std::same_as<double>;
};
template <class C>
concept RoulettePolicy = EarlyPolicy<C> || LatePolicy<C>;

/// On to term k with probability min(1, c / k): for terms like c^k / k!.
struct IndexRoulette {
  double c;

  /// Throws std::invalid_argument unless c is positive and finite.
  explicit IndexRoulette(double factor) : c(factor) {
    if (c > 0 && std::isfinite(c)) return;
    throw std::invalid_argument("IndexRoulette: c = " + detail::format("%f", c) + " (must be positive and finite)");
  }
  double operator()(std::int64_t level) const { return std::min(1.0, c / static_cast<double>(level)); }
  [[nodiscard]] static TailExponent tail_exponent() { return {Rates::faster_than_any}; }
  [[nodiscard]] std::string spec() const { return "index:c=" + detail::format("%f", c); }
};

/// Keeps a term with probability min(1, size / reference) ("cumulative"): kept ones have at least the size of
/// the reference, which is best that of the first term. At a term of zero it goes on in half of the cases,
/// unless the cursor says that nothing can follow (`ended()`): a coefficient may be zero and the next one
/// not.
class RunningWeight {
 public:
  /// Throws std::invalid_argument unless the reference is positive and finite.
  explicit RunningWeight(double size_of_first_term) : reference_(size_of_first_term), inverse_(1 / size_of_first_term) {
    if (reference_ > 0 && std::isfinite(reference_) && std::isfinite(inverse_)) return;
    throw std::invalid_argument("RunningWeight: reference = " + detail::format("%f", reference_) +
                                " (must be positive and finite: the size of the first term, say)");
  }
  double operator()(std::int64_t /*level*/, double size) const {
    if (size > 0) return std::min(1.0, size * inverse_);
    return size == 0 ? 0.5 : std::numeric_limits<double>::quiet_NaN();  // no size: PolicyRoulette throws
  }
  [[nodiscard]] std::string spec() const { return "running-weight:reference=" + detail::format("%f", reference_); }

 private:
  double reference_;
  double inverse_;
};

/// Z = sum_(k <= m) T_k + sum_(k > m) T_k / (P_(m+1) ... P_k) while the policy keeps the terms, P_k its
/// probabilities.
template <TermSequence S, RoulettePolicy C>
class PolicyRoulette {
 public:
  using value_type = sequence_value_t<S>;

  /// Throws std::invalid_argument for a negative base level, or a policy that the terms refuse (`require`).
  PolicyRoulette(S terms, C policy, const RouletteOptions& options)
      : terms_(std::move(terms)), policy_(std::move(policy)), base_level_(options.base_level) {
    detail::check_base_level("roulette", base_level_);
    if constexpr (requires { terms_.require(policy_.tail_exponent()); }) {
      terms_.require(policy_.tail_exponent());
    }
  }

  /// Throws std::length_error where 10^9 terms are not enough: they do not fall.
  template <Record R>
  Sample<value_type> operator()(Stream& rng, R& record) const {
    Stream decisions = split(rng, Branch::pmf);
    Stream path = split_level(rng, 0);
    auto cursor = terms_(path);
    auto term = cursor();
    Sample<value_type> sample{std::move(term.value), term.work, base_level_};
    detail::check_work(0, term.work);
    for (std::int64_t k = 1; k <= base_level_; ++k) {
      term = cursor();
      detail::check_work(k, term.work);
      sample.value = debias::sum(std::move(sample.value), term.value);
      sample.work += term.work;
    }
    record.base(base_level_, debias::as_scalar(sample.value), sample.work);
    double weight = 1;
    for (std::int64_t level = base_level_ + 1; level - base_level_ <= most_terms; ++level) {
      if constexpr (!LatePolicy<C>) {
        if (!keep(policy_(level), level, decisions, weight)) return sample;
      }
      term = cursor();
      const double size = debias::as_scalar(term.value);
      record.difference(level, size, term.work);
      sample.level = level;
      sample.work += term.work;
      if constexpr (LatePolicy<C>) {
        if constexpr (requires {
                        { cursor.ended() } -> std::same_as<bool>;
                      }) {
          if (size == 0 && cursor.ended()) return sample;
        }
        // What is not finite must reach the mean, and has no probability.
        if (std::isfinite(size) && !keep(policy_(level, std::abs(size) * weight), level, decisions, weight)) {
          return sample;
        }
      }
      sample.value = debias::sum(std::move(sample.value), debias::scaled(std::move(term.value), weight));
      if (!std::isfinite(size)) return sample;
    }
    throw std::length_error("roulette: the policy goes on after 10^9 terms (they do not fall); take a PMF");
  }

  [[nodiscard]] std::string describe() const {
    std::string name = "user-defined policy";
    if constexpr (requires {
                    { policy_.spec() } -> std::same_as<std::string>;
                  })
      name = policy_.spec();
    return "roulette, " + name + ", base level " + std::to_string(base_level_);
  }

 private:
  static constexpr std::int64_t most_terms = 1'000'000'000;

  // Plays for one term, and divides the weight by the probability of going on.
  static bool keep(double probability, std::int64_t level, Stream& decisions, double& weight) {
    if (!(probability >= 0 && probability <= std::numeric_limits<double>::max())) [[unlikely]]
      refuse(probability, level);
    if (probability >= 1) return true;
    if (!(decisions.uniform() < probability)) return false;
    weight /= probability;
    return true;
  }

  [[noreturn]] static void refuse(double probability, std::int64_t level) {
    throw std::domain_error("roulette: the policy keeps the term of level " + std::to_string(level) +
                            " with probability " + detail::format("%g", probability) +
                            " (must lie in [0, 1]; 0 ends the sum)");
  }

  S terms_;
  C policy_;
  std::int64_t base_level_;
};

/// Roulette on the sum of `terms`, decided term by term by a policy.
template <TermSequence S, RoulettePolicy C>
PolicyRoulette<S, C> roulette(S terms, C policy, const RouletteOptions& options = {}) {
  return {std::move(terms), std::move(policy), options};
}

// What is none of these.
template <class S, class P>
requires(!(TermSequence<S> && (Pmf<P> || RoulettePolicy<P>)) &&
         !std::same_as<P, RouletteOptions>) auto roulette(const S& /*terms*/, const P& /*pmf*/,
                                                          const RouletteOptions& /*options*/ = {}) {
  return detail::refuse<detail::mistake_in_terms_and_pmf<S, P>(), S, P>();
}
template <class S>
requires(!(TermSequence<S> && DeclaresRates<S>)) auto roulette(const S& /*terms*/,
                                                               const RouletteOptions& /*options*/ = {}) {
  return detail::refuse<detail::mistake_in_rated_terms<S>(), S>();
}

}  // namespace debias
