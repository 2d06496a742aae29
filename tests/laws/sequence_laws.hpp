#pragma once

// The laws that every sequence of biased estimates must keep, as one call:
//
//   CHECK(laws::sequence_laws(s) == laws::Failures{});             // prints every broken law
//   CHECK(laws::sequence_laws(wrong_s) != laws::Failures{});       // the power check beside it
//
//   replay        the same (seed, index, level) gives the same bits and uses the same random numbers
//   base          at level 0 the difference is the value
//   work          is positive and finite
//   telescoping   E I_k - E I_(k-1) = E D_k, the three means from independent streams; where hooks give differences only,
//                 no run checks its coupling (core/coupling.hpp), and these laws alone do
//   same means    value_at(k), difference_at(k) and shared(N, m), where offered, mean what I_k and D_k mean
//   batches       values, differences and shared of many members, where offered, are those of one by one
//   rates         log2 E D_k^2 and log2 E work_k have the declared slopes over the upper levels
//
// Means are compared per component, at `z_limit` standard errors. What cannot be seen here: a coupling that
// keeps the means and only loses variance, when the sequence declares no rates.

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/value.hpp>

#include "failures.hpp"

namespace debias::laws {

struct SequenceLawOptions {
  std::int64_t first = 0;       // shallower levels are not looked at: their moments may be infinite
  std::int64_t last = 6;        // the deepest level
  std::int64_t samples = 4096;  // draws for every mean
  std::uint64_t seed = 20220811;
  double z_limit = 5.5;              // in standard errors; right for about 30 claims
  double rounding = 1e-14;           // relative to the numbers: the least standard error that is believed
  bool rates = true;                 // false: leave the declared rates alone
  std::int64_t rates_from = 2;       // the slopes are fitted over max(first, rates_from) ... last
  double variance_tolerance = 0.25;  // on the exponent of E D_k^2
  double work_tolerance = 0.15;      // on the exponent of the work
};

namespace detail {

/// What n draws of one random value say, component by component.
struct Means {
  std::vector<Moments> components;
  double work = 0;
  bool work_is_positive = true;
};

inline double second_moment(const Moments& m) { return m.mean * m.mean + m.m2 / static_cast<double>(m.count); }
inline double second_moment(const Means& means) {
  double sum = 0;
  for (const Moments& m : means.components) sum += second_moment(m);
  return sum;
}

/// What one evaluation produced, whatever it came from.
template <Value V>
struct Numbers {
  std::vector<V> values;
  double work;
};

template <Value V>
Numbers<V> numbers(const Draw<V>& d) {
  return {{d.value, d.difference}, d.work};
}
template <Value V>
Numbers<V> numbers(const Term<V>& t) {
  return {{t.value}, t.work};
}
template <Value V>
Numbers<V> numbers(const SharedDraw<V>& d) {
  return {{d.base, d.difference}, d.work};
}

template <Value V>
bool equal_bits(const V& a, const V& b) {
  if (component_count(a) != component_count(b)) return false;
  for (std::size_t i = 0; i < component_count(a); ++i) {
    if (std::bit_cast<std::uint64_t>(component(a, i)) != std::bit_cast<std::uint64_t>(component(b, i))) {
      return false;
    }
  }
  return true;
}

/// Least squares slope of log2 y over x.
inline double log2_slope(const std::vector<double>& x, const std::vector<double>& y) {
  const double n = static_cast<double>(x.size());
  double mean_x = 0;
  double mean_y = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mean_x += x[i] / n;
    mean_y += std::log2(y[i]) / n;
  }
  double xx = 0;
  double xy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mean_x) * (x[i] - mean_x);
    xy += (x[i] - mean_x) * (std::log2(y[i]) - mean_y);
  }
  return xy / xx;
}

template <BiasedSequence S>
class SequenceLaws {
 public:
  SequenceLaws(const S& s, const SequenceLawOptions& options) : s_(s), options_(options) {}

  Failures check() {
    replay_and_base();
    for (std::int64_t k = options_.first; k <= options_.last; ++k) {
      values_.push_back(draw_means(k, 0, [this, k](Stream& rng) {
        auto d = s_(k, rng);
        return Term<V>{std::move(d.value), d.work};
      }));
      differences_.push_back(draw_means(k, 1, [this, k](Stream& rng) {
        auto d = s_(k, rng);
        return Term<V>{std::move(d.difference), d.work};
      }));
      work_is_positive("level " + std::to_string(k), values_.back());
      work_is_positive("level " + std::to_string(k), differences_.back());
    }
    telescoping();
    same_means();
    batches();
    if constexpr (DeclaresRates<S>) {
      if (options_.rates) declared_rates(s_.rates);
    }
    return std::move(failures_);
  }

 private:
  using V = sequence_value_t<S>;

  void fail(const std::string& what) { failures_.push_back(what); }

  const Means& value(std::int64_t k) const { return values_[static_cast<std::size_t>(k - options_.first)]; }
  const Means& difference(std::int64_t k) const { return differences_[static_cast<std::size_t>(k - options_.first)]; }

  /// The means of a Term over independent samples; every (purpose, level) has streams of its own.
  template <class Evaluate>
  Means draw_means(std::int64_t level, std::uint64_t purpose, const Evaluate& evaluate) const {
    Means means;
    std::vector<std::vector<double>> columns;
    for (std::int64_t i = 0; i < options_.samples; ++i) {
      Stream rng = split_level(Stream(options_.seed, static_cast<std::uint64_t>(i)).split(purpose), level);
      const Term<V> t = evaluate(rng);
      if (columns.empty()) columns.resize(component_count(t.value));
      for (std::size_t c = 0; c < columns.size(); ++c) columns[c].push_back(component(t.value, c));
      means.work += t.work / static_cast<double>(options_.samples);
      means.work_is_positive = means.work_is_positive && t.work > 0 && std::isfinite(t.work);
    }
    for (const auto& column : columns) means.components.push_back(Moments::of(column));
    return means;
  }

  template <class Evaluate>
  void replays(const std::string& what, const Evaluate& evaluate) {
    for (std::uint64_t i = 0; i < 8; ++i) {
      Stream one(options_.seed, i);
      Stream two(options_.seed, i);
      const auto a = numbers(evaluate(one));
      const auto b = numbers(evaluate(two));
      bool same = std::bit_cast<std::uint64_t>(a.work) == std::bit_cast<std::uint64_t>(b.work);
      for (std::size_t n = 0; n < a.values.size(); ++n) same = same && equal_bits(a.values[n], b.values[n]);
      if (!same) return fail(what + ": a replay of sample " + std::to_string(i) + " gives other bits");
      if (one.bits() != two.bits()) return fail(what + ": a replay uses another number of random numbers");
    }
  }

  void replay_and_base() {
    for (std::int64_t k = options_.first; k <= options_.last; ++k) {
      const std::string level = "level " + std::to_string(k);
      replays(level, [this, k](Stream& rng) { return s_(k, rng); });
      if constexpr (OffersValueAt<S>) {
        replays("value_at, " + level, [this, k](Stream& rng) { return s_.value_at(k, rng); });
      }
      if constexpr (OffersDifferenceAt<S>) {
        replays("difference_at, " + level, [this, k](Stream& rng) { return s_.difference_at(k, rng); });
      }
      if constexpr (OffersSharedBase<S>) {
        if (k > 0) replays("shared, " + level, [this, k](Stream& rng) { return s_.shared(k, k - 1, rng); });
      }
    }
    if (options_.first > 0) return;
    for (std::uint64_t i = 0; i < 8; ++i) {
      Stream rng(options_.seed, i);
      const auto d = s_(0, rng);
      if (!equal_bits(d.value, d.difference)) return fail("level 0: the difference is not the value");
    }
  }

  /// Each number of each member against what its stream gives alone, for batches of several sizes.
  void batches() {
    for (const std::size_t size : {std::size_t{1}, std::size_t{3}, std::size_t{20}, StreamBatch::capacity}) {
      for (std::int64_t k = options_.first; k <= options_.last; ++k) {
        [[maybe_unused]] const std::string where = "level " + std::to_string(k) + ", batch of " + std::to_string(size);
        if constexpr (BatchesValues<S>) {
          batch<Term<V>>(
              "values, " + where, k, size, [&](auto& streams, auto out) { s_.values(k, streams, out); },
              [&](Stream& rng) { return value_of(s_, k, rng); });
        }
        if constexpr (BatchesDifferences<S>) {
          batch<Term<V>>(
              "differences, " + where, k, size, [&](auto& streams, auto out) { s_.differences(k, streams, out); },
              [&](Stream& rng) { return difference_of(s_, k, rng); });
        }
        if constexpr (BatchesShared<S>) {
          for (std::int64_t m = options_.first; m < k; ++m) {
            batch<SharedDraw<V>>(
                "shared, base " + std::to_string(m) + ", " + where, k, size,
                [&](auto& streams, auto out) { s_.shared(k, m, streams, out); },
                [&](Stream& rng) { return s_.shared(k, m, rng); });
          }
        }
      }
    }
  }

  template <class Draw, class Together, class Alone>
  void batch(const std::string& what, std::int64_t level, std::size_t size, const Together& together,
             const Alone& alone) {
    const Stream sample(options_.seed, 1);
    std::vector<Draw> out(size);
    StreamBatch streams(sample, 5, size, static_cast<std::uint64_t>(level));
    together(streams, std::span(out));
    for (std::size_t b = 0; b < size; ++b) {
      Stream rng = split_level(sample.split(5 + b), level);
      const auto one = numbers(alone(rng));
      const auto many = numbers(out[b]);
      double scale = std::abs(value(level).components[0].mean);
      for (const auto& x : one.values) scale = std::max(scale, std::abs(x));
      bool same = one.work == many.work;
      for (std::size_t i = 0; i < one.values.size(); ++i) {
        same = same && std::abs(one.values[i] - many.values[i]) <= options_.rounding * scale;
      }
      if (!same) return fail(what + ": member " + std::to_string(b) + " is another draw than alone");
    }
  }

  void work_is_positive(const std::string& what, const Means& means) {
    if (!means.work_is_positive) fail(what + ": work is not positive and finite");
  }

  /// Claims that the means on the left and on the right have equal sums.
  void equal_sums(const std::string& what, std::initializer_list<const Means*> left,
                  std::initializer_list<const Means*> right) {
    const std::size_t count = (*left.begin())->components.size();
    for (const auto& side : {left, right}) {
      for (const Means* m : side) {
        if (m->components.size() != count) return fail(what + ": the number of components differs");
      }
    }
    for (std::size_t c = 0; c < count; ++c) {
      double gap = 0;
      double variance = 0;
      double size = 0;
      const auto add = [&](const Moments& m, double sign) {
        gap += sign * m.mean;
        variance += m.standard_error() * m.standard_error();
        size += std::sqrt(second_moment(m));
      };
      for (const Means* m : left) add(m->components[c], 1);
      for (const Means* m : right) add(m->components[c], -1);
      if (gap == 0) continue;
      const double z = gap / std::max(std::sqrt(variance), options_.rounding * size);
      if (std::abs(z) <= options_.z_limit) continue;  // a NaN does not pass
      std::ostringstream text;
      text << what << ": off by " << gap << " = " << z << " standard errors";
      if (count > 1) text << " in component " << c;
      fail(text.str());
    }
  }

  void telescoping() {
    for (std::int64_t k = options_.first + 1; k <= options_.last; ++k) {
      const std::string i = std::to_string(k);
      const std::string j = std::to_string(k - 1);
      equal_sums("E I_" + i + " = E I_" + j + " + E D_" + i, {&value(k)}, {&value(k - 1), &difference(k)});
    }
  }

  void same_means() {
    for (std::int64_t k = options_.first; k <= options_.last; ++k) {
      [[maybe_unused]] const std::string level = std::to_string(k);
      if constexpr (OffersValueAt<S>) {
        const Means means = draw_means(k, 2, [this, k](Stream& rng) { return s_.value_at(k, rng); });
        work_is_positive("value_at, level " + level, means);
        equal_sums("E value_at(" + level + ") = E I_" + level, {&means}, {&value(k)});
      }
      if constexpr (OffersDifferenceAt<S>) {
        const Means means = draw_means(k, 3, [this, k](Stream& rng) { return s_.difference_at(k, rng); });
        work_is_positive("difference_at, level " + level, means);
        equal_sums("E difference_at(" + level + ") = E D_" + level, {&means}, {&difference(k)});
      }
    }
    if constexpr (OffersSharedBase<S>) {
      for (std::int64_t m = options_.first; m <= std::min(options_.first + 2, options_.last - 1); ++m) {
        for (std::int64_t n = m + 1; n <= std::min(m + 3, options_.last); ++n) shared(n, m);
      }
    }
  }

  void shared(std::int64_t n, std::int64_t m) requires OffersSharedBase<S> {
    const std::uint64_t purpose = 4 + 2 * static_cast<std::uint64_t>(m);
    const Means bases = draw_means(n, purpose, [this, n, m](Stream& rng) {
      auto d = s_.shared(n, m, rng);
      return Term<V>{std::move(d.base), d.work};
    });
    const Means corrections = draw_means(n, purpose + 1, [this, n, m](Stream& rng) {
      auto d = s_.shared(n, m, rng);
      return Term<V>{std::move(d.difference), d.work};
    });
    const std::string name = "shared(" + std::to_string(n) + ", " + std::to_string(m) + ")";
    work_is_positive(name, bases);
    equal_sums("E base of " + name + " = E I_" + std::to_string(m), {&bases}, {&value(m)});
    equal_sums("E difference of " + name + " = E D_" + std::to_string(n), {&corrections}, {&difference(n)});
  }

  /// One declared exponent against the slope of y over the level (or over its logarithm).
  void slope(const std::string& what, const std::vector<double>& x, const std::vector<double>& y, double declared,
             double tolerance) {
    const double measured = log2_slope(x, y);
    if (std::abs(measured - declared) <= tolerance) return;
    std::ostringstream text;
    text << what << " has exponent " << measured << ", declared is " << declared << " within " << tolerance;
    fail(text.str());
  }

  void declared_rates(const Rates& rates) {
    const bool polynomial = rates.decay == Decay::polynomial;
    std::vector<double> x;
    std::vector<double> work;
    std::vector<double> x_above;  // where the differences are more than rounding
    std::vector<double> squares;
    const std::int64_t from = std::max({options_.first, options_.rates_from, std::int64_t{1}});
    for (std::int64_t k = from; k <= options_.last; ++k) {
      const double at = polynomial ? std::log2(static_cast<double>(k)) : static_cast<double>(k);
      x.push_back(at);
      work.push_back(value(k).work);
      const double square = second_moment(difference(k));
      if (square <= options_.rounding * options_.rounding * second_moment(value(k))) continue;
      x_above.push_back(at);
      squares.push_back(square);
    }
    if (x.size() < 3) return fail("rates: fewer than three levels to fit, raise `last`");
    slope("work", x, work, rates.work_growth, options_.work_tolerance);
    if (x_above.size() < 3) return;  // zero, or down to rounding within a few levels
    if (rates.variance_decay < Rates::faster_than_any) {
      return slope("E D_k^2", x_above, squares, -rates.variance_decay, options_.variance_tolerance);
    }
    const std::size_t middle = x_above.size() / 2;
    const auto fall = [&](std::size_t i, std::size_t j) {
      return std::log2(squares[i] / squares[j]) / (x_above[j] - x_above[i]);
    };
    if (!(fall(middle, x_above.size() - 1) > fall(0, middle) + options_.variance_tolerance)) {
      fail("E D_k^2 is declared to fall faster than any rate, but its fall does not accelerate");
    }
  }

  const S& s_;
  SequenceLawOptions options_;
  Failures failures_;
  std::vector<Means> values_;
  std::vector<Means> differences_;
};

}  // namespace detail

/// Every broken law in words; empty when all are kept.
template <debias::BiasedSequence S>
Failures sequence_laws(const S& s, const SequenceLawOptions& options = {}) {
  return detail::SequenceLaws<S>(s, options).check();
}

}  // namespace debias::laws
