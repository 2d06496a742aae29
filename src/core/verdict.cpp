#include <debias/core/verdict.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string_view>

#include <debias/core/result.hpp>

#include "core/text.hpp"

namespace debias {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double half = 0.5;
constexpr double confidence = 2;  // standard errors
// Before a level votes. Draws four times the kurtosis fix its second moment to a factor of two.
constexpr double draws_per_kurtosis = 4;
constexpr double fewest_draws = 4;
constexpr std::size_t fewest_levels = 2;
constexpr std::int64_t fewest_levels_for_finite = 4;
constexpr double surplus_limit = 3;
// Draws that must be zero before an end of the differences is believed: so many, and ten times the kurtosis
// of the levels before, of which only a part of 1 / kurtosis may have been different from zero.
constexpr double fewest_zeros = 30;
constexpr double zeros_per_kurtosis = 10;
// How far log2 of a moment may be from a straight line although it is known exactly: a factor that is a power
// of the level, a start that is not asymptotic yet, and anything else.
constexpr double power_factor = 0.3;
constexpr double start = 1;
constexpr double scatter = 0.03;
constexpr int passes = 4;  // of the fit: curvature that the data insist on widens what is expected of it
constexpr double index_error = 0.01;
// A base whose own second moment is known this badly may be heavier than all the levels.
constexpr double draws_per_kurtosis_of_base = 10;
// The largest of n numbers with tail index xi has a share of about n^(2 xi - 1) of the sum of squares. A side
// whose largest has less than that of xi = 0.2 does not decide about the variance, whatever the shape of its
// values.
constexpr double irrelevant_share = -0.6;

Finiteness below(double value, double error, double border) {
  if (value + confidence * error < border) return Finiteness::finite;
  if (value - confidence * error >= border) return Finiteness::infinite;
  return Finiteness::undecided;
}

// A level that votes: logarithms to base 2, with the standard error that its kurtosis implies.
struct Vote {
  double level;
  double position;  // in the law: 0 for its first outcome
  double probability;
  double second;
  double second_error;
  double fourth;
  double fourth_error;
  double work;
};

struct Votes {
  std::vector<Vote> votes;
  bool ends = false;    // all deeper differences were zero
  double kurtosis = 1;  // of the worst level
};

Votes votes_of(const std::vector<LevelRow>& rows) {
  constexpr double epsilon = std::numeric_limits<double>::epsilon();
  double size = 0;
  for (const LevelRow& row : rows) size = std::max(size, row.second_moment);
  const double rounding = 64 * epsilon * epsilon * size;
  Votes result;
  double kurtosis = 1;  // of a level is not below that of the ones above it, which have more draws
  double zeros = 0;
  double first = -1;
  bool open = true;
  for (const LevelRow& row : rows) {
    if (row.is_base || row.probability <= 0) continue;
    const auto level = static_cast<double>(row.level);
    const auto draws = static_cast<double>(row.count);
    if (first < 0) first = level;
    if (!(row.second_moment > rounding)) {
      zeros += draws;
      continue;
    }
    zeros = 0;
    open = open && std::isfinite(row.fourth_moment) && row.fourth_moment > 0;  // neither over- nor underflow
    if (!open) continue;
    kurtosis = std::max(kurtosis, row.fourth_moment / (row.second_moment * row.second_moment));
    open = open && draws >= std::max(fewest_draws, draws_per_kurtosis * kurtosis);
    if (!open) continue;
    const double error = std::sqrt((kurtosis - 1) / draws) / std::log(2.0);
    result.votes.push_back({level, level - first, std::log2(row.probability), std::log2(row.second_moment),
                            std::hypot(error, scatter), std::log2(row.fourth_moment),
                            std::hypot(3 * error, 2 * scatter), std::log2(std::max(row.work, 1e-300))});
  }
  result.ends = open && zeros >= std::max(fewest_zeros, zeros_per_kurtosis * kurtosis);
  result.kurtosis = kurtosis;
  return result;
}

struct Slope {
  double value = 0;
  double error = 0;
  double chi_square = 0;
  double factor = 0;  // c
  double start = 0;   // d
  double last = 0;    // y of the fit at the last point
};

// y = a + b x + c u + d v with prior knowledge of c = 0 +- power_factor and d = 0 +- start: the slope b, with
// what the two curved terms leave unknown of it in its error.
class CurvedFit {
 public:
  void add(double x, double u, double v, double y, double error) {
    const std::array<double, 4> row = {1, x, u, v};
    const double w = 1 / (error * error);
    for (std::size_t i = 0; i < 4; ++i) {
      right_[i] += w * row[i] * y;
      for (std::size_t j = 0; j < 4; ++j) normal_[i][j] += w * row[i] * row[j];
    }
    yy_ += w * y * y;
  }
  void add_prior(double c, double d) {
    normal_[2][2] += 1 / (c * c);
    normal_[3][3] += 1 / (d * d);
  }
  // Two columns solve for the coefficients and for the variance of b; the matrix is positive definite.
  [[nodiscard]] Slope solve() const {
    auto m = normal_;
    auto right = right_;
    std::array<double, 4> unit = {0, 1, 0, 0};
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t k = i + 1; k < 4; ++k) {
        const double f = m[k][i] / m[i][i];
        for (std::size_t j = i; j < 4; ++j) m[k][j] -= f * m[i][j];
        right[k] -= f * right[i];
        unit[k] -= f * unit[i];
      }
    }
    for (std::size_t i = 4; i-- > 0;) {
      for (std::size_t j = i + 1; j < 4; ++j) {
        right[i] -= m[i][j] * right[j];
        unit[i] -= m[i][j] * unit[j];
      }
      right[i] /= m[i][i];
      unit[i] /= m[i][i];
    }
    double explained = 0;
    for (std::size_t i = 0; i < 4; ++i) explained += right[i] * right_[i];
    return {right[1], std::sqrt(unit[1]), std::max(0.0, yy_ - explained), right[2], right[3], right[0]};
  }

 private:
  std::array<std::array<double, 4>, 4> normal_{};
  std::array<double, 4> right_{};
  double yy_ = 0;
};

// The decay of a moment in the unit of the law.
Slope decay(std::span<const Vote> votes, bool polynomial, double Vote::*moment, double Vote::*error) {
  CurvedFit data;
  const Vote& reference = votes.back();  // small numbers keep the normal equations well conditioned
  for (std::size_t i = 0; i < votes.size(); ++i) {
    const Vote& p = votes[i];
    const double x = polynomial ? std::log2(p.level + 1) : p.level;
    const double x0 = polynomial ? std::log2(reference.level + 1) : reference.level;
    const double u = std::log2((x + 1) / (x0 + 1));
    const double early = polynomial ? 1 / static_cast<double>(i + 1) : std::exp2(-static_cast<double>(i));
    data.add(x - x0, u, early, p.*moment - reference.*moment, p.*error);
  }
  const double scale = moment == &Vote::fourth ? 2 : 1;
  double factor = scale * power_factor;
  double early_part = scale * start;
  Slope slope;
  const int repeats = votes.size() >= 6 ? passes : 1;
  for (int pass = 0; pass < repeats; ++pass) {
    CurvedFit fit = data;
    fit.add_prior(factor, early_part);
    slope = fit.solve();
    factor = std::max(factor, std::abs(slope.factor));
    early_part = std::max(early_part, std::abs(slope.start));
  }
  slope.last += reference.*moment;  // where u is 0 and the start has died out
  const double degrees = static_cast<double>(votes.size()) - 2;
  if (degrees > 0) {
    const double misfit = slope.chi_square / degrees - 1;
    const double doubt = degrees > 1 ? 1 : 3;  // one spare point says little about the size of a misfit
    slope.error *= std::sqrt(1 + std::max(0.0, doubt * misfit));
  }
  return slope;
}

// Shallow levels leave while the others lie on a better line.
std::span<const Vote> asymptotic(std::span<const Vote> votes, bool polynomial) {
  while (votes.size() > 4) {
    const double degrees = static_cast<double>(votes.size()) - 2;
    const double misfit = decay(votes, polynomial, &Vote::second, &Vote::second_error).chi_square;
    if (misfit <= degrees + confidence * std::sqrt(2 * degrees)) break;
    votes = votes.subspan(1);
  }
  return votes;
}

// Masses and work are known exactly: the slope between the first and the last vote.
double exact_slope(std::span<const Vote> votes, double x_first, double x_last, double Vote::*y) {
  return (votes.back().*y - votes.front().*y) / (x_last - x_first);
}

// Are the levels with too few draws to vote larger than the line through those that voted? By how many
// standard errors.
double surplus(const std::vector<LevelRow>& rows, const Votes& all, const Slope& slope, bool polynomial) {
  const auto x = [polynomial](double level) { return polynomial ? std::log2(level + 1) : level; };
  const double last = all.votes.back().level;
  double excess = 0;
  double draws = 0;
  for (const LevelRow& row : rows) {
    const auto level = static_cast<double>(row.level);
    if (row.is_base || row.probability <= 0 || level <= last) continue;
    const auto n = static_cast<double>(row.count);
    const double steps = x(level) - x(last);
    const double factor = slope.factor * std::log2((x(level) + 1) / (x(last) + 1));
    const double expected = std::exp2(slope.last + (slope.value + slope.error) * steps + factor);
    excess += n * (row.second_moment / expected - 1);
    draws += n;
  }
  return draws > 0 ? excess / std::sqrt(std::max(2.0, all.kurtosis - 1) * draws) : 0;
}

LevelEvidence evidence_of(const std::vector<LevelRow>& rows) {
  LevelEvidence e;
  const Votes all = votes_of(rows);
  const std::vector<Vote>& v = all.votes;
  if (!v.empty()) {
    e.first_level = static_cast<std::int64_t>(v.front().level);
    e.last_level = static_cast<std::int64_t>(v.back().level);
  }
  if (all.ends) {
    e.available = true;
    e.tail_index = -infinity;
    e.fourth_moment = Finiteness::finite;
    return e;
  }
  if (v.size() < fewest_levels) return e;

  // A geometric law falls by the same factor everywhere, a power law ever more slowly.
  const auto law_step = [&v](std::size_t i) {
    return (v[i].probability - v[i + 1].probability) / (v[i + 1].level - v[i].level);
  };
  const double bend = law_step(v.size() - 2) / law_step(0);
  e.polynomial = bend < 0.8;
  const std::span<const Vote> used = asymptotic(v, e.polynomial);
  const Vote& first = used.front();
  const Vote& last = used.back();
  const auto x = [&e](double level) { return e.polynomial ? std::log2(level + 1) : level; };
  const Slope second = decay(used, e.polynomial, &Vote::second, &Vote::second_error);
  const Slope fourth = decay(used, e.polynomial, &Vote::fourth, &Vote::fourth_error);
  const double work = exact_slope(used, x(first.level), x(last.level), &Vote::work);
  e.available = true;
  e.contradicted = surplus(rows, all, second, e.polynomial) > surplus_limit;
  e.votes = static_cast<std::int64_t>(used.size());
  e.first_level = static_cast<std::int64_t>(first.level);
  e.beta = -second.value;
  e.beta_error = second.error;
  e.rho = -exact_slope(used, x(first.position), x(last.position), &Vote::probability);
  const double border = e.polynomial ? 1 : 0;
  const double span = std::max(e.rho - border, 1e-3);
  e.tail_index = (e.rho - e.beta / 2) / span;
  e.error = std::hypot(e.beta_error / 2 / span, index_error);
  // A law that falls ever faster than any power leaves every such sequence behind, sooner or later.
  if (bend > 1.25 && e.tail_index < half) e.error = std::max(e.error, 0.1 * (1 + std::abs(e.tail_index)));
  e.fourth_moment = below(3 * e.rho + fourth.value, fourth.error + index_error, -border);
  e.work = below(work - e.rho, index_error, -border);
  return e;
}

// A base that is heavier than the rows of its own can tell.
bool heavy_base(const std::vector<LevelRow>& rows) {
  for (const LevelRow& row : rows) {
    if (!row.is_base || !(row.second_moment > 0)) continue;
    const double kurtosis = row.fourth_moment / (row.second_moment * row.second_moment);
    if (static_cast<double>(row.count) < draws_per_kurtosis_of_base * kurtosis) return true;
  }
  return false;
}

struct Index {
  double value = -infinity;
  double error = 0;
};

Index heavier(const Index& a, const Index& b) {
  if (std::isinf(a.error) || std::isinf(b.error)) return {std::max(a.value, b.value), infinity};
  return a.value >= b.value ? a : b;
}

// Averaged by precision where the two agree on an infinite variance, else the levels: light tails may only
// mean that the samples have not reached the levels that make them heavy.
Index together(const Index& levels, const Index& tails) {
  if (levels.value < half || tails.value < half || std::isinf(tails.error)) return levels;
  if (std::abs(levels.value - tails.value) > std::hypot(levels.error, tails.error)) return levels;
  const double a = 1 / (levels.error * levels.error);
  const double b = 1 / (tails.error * tails.error);
  return {(a * levels.value + b * tails.value) / (a + b), 1 / std::sqrt(a + b)};
}

// Of one side, as far as it can carry the variance.
Index index_of(const TailIndex& tail, double share, std::int64_t samples) {
  if (tail.state == TailState::too_few) return {tail.k, infinity};
  if (tail.state == TailState::bounded || share < std::pow(static_cast<double>(samples), irrelevant_share)) return {};
  return {tail.k, tail.error};
}

void combine(RunVerdict& v, const Index& tails, bool has_levels, bool base_is_heavy) {
  const LevelEvidence& l = v.levels;
  const Index by_levels = {l.tail_index, l.error};
  Index index = tails;
  if (l.available) index = base_is_heavy ? heavier(by_levels, tails) : together(by_levels, tails);
  v.tail_index = index.value;
  v.error = index.error;
  v.variance = below(index.value, index.error, half);
  v.fourth_moment = below(index.value, index.error, half / 2);
  if (l.available && !base_is_heavy) v.fourth_moment = l.fourth_moment;
  // What the levels could not see the tails cannot either: clusters that are almost a lattice look light.
  // Three levels lie on every curve, also on that of a start which is not asymptotic.
  const bool too_few =
      has_levels && (!l.available || l.contradicted || (l.votes > 0 && l.votes < fewest_levels_for_finite));
  if (too_few && v.variance == Finiteness::finite) v.variance = Finiteness::undecided;
  if (v.variance == Finiteness::infinite) v.fourth_moment = Finiteness::infinite;
  if (v.variance == Finiteness::undecided && v.fourth_moment == Finiteness::finite) {
    v.fourth_moment = Finiteness::undecided;
  }
  v.work = l.work;
  v.samples_needed = samples_for_mean(v.tail_index);
  v.rate = convergence_rate(v.tail_index, v.samples) / 2;
}

std::string figure(double x) { return std::isfinite(x) ? format("%.2f", x) : "bounded"; }

std::string index_text(const RunVerdict& v) {
  if (std::isinf(v.tail_index)) return std::isinf(v.error) ? "no tail to be seen" : "the values are bounded";
  return "tail index " + figure(v.tail_index) + (std::isinf(v.error) ? "" : " +- " + figure(v.error));
}

std::string tails_text(const RunVerdict& v) {
  const auto side = [](const TailIndex& tail, const char* name) {
    if (tail.state != TailState::fitted) return std::string("no tail among the ") + name;
    return "Pareto k " + figure(tail.k) + " of the " + std::to_string(tail.values) + " " + name;
  };
  return side(v.upper, "largest") + " and " + side(v.lower, "smallest") + " values";
}

std::string evidence_text(const RunVerdict& v) {
  const LevelEvidence& l = v.levels;
  if (!l.available) return tails_text(v);
  return "levels " + std::to_string(l.first_level) + " ... " + std::to_string(l.last_level) +
         (std::isinf(l.tail_index) ? ", beyond which every difference is zero" : "") +
         (l.contradicted ? ", which deeper ones contradict" : "") + "; " + tails_text(v);
}

}  // namespace

const char* name_of(Finiteness finiteness) {
  switch (finiteness) {
    case Finiteness::finite:
      return "finite";
    case Finiteness::infinite:
      return "infinite";
    case Finiteness::undecided:
      break;
  }
  return "undecided";
}

namespace {

struct Tails {
  RunVerdict verdict;  // without the verdict itself
  Index index;
};

Tails tails_of(const Moments& moments, std::span<const double> upper, std::span<const double> lower) {
  Tails t;
  RunVerdict& v = t.verdict;
  v.samples = moments.count;
  v.kurtosis = moments.kurtosis();
  v.upper = tail_index(upper, moments.count, moments.mean);
  std::vector<double> mirrored(lower.begin(), lower.end());
  for (double& x : mirrored) x = -x;
  v.lower = tail_index(mirrored, moments.count, -moments.mean);
  if (moments.count < 2 || !std::isfinite(moments.m2) || upper.empty() || lower.empty()) {
    t.index.error = infinity;  // nothing to judge, or squares that overflow
    return t;
  }
  if (moments.m2 == 0) return t;
  const auto share = [&moments](double x) { return (x - moments.mean) * (x - moments.mean) / moments.m2; };
  t.index = heavier(index_of(v.upper, share(upper.front()), moments.count),
                    index_of(v.lower, share(lower.front()), moments.count));
  v.largest_share = std::max(share(upper.front()), share(lower.front()));
  return t;
}

}  // namespace

RunVerdict judge(const Moments& moments, std::span<const double> upper, std::span<const double> lower) {
  Tails t = tails_of(moments, upper, lower);
  combine(t.verdict, t.index, false, false);
  return t.verdict;
}

RunVerdict judge(const Statistics& s) {
  Tails t = tails_of(s.moments, s.upper_tail, s.lower_tail);
  RunVerdict& v = t.verdict;
  if (s.nonfinite == 0) v.levels = evidence_of(s.levels);
  bool has_levels = false;
  for (const LevelRow& row : s.levels) {
    v.deepest_level = std::max(v.deepest_level, row.last_level);
    has_levels = has_levels || row.probability > 0;
  }
  v.largest.assign(s.largest.begin(), s.largest.begin() + std::min<std::ptrdiff_t>(3, std::ssize(s.largest)));
  combine(v, t.index, has_levels, heavy_base(s.levels));
  return v;
}

std::vector<std::string> RunVerdict::sentences() const {
  std::vector<std::string> all;
  const std::string number = index_text(*this);
  switch (variance) {
    case Finiteness::finite:
      all.push_back(std::string("variance finite") + (levels.available ? ": " : " as far as these values reach: ") +
                    number + " (threshold 0.5; " + evidence_text(*this) + ").");
      break;
    case Finiteness::infinite:
      all.push_back("variance INFINITE: " + number + " (threshold 0.5; " + evidence_text(*this) +
                    "), so the standard error is too small most of the time and errors fall like N^-" +
                    format("%.2f", rate) + ", not N^-0.5; " +
                    (levels.available && levels.beta > 0
                         ? "take a law that falls more slowly, with exponent below " +
                               format("%.2f", levels.polynomial ? levels.beta - 1 : levels.beta) +
                               ", as long as its work is finite."
                         : std::string("find what makes the largest values, a law that falls too fast say.")));
      break;
    case Finiteness::undecided:
      all.push_back("variance undecided: " + number + " (threshold 0.5; " + evidence_text(*this) +
                    "), so the interval is not to be trusted; take more samples; a survey of the levels, if "
                    "there are any, tells sooner.");
      break;
  }
  if (variance == Finiteness::finite && fourth_moment != Finiteness::finite) {
    all.push_back("fourth moment " + std::string(name_of(fourth_moment)) + ": " + number +
                  " (threshold 0.25; kurtosis " + format("%.3g", kurtosis) +
                  " so far), so the standard error converges slowly and the interval is unreliable; take a "
                  "law that falls more slowly, or more samples.");
  }
  if (variance != Finiteness::finite && tail_index > usable_tail_index(samples)) {
    all.push_back("even the mean is doubtful: " + number + " (threshold " + format("%.2f", usable_tail_index(samples)) +
                  " for " + std::to_string(samples) + " samples), so it may be far off; " +
                  (std::isfinite(samples_needed) ? "this index asks for " + format("%.1e", samples_needed) + " samples."
                                                 : "no number of samples helps."));
  }
  if (variance != Finiteness::finite && !largest.empty()) {
    const LargeSample& l = largest.front();
    all.push_back("the largest sample, index " + std::to_string(l.index) + " of level " + std::to_string(l.level) +
                  ", carries " + format("%.2g", 100 * largest_share) +
                  " % of the sum of squares; replay it to see what it is made of.");
  }
  return all;
}

}  // namespace debias
