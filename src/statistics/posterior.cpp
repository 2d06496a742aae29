#include "statistics/posterior.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

#include <debias/core/stream.hpp>

#include "core/infinity.hpp"

namespace debias::statistics {
namespace {

constexpr std::int64_t fewest_draws = 64;  // of a failure
constexpr std::int64_t many_draws = 512;   // of a failure that silences the levels below
constexpr std::int64_t draws_for_heavy = 1024;
constexpr double heavy_z = 1;
constexpr double light_z = -1.5;
constexpr double light_index = 0.25;  // below, errors fall like n^-1/2
constexpr double most_index = 0.49;   // and above at least like n^-(1 - 2 k)
constexpr double most_rarity = 0x1p60;
constexpr double most_error = 3;  // octaves of a usable level

LevelTail tail_of(const LevelFacts& f) {
  if (f.second_moment == 0 || std::isnan(f.tail_index)) return LevelTail::light;
  const double z = (f.tail_index - 0.5) / f.tail_error;
  if (z > heavy_z && f.draws >= draws_for_heavy) return LevelTail::heavy;
  return z > light_z ? LevelTail::unclear : LevelTail::light;
}

// The weighted line through log2 kappa of the levels that show theirs.
class RarityLine {
 public:
  explicit RarityLine(std::span<const LevelVoice> voices) {
    double weight = 0;
    int count = 0;
    for (const LevelVoice& v : voices) {
      if (!(v.raw_hits >= 2 * few)) continue;
      const double w = std::min(v.raw_hits, 1000.0);
      weight += w;
      middle_ += w * static_cast<double>(v.level);
      height_ += w * v.log2_rarity;
      ++count;
    }
    known_ = count >= 2;
    if (!known_) return;
    middle_ /= weight;
    height_ /= weight;
    double xx = 0;
    double xy = 0;
    for (const LevelVoice& v : voices) {
      if (!(v.raw_hits >= 2 * few)) continue;
      const double x = static_cast<double>(v.level) - middle_;
      const double w = std::min(v.raw_hits, 1000.0);
      xx += w * x * x;
      xy += w * x * v.log2_rarity;
    }
    if (xx > 0) slope_ = xy / xx;
  }
  [[nodiscard]] double at(std::int64_t level) const {
    if (!known_) return 1;
    return std::clamp(std::exp2(std::min(61.0, height_ + slope_ * (static_cast<double>(level) - middle_))), 1.0,
                      most_rarity);
  }

 private:
  bool known_ = false;
  double middle_ = 0;
  double height_ = 0;
  double slope_ = 0;
};

// Of draws that are all the same.
bool is_constant(const LevelFacts& f) {
  constexpr double rounding = 1e-9;
  return std::abs(f.kurtosis - 1) <= rounding && std::abs(f.mean * f.mean / f.second_moment - 1) <= rounding;
}

// Differences that many draws of several levels, and all others, have shown not to be random: one draw says all of a level.
bool are_certain(std::span<const LevelFacts> facts) {
  constexpr int several = 3;
  int shown = 0;
  for (const LevelFacts& f : facts) {
    if (f.is_base || f.draws == 0 || f.second_moment == 0) continue;
    if (!is_constant(f)) return false;
    shown += f.draws >= fewest_draws;
  }
  return shown >= several;
}

}  // namespace

void drop_rounding(LevelFacts& f) {
  constexpr double rounding = 64 * std::numeric_limits<double>::epsilon();
  if (f.is_base || !(f.second_moment <= rounding * rounding * f.value_square)) return;
  f.mean = f.second_moment = f.kurtosis = 0;
  if (!std::isnan(f.nonzero)) f.nonzero = 0;
}

std::vector<LevelVoice> voices_of(std::span<const LevelFacts> facts) {
  std::vector<LevelVoice> voices;
  for (const LevelFacts& f : facts) {
    LevelVoice v;
    v.level = f.level;
    v.log2_second = std::numeric_limits<double>::quiet_NaN();
    if (f.is_base) {
      v.log2_second = std::log2(f.second_moment);
    } else if (f.second_moment == 0) {
      v.log2_second = -infinity;
    } else if (!std::isfinite(f.second_moment) || !std::isfinite(f.kurtosis)) {
      v.tail = LevelTail::heavy;
    } else if (f.kurtosis > 0) {
      v.log2_second = std::log2(f.second_moment);
      v.log2_rarity = std::max(0.0, std::log2(f.kurtosis));
      v.raw_hits = static_cast<double>(f.draws) / std::max(1.0, f.kurtosis);
      v.tail = tail_of(f);
    }
    voices.push_back(v);
  }
  std::vector<std::size_t> levels;
  for (std::size_t i = 0; i < facts.size(); ++i) {
    if (!facts[i].is_base) levels.push_back(i);
  }
  const RarityLine line(voices);
  const bool certain = are_certain(facts);
  bool started = false;
  bool ended = false;
  int failures = 0;
  for (std::size_t j = 0; j < levels.size(); ++j) {
    LevelVoice& v = voices[levels[j]];
    const LevelFacts& f = facts[levels[j]];
    if (!(v.raw_hits > 0)) continue;
    double rarity = line.at(v.level);
    for (std::size_t near = j > 0 ? j - 1 : 0; near < std::min(levels.size(), j + 2); ++near) {
      const LevelVoice& n = voices[levels[near]];
      if (n.raw_hits > 0) rarity = std::max(rarity, std::exp2(n.log2_rarity));
    }
    const auto draws = static_cast<double>(f.draws);
    v.hits = certain ? std::max(draws, static_cast<double>(fewest_draws)) : std::min(v.raw_hits, draws / rarity);
    if (v.hits < few) {
      if (f.draws < fewest_draws) continue;
      ++failures;
      // Deeper levels look usable only because they missed what is rare.
      if (started && (failures >= 2 || f.draws >= many_draws)) ended = true;
      continue;
    }
    failures = 0;
    if (ended || v.tail == LevelTail::heavy) continue;
    started = true;
    double error = 1 / std::sqrt(v.hits);
    if (f.tail_index > light_index) {
      error = std::max(error, std::pow(draws, -(1 - 2 * std::min(f.tail_index, most_index))));
    }
    error *= octaves;
    if (error < most_error) v.error = error;
  }
  return voices;
}

namespace {

constexpr std::array taus = {0.0, .001, .003, .01, .03, .1, .3, 1.0, 3.0, 10.0, 30.0};
constexpr std::array omegas = {.03, .1, .3, 1.0, 3.0};
constexpr std::array settlings = {0.0, .5, 1.0};
constexpr double typical = 0.1;         // of tau and omega: small changes are likelier than large ones
constexpr double slope_variance = 100;  // before anything is seen
constexpr double polynomial_prior = 0.3;
constexpr std::size_t course_count = 512;
constexpr double declared_error = 0.15;
constexpr double declared_drift = 0.3;  // of the drift that the limit is free by
constexpr double contradiction_z = 3;
constexpr double contradiction_slack = 0.1;
// Octaves that the last levels may be off declared rates which they support, and at most this part of them.
constexpr double not_there_yet = 0.5;
constexpr double part_of_declared = 0.25;

// The filtered state of one point of the grid.
struct State {
  double b = 0;
  double s = 0;
  double bb = 0;  // covariance
  double bs = 0;
  double ss = 0;
  double log_weight = 0;
  double tau = 0;  // at the last level
  double omega = 0;
  bool polynomial = false;
};

State filter(std::span<const Observation> seen, double tau, double omega, double q, bool polynomial) {
  const auto x = [&](std::size_t i) { return polynomial ? std::log2(seen[i].level + 1) : seen[i].level; };
  State t;
  t.b = seen[0].value;
  t.bb = seen[0].error * seen[0].error + omega * omega;
  t.ss = slope_variance;
  const double first = x(0);
  double last = first;
  for (std::size_t i = 1; i < seen.size(); ++i) {
    const double here = x(i);
    const double dx = here - last;
    const double noise = tau * tau * (q == 0 ? 1 : std::exp2(-2 * q * (last - first)));
    t.b -= t.s * dx;
    t.bb += dx * (-2 * t.bs + dx * t.ss) + noise * dx * dx * dx / 3;
    t.bs += -dx * t.ss - noise * dx * dx / 2;
    t.ss += noise * dx;
    const double variance = t.bb + seen[i].error * seen[i].error + omega * omega;
    const double e = seen[i].value - t.b;
    t.log_weight -= 0.5 * std::log(variance) + 0.5 * e * e / variance;
    const double gain = t.bb / variance;
    const double slope_gain = t.bs / variance;
    t.b += gain * e;
    t.s += slope_gain * e;
    t.ss -= slope_gain * t.bs;
    t.bs -= gain * t.bs;
    t.bb -= gain * t.bb;
    last = here;
  }
  t.log_weight -= 0.5 * std::log1p(tau / typical) + 0.5 * std::log1p(omega / typical);
  if (polynomial) t.log_weight += std::log(polynomial_prior);
  t.tau = tau * std::exp2(-q * (last - first));
  t.omega = omega;
  t.polynomial = polynomial;
  return t;
}

// Pairs of normal numbers that fill the plane evenly [Roberts 2018].
const std::array<std::array<double, 2>, course_count>& normals() {
  static const auto table = [] {
    constexpr double g = 1.32471795724474602596;
    std::array<std::array<double, 2>, course_count> all{};
    for (std::size_t i = 0; i < course_count; ++i) {
      const auto n = static_cast<double>(i) + 1;
      const auto fraction = [](double u) { return u - std::floor(u); };
      all[i] = {normal_quantile(fraction(0.5 + n / g)), normal_quantile(fraction(0.5 + n / (g * g)))};
    }
    return all;
  }();
  return table;
}

}  // namespace

namespace {

// The fall over the last four levels, in the unit of the rates, by least squares. Of one level nothing is known.
FittedRate shown_by(std::span<const Observation> seen, bool polynomial) {
  const std::span<const Observation> last = seen.last(std::min<std::size_t>(seen.size(), 4));
  const auto x = [&](const Observation& o) { return polynomial ? std::log2(o.level + 1) : o.level; };
  double middle = 0;
  for (const Observation& o : last) middle += x(o) / static_cast<double>(last.size());
  double xx = 0;
  double xy = 0;
  double errors = 0;
  for (const Observation& o : last) {
    const double dx = x(o) - middle;
    xx += dx * dx;
    xy += dx * o.value;
    errors += dx * dx * o.error * o.error;
  }
  if (!(xx > 0)) return {0, infinity};
  return {-xy / xx, std::sqrt(errors) / xx};
}

// The limits of courses whose slopes have drifted: `free` is what a limit is free by, geometric and polynomial.
void add_limits(std::vector<Course>& courses, const std::vector<double>& drifts, std::array<double, 2> free) {
  for (std::size_t i = 0; i < courses.size(); ++i) {
    Course& c = courses[i];
    c.limit_error = std::hypot(drifts[i] * std::sqrt(2.0), free[c.polynomial ? 1 : 0]) * (c.polynomial ? 0.7 : 1.0);
    // A third number for the limit, evenly and out of step with the other two.
    constexpr double step = 0.6180339887498949;
    const double v = 0.5 + step * static_cast<double>(i);
    c.limit = c.slope + c.limit_error * normal_quantile(v - std::floor(v) + 1e-12);
  }
}

}  // namespace

RatedCourses courses_of(std::span<const Observation> seen, bool may_be_polynomial,
                        const std::optional<Rates>& declared) {
  std::vector<State> states;
  for (int polynomial = 0; polynomial <= (may_be_polynomial ? 1 : 0); ++polynomial) {
    for (const double tau : taus) {
      for (const double omega : omegas) {
        for (const double q : settlings) states.push_back(filter(seen, tau, omega, q, polynomial == 1));
      }
    }
  }
  double largest = -infinity;
  for (const State& s : states) largest = std::max(largest, s.log_weight);
  double total = 0;
  for (State& s : states) total += s.log_weight = std::exp(s.log_weight - largest);

  const double levels = seen.back().level - seen.front().level + 1;
  const double octaves_seen = std::log2((seen.back().level + 1) / (seen.front().level + 1) + 1);
  RatedCourses rated;
  std::vector<Course>& courses = rated.courses;
  std::vector<double> drifts;
  std::size_t state = 0;
  double below = 0;
  for (std::size_t i = 0; i < course_count; ++i) {
    const double u = (static_cast<double>(i) + 0.5) / static_cast<double>(course_count) * total;
    while (state + 1 < states.size() && below + states[state].log_weight < u) below += states[state++].log_weight;
    const State& s = states[state];
    const auto& z = normals()[i];
    const double root = std::sqrt(std::max(s.bb, 1e-12));
    const double lower = s.bs / root;
    Course c;
    c.at_last = s.b + root * z[0];
    c.slope = s.s + lower * z[0] + std::sqrt(std::max(0.0, s.ss - lower * lower)) * z[1];
    c.scatter = s.omega;
    c.polynomial = s.polynomial;
    courses.push_back(c);
    drifts.push_back(s.tau);
  }
  const std::array<double, 2> free_by = {1 / levels, 1 / octaves_seen};
  // R3: declared rates hold in the limit.
  double narrowing = 1;
  if (declared && std::isfinite(declared->variance_decay)) {
    const bool polynomial = declared->decay == Decay::polynomial;
    double mean = 0;
    double square = 0;
    double drift = 0;
    double n = 0;
    for (std::size_t i = 0; i < courses.size(); ++i) {
      if (courses[i].polynomial != polynomial) continue;
      ++n;
      mean += courses[i].slope;
      square += courses[i].slope * courses[i].slope;
      drift += drifts[i] * drifts[i] * 2;
    }
    if (n > 0) {
      mean /= n;
      const double free = free_by[polynomial ? 1 : 0];
      const double spread = std::max(0.0, square / n - mean * mean) + 0.01;
      const double error = std::sqrt(spread + drift / n + free * free);
      if (std::abs(mean - declared->variance_decay) >
              contradiction_z * std::sqrt(spread) +
                  std::min(contradiction_slack, part_of_declared * declared->variance_decay) &&
          std::abs(mean - declared->variance_decay) > contradiction_z * error) {
        rated.contradiction = Contradiction{declared->variance_decay, mean, error};
      } else if (const FittedRate shown = shown_by(seen, polynomial);
                 std::abs(shown.value - declared->variance_decay) <
                 std::min(not_there_yet, part_of_declared * declared->variance_decay) + contradiction_z * shown.error) {
        rated.unaided = courses;
        add_limits(rated.unaided, drifts, free_by);
        narrowing = declared_drift;
        const double own = 1 / spread;
        const double stated = 1 / (declared_error * declared_error);
        const double centre = (own * mean + stated * declared->variance_decay) / (own + stated);
        const double shrink = std::sqrt(own / (own + stated));
        for (std::size_t i = 0; i < courses.size(); ++i) {
          if (courses[i].polynomial != polynomial) continue;
          courses[i].slope = centre + (courses[i].slope - mean) * shrink;
          drifts[i] = std::min(drifts[i], 0.1);
        }
        // They say of which kind the decay is, too.
        std::size_t same = 0;
        for (std::size_t i = 0; i < courses.size(); ++i) {
          if (courses[i].polynomial == polynomial) continue;
          while (courses[same % courses.size()].polynomial != polynomial) ++same;
          courses[i] = courses[same % courses.size()];
          drifts[i] = drifts[same % courses.size()];
          ++same;
        }
      }
    }
  }
  add_limits(courses, drifts, {narrowing * free_by[0], narrowing * free_by[1]});
  return rated;
}

std::vector<Course> courses_of(std::span<const Observation> seen, bool may_be_polynomial) {
  return courses_of(seen, may_be_polynomial, std::nullopt).courses;
}

Halves halves_of(std::span<const Observation> seen, double scatter) {
  const auto fall = [&](const Observation& from, const Observation& to) {
    const double steps = to.level - from.level;
    return FittedRate{(from.value - to.value) / steps, std::hypot(from.error, to.error, scatter) / steps};
  };
  const Observation& middle = seen[seen.size() / 2];
  return {fall(seen.front(), middle), fall(middle, seen.back())};
}

double chance_of_zeros(const LevelFacts& level, double draws) {
  if (!(level.second_moment > 0)) return 1;
  // Both by Cauchy and Schwarz; a run does not count what is not zero.
  double share = std::max(1 / level.kurtosis, level.mean * level.mean / level.second_moment);
  if (!std::isnan(level.nonzero)) share = std::max(share, level.nonzero);
  return std::isnan(share) ? 1 : std::exp(-share * draws);
}

double scatter_of(std::span<const Course> courses) {
  if (courses.empty()) return 0;
  std::vector<double> omega;
  for (const Course& c : courses) omega.push_back(c.scatter);
  const auto middle = omega.begin() + std::ssize(omega) / 2;
  std::nth_element(omega.begin(), middle, omega.end());
  return *middle;
}

Ahead::Way Ahead::way(double length) { return {length, std::exp2(-std::min(length, 50.0))}; }

Ahead::Ahead(std::int64_t last_usable, std::int64_t level)
    : level_(level),
      levels_(way(static_cast<double>(level) - static_cast<double>(last_usable))),
      octaves_(way(std::log2((static_cast<double>(level) + 1) / (static_cast<double>(last_usable) + 1)))) {}

Horizon horizon_of(std::int64_t last_usable) {
  Horizon h;
  for (std::int64_t i = 1; i <= 32; ++i) h.emplace_back(last_usable, last_usable + i);
  for (int i = 1; i <= 24; ++i) {
    h.emplace_back(last_usable, last_usable + static_cast<std::int64_t>(32 * std::exp2(i / 2.0) + 0.5));
  }
  return h;
}

double sum_beyond(const Course& c, std::int64_t last_usable, const Horizon& h, double factor,
                  std::span<const double> offsets, double lambda) {
  const auto term = [&](std::size_t i) {
    return std::exp2(std::clamp(factor * h[i].on(c) + offsets[i], -1000.0, 900.0));
  };
  double sum = 0;
  double before = 0;
  std::int64_t from = last_usable;
  for (std::size_t i = 0; i < h.size(); ++i) {
    const double here = term(i);
    const auto gap = static_cast<double>(h[i].level() - from);
    sum += gap == 1 ? here : gap * std::sqrt(before) * std::sqrt(here);  // a power between them, about
    if (gap > 1 && here < 1e-12 * sum) return sum;
    before = here;
    from = h[i].level();
  }
  const double per_level = c.polynomial ? lambda / static_cast<double>(from) : lambda * 0.6931471805599453;
  return sum + before / std::max(per_level, 1e-12);
}

}  // namespace debias::statistics
