// Second moments as they should be believed: measured, between measured levels, and beyond them; facts of levels put together.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <debias/statistics/evidence.hpp>

#include "statistics/posterior.hpp"

namespace debias {

using statistics::is_finite;
using statistics::is_zero;

namespace {

double mix(double a, std::int64_t m, double b, std::int64_t n) {
  if (m == 0 || std::isnan(a)) return n == 0 ? a : b;
  if (n == 0 || std::isnan(b)) return a;
  const double share = static_cast<double>(n) / static_cast<double>(m + n);
  return a + share * (b - a);
}

}  // namespace

std::vector<LevelFacts> together(std::span<const LevelFacts> a, std::span<const LevelFacts> b) {
  std::vector<LevelFacts> all;
  std::size_t i = 0;
  std::size_t j = 0;
  const auto before = [](const LevelFacts& x, const LevelFacts& y) {
    return std::pair(x.level, !x.is_base) < std::pair(y.level, !y.is_base);
  };
  while (i < a.size() || j < b.size()) {
    if (j == b.size() || (i < a.size() && before(a[i], b[j]))) {
      all.push_back(a[i++]);
    } else if (i == a.size() || before(b[j], a[i])) {
      all.push_back(b[j++]);
    } else {
      const LevelFacts& x = a[i++];
      const LevelFacts& y = b[j++];
      LevelFacts f = x;
      f.draws = x.draws + y.draws;
      f.mean = mix(x.mean, x.draws, y.mean, y.draws);
      f.second_moment = mix(x.second_moment, x.draws, y.second_moment, y.draws);
      const auto fourth = [&f](const LevelFacts& l) {  // beside the square of the second
        const double ratio = l.second_moment / f.second_moment;
        return f.second_moment > 0 ? l.kurtosis * ratio * ratio : 0;
      };
      f.kurtosis = mix(fourth(x), x.draws, fourth(y), y.draws);
      f.work = mix(x.work, x.draws, y.work, y.draws);
      f.value_variance = mix(x.value_variance, x.draws, y.value_variance, y.draws);
      f.value_square = mix(x.value_square, x.draws, y.value_square, y.draws);
      const auto share = [](const LevelFacts& l) { return l.second_moment > 0 ? l.nonzero : 0; };
      f.nonzero = mix(share(x), x.draws, share(y), y.draws);  // what one does not know the other does
      if (f.nonzero == 0 && f.second_moment > 0) f.nonzero = LevelFacts::unknown;
      if (std::isnan(x.tail_index) || (!std::isnan(y.tail_index) && y.draws > x.draws)) {
        f.tail_index = y.tail_index;
        f.tail_error = y.tail_error;
      }
      all.push_back(f);
    }
  }
  return all;
}

double log2_work(const Evidence& e, std::int64_t level) {
  const LevelFacts* below = nullptr;
  const LevelFacts* above = nullptr;
  for (const LevelFacts& f : e.facts) {
    if (!(f.work > 0)) continue;
    if (f.level <= level) below = &f;
    if (f.level >= level && above == nullptr) above = &f;
  }
  if (below != nullptr && below->level == level) return std::log2(below->work);
  if (below == nullptr) return above == nullptr ? 0 : std::log2(above->work);
  const double from = std::log2(below->work);
  const auto k = static_cast<double>(level);
  const auto k0 = static_cast<double>(below->level);
  if (above != nullptr) {
    return from + (std::log2(above->work) - from) * (k - k0) / (static_cast<double>(above->level) - k0);
  }
  return from + e.work.value * (e.exponential_work ? k - k0 : std::log2((k + 1) / (k0 + 1)));
}

double upper(const Evidence& e, const Believed& level) {
  constexpr double most_above = 2;
  double largest = level.log2_second;
  for (const LevelVoice& v : e.voices) {
    if (is_finite(v) && !is_zero(v)) largest = std::max(largest, v.log2_second);
  }
  const double up = std::min(level.error, 0.35 * level.error * level.error);
  return std::min(level.log2_second + up, largest + most_above);
}

std::vector<Believed> believed(const Evidence& e, std::int64_t last) {
  const auto size = static_cast<std::size_t>(last) + 1;
  std::vector<Believed> b(size);
  const auto at = [&](std::int64_t level) -> Believed& { return b[static_cast<std::size_t>(level)]; };
  std::vector<const LevelVoice*> usable;
  for (const LevelVoice& v : e.voices) {
    if (v.usable()) usable.push_back(&v);
  }
  const double scatter = statistics::scatter_of(e.courses);
  // Measured, and between measured ones: there the larger neighbour counts where levels scatter widely.
  constexpr double wide = 0.5;
  for (std::size_t i = 0; i < usable.size(); ++i) {
    if (usable[i]->level > last) break;
    at(usable[i]->level) = {usable[i]->log2_second, usable[i]->error};
    if (i + 1 == usable.size()) continue;
    const LevelVoice& from = *usable[i];
    const LevelVoice& to = *usable[i + 1];
    const double top = std::max(from.log2_second, to.log2_second);
    for (std::int64_t k = from.level + 1; k < std::min(to.level, last + 1); ++k) {
      const double s = static_cast<double>(k - from.level) / static_cast<double>(to.level - from.level);
      const double line = from.log2_second + s * (to.log2_second - from.log2_second);
      at(k) = {scatter > wide ? top : line, std::hypot(from.error + s * (to.error - from.error), scatter)};
    }
  }
  if (!e.courses.empty() && last > e.last_usable) {
    std::vector<double> paths(e.courses.size());
    std::int64_t previous = e.last_usable;
    for (std::int64_t k = e.last_usable + 1; k <= last;) {
      const statistics::Ahead ahead(e.last_usable, k);
      for (std::size_t i = 0; i < paths.size(); ++i) paths[i] = ahead.on(e.courses[i]);
      auto sorted = paths.begin();  // as far as that, none is larger than one behind it
      const auto quantile = [&](double q) {
        const auto nth = paths.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(paths.size()));
        std::nth_element(sorted, nth, paths.end());
        sorted = nth;
        return *nth;
      };
      const double median = quantile(0.5);
      at(k) = {median, std::hypot(std::max(quantile(0.84) - median, 0.1), scatter)};
      for (std::int64_t j = previous + 1; j < k; ++j) {
        const double s = static_cast<double>(j - previous) / static_cast<double>(k - previous);
        at(j) = {at(previous).log2_second + s * (at(k).log2_second - at(previous).log2_second),
                 at(previous).error + s * (at(k).error - at(previous).error)};
      }
      previous = k;
      if (k == last) break;
      k = std::min(last, statistics::node_after(e.last_usable, k));
    }
  }
  // Seen, but without a vote, or with too few others for a course: at least what was seen.
  for (std::size_t i = 0; i < e.facts.size(); ++i) {
    const LevelVoice& v = e.voices[i];
    if (e.facts[i].is_base || v.level > last || !is_finite(v) || is_zero(v)) continue;
    if (v.usable() && !e.courses.empty()) continue;  // measured
    Believed& here = at(v.level);
    if (v.log2_second - here.log2_second <= 2 * here.error) {  // as the course has it: both speak
      const double own = 2 * statistics::octaves / std::sqrt(std::max(v.hits, 0.25));
      const double weight = std::pow(here.error, 2) / (std::pow(here.error, 2) + own * own);
      const double together = here.log2_second + weight * (v.log2_second - here.log2_second);
      here = {std::max(together, v.log2_second), own * std::sqrt(weight)};
    } else {
      here = {v.log2_second, statistics::octaves / std::sqrt(std::max(v.raw_hits, 0.5))};
    }
  }
  const bool over = e.end != End::none && e.grade == Grade::shown;
  // Zeros: the rule of three. Too few usable levels for a course: as the work asks for.
  // Before the first difference: as large as the value.
  LevelFacts value;
  const LevelFacts* before = nullptr;
  for (const LevelFacts& f : e.facts) {
    if (!f.is_base || before != nullptr || !(f.value_variance > 0) || !std::isfinite(f.value_variance)) continue;
    value = f;
    value.second_moment = f.value_variance;
    value.nonzero = 1;
    before = &value;
  }
  const double fall = (e.exponential_work ? e.work.value : 0) + 0.4;
  for (std::int64_t k = 1; k <= last; ++k) {
    Believed& here = at(k);
    if (k <= e.lowest_base) {  // no part of an estimate, and no measure for what follows
      for (const LevelFacts& f : e.facts) {
        if (f.is_base || f.level != k || !(f.value_variance > 0) || !std::isfinite(f.value_variance)) continue;
        value = f;
        value.second_moment = f.value_variance;
        value.nonzero = 1;
        before = &value;
      }
      if (k < e.lowest_base) continue;
    }
    if (over && k > e.last_difference) {
      here = {};
      continue;
    }
    const LevelFacts* fact = nullptr;
    for (const LevelFacts& f : e.facts) {
      if (!f.is_base && f.level == k && f.draws > 0) fact = &f;
    }
    if (fact != nullptr && fact->second_moment > 0) {
      before = fact;
      continue;
    }
    if (fact != nullptr && before != nullptr) {  // a course may promise more than the zeros leave room for
      const double share = std::isnan(before->nonzero) ? 1 : std::max(before->nonzero, 1e-12);
      const double most = std::log2(before->second_moment / share * 3 / static_cast<double>(fact->draws));
      const bool has_course = std::isfinite(here.log2_second);
      if (!has_course || most < here.log2_second + here.error) here = {most, 0.01};
      continue;
    }
    if (std::isfinite(here.log2_second)) continue;
    if (fact == nullptr && before != nullptr && e.courses.empty() && e.end == End::none) {
      here = {std::max(at(k - 1).log2_second, std::log2(before->second_moment) - 900) - fall, 2};  // not of a zero
    }
  }
  return b;
}

}  // namespace debias
