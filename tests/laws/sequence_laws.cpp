#include "laws/sequence_laws.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <initializer_list>
#include <sstream>
#include <string>
#include <utility>

#include <debias/core/accumulator.hpp>

namespace debias::laws::detail {
namespace {

/// What n draws of one random value say, component by component.
struct Means {
  std::vector<Moments> components;
  double work = 0;
  bool work_is_positive = true;
};

double second_moment(const Moments& m) { return m.mean * m.mean + m.m2 / static_cast<double>(m.count); }
double second_moment(const Means& means) {
  double sum = 0;
  for (const Moments& m : means.components) sum += second_moment(m);
  return sum;
}

bool equal_bits(const Numbers& a, const Numbers& b) {
  const auto same = [](double x, double y) {
    return std::bit_cast<std::uint64_t>(x) == std::bit_cast<std::uint64_t>(y);
  };
  return same(a.work, b.work) &&
         std::equal(a.components.begin(), a.components.end(), b.components.begin(), b.components.end(), same);
}

/// The components of the first, or of the second, of two values.
enum class Half { first, second };
std::span<const double> half_of(const Numbers& pair, Half half) {
  const std::span<const double> all = pair.components;
  return half == Half::first ? all.first(all.size() / 2) : all.last(all.size() / 2);
}

/// Least squares slope of log2 y over x.
double log2_slope(const std::vector<double>& x, const std::vector<double>& y) {
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

class SequenceLaws {
 public:
  SequenceLaws(const AnySequence& s, const SequenceLawOptions& options) : s_(s), options_(options) {}

  Failures check() {
    replay_and_base();
    for (std::int64_t k = options_.first; k <= options_.last; ++k) {
      const auto draw = [this, k](Stream& rng) { return s_.draw(k, rng); };
      values_.push_back(draw_means(k, 0, draw, Half::first));
      differences_.push_back(draw_means(k, 1, draw, Half::second));
      work_is_positive("level " + std::to_string(k), values_.back());
      work_is_positive("level " + std::to_string(k), differences_.back());
    }
    telescoping();
    same_means();
    batches();
    if (s_.rates && options_.rates) declared_rates(*s_.rates);
    return std::move(failures_);
  }

 private:
  void fail(const std::string& what) { failures_.push_back(what); }

  const Means& value(std::int64_t k) const { return values_[static_cast<std::size_t>(k - options_.first)]; }
  const Means& difference(std::int64_t k) const { return differences_[static_cast<std::size_t>(k - options_.first)]; }

  /// The means of one value, or of one of two, over independent samples; every (purpose, level) has streams of its own.
  template <class Evaluate>
  Means draw_means(std::int64_t level, std::uint64_t purpose, const Evaluate& evaluate,
                   std::optional<Half> half = {}) const {
    Means means;
    std::vector<std::vector<double>> columns;
    for (std::int64_t i = 0; i < options_.samples; ++i) {
      Stream rng = split_level(Stream(options_.seed, static_cast<std::uint64_t>(i)).split(purpose), level);
      const Numbers all = evaluate(rng);
      const std::span<const double> one = half ? half_of(all, *half) : std::span<const double>(all.components);
      if (columns.empty()) columns.resize(one.size());
      for (std::size_t c = 0; c < columns.size(); ++c) columns[c].push_back(one[c]);
      means.work += all.work / static_cast<double>(options_.samples);
      means.work_is_positive = means.work_is_positive && all.work > 0 && std::isfinite(all.work);
    }
    for (const auto& column : columns) means.components.push_back(Moments::of(column));
    return means;
  }

  template <class Evaluate>
  void replays(const std::string& what, const Evaluate& evaluate) {
    for (std::uint64_t i = 0; i < 8; ++i) {
      Stream one(options_.seed, i);
      Stream two(options_.seed, i);
      const Numbers a = evaluate(one);
      const Numbers b = evaluate(two);
      if (!equal_bits(a, b)) return fail(what + ": a replay of sample " + std::to_string(i) + " gives other bits");
      if (one.bits() != two.bits()) return fail(what + ": a replay uses another number of random numbers");
    }
  }

  void replay_and_base() {
    for (std::int64_t k = options_.first; k <= options_.last; ++k) {
      const std::string level = "level " + std::to_string(k);
      const auto replayed = [&](const char* what, const AnySequence::One& one) {
        if (one) replays(what + level, [&one, k](Stream& rng) { return one(k, rng); });
      };
      replayed("", s_.draw);
      replayed("value_at, ", s_.value_at);
      replayed("difference_at, ", s_.difference_at);
      if (s_.shared && k > 0) replays("shared, " + level, [this, k](Stream& rng) { return s_.shared(k, k - 1, rng); });
    }
    if (options_.first > 0) return;
    for (std::uint64_t i = 0; i < 8; ++i) {
      Stream rng(options_.seed, i);
      const Numbers d = s_.draw(0, rng);
      const auto half = [&d](Half h) {
        const std::span<const double> x = half_of(d, h);
        return Numbers{{x.begin(), x.end()}, d.work};
      };
      if (!equal_bits(half(Half::first), half(Half::second))) return fail("level 0: the difference is not the value");
    }
  }

  /// Each number of each member against what its stream gives alone, for batches of several sizes.
  void batches() {
    for (const std::size_t size : {std::size_t{1}, std::size_t{3}, std::size_t{20}, StreamBatch::capacity}) {
      for (std::int64_t k = options_.first; k <= options_.last; ++k) {
        const std::string where = "level " + std::to_string(k) + ", batch of " + std::to_string(size);
        const auto together = [&](const std::string& what, const AnySequence::Batch& many,
                                  const AnySequence::One& one) {
          if (!many) return;
          batch(
              what + where, k, size, [&](StreamBatch& streams) { return many(k, streams, size); },
              [&](Stream& rng) { return one(k, rng); });
        };
        together("values, ", s_.values, s_.value);
        together("differences, ", s_.differences, s_.difference);
        for (std::int64_t m = options_.first; s_.shared_batch && m < k; ++m) {
          batch(
              "shared, base " + std::to_string(m) + ", " + where, k, size,
              [&](StreamBatch& streams) { return s_.shared_batch(k, m, streams, size); },
              [&](Stream& rng) { return s_.shared(k, m, rng); });
        }
      }
    }
  }

  template <class Together, class Alone>
  void batch(const std::string& what, std::int64_t level, std::size_t size, const Together& together,
             const Alone& alone) {
    const Stream sample(options_.seed, 1);
    StreamBatch streams(sample, 5, size, static_cast<std::uint64_t>(level));
    const std::vector<Numbers> out = together(streams);
    for (std::size_t b = 0; b < size; ++b) {
      Stream rng = split_level(sample.split(5 + b), level);
      const Numbers one = alone(rng);
      const Numbers& many = out[b];
      double scale = std::abs(value(level).components[0].mean);
      for (const double x : one.components) scale = std::max(scale, std::abs(x));
      bool same = one.work == many.work;
      for (std::size_t i = 0; i < one.components.size(); ++i) {
        same = same && std::abs(one.components[i] - many.components[i]) <= options_.rounding * scale;
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
      const std::string level = std::to_string(k);
      if (s_.value_at) {
        const Means means = draw_means(k, 2, [this, k](Stream& rng) { return s_.value_at(k, rng); });
        work_is_positive("value_at, level " + level, means);
        equal_sums("E value_at(" + level + ") = E I_" + level, {&means}, {&value(k)});
      }
      if (s_.difference_at) {
        const Means means = draw_means(k, 3, [this, k](Stream& rng) { return s_.difference_at(k, rng); });
        work_is_positive("difference_at, level " + level, means);
        equal_sums("E difference_at(" + level + ") = E D_" + level, {&means}, {&difference(k)});
      }
    }
    if (s_.shared) {
      for (std::int64_t m = options_.first; m <= std::min(options_.first + 2, options_.last - 1); ++m) {
        for (std::int64_t n = m + 1; n <= std::min(m + 3, options_.last); ++n) shared(n, m);
      }
    }
  }

  void shared(std::int64_t n, std::int64_t m) {
    const std::uint64_t purpose = 4 + 2 * static_cast<std::uint64_t>(m);
    const auto draw = [this, n, m](Stream& rng) { return s_.shared(n, m, rng); };
    const Means bases = draw_means(n, purpose, draw, Half::first);
    const Means corrections = draw_means(n, purpose + 1, draw, Half::second);
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

  const AnySequence& s_;
  SequenceLawOptions options_;
  Failures failures_;
  std::vector<Means> values_;
  std::vector<Means> differences_;
};

}  // namespace

Failures sequence_laws(const AnySequence& sequence, const SequenceLawOptions& options) {
  return SequenceLaws(sequence, options).check();
}

}  // namespace debias::laws::detail
