#include <debias/recipe/terms.hpp>

#include <limits>
#include <ostream>
#include <stdexcept>
#include <string>

#include <debias/core/text.hpp>

#include "core/regression.hpp"

namespace debias {

std::string WorkSplit::sentence() const {
  const double share = probe_share();
  const std::string percent = detail::format("%.0f", 100 * share) + " % of the variance is that of the probes, " +
                              detail::format("%.0f", 100 * (1 - share)) + " % that of stopping";
  if (share > 0.5) {
    return "the probes are the noise: " + percent + "; quieter probes help, longer paths do not";
  }
  return "the stopping is the noise: " + percent +
         "; a higher base level or narrower bounds help, quieter probes do not";
}

std::ostream& operator<<(std::ostream& out, const WorkSplit& s) {
  return out << "split         terms to level " << std::to_string(s.base_level)
             << " always, each later one with probability " << detail::format("%.3g", s.survival) << "; "
             << detail::format("%.3g", s.work) << " work a sample\n              " << s.sentence() << ".\n";
}

std::string slow_terms(const Statistics& result) {
  if (!result.sequence.declared) return {};
  const Rates& rates = *result.sequence.declared;
  if (rates.decay != Decay::geometric || std::isinf(rates.variance_decay)) return {};
  constexpr double fewest_hits = 16;
  constexpr std::size_t fewest_levels = 8;
  constexpr double z = 4.5;
  std::vector<const LevelRow*> rows;
  for (const LevelRow& row : result.levels) {
    if (row.is_base || row.level != row.last_level || row.level < 1) continue;
    if (!(row.second_moment > 0) || !(static_cast<double>(row.count) >= fewest_hits * row.kurtosis)) continue;
    rows.push_back(&row);
  }
  if (rows.size() < fewest_levels) return {};
  rows.erase(rows.begin(),
             rows.begin() + static_cast<std::ptrdiff_t>(std::min(rows.size() / 2, rows.size() - fewest_levels)));
  constexpr double octaves = 1.4426950408889634;  // 1 / ln 2
  std::vector<double> k;
  std::vector<double> b;
  std::vector<double> errors;
  for (const LevelRow* row : rows) {
    k.push_back(static_cast<double>(row->level));
    b.push_back(std::log2(row->second_moment));
    errors.push_back(octaves * std::sqrt(std::max(row->kurtosis - 1, 0.01) / static_cast<double>(row->count)));
  }
  const Line line = fit_line(k, b, errors);
  const double slope = line.slope;
  // Levels that scatter more than their errors say know less.
  const double error = line.slope_error * std::sqrt(std::max(1.0, line.chi_square / line.degrees));
  if (!(-slope + z * error < 0.9 * rates.variance_decay)) return {};
  return "terms fall more slowly than declared: E D^2 by 2^-" + detail::format("%.2g", -slope) + " +- " +
         detail::format("%.1g", error) + " a level over levels " + std::to_string(rows.front()->level) + " to " +
         std::to_string(rows.back()->level) + ", declared 2^-" + detail::format("%.2g", rates.variance_decay) +
         "; of an operator, some eigenvalue lies outside of the interval: widen it";
}

void print_terms(std::ostream& out, const Statistics& result, const WorkSplit& split) {
  out << result << split;
  const std::string slow = slow_terms(result);
  if (!slow.empty()) out << "warning       " << slow << ".\n";
}

namespace detail {

void refuse_split(const std::string& why) { throw std::invalid_argument("split_work: " + why); }

namespace {

// E (I - I_(j-1))^2 of level j over the paths, in units of the variance of I where there is one.
struct Residuals {
  std::vector<double> left;  // by level; not increasing
  double variance = 0;       // of I
  double unit = 1;           // that both are divided by, of the first component
};

Residuals residuals_of(std::span<const PathTerms> paths, std::size_t components) {
  const std::size_t levels = paths[0].work.size();
  const auto count = static_cast<double>(paths.size());
  Residuals r;
  r.left.assign(levels, 0);
  for (std::size_t c = 0; c < components; ++c) {
    std::vector<double> left(levels);
    double mean = 0;
    double squares = 0;  // about the mean
    double seen = 0;
    for (const PathTerms& path : paths) {
      double rest = 0;
      for (std::size_t j = levels; j-- > 0;) {
        rest += path.terms[j * components + c];
        left[j] += rest * rest / count;
      }
      seen += 1;
      const double gap = rest - mean;
      mean += gap / seen;
      squares += gap * (rest - mean);
    }
    const double variance = squares / (count - 1);
    const bool noisy = variance > 1e-24 * left[0];
    const double unit = noisy ? variance : left[0] > 0 ? left[0] : 1;
    if (c == 0) r.unit = unit;
    for (std::size_t j = 0; j < levels; ++j) r.left[j] += left[j] / unit / static_cast<double>(components);
    r.variance += noisy ? 1 / static_cast<double>(components) : 0;
  }
  for (std::size_t j = levels - 1; j-- > 0;) r.left[j] = std::max(r.left[j], r.left[j + 1]);
  return r;
}

}  // namespace

WorkSplit choose_split(std::span<const PathTerms> paths, std::size_t components, double decay) {
  const std::size_t levels = paths[0].work.size();
  Residuals r = residuals_of(paths, components);
  WorkSplit best;
  best.paths = static_cast<std::int64_t>(paths.size());
  for (const PathTerms& path : paths) {
    for (const double w : path.work) best.pilot_work += w;
  }
  // What the last levels leave is not seen: from half-way on the residuals fall as declared, unless they were seen to fall
  // more slowly.
  const std::size_t half = std::max<std::size_t>(1, levels / 2);
  double ratio = decay;
  if (half >= 8 && r.left[half] > 0) {
    const double seen = std::pow(r.left[half] / r.left[half / 2], 1 / static_cast<double>(half - half / 2));
    ratio = std::min(0.999, std::max(decay, seen));
  }
  if (!(ratio > 1e-6)) ratio = 1e-6;  // faster than any power: the levels seen say more
  const auto left = [&](std::size_t j) {
    return j <= half ? r.left[j] : r.left[half] * std::pow(ratio, static_cast<double>(j - half));
  };
  // Residuals of all levels that may matter, once.
  std::vector<double> all;
  for (std::size_t j = 0; j <= levels || (all.back() > 1e-14 * all[0] && j < 20 * levels + 100); ++j)
    all.push_back(left(j));

  const double first_work = paths[0].work[0];
  const double term_work = paths[0].work[levels - 1];
  const double root = std::sqrt(ratio);
  double least = std::numeric_limits<double>::infinity();
  const std::size_t stride = std::max<std::size_t>(1, levels / 64);
  for (const double power : {0.5, 0.7, 0.85, 1.0, 1.2, 1.4}) {
    const double survival = std::min(0.9995, std::pow(root, power));
    if (1 - survival >= 1 - 1e-9) continue;
    for (std::size_t m = 0; m < levels; m += stride) {
      double stopping = 0;
      double weight = 1;
      for (std::size_t j = m + 1; j + 1 < all.size(); ++j) {
        weight /= survival;
        stopping += (all[j] - all[j + 1]) * (weight - 1);
      }
      const double work = first_work + term_work * (static_cast<double>(m) + survival / (1 - survival));
      const double variance = r.variance + stopping;
      if (!(variance * work < least)) continue;
      least = variance * work;
      best.base_level = static_cast<std::int64_t>(m);
      best.survival = survival;
      best.work = work;
      best.stopping_variance = stopping * r.unit;
      best.probe_variance = r.variance * r.unit;
    }
  }
  return best;
}

}  // namespace detail

}  // namespace debias
