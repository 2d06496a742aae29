// What the levels say of a run under a PMF: is its variance finite, and what of it has nobody seen?

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include <debias/statistics/evidence.hpp>

#include "core/infinity.hpp"
#include "statistics/posterior.hpp"

namespace debias {
namespace {

using statistics::few;
using statistics::likely_p;
using statistics::shown_p;

constexpr double most_unseen_of_variance = 0.75;
constexpr double most_doubt =
    0.5;  // of an unseen variance, relative and squared: it stands at its mean, not at an estimate
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
    // A table that ends there shows no bend beyond: so deep that half as much follows.
    near_ = std::min({last(), level, std::max(first_ + 1, 2 * last() / 3)});
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

// The contributions fall over the last third of the usable levels: nothing infinite to be seen.
bool do_not_fall(const std::vector<double>& contributions, int by_rates) {
  if (std::ssize(contributions) + by_rates < 3) return false;
  if (contributions.size() <= 3) {  // every step up
    for (std::size_t i = 1; i < contributions.size(); ++i) {
      if (!(contributions[i] > contributions[i - 1] + 0.3)) return false;
    }
    return true;
  }
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

namespace {

// The courses of E D_k^2, or of E D_k^4, beside the first or the third power of the masses.
class Sum {
 public:
  Sum(const Evidence& e, const Logarithms& p, double power)
      : e_(e), p_(p), power_(power), courses_(e.courses), unaided_(e.unaided) {
    std::vector<statistics::Observation> own;
    std::vector<statistics::Observation> ratios;
    for (const LevelVoice& v : e.voices) {
      if (!v.usable()) continue;
      const bool second = power == 1;
      // E D^4 is known three times worse, at its best.
      const double moment = second ? v.log2_second : 2 * v.log2_second + v.log2_rarity;
      const double error = second ? v.error : 3 * v.error;
      const auto level = static_cast<double>(v.level);
      own.push_back({level, moment, error});
      if (!p.holds(v.level)) continue;
      contributions.push_back(moment - power * p.at(v.level));
      ratios.push_back({level, contributions.back(), error});
    }
    // Beside a PMF that falls ever faster the ratio is what has a trend.
    of_ratios_ = p.steep() && ratios.size() >= 3;
    if (of_ratios_) {
      turns_ = turns_up(ratios);
      unaided_ = {};
      courses_ = statistics::courses_of(ratios, false);
    } else if (power != 1) {
      courses_ = statistics::courses_of(own, !e.exponential_work);
    }
  }

  [[nodiscard]] double diverges() const { return diverges(courses_); }
  // The same without declared rates.
  [[nodiscard]] double diverges_unaided() const { return diverges(unaided_.empty() ? courses_ : unaided_); }
  [[nodiscard]] double growth() const {
    double sum = 0;
    for (const Course& c : courses_)
      sum += (of_ratios_ ? 0 : power_ * (p_.power() ? p_.exponent() : p_.fall())) - c.slope;
    return sum / static_cast<double>(courses_.size());
  }
  // The part of the sum in levels beyond the last usable one, at 99.5 %.
  [[nodiscard]] double unseen() const {
    double seen = 0;
    for (const double x : contributions) seen += std::exp2(std::clamp(x, -1000.0, 900.0));
    const statistics::Horizon horizon = statistics::horizon_of(e_.last_usable);
    std::vector<double> offsets;
    for (const statistics::Ahead& ahead : horizon) offsets.push_back(of_ratios_ ? 0 : -power_ * p_.at(ahead.level()));
    std::vector<double> u;
    for (const Course& c : courses_) {
      const double l = excess(c, c.limit);
      if (!(l > 0) || !(seen > 0)) {
        u.push_back(1);
        continue;
      }
      const double rest = statistics::sum_beyond(c, e_.last_usable, horizon, 1, offsets, l);
      u.push_back(rest / (rest + seen));
    }
    std::sort(u.begin(), u.end());
    return u[static_cast<std::size_t>((1 - shown_p) * static_cast<double>(u.size() - 1) + 0.5)];
  }

  // Levels that do not fall ever faster, as the PMF does: what falls today grows in the end.
  [[nodiscard]] bool turns() const { return turns_; }

  std::vector<double> contributions;  // of usable levels, in octaves

 private:
  [[nodiscard]] double diverges(std::span<const Course> courses) const {
    double sum = 0;
    for (const Course& c : courses) {
      const double mean = excess(c, c.slope);
      const bool sure = !of_ratios_ && c.polynomial != p_.power();
      sum += sure ? (mean > 0 ? 0.0 : 1.0) : statistics::normal_cdf(-mean / std::max(c.limit_error, 1e-12));
    }
    return sum / static_cast<double>(courses.size());
  }
  // Of the last six: the ratio may bend up by more than half of what the masses bend down.
  [[nodiscard]] bool turns_up(const std::vector<statistics::Observation>& ratios) const {
    const auto last = std::span(ratios).last(std::min<std::size_t>(6, ratios.size()));
    std::vector<statistics::Observation> masses(last.begin(), last.end());
    for (statistics::Observation& o : masses) o.value = power_ * p_.at(static_cast<std::int64_t>(o.level));
    const statistics::Halves ratio = statistics::halves_of(last, 0);
    return ratio.bend() < ratio.bend_error() - statistics::halves_of(masses, 0).bend() / 2;
  }
  // How much faster than necessary the terms fall.
  [[nodiscard]] double excess(const Course& c, double slope) const {
    if (of_ratios_) return slope;
    if (!p_.power()) return c.polynomial ? -1 : slope - power_ * p_.fall();
    if (c.polynomial) return slope - power_ * p_.exponent() - 1;
    return slope > 0 ? std::max(slope, 0.05) : -1;
  }

  const Evidence& e_;
  const Logarithms& p_;
  double power_;
  std::vector<Course> courses_;
  std::span<const Course> unaided_;
  bool of_ratios_ = false;
  bool turns_ = false;
};

}  // namespace

SumConvergence judge(const Evidence& e, const Masses& masses) {
  using Value = SumConvergence::Value;
  SumConvergence v;
  if (e.end != End::none) {
    if (e.grade != Grade::open) v = {Value::finite, e.grade, 0, 0, -infinity};
    return v;
  }
  Logarithms p(masses);
  if (e.courses.empty() || p.empty()) return v;
  p.look_at(std::max(e.last_usable, p.first() + 1) + 8);
  const Sum sum(e, p, 1);
  v.diverges = sum.diverges();
  v.growth = sum.growth();
  v.unseen = sum.unseen();
  // Rates neither show anything, nor turn what the levels lean to.
  const double unaided = sum.diverges_unaided();
  const bool turned = unaided > 0.5;

  if (v.diverges <= shown_p && v.unseen <= most_unseen_of_variance && e.known >= 4 && !sum.turns() && !turned) {
    v.value = Value::finite;
    v.grade = e.missing_moments || unaided > likely_p ? Grade::likely : Grade::shown;
    return v;
  }
  const int known = e.known + e.known_by_rates;
  // Levels that fall faster than declared rates allow may only not be there yet; many that contradict them are.
  constexpr int enough_to_contradict = 5;
  const bool may_be_slower = e.not_there && (!e.contradiction || e.known < enough_to_contradict);
  const bool too_steep = may_be_slower && (e.not_there->decay == Decay::polynomial) == p.power() &&
                         e.not_there->variance_decay < (p.power() ? p.exponent() + 1 : p.fall());
  if (v.diverges <= likely_p && known >= 3 && !too_steep && !sum.turns() && !turned) {
    v.value = Value::finite;
    v.grade = Grade::likely;
    return v;
  }
  const std::size_t n = sum.contributions.size();
  // A decay like a power beside work like a power shows late whether it is enough.
  const bool established = e.decay.value > 4 * e.decay.error || e.decay.value + 2.6 * e.decay.error < 0;
  const bool slow = !e.exponential_work && e.polynomial && !established;
  const bool drops = n >= 3 && sum.contributions[n - 1] < sum.contributions[n - 3] - 1;
  if (e.changes || e.missing_moments || slow || drops || !do_not_fall(sum.contributions, e.known_by_rates) || known < 3)
    return v;
  if (v.diverges >= 1 - shown_p) {
    v.value = Value::infinite;
    v.grade = e.known >= 6 && (e.exponential_work || !e.polynomial) ? Grade::shown : Grade::likely;
    if (e.answer == Answer::no) v.grade = std::min(v.grade, e.grade);
  } else if (v.diverges >= 1 - likely_p && e.known >= 4 && e.answer != Answer::open) {
    v.value = Value::infinite;
    v.grade = Grade::likely;
  }
  return v;
}

double fourth_moment_diverges(const Evidence& e, const Masses& masses) {
  if (e.end != End::none) return e.grade == Grade::open ? 0.5 : 0;
  Logarithms p(masses);
  if (e.courses.empty() || p.empty()) return 0.5;
  p.look_at(std::max(e.last_usable, p.first() + 1) + 8);
  return Sum(e, p, 3).diverges();
}

double exponent_of(const Masses& masses, std::int64_t level, bool& polynomial) {
  Logarithms p(masses);
  polynomial = false;
  if (p.empty()) return 0;
  p.look_at(std::max(level, p.first() + 1) + 8);
  polynomial = p.power();
  return polynomial ? p.exponent() : p.fall();
}

namespace {

constexpr std::int64_t most_left_out = 64;  // levels that nobody has seen

// log2 kappa beyond the usable levels: as it grew over the last of them.
class RarityTrend {
 public:
  explicit RarityTrend(const Evidence& e) {
    const LevelVoice* first = nullptr;
    const LevelVoice* last = nullptr;
    int usable = 0;
    for (auto v = e.voices.rbegin(); v != e.voices.rend() && usable < 4; ++v) {
      if (!v->usable()) continue;
      if (last == nullptr) last = &*v;
      first = &*v;
      ++usable;
    }
    if (last == nullptr) {  // at least as rare as the commonest differences that were seen
      height_ = infinity;
      for (const LevelVoice& v : e.voices) {
        if (v.raw_hits > 0) height_ = std::min(height_, v.log2_rarity);
      }
      if (std::isinf(height_)) height_ = 0;
      return;
    }
    level_ = last->level;
    height_ = last->log2_rarity;
    if (usable > 1) {
      slope_ =
          std::max(0.0, (last->log2_rarity - first->log2_rarity) / static_cast<double>(last->level - first->level));
    }
  }
  [[nodiscard]] double at(std::int64_t level) const {
    return std::max(0.0, height_ + slope_ * static_cast<double>(level - level_));
  }

 private:
  std::int64_t level_ = 0;
  double height_ = 0;
  double slope_ = 0;
};

}  // namespace

namespace {

// mu, where the masses are those of a single term; 0 for the survival of a sum, whose parts do not exclude each other.
double sum_of_means(const Evidence& e, const Masses& masses) {
  double total = 0;
  for (const double p : masses.mass) total += p;
  if (!(total <= 1 + 1e-6)) return 0;
  double sum = 0;
  for (const LevelFacts& f : e.facts) {
    const bool is_part = f.level >= masses.first_level && (f.is_base ? f.level == masses.first_level : true);
    if (is_part && f.draws > 0 && std::isfinite(f.mean)) sum += f.mean;
  }
  return sum;
}

}  // namespace

namespace {

// What levels beyond all that were drawn may add, each way in which the levels may go on by itself: what is unlikely of one
// level is not likely of all of them.
class Beyond {
 public:
  explicit Beyond(const Evidence& e) : e_(e), variance_(e.courses.size()), left_out_(e.courses.size()) {
    for (const LevelFacts& f : e.facts) {
      if (f.draws > 0) last_ = std::max(last_, f.level);
    }
  }
  [[nodiscard]] bool holds(std::int64_t level) const { return !e_.courses.empty() && level > last_; }
  // A level that is drawn: its variance.
  template <class Part>
  void add_drawn(std::int64_t level, const Part& part) {
    const statistics::Ahead ahead(e_.last_usable, level);
    for (std::size_t i = 0; i < variance_.size(); ++i) variance_[i] += part(second_moment(i, ahead));
  }
  // A level that is not: what is missing is its mean.
  template <class Part>
  void add_left_out(std::int64_t level, const Part& part) {
    const statistics::Ahead ahead(e_.last_usable, level);
    for (std::size_t i = 0; i < left_out_.size(); ++i) left_out_[i] += part(second_moment(i, ahead));
  }
  // In the middle of all; what is left out is at most `most`.
  [[nodiscard]] double variance(double most) const {
    if (variance_.empty()) return 0;
    std::vector<double> all;
    for (std::size_t i = 0; i < variance_.size(); ++i) {
      const double left_out = std::min(left_out_[i], most);
      all.push_back(variance_[i] + left_out * left_out);
    }
    const auto middle = all.begin() + std::ssize(all) / 2;
    std::nth_element(all.begin(), middle, all.end());
    return *middle;
  }

 private:
  [[nodiscard]] double second_moment(std::size_t i, const statistics::Ahead& ahead) const {
    return std::exp2(std::clamp(ahead.on(e_.courses[i]), -1000.0, 900.0));
  }
  const Evidence& e_;
  std::int64_t last_ = -1;
  std::vector<double> variance_;
  std::vector<double> left_out_;
};

// Of a difference that is not random, how far off its size may be: a half of that of its square, in natural units.
double uncertain_part(const Believed& b) { return std::min(1.0, 0.5 * 0.6931471805599453 * b.error); }

}  // namespace

Doubt doubt_of(const Evidence& e, const Masses& masses, double members) {
  Doubt d;
  const Logarithms p(masses);
  if (masses.empty()) return d;
  // Of the square, what the mean is: one where differences are not random. Its sign is that of the last level known.
  double share_of_mean = 0;
  double sign = 1;
  for (std::size_t i = 0; i < e.voices.size(); ++i) {
    const LevelFacts& f = e.facts[i];
    if (!e.voices[i].usable() || !(f.second_moment > 0)) continue;
    share_of_mean = std::min(1.0, std::abs(f.mean) / std::sqrt(f.second_moment));
    sign = f.mean < 0 ? -1 : 1;
  }
  constexpr double not_random = 0.99;
  if (share_of_mean > not_random) d.mu = sum_of_means(e, masses);
  const double mu = d.mu;
  // Of one level in the squared error of the mean: E (D / p - mu)^2 p / members; a level of which no draw is expected leaves
  // out (D - mu p)^2.
  const auto part_of = [&](double second, double mean, double mass) {
    return std::max(0.0, second - 2 * mu * mean * mass + mu * mu * mass * mass) / std::max(mass, 1 / members) / members;
  };
  double squares = 0;  // of the variances of the parts
  const auto add = [&](double& part, double variance, double relative) {
    part += variance;
    squares += variance * variance * relative;
  };
  for (const LevelFacts& f : e.facts) {
    if (!f.is_base || !(f.draws > 0)) continue;
    const bool drawn = p.holds(f.level) && p.at(f.level) < 0;  // one outcome of the PMF
    // Zeros alone may be those of something as rare as the first difference.
    if (drawn && f.second_moment == 0) {
      const auto shown = std::find_if(e.facts.begin(), e.facts.end(), [](const LevelFacts& g) {
        return !g.is_base && g.second_moment > 0 && std::isfinite(g.second_moment);
      });
      if (shown != e.facts.end()) {
        const double square = shown->second_moment * statistics::chance_of_zeros(*shown, static_cast<double>(f.draws));
        add(d.unseen, square * std::exp2(-p.at(f.level)) / members, 2);
      }
    }
    const double variance = drawn                          ? f.second_moment * std::exp2(-p.at(f.level))
                            : std::isnan(f.value_variance) ? f.second_moment - f.mean * f.mean
                                                           : f.value_variance;
    if (!(variance > 0) || !std::isfinite(variance)) continue;
    add(d.seen, variance / members,
        (std::isfinite(f.kurtosis) ? std::max(f.kurtosis, 3.0) : 3) / static_cast<double>(f.draws));
  }
  if (p.last() < p.first()) return d;
  const double log2_members = std::log2(members);
  const auto expects_draws = [&](std::int64_t level) { return std::exp2(p.at(level) + log2_members) >= 1; };
  // Where levels go on for ever, the first one that is too deep to count ends what follows.
  std::int64_t deepest = p.last();
  if (!e.courses.empty() && e.end == End::none) {
    deepest = std::min(deepest, std::max({p.first(), e.last_usable, e.facts.back().level}) + 1);
    const std::int64_t counts = e.last_difference + most_left_out;
    while (deepest < p.last() && (deepest <= counts || expects_draws(deepest) || voice_at(e, deepest) != nullptr))
      ++deepest;
  }
  const std::vector<Believed> all = believed(e, std::min(p.last(), statistics::node_from(e.last_usable, deepest)));
  const RarityTrend rarity(e);
  // What a level with a mass but no draw leaves out is its mean: those add up. The sequence converges, so that no mean
  // is larger than those seen.
  double largest_mean = -infinity;  // log2 of its square
  for (const LevelVoice& v : e.voices) {
    if (std::isfinite(v.log2_second)) largest_mean = std::max(largest_mean, v.log2_second - v.log2_rarity);
  }
  Beyond beyond(e);
  double sum_of_seen = 0;  // the sequence converges: what follows is no more than what the known levels have added
  for (std::size_t i = 0; i < e.voices.size(); ++i) {
    const bool is_known = e.voices[i].usable() && !e.facts[i].is_base && e.voices[i].level >= p.first();
    if (is_known)
      sum_of_seen += std::exp2(std::clamp(e.voices[i].log2_second - e.voices[i].log2_rarity, -1000.0, 900.0) / 2);
  }
  double left_out = 0;
  double replaced = 0;  // the means beside what stands for them
  double left_out_doubt = 0;
  for (std::int64_t k = p.first(); k <= p.last(); ++k) {
    const double draws_expected = std::exp2(p.at(k) + log2_members);
    const double mass = std::exp2(p.at(k));
    const LevelVoice* voice = voice_at(e, k);
    const bool known = voice != nullptr && voice->hits >= few && std::isfinite(voice->log2_second);
    if (known) {
      const auto draws = static_cast<double>(e.facts[static_cast<std::size_t>(voice - e.voices.data())].draws);
      const double rarity_seen = std::max(std::exp2(voice->log2_rarity), draws / voice->hits);
      const bool drawn = draws_expected >= few * rarity_seen;
      if (!drawn) d.levels.push_back(k);
      const double mean = e.facts[static_cast<std::size_t>(voice - e.voices.data())].mean;
      const double second = std::exp2(std::clamp(voice->log2_second, -1000.0, 900.0));
      add(drawn ? d.seen : d.undrawn, part_of(second, mean, mass),
          drawn ? rarity_seen / draws_expected : 1 / voice->hits);
      continue;
    }
    d.levels.push_back(k);
    if (k >= std::ssize(all)) break;
    const Believed& b = all[static_cast<std::size_t>(k)];
    if (!std::isfinite(b.log2_second)) continue;
    const double doubt = std::min(std::exp2(2 * b.error) - 1, most_doubt);
    if (draws_expected < 1 && k > e.last_difference) {
      if (k > e.last_difference + most_left_out) break;
      const double most = std::min(upper(e, b) - rarity.at(k), largest_mean);
      const double mean = std::exp2(std::clamp(most, -1000.0, 900.0) / 2);
      // What the other samples say for it: mu p.
      const double expected = sign * share_of_mean * std::exp2(std::clamp(b.log2_second, -1000.0, 900.0) / 2);
      const bool certain = mu != 0;
      if (!certain && beyond.holds(k)) {
        const double most_mean = std::exp2(std::clamp(largest_mean, -1000.0, 900.0) / 2);
        const double rare = std::exp2(-rarity.at(k) / 2);
        beyond.add_left_out(k,
                            [&](double second_moment) { return std::min(std::sqrt(second_moment) * rare, most_mean); });
        continue;
      }
      if (certain) replaced += expected - mu * mass;
      left_out += certain ? uncertain_part(b) * std::abs(expected) : mean;
      left_out_doubt = std::max(left_out_doubt, doubt);
      continue;
    }
    const double expected = sign * share_of_mean * std::exp2(std::clamp(b.log2_second, -1000.0, 900.0) / 2);
    const double second = mu != 0 ? expected * expected * (1 + std::pow(uncertain_part(b), 2))
                                  : std::exp2(std::clamp(upper(e, b), -1000.0, 900.0));
    if (mu == 0 && beyond.holds(k)) {
      beyond.add_drawn(k, [&](double second_moment) { return part_of(second_moment, 0, mass); });
      continue;
    }
    const double part = part_of(second, expected, mass);
    // Of a difference that is not random the size is known but for its doubt.
    const double known_part = mu != 0 ? std::min(part, part_of(expected * expected, expected, mass)) : 0;
    add(d.undrawn, known_part, doubt);
    add(d.unseen, part - known_part, doubt);
  }
  if (const double variance = beyond.variance(sum_of_seen); variance > 0) add(d.unseen, variance, most_doubt);
  left_out += std::abs(replaced);
  if (left_out > 0) {
    add(d.undrawn, replaced * replaced, left_out_doubt);
    add(d.unseen, left_out * left_out - replaced * replaced, left_out_doubt);
  }
  const double variance = d.seen + d.undrawn + d.unseen;
  if (squares > 0) d.degrees = std::max(1.0, 2 * variance * variance / squares);
  return d;
}

}  // namespace debias
