#include <debias/multilevel.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <ostream>
#include <stdexcept>
#include <string>

#include "core/regression.hpp"
#include "core/text.hpp"
#include "core/words.hpp"

namespace debias {
namespace {

constexpr double slowest_rate = 0.5;
constexpr double fastest_rate = 1;         // of the mean, unless more is declared: few levels overstate it
constexpr std::int64_t fewest_levels = 4;  // before anything is extrapolated
constexpr double fewest_draws = 64;        // of the pilot of a deep level
constexpr double enough_hits = 32;         // of a level, in its pilot
constexpr double fewest_hits = 8;          // without which its variance is not known
constexpr double fewest_equal = 0x1p16;    // draws of a base that are all zero, before they are believed
constexpr double hits_promised = 14;       // of levels of zeros that are the end: P(none) = 1e-6
constexpr double pilot_share = 1.0 / 16;   // of the draws of a level, where these are many
constexpr double most_pilot = 0x1p24;      // draws of a pilot
constexpr std::int64_t pilot_first = std::int64_t{1} << 50;  // its samples: none that a run will draw

// The sums of one level, component by component.
struct Level {
  std::int64_t draws = 0;
  double work = 0;
  double size = 0;    // of squares: fourth powers of others might leave the range of doubles
  double second = 0;  // sums of the norm, squared and to the fourth, in that unit
  double fourth = 0;
  std::vector<Moments> components;
  std::vector<Moments> values;  // of I_l
  std::vector<Moments> coarse;  // of its coarse partner

  void add(const Statistics& s) {
    // Components of I_l, of its coarse partner and of D_l, then a flag: see ValueTuple.
    const std::size_t each = (s.components.size() - 1) / 3;
    const auto n = static_cast<double>(s.samples);
    const auto merge = [&](std::size_t part, std::vector<Moments>& into) {
      into.resize(each);
      for (std::size_t c = 0; c < each; ++c) {
        const ComponentEstimate& d = s.components[part * each + c];
        Moments m;
        m.count = s.samples;
        m.mean = d.mean;
        m.m2 = s.samples > 1 ? d.variance * (n - 1) : 0;
        into[c].merge(m);
      }
    };
    merge(0, values);
    merge(1, coarse);
    merge(2, components);
    for (const LevelRow& row : s.levels) {
      if (row.is_base) continue;
      if (size == 0) size = row.second_moment;
      const double square = size > 0 ? row.second_moment / size : 0;
      second += n * square;
      fourth += n * row.kurtosis * square * square;
    }
    draws += s.samples;
    work += s.work;
  }
  [[nodiscard]] double mean() const {
    if (components.size() == 1) return components[0].mean;
    double square = 0;
    for (const Moments& m : components) square += m.mean * m.mean;
    return std::sqrt(square);
  }
  [[nodiscard]] double variance() const {
    double sum = 0;
    for (const Moments& m : components) sum += m.m2 / static_cast<double>(m.count);
    return sum;
  }
  [[nodiscard]] double error() const { return std::sqrt(variance() / static_cast<double>(draws)); }
  [[nodiscard]] double work_per_draw() const { return work / static_cast<double>(draws); }
  // Draws that carry the second moment.
  [[nodiscard]] double hits() const { return fourth > 0 ? second * second / fourth : 0; }
};

// The draws that count are fixed from a pilot of each level, and drawn afresh: draws whose number depends on what they
// showed are biased.
class Driver {
 public:
  Driver(const LevelRuns& runs, double error, const Plan& plan, const MultilevelOptions& options)
      : runs_(runs), plan_(plan), options_(options), error_(error) {}

  MultilevelStatistics run() {
    MultilevelStatistics result;
    while (std::ssize(pilots_) < std::min(fewest_levels, most_levels())) add_level();
    for (;;) {
      const auto start = std::chrono::steady_clock::now();
      plan_levels();
      result.pilot_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      draw();
      result.bias = remaining_bias(levels_);
      const bool add = result.bias > allowed_bias();
      result.bias = std::max(result.bias, hidden_bias());
      if (total_error(result.bias) <= error_ && is_known()) {
        result.converged = std::ssize(levels_) >= fewest_levels;
        break;
      }
      if (std::ssize(pilots_) >= most_levels() || !add) break;
      add_level();
    }
    finish(result);
    return result;
  }

 private:
  [[nodiscard]] std::int64_t most_levels() const {
    return runs_.deepest_level < options_.most_levels ? runs_.deepest_level + 1 : options_.most_levels;
  }
  [[nodiscard]] double allowed_bias() const { return std::sqrt(options_.bias_share) * error_; }

  void add_level() {
    pilots_.emplace_back();
    levels_.emplace_back();
    // Deep levels are dear: about what the run will ask for, as far as the level above tells.
    const auto first = static_cast<double>(options_.first_draws);
    const bool extrapolated = std::ssize(pilots_) > fewest_levels && !wanted_.empty();
    grow(pilots_.size() - 1, extrapolated ? std::clamp(wanted_.back(), std::min(fewest_draws, first), first) : first);
  }

  Statistics draws_of(std::size_t l, std::int64_t first, std::int64_t count) const {
    Plan part = plan_;
    part.first = first;
    part.samples = count;
    part.goal = {};
    part.save = {};
    part.earlier = {};
    part.pilot = {};
    return runs_.draw(static_cast<std::int64_t>(l), part);
  }

  void add(Level& level, std::size_t l, const Statistics& s) {
    level.add(s);
    if (s.fewer_threads > 0 && warnings_.empty()) warnings_.push_back(detail::fewer_threads_warning(s.fewer_threads));
    if (s.nonfinite > 0 || !std::isfinite(level.mean()) || !std::isfinite(level.variance())) {
      throw std::invalid_argument("multilevel: level " + std::to_string(l) +
                                  " (draws, or their squares, are not finite: no mean and no error)");
    }
  }

  void grow(std::size_t l, double draws) {
    Level& pilot = pilots_[l];
    const auto more = static_cast<std::int64_t>(std::min(draws, most_pilot)) - pilot.draws;
    if (more < 2) return;
    add(pilot, l, draws_of(l, pilot_first + pilot.draws, more));
    if (l > 0) check_coupling(l);
    if (l + 1 < pilots_.size() && pilots_[l + 1].draws > 0) check_coupling(l + 1);
  }

  // A coarse partner with another mean than the level below: the differences add up to nothing, and never end.
  void check_coupling(std::size_t l) const {
    constexpr std::int64_t fewest = 256;
    constexpr double most = 8;  // errors: of 256 values of any shape, the larger of both variances on both sides
    const Level& here = pilots_[l];
    const Level& below = pilots_[l - 1];
    if (here.draws < fewest || below.draws < fewest) return;
    for (std::size_t c = 0; c < here.coarse.size(); ++c) {
      const Moments& a = here.coarse[c];
      const Moments& b = below.values[c];
      const double variance = std::max(a.variance(), b.variance());
      const double rounding = 1e-10 * (std::abs(a.mean) + std::abs(b.mean));
      const double error = std::hypot(
          std::sqrt(variance / static_cast<double>(a.count) + variance / static_cast<double>(b.count)), rounding);
      const double gap = std::abs(a.mean - b.mean);
      if (!(gap > most * error)) continue;
      throw std::invalid_argument("multilevel: wrong coupling: the coarse partner of level " + std::to_string(l) +
                                  " does not have the mean of the level below (" + format("%.3g", gap / error) +
                                  " standard errors apart), so no number of levels ends; are fine and coarse "
                                  "exchanged, or do levels not start at 0?");
    }
  }

  // The draws that each level asks for, from pilots that know its variance, until the bias is small enough.
  void plan_levels() {
    for (;;) {
      wanted_draws();
      bool grown = false;
      double cost = 0;
      for (std::size_t l = 0; l < pilots_.size(); ++l) cost += wanted_[l] * pilots_[l].work_per_draw();
      for (std::size_t l = 0; l < pilots_.size(); ++l) {
        const Level& pilot = pilots_[l];
        const auto have = static_cast<double>(pilot.draws);
        double want = std::max(have, pilot_share * wanted_[l]);
        // A level whose variance is not known may cost as much as all others.
        if (pilot.hits() < enough_hits && pilot.work < cost) want = std::max(want, 2 * have);
        // A base of zeros may be one that is rare.
        if (l == 0 && pilot.second == 0 && have < fewest_equal) want = std::max(want, 4 * have);
        // Of the last three, the first knows its mean best.
        if (l + 3 == pilots_.size() && 2 * pilot.error() > 0.5 * allowed_bias() && have < wanted_[l]) {
          want = std::max(want, std::min(wanted_[l], 4 * have));
        }
        if (want >= 1.25 * have && have < most_pilot) {
          grow(l, want);
          grown = true;
        }
      }
      if (grown) continue;
      if (remaining_bias(pilots_) <= 0.9 * allowed_bias() || std::ssize(pilots_) >= most_levels()) return;
      add_level();
    }
  }

  void wanted_draws() {
    double roots = 0;
    std::vector<double> variances;
    for (const Level& pilot : pilots_) {
      const double doubt = 2 / std::sqrt(std::max(pilot.hits(), 1.0));
      variances.push_back(pilot.variance() * (1 + doubt));
      roots += std::sqrt(variances.back() * pilot.work_per_draw());
    }
    const double budget = (1 - options_.bias_share) * error_ * error_;
    wanted_.clear();
    for (std::size_t l = 0; l < pilots_.size(); ++l) {
      const double n = std::ceil(std::sqrt(variances[l] / pilots_[l].work_per_draw()) * roots / budget);
      if (!(n < 0x1p49)) {
        throw std::invalid_argument("multilevel: error = " + format("%g", error_) + " (asks for " + format("%.3g", n) +
                                    " draws of level " + std::to_string(l) + "); ask for a larger error");
      }
      wanted_.push_back(std::max(n, 2.0));
    }
    // Zeros that may hide a bias: draws that rule it out, for no more than the others cost.
    const std::size_t l = pilots_.size() - 1;
    const std::size_t last = last_shown(l);
    if (last == 0 || last == l) return;
    double cost = 0;
    for (std::size_t k = 0; k < l; ++k) cost += wanted_[k] * pilots_[k].work_per_draw();
    const double enough = 6 * std::sqrt(pilots_[last].fourth / pilots_[last].second) / allowed_bias();
    wanted_[l] = std::max(wanted_[l], std::floor(std::min(enough, cost / pilots_[l].work_per_draw())));
  }

  void draw() {
    for (std::size_t l = 0; l < pilots_.size(); ++l) {
      const auto wanted = static_cast<std::int64_t>(wanted_[l]);
      if (wanted > levels_[l].draws) add(levels_[l], l, draws_of(l, levels_[l].draws, wanted - levels_[l].draws));
    }
  }

  // Of the fall of |E D_l| over the last levels that show it, at its slow end.
  [[nodiscard]] double alpha_of(const std::vector<Level>& levels) const {
    constexpr double bend = 0.2;  // octaves that a mean may lie beside the line
    std::vector<double> x;
    std::vector<double> logs;
    std::vector<double> errors;
    for (std::size_t l = levels.size() - 1; l > 0 && x.size() < 4; --l) {
      const double size = std::abs(levels[l].mean());
      if (!(size > 2 * levels[l].error())) continue;  // drowned: it would look like no fall at all
      x.push_back(static_cast<double>(l));
      logs.push_back(std::log2(size));
      errors.push_back(std::hypot(bend, levels[l].error() / size / std::log(2.0)));
    }
    if (x.size() < 2) return slowest_rate;
    double most = fastest_rate;
    // Declared: E D_l^2 falls at most twice as fast as E D_l.
    if (runs_.facts.declared && runs_.facts.declared->decay == Decay::geometric) {
      most = std::max(most, std::min(runs_.facts.declared->variance_decay / 2, 4.0));
    }
    const Line line = fit_line(x, logs, errors);
    return std::clamp(-line.slope - line.slope_error, slowest_rate, most);
  }

  // The last level before l whose pilot shows differences; 0: none does.
  [[nodiscard]] std::size_t last_shown(std::size_t l) const {
    while (l > 0 && pilots_[l].second == 0) --l;
    return l;
  }

  // What zeros of level l may hide: nothing, where the share of draws with a difference promised some; else, by the rule
  // of three, differences as large as the last ones.
  [[nodiscard]] double of_zeros(std::size_t l) const {
    const std::size_t last = last_shown(l);
    if (last == 0) return 0;
    const Level& seen = pilots_[last];
    double share = seen.hits() / static_cast<double>(seen.draws);  // at least
    double promised = 0;
    for (std::size_t k = last + 1; k < pilots_.size(); ++k) {
      share /= 2;
      promised += share * static_cast<double>(pilots_[k].draws + levels_[k].draws);
    }
    if (promised >= hits_promised) return 0;
    return 3 / static_cast<double>(pilots_[l].draws + levels_[l].draws) * std::sqrt(seen.fourth / seen.second);
  }
  // Of the last level, if it is zero; deeper ones then fall as the others do.
  [[nodiscard]] double hidden_bias() const {
    const std::size_t l = pilots_.size() - 1;
    if (pilots_[l].second != 0 || levels_[l].second != 0) return 0;
    return of_zeros(l) / (std::exp2(alpha_of(pilots_)) - 1);
  }

  // The least upper bound of the last three levels, at two errors, but no less than a lower bound of any of them.
  [[nodiscard]] double remaining_bias(const std::vector<Level>& levels) const {
    const double alpha = alpha_of(levels);
    double upper = std::numeric_limits<double>::infinity();
    double lower = 0;
    for (std::size_t k = 0; k < 3 && k + 1 < levels.size(); ++k) {
      const Level& level = levels[levels.size() - 1 - k];
      const double fall = std::exp2(-alpha * static_cast<double>(k));
      upper = std::min(upper, (std::abs(level.mean()) + 2 * level.error()) * fall);
      lower = std::max(lower, (std::abs(level.mean()) - 2 * level.error()) * fall);
    }
    return std::max(upper, lower) / (std::exp2(alpha) - 1);
  }

  [[nodiscard]] double total_error(double bias) const {
    double square = bias * bias;
    for (const Level& level : levels_) square += level.variance() / static_cast<double>(level.draws);
    return std::sqrt(square);
  }

  // No level has shown a difference, though values vary at all of them alike: an end, or a pause that nobody looked beyond.
  [[nodiscard]] bool only_zeros() const {
    if (runs_.facts.exact_from || pilots_.size() < 2 || last_shown(pilots_.size() - 1) != 0) return false;
    const auto varies = [](const Level& pilot) {
      double sum = 0;
      for (const Moments& m : pilot.values) sum += m.mean * m.mean > 0x1p60 * m.variance() ? 0 : m.variance();
      return sum;
    };
    return pilots_.front().second != 0 && varies(pilots_.back()) > varies(pilots_.front()) / 2;
  }

  // Every level has shown its variance.
  [[nodiscard]] bool is_known() const {
    if (only_zeros()) return false;
    const auto is_zero = [](const Level& pilot) { return pilot.second == 0; };
    if (std::all_of(pilots_.begin(), pilots_.end(), is_zero)) return false;  // a rarer value would not have been seen
    return std::all_of(pilots_.begin(), pilots_.end(), [](const Level& pilot) {
      return pilot.hits() >= fewest_hits || (pilot.second == 0 && pilot.draws >= 1000);
    });
  }

  void finish(MultilevelStatistics& result) const {
    result.goal = error_;
    result.alpha = alpha_of(levels_);
    result.seed = plan_.seed;
    result.warnings = warnings_;
    if (std::all_of(levels_.begin(), levels_.end(), [](const Level& level) { return level.second == 0; })) {
      result.warnings.push_back(
          {WarningCode::equal_samples,
           "all draws are zero, so the goal is not met: a value that comes up less than three times in " +
               std::to_string(pilots_.front().draws) + " draws would not have been seen."});
    }
    if (only_zeros()) {
      result.warnings.push_back(
          {WarningCode::zero_differences, "all differences of levels 1 to " + std::to_string(pilots_.size() - 1) +
                                              " are exactly zero, so the goal is not met: the base is all, or levels "
                                              "only begin to differ deeper down; "
                                              "state `exact_from` where they end."});
    }
    result.components.resize(levels_.front().components.size());
    std::vector<double> x;
    std::vector<double> logs;
    for (std::size_t l = 0; l < levels_.size(); ++l) {
      const Level& level = levels_[l];
      for (std::size_t c = 0; c < level.components.size(); ++c) {
        const Moments& m = level.components[c];
        ComponentEstimate& e = result.components[c];
        e.mean += m.mean;
        e.standard_error = std::hypot(e.standard_error, m.standard_error());
      }
      result.pilot_work += pilots_[l].work;
      result.work += level.work + pilots_[l].work;
      result.rows.push_back(
          {static_cast<std::int64_t>(l), level.draws, level.mean(), level.variance(), level.work_per_draw()});
      if (l == 0 || !(level.variance() > 0)) continue;
      x.push_back(static_cast<double>(l));
      logs.push_back(std::log2(level.variance()));
    }
    judge_points(result);
    result.beta = x.size() < 2 ? slowest_rate : -fit_line(x, logs, std::vector<double>(x.size(), 1.0)).slope;
  }

  // What lies beyond the last level, beside what is said of it (core/resonance.hpp).
  void judge_points(MultilevelStatistics& result) const {
    if (!runs_.missed) return;
    constexpr double share_of_run = 1.0 / 16;  // of its look-ups
    constexpr double least_lookups = 8192;
    const double budget = std::max(share_of_run * result.work, least_lookups);
    auto last = static_cast<std::int64_t>(levels_.size()) - 1;
    while (last > 0 && detail::draws_of_missed(last, budget / 3) == 0) --last;
    const std::vector<std::int64_t> levels = detail::levels_to_check(0, last);
    const detail::Missed missed = [&](std::int64_t level, std::int64_t draws, detail::Batches which) {
      return runs_.missed(level, draws, which, plan_.seed);
    };
    constexpr double rounding = 1e-12;
    double worst = 0;
    double error = 0;
    std::int64_t where = 0;
    for (const std::int64_t level : levels) {
      const std::int64_t draws = detail::draws_of_missed(level, budget / static_cast<double>(levels.size()));
      if (draws == 0) continue;
      std::vector<detail::Answered> answer;
      for (std::size_t c = 0; c < result.components.size(); ++c) {
        double added = 0;
        for (auto k = static_cast<std::size_t>(level) + 1; k < levels_.size(); ++k)
          added += levels_[k].components[c].mean;
        const ComponentEstimate& e = result.components[c];
        answer.push_back({std::hypot(e.standard_error, result.bias) + rounding * std::abs(e.mean), added});
      }
      double spent = 0;
      const std::vector<double> seen = detail::seen_beyond(missed, level, draws, answer, spent);
      result.work += spent;
      result.pilot_work += spent;
      for (std::size_t c = 0; c < seen.size(); ++c) {
        if (!(std::abs(seen[c]) > std::abs(worst))) continue;
        worst = seen[c];
        error = std::max(result.components[c].standard_error, rounding * std::abs(result.components[c].mean));
        where = level;
      }
    }
    if (worst == 0) return;
    result.converged = false;
    result.warnings.push_back(
        {WarningCode::aliased_differences, detail::resonance_words(where, worst, std::abs(worst) / error) + "."});
  }

  const LevelRuns& runs_;
  const Plan& plan_;
  const MultilevelOptions& options_;
  double error_;
  std::vector<Level> pilots_;
  std::vector<Level> levels_;
  std::vector<double> wanted_;
  std::vector<Warning> warnings_;
};

}  // namespace

double MultilevelStatistics::error() const {
  double square = bias * bias;
  for (const ComponentEstimate& c : components) square += c.standard_error * c.standard_error;
  return std::sqrt(square);
}

MultilevelStatistics multilevel(const LevelRuns& runs, double error, const Plan& plan,
                                const MultilevelOptions& options) {
  const auto refuse = [](const std::string& what) { throw std::invalid_argument("multilevel: " + what); };
  if (!(error > 0 && std::isfinite(error))) {
    refuse("error = " + format("%f", error) + " (must be positive and finite)");
  }
  if (!(options.bias_share > 0 && options.bias_share < 1)) {
    refuse("bias_share = " + format("%f", options.bias_share) + " (must lie in (0, 1)); 0.25 is usual");
  }
  if (options.first_draws < 2) {
    refuse("first_draws = " + std::to_string(options.first_draws) + " (a variance needs two); 1000 is usual");
  }
  if (options.most_levels < 3) {
    refuse("most_levels = " + std::to_string(options.most_levels) + " (must be at least 3); 24 is usual");
  }
  if (runs.deepest_level < 2) {
    refuse("the sequence can draw no level beyond " + std::to_string(runs.deepest_level) +
           " (a bias takes three levels)");
  }
  const auto start = std::chrono::steady_clock::now();
  MultilevelStatistics result = Driver(runs, error, plan, options).run();
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

namespace {

void print(std::ostream& out, const MultilevelStatistics& s, bool full) {
  detail::print_ends(s.components.size(), [&](std::size_t i, const std::string& left_out) {
    out << (i == 0 ? "mean          " : "              ")
        << (left_out.empty() ? with_error(s.components[i].mean, s.components[i].standard_error) : left_out) << '\n';
  });
  out << "bias          " << format("%.2g", s.bias) << " left out, if the differences go on falling like "
      << power_text(-s.alpha, Decay::geometric) << '\n';
  out << "goal          root mean square error " << format("%g", s.goal) << (s.goal_met() ? ": met, " : ": NOT met, ")
      << format("%.3g", s.error());
  if (!s.goal_met() && s.error() <= s.goal && s.warnings.empty()) out << ", but a level has not shown its variance";
  out << '\n';
  if (full) out << "estimator     multilevel, levels 0 to " << std::to_string(s.rows.back().level) << '\n';
  out << "work          " << format("%.4g", s.work) << ", of that " << format("%.4g", s.pilot_work)
      << " in the pilots, which planned the others\nseconds       " << format("%.3g", s.seconds) << '\n';
  for (const Warning& warning : s.warnings) out << "warning       " << warning.text << '\n';
  if (!full) return;
  const auto line = [&out](const std::array<std::string, 5>& cells) {
    constexpr std::array<std::size_t, 5> widths = {5, 10, 12, 12, 10};
    for (std::size_t i = 0; i < widths.size(); ++i) out << (i > 0 ? " " : "") << right(cells[i], widths[i]);
    out << '\n';
  };
  const auto number = [](double x) { return std::isfinite(x) ? format("%.4g", x) : std::string("-"); };
  line({"level", "draws", "E D", "Var D", "work"});
  for (const MultilevelRow& r : s.rows) {
    line({std::to_string(r.level), std::to_string(r.draws), number(r.difference), number(r.variance), number(r.work)});
  }
}

}  // namespace

std::ostream& operator<<(std::ostream& out, const MultilevelStatistics& s) {
  print(out, s, false);
  return out;
}

void print_full(std::ostream& out, const MultilevelStatistics& s) { print(out, s, true); }

}  // namespace debias
