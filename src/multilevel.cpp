#include <debias/multilevel.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <ostream>
#include <stdexcept>
#include <string>

#include "core/regression.hpp"
#include "core/text.hpp"

namespace debias {
namespace {

constexpr double slowest_rate = 0.5;
constexpr double expected_fall = 0.5;  // at least this part of what the rates predict
constexpr double negligible = 0.01;    // draws that are missing and not worth a round
constexpr std::int64_t lowest_last_level = 2;

// The sums of one level, component by component.
struct Level {
  std::int64_t draws = 0;
  double work = 0;
  std::vector<Moments> components;

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
  [[nodiscard]] double work_per_draw() const { return work / static_cast<double>(draws); }
};

class Driver {
 public:
  Driver(const LevelRuns& runs, double error, const Plan& plan, const MultilevelOptions& options)
      : runs_(runs), plan_(plan), options_(options), error_(error) {}

  MultilevelStatistics run() {
    MultilevelStatistics result;
    const auto start = std::chrono::steady_clock::now();
    for (std::int64_t l = 0; l <= lowest_last_level; ++l) add_level();
    for (bool first = true;; first = false) {
      draw_what_is_missing();
      if (first) {
        for (const Level& level : levels_) result.pilot_work += level.work;
        result.pilot_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      }
      measure();
      if (plan_draws()) continue;
      if (remaining_bias() <= std::sqrt(options_.bias_share) * error_) {
        if (plan_the_rest()) continue;
        result.converged = true;
        break;
      }
      if (static_cast<std::int64_t>(levels_.size()) >= options_.most_levels || last_level() == runs_.deepest_level)
        break;
      variance_.push_back(variance_.back() / std::exp2(beta_));
      work_.push_back(work_.back() * std::exp2(gamma_));
      mean_.push_back(0);
      add_level();
      missing_.back() = 0;
      plan_draws();
    }
    finish(result);
    return result;
  }

 private:
  [[nodiscard]] std::int64_t last_level() const { return static_cast<std::int64_t>(levels_.size()) - 1; }

  void add_level() {
    levels_.emplace_back();
    missing_.push_back(options_.first_draws);
  }

  void draw_what_is_missing() {
    for (std::size_t l = 0; l < levels_.size(); ++l) {
      if (missing_[l] == 0) continue;
      Level& level = levels_[l];
      Plan part = plan_;
      part.first = level.draws;
      part.samples = missing_[l];
      part.goal = {};
      part.save = {};
      part.earlier = {};
      part.pilot = {};
      const Statistics s = runs_.draw(static_cast<std::int64_t>(l), part);
      // Components of I_l, of its coarse partner and of D_l, then a flag: see Several.
      const std::size_t each = (s.components.size() - 1) / 3;
      level.components.resize(each);
      const auto n = static_cast<double>(s.samples);
      for (std::size_t c = 0; c < each; ++c) {
        const ComponentEstimate& d = s.components[2 * each + c];
        Moments m;
        m.count = s.samples;
        m.mean = d.mean;
        m.m2 = s.samples > 1 ? d.variance * (n - 1) : 0;
        level.components[c].merge(m);
      }
      if (s.fewer_threads > 0 && warnings_.empty()) warnings_.push_back(detail::fewer_threads_text(s.fewer_threads));
      if (s.nonfinite > 0 || !std::isfinite(level.mean()) || !std::isfinite(level.variance())) {
        throw std::invalid_argument("multilevel: level " + std::to_string(l) +
                                    " (draws, or their squares, are not finite: no mean and no error)");
      }
      level.draws += s.samples;
      level.work += s.work;
      missing_[l] = 0;
    }
  }

  // Means, variances and work of the levels, with their floors, and the rates behind those.
  void measure() {
    variance_.clear();
    mean_.clear();
    work_.clear();
    for (const Level& level : levels_) {
      mean_.push_back(std::abs(level.mean()));
      variance_.push_back(level.variance());
      work_.push_back(level.work_per_draw());
    }
    alpha_ = rate(mean_);
    beta_ = rate(variance_);
    for (std::size_t l = 2; l < levels_.size(); ++l) {
      mean_[l] = std::max(mean_[l], expected_fall * mean_[l - 1] / std::exp2(alpha_));
      variance_[l] = std::max(variance_[l], expected_fall * variance_[l - 1] / std::exp2(beta_));
    }
    gamma_ = std::log2(work_.back() / work_[work_.size() - 2]);
  }

  // Of the fall of y over the levels from 1 on: two of them at least, since a line through one point has no slope.
  static double rate(const std::vector<double>& y) {
    std::vector<double> x;
    std::vector<double> logs;
    for (std::size_t l = 1; l < y.size(); ++l) {
      if (!(y[l] > 0)) continue;
      x.push_back(static_cast<double>(l));
      logs.push_back(std::log2(y[l]));
    }
    if (x.size() < 2) return slowest_rate;
    return std::max(slowest_rate, -fit_line(x, logs, std::vector<double>(x.size(), 1.0)).slope);
  }

  // True when some level needs more draws, by more than a percent.
  bool plan_draws() {
    double roots = 0;
    for (std::size_t l = 0; l < levels_.size(); ++l) roots += std::sqrt(variance_[l] * work_[l]);
    const double budget = (1 - options_.bias_share) * error_ * error_;
    bool needed = false;
    for (std::size_t l = 0; l < levels_.size(); ++l) {
      const double wanted = std::ceil(std::sqrt(variance_[l] / work_[l]) * roots / budget);
      if (!(wanted < 0x1p53)) {
        throw std::invalid_argument("multilevel: error = " + format("%f", error_) +
                                    " (asks for more than 2^53 draws of level " + std::to_string(l) + ")");
      }
      const auto have = static_cast<double>(levels_[l].draws);
      missing_[l] = wanted > have ? static_cast<std::int64_t>(wanted - have) : 0;
      if (levels_[l].draws == 0) missing_[l] = std::max<std::int64_t>(missing_[l], 2);
      needed = needed || wanted - have > negligible * have;
    }
    return needed;
  }

  // True where the draws that are missing by less than that percent leave the error above the goal: then they are drawn.
  bool plan_the_rest() {
    double variance = 0;
    for (const Level& level : levels_) {
      double squares = 0;
      for (const Moments& m : level.components) squares += m.standard_error() * m.standard_error();
      variance += squares;
    }
    const double bias = remaining_bias();
    const double allowed = error_ * error_ - bias * bias;
    if (variance <= allowed) return false;
    constexpr double margin = 1.001;
    for (std::size_t l = 0; l < levels_.size(); ++l) {
      const auto have = static_cast<double>(levels_[l].draws);
      missing_[l] = static_cast<std::int64_t>(std::ceil(have * (margin * variance / allowed - 1)));
    }
    return true;
  }

  [[nodiscard]] double remaining_bias() const {
    double bias = 0;
    const std::size_t last = mean_.size() - 1;
    for (std::size_t k = 0; k < 3 && k < last; ++k) {
      bias = std::max(bias, mean_[last - k] * std::exp2(-alpha_ * static_cast<double>(k)));
    }
    return bias / (std::exp2(alpha_) - 1);
  }

  void finish(MultilevelStatistics& result) const {
    result.goal = error_;
    result.bias = remaining_bias();
    result.alpha = alpha_;
    result.beta = beta_;
    result.seed = plan_.seed;
    result.warnings = warnings_;
    result.components.resize(levels_.front().components.size());
    for (std::size_t l = 0; l < levels_.size(); ++l) {
      const Level& level = levels_[l];
      for (std::size_t c = 0; c < level.components.size(); ++c) {
        const Moments& m = level.components[c];
        ComponentEstimate& e = result.components[c];
        e.mean += m.mean;
        e.standard_error = std::hypot(e.standard_error, m.standard_error());
      }
      result.work += level.work;
      result.rows.push_back(
          {static_cast<std::int64_t>(l), level.draws, level.mean(), level.variance(), level.work_per_draw()});
    }
  }

  const LevelRuns& runs_;
  const Plan& plan_;
  const MultilevelOptions& options_;
  double error_;
  std::vector<Level> levels_;
  std::vector<std::string> warnings_;
  std::vector<std::int64_t> missing_;
  std::vector<double> mean_;
  std::vector<double> variance_;
  std::vector<double> work_;
  double alpha_ = slowest_rate;
  double beta_ = slowest_rate;
  double gamma_ = 0;
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
  if (options.most_levels < lowest_last_level + 1) {
    refuse("most_levels = " + std::to_string(options.most_levels) + " (must be at least 3); 24 is usual");
  }
  if (runs.deepest_level < lowest_last_level) {
    refuse("the sequence can draw no level beyond " + std::to_string(runs.deepest_level) +
           " (a bias takes three levels)");
  }
  const auto start = std::chrono::steady_clock::now();
  MultilevelStatistics result = Driver(runs, error, plan, options).run();
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

std::ostream& operator<<(std::ostream& out, const MultilevelStatistics& s) {
  for (std::size_t i = 0; i < s.components.size(); ++i) {
    out << (i == 0 ? "mean          " : "              ")
        << with_error(s.components[i].mean, s.components[i].standard_error) << '\n';
  }
  out << "bias          " << format("%.2g", s.bias) << " left out, if the differences go on falling like 2^(-"
      << format("%.2f", s.alpha) << " l)\n";
  out << "goal          root mean square error " << format("%g", s.goal) << (s.goal_met() ? ": met, " : ": NOT met, ")
      << format("%.3g", s.error()) << '\n';
  out << "estimator     multilevel, levels 0 to " << std::to_string(s.rows.back().level) << '\n';
  out << "work          " << format("%.4g", s.work) << ", of that " << format("%.4g", s.pilot_work)
      << " in the first draws, which planned the others\nseconds       " << format("%.3g", s.seconds) << '\n';
  for (const std::string& warning : s.warnings) out << "warning       " << warning << '\n';
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
  return out;
}

}  // namespace debias
