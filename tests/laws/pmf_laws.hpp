#pragma once

// What every PMF of the random level must satisfy, as a list of the claims that failed:
//
//   CHECK(laws::pmf_laws(Geometric(0.6)) == laws::Failures{});
//
// masses: positive, the differences of the tails, and summing to them. inverse: sample(u) is the largest j
// with u <= tail(j), on both sides of every jump, at the smallest and largest uniforms, and falls with u.
// frequencies: chi-square of 10^5 samples against masses, expectation >= 25 in each bin, at p > 10^-6.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <boost/math/distributions/chi_squared.hpp>

#include <debias/core/pmf.hpp>
#include <debias/core/stream.hpp>

#include "failures.hpp"

namespace debias::laws {

/// Each claim is reported once, with the first level or u that contradicts it.
class Verdict {
 public:
  void require(bool holds, const std::string& claim, double where) {
    if (holds || (!failures_.empty() && failures_.back().rfind(claim, 0) == 0)) return;
    for (const std::string& failure : failures_) {
      if (failure.rfind(claim, 0) == 0) return;
    }
    failures_.push_back(claim + ", not so at " + std::to_string(where));
  }
  const Failures& failures() const { return failures_; }

 private:
  Failures failures_;
};

inline double relative_error(double got, double exact) { return std::abs(got - exact) / std::abs(exact); }

inline constexpr double rounding = std::numeric_limits<double>::epsilon();
inline constexpr double underflow = 1e-290;
inline constexpr std::int64_t level_end = std::int64_t{1} << 62;

/// Where tests of a PMF begin: the shallowest level that a uniform can reach.
template <debias::Pmf P>
std::int64_t first_level(const P& p) {
  return p.sample(1 - 0x1p-53);
}

/// Up to 2000 levels from the first one on, as long as tails are normal numbers.
template <debias::Pmf P>
std::int64_t last_level(const P& p) {
  const std::int64_t first = first_level(p);
  std::int64_t last = first;
  while (last < first + 2000 && p.tail(last + 1) >= underflow) ++last;
  return last;
}

template <debias::Pmf P>
void check_masses(const P& p, Verdict& verdict) {
  const std::int64_t first = first_level(p);
  const std::int64_t last = last_level(p);
  verdict.require(p.tail(0) == 1, "masses: tail(0) is 1", 0);
  verdict.require(p.tail(first) >= 1 - 0x1p-53, "masses: tail is 1 to rounding at the first level",
                  static_cast<double>(first));
  long double sum = p.tail(last + 1);
  for (std::int64_t j = last; j >= first; --j) {
    const double mass = p.mass(j);
    const double tail = p.tail(j);
    const double next = p.tail(j + 1);
    const auto where = static_cast<double>(j);
    sum += mass;
    verdict.require(mass > 0 && mass <= 1, "masses: in (0, 1]", where);
    verdict.require(next <= tail, "masses: tails fall", where);
    verdict.require(std::abs(tail - next - mass) <= 8 * rounding * tail, "masses: mass(j) = tail(j) - tail(j+1)",
                    where);
    verdict.require(std::abs(static_cast<double>(sum - tail)) <= 32 * rounding * tail,
                    "masses: tail(j) is the sum of the masses from j on", where);
  }
}

/// A level, or level_end where the PMF refuses, as it must for levels beyond 2^62 or beyond underflow.
template <debias::Pmf P>
std::int64_t sampled_level(const P& p, double u) {
  try {
    return p.sample(u);
  } catch (const std::length_error&) {
    return level_end;
  }
}

template <debias::Pmf P>
bool inverts(const P& p, double u) {
  const std::int64_t j = sampled_level(p, u);
  if (j == level_end) return u <= p.tail(level_end) || u < underflow;
  return j >= 0 && u <= p.tail(j) && u > p.tail(j + 1);
}

template <debias::Pmf P>
void check_inverse(const P& p, Verdict& verdict) {
  const std::string claim = "inverse: sample(u) is the largest j with u <= tail(j)";
  const std::int64_t last = last_level(p);
  for (std::int64_t j = first_level(p); j <= last; ++j) {
    const double tail = p.tail(j);
    for (const double u : {tail, std::nextafter(tail, 0.0), std::nextafter(tail, 1.0), (tail + p.tail(j + 1)) / 2}) {
      verdict.require(inverts(p, u), claim, u);
    }
  }
  std::vector<double> uniforms(1000);
  debias::Stream(2, 0).fill(uniforms);
  for (int bits = 1; bits <= 53; ++bits) {
    uniforms.push_back(std::ldexp(1.0, -bits));
    uniforms.push_back(1 - std::ldexp(1.0, -bits));
  }
  std::sort(uniforms.begin(), uniforms.end());
  std::int64_t deeper = level_end;
  for (const double u : uniforms) {
    const std::int64_t level = sampled_level(p, u);
    verdict.require(inverts(p, u), claim, u);
    verdict.require(level <= deeper, "inverse: sample(u) falls with u", u);
    deeper = level;
  }
}

template <debias::Pmf P>
void check_frequencies(const P& p, Verdict& verdict) {
  constexpr double samples = 1e5;
  std::vector<std::int64_t> levels;
  debias::Stream rng(3, 0);
  for (int i = 0; i < static_cast<int>(samples); ++i) levels.push_back(sampled_level(p, rng.uniform()));
  std::sort(levels.begin(), levels.end());

  // Neighbouring levels share a bin, more of them the deeper it lies; the last bin is the whole tail.
  std::int64_t begin = first_level(p);
  auto counted = levels.cbegin();
  double chi_square = 0;
  int bins = 0;
  const auto add_bin = [&](double expected, std::vector<std::int64_t>::const_iterator counted_end) {
    const auto observed = static_cast<double>(counted_end - counted);
    chi_square += (observed - expected) * (observed - expected) / expected;
    counted = counted_end;
    ++bins;
  };
  verdict.require(levels.front() >= begin, "frequencies: no level above the first", 0);
  const std::int64_t first = begin;
  while (begin < level_end / 4) {
    std::int64_t end = begin;
    double expected = 0;
    while (expected < 25 && end < level_end / 4) {
      const std::int64_t next = end + 1 + (end - first) / 8;
      if (next - end <= 64) {
        for (std::int64_t j = end; j < next; ++j) expected += samples * p.mass(j);
      } else {
        expected += samples * (p.tail(end) - p.tail(next));
      }
      end = next;
    }
    if (samples * p.tail(end) < 25) break;
    add_bin(expected, std::lower_bound(counted, levels.cend(), end));
    begin = end;
  }
  add_bin(samples * p.tail(begin), levels.cend());
  if (bins == 1) return;
  const boost::math::chi_squared law(bins - 1);
  const double p_value = std::isfinite(chi_square) ? cdf(complement(law, chi_square)) : 0.0;
  verdict.require(p_value > 1e-6, "frequencies: samples follow the masses", p_value);
}

/// All of the above.
template <debias::Pmf P>
Failures pmf_laws(const P& p) {
  Verdict verdict;
  check_masses(p, verdict);
  check_inverse(p, verdict);
  check_frequencies(p, verdict);
  return verdict.failures();
}

}  // namespace debias::laws
