// What the levels say of a run under a PMF: is its variance finite, and what of it has nobody seen?

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <debias/statistics/evidence.hpp>

#include "statistics/posterior.hpp"

namespace debias {
namespace {

using statistics::few;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double shown_p = 0.005;
constexpr double likely_p = 0.1;
constexpr double most_unseen = 0.75;  // of the variance
constexpr double most_doubt = 20;     // of an unseen variance, relative and squared
constexpr double least_mass = 1e-300;

// log2 p at any level: beyond the table it goes on as it ends.
class Logarithms {
 public:
  explicit Logarithms(const Masses& masses) : first_(masses.first_level) {
    for (const double p : masses.mass) {
      if (!(p > least_mass)) break;
      log2_.push_back(std::log2(p));
    }
  }
  [[nodiscard]] bool empty() const { return log2_.size() < 2; }
  [[nodiscard]] std::int64_t first() const { return first_; }
  [[nodiscard]] std::int64_t last() const { return first_ + std::ssize(log2_) - 1; }
  [[nodiscard]] bool holds(std::int64_t level) const { return level >= first_ && level <= last(); }
  [[nodiscard]] double at(std::int64_t level) const {
    if (holds(level)) return log2_[static_cast<std::size_t>(level - first_)];
    const auto beyond = static_cast<double>(level - last());
    if (!power()) return log2_.back() - fall_at(last()) * beyond;
    const auto end = static_cast<double>(last()) + 1;
    return log2_.back() - exponent() * std::log2((end + beyond) / end);
  }
  // Octaves a level, over four levels.
  [[nodiscard]] double fall_at(std::int64_t level) const {
    const std::int64_t to = std::clamp(level, std::min(first_ + 1, last()), last());
    const std::int64_t from = std::max(first_, to - 4);
    return (at(from) - at(to)) / static_cast<double>(to - from);
  }
  void look_at(std::int64_t level) {
    near_ = std::min(last(), level);
    far_ = std::min(last(), 2 * near_);
  }
  // Falls like k^-exponent: ever more slowly.
  [[nodiscard]] bool power() const { return bend() < 0.7; }
  // Falls faster than any power of 2.
  [[nodiscard]] bool steep() const { return bend() > 1.3; }
  [[nodiscard]] double fall() const { return fall_at(near_); }
  [[nodiscard]] double exponent() const { return fall() * (static_cast<double>(near_) - 1) * 0.6931471805599453; }

 private:
  [[nodiscard]] double bend() const {
    const bool far_enough = static_cast<double>(far_) > 1.4 * static_cast<double>(near_);
    return far_enough ? fall_at(far_) / fall_at(near_) : 1;
  }
  std::int64_t first_;
  std::vector<double> log2_;
  std::int64_t near_ = 0;
  std::int64_t far_ = 0;
};

const LevelVoice* voice_at(const Evidence& e, std::int64_t level) {
  for (std::size_t i = 0; i < e.voices.size(); ++i) {
    if (!e.facts[i].is_base && e.voices[i].level == level) return &e.voices[i];
  }
  return nullptr;
}

// The contributions fall over the last third of the votes: nothing infinite to be seen.
bool do_not_fall(const std::vector<double>& contributions) {
  if (contributions.size() < 4) return false;
  const std::size_t third = std::max<std::size_t>(1, contributions.size() / 3);
  const auto mean = [&](std::size_t first, std::size_t last) {
    double sum = 0;
    for (std::size_t i = first; i < last; ++i) sum += contributions[i];
    return sum / static_cast<double>(last - first);
  };
  const std::size_t n = contributions.size();
  const double before = third < n - third ? mean(third, n - third) : mean(0, third);
  return mean(n - third, n) >= before - 0.3;
}

}  // namespace

SumVerdict judge(const Evidence& e, const Masses& masses) {
  using Value = SumVerdict::Value;
  SumVerdict v;
  if (e.end != End::none) {
    if (e.grade != Grade::open) v = {Value::finite, e.grade, 0, 0, -infinity};
    return v;
  }
  Logarithms p(masses);
  if (e.courses.empty() || p.empty()) return v;
  p.look_at(std::max(e.last_vote, p.first() + 1) + 8);

  std::vector<double> contributions;  // of levels that vote, in octaves
  std::vector<statistics::Observation> ratios;
  double seen = 0;
  for (const LevelVoice& voice : e.voices) {
    if (!voice.votes() || !p.holds(voice.level)) continue;
    contributions.push_back(voice.log2_second - p.at(voice.level));
    ratios.push_back({static_cast<double>(voice.level), contributions.back(), voice.error});
    seen += std::exp2(std::clamp(contributions.back(), -1000.0, 900.0));
  }
  // Beside a PMF that falls ever faster the ratio is what has a trend.
  std::vector<Course> courses = e.courses;
  const bool of_ratios = p.steep() && ratios.size() >= 3;
  if (of_ratios) {
    std::optional<Contradiction> none;
    courses = statistics::courses_of(ratios, false, std::nullopt, none);
  }
  const auto excess = [&](const Course& c, double slope) {
    if (of_ratios) return slope;
    if (p.power()) return c.polynomial ? slope - p.exponent() - 1 : (slope > 0 ? std::max(slope, 0.05) : -1);
    return c.polynomial ? -1 : slope - p.fall();
  };
  const statistics::Horizon horizon = statistics::horizon_of(e.last_vote);
  std::vector<double> offsets;
  for (const std::int64_t k : horizon.levels) offsets.push_back(of_ratios ? 0 : -p.at(k));
  std::vector<double> u;
  double diverges = 0;
  for (const Course& c : courses) {
    const bool sure = !of_ratios && (c.polynomial != p.power());
    const double mean = excess(c, c.slope);
    diverges += sure ? (mean > 0 ? 0.0 : 1.0) : statistics::normal_cdf(-mean / std::max(c.limit_error, 1e-12));
    v.growth -=
        (of_ratios ? c.slope : c.slope - (p.power() ? p.exponent() : p.fall())) / static_cast<double>(courses.size());
    const double l = excess(c, c.limit);
    if (!(l > 0)) {
      u.push_back(1);
      continue;
    }
    const double rest = statistics::sum_beyond(c, e.last_vote, horizon, 1, offsets, l);
    u.push_back(seen > 0 ? rest / (rest + seen) : 1);
  }
  v.diverges = diverges / static_cast<double>(courses.size());
  std::sort(u.begin(), u.end());
  v.unseen = u[static_cast<std::size_t>((1 - shown_p) * static_cast<double>(u.size() - 1) + 0.5)];

  if (v.diverges <= shown_p && v.unseen <= most_unseen && e.known >= 4) {
    v.value = Value::finite;
    v.grade = e.missing_moments ? Grade::likely : Grade::shown;
    return v;
  }
  if (v.diverges <= likely_p && e.known >= 3) {
    v.value = Value::finite;
    v.grade = Grade::likely;
    return v;
  }
  const std::size_t n = contributions.size();
  const bool drops = n >= 3 && contributions[n - 1] < contributions[n - 3] - 1;
  if (e.changes || e.missing_moments || drops || !do_not_fall(contributions) || e.known < 4) return v;
  if (v.diverges >= 1 - shown_p) {
    v.value = Value::infinite;
    v.grade = e.known >= 6 && (e.exponential_work || !e.polynomial) ? Grade::shown : Grade::likely;
  } else if (v.diverges >= 1 - likely_p && e.answer != Answer::open) {
    v.value = Value::infinite;
    v.grade = Grade::likely;
  }
  return v;
}

Doubt doubt_of(const Evidence& e, const Masses& masses, double members) {
  Doubt d;
  const Logarithms p(masses);
  if (masses.empty()) return d;
  double squares = 0;  // of the variances of the parts
  const auto add = [&](double& part, double variance, double relative) {
    part += variance;
    squares += variance * variance * relative;
  };
  for (const LevelFacts& f : e.facts) {
    if (!f.is_base || f.level >= masses.first_level || !(f.draws > 0)) continue;
    const double variance = std::isnan(f.value_variance) ? f.second_moment - f.mean * f.mean : f.value_variance;
    if (!(variance > 0) || !std::isfinite(variance)) continue;
    const double kurtosis = f.fourth_moment / (f.second_moment * f.second_moment);
    add(d.seen, variance / members,
        (std::isfinite(kurtosis) ? std::max(kurtosis, 3.0) : 3) / static_cast<double>(f.draws));
  }
  if (p.last() < p.first()) return d;
  const std::vector<Believed> all = believed(e, p.last());
  for (std::int64_t k = p.first(); k <= p.last(); ++k) {
    const double scale = p.at(k) + std::log2(members);
    const LevelVoice* voice = voice_at(e, k);
    if (voice != nullptr && voice->hits >= few && std::isfinite(voice->log2_second)) {
      const LevelFacts& f = e.facts[static_cast<std::size_t>(voice - e.voices.data())];
      const auto draws = static_cast<double>(f.draws);
      const double share = draws < 20 ? 1 : std::clamp(1 - f.mean * f.mean / f.second_moment, 0.0, 1.0);
      add(d.seen, share * std::exp2(std::clamp(voice->log2_second - scale, -1000.0, 900.0)),
          std::max(std::exp2(voice->log2_rarity), draws / voice->hits) / draws);
      continue;
    }
    const Believed& b = all[static_cast<std::size_t>(k)];
    if (!std::isfinite(b.log2_second)) continue;
    add(d.unseen, std::exp2(std::clamp(b.log2_second + b.error - scale, -1000.0, 900.0)),
        std::min(std::exp2(2 * b.error) - 1, most_doubt));
  }
  const double variance = d.seen + d.unseen;
  if (squares > 0) d.degrees = std::max(1.0, 2 * variance * variance / squares);
  return d;
}

}  // namespace debias
