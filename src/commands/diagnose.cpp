#include "diagnose.hpp"

#include <cmath>
#include <limits>
#include <ostream>

#include "core/text.hpp"
#include "describe.hpp"
#include "text.hpp"

namespace debias::commands {
namespace {

std::string figure(double x, int digits = 3) { return std::isfinite(x) ? rounded(x, digits) : "-"; }

std::string text_of(const TailIndex& tail) {
  if (tail.state == TailState::too_few) return "no shape: too few values beyond the most common ones";
  if (tail.state == TailState::bounded) return "bounded: the outermost value is too common for a tail";
  return "k = " + figure(tail.k) + " +- " + figure(tail.error, 2) + " (" + std::to_string(tail.values) + " values; " +
         (tail.ties ? "with ties as they are " + figure(tail.plain) + ", " : "") + "Hill " + figure(tail.hill) +
         ", moment " + figure(tail.moment) + ", Pickands " + figure(tail.pickands) + ")";
}

// Neighbours that resemble each other make the means of blocks scatter more than single values say.
void judge_blocks(Diagnosis& d) {
  constexpr double limit = 1.5;
  constexpr std::size_t fewest_blocks = 32;
  if (d.block_means.size() < 2) return;
  d.block_interval = batch_interval(d.block_means);
  if (d.block_means.size() < fewest_blocks || d.block_length < 2) return;
  const double ratio = (d.block_interval.high - d.block_interval.low) / (d.interval.high - d.interval.low);
  if (ratio < limit) return;
  d.warnings.push_back("the interval by blocks is " + rounded(ratio, 2) + " times as wide (threshold " +
                       rounded(limit) +
                       "): values depend on their neighbours, so the standard error is too small; take the blocks.");
}

}  // namespace

double square_share(const Diagnosis& d, double value) {
  return (value - d.moments.mean) * (value - d.moments.mean) / d.moments.m2;
}

namespace {

void print_values(std::ostream& out, const Diagnosis& d) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Moments& m = d.moments;
  print_line(out, "file", d.file + (d.column.empty() ? "" : ", column " + d.column));
  print_line(out, "values", std::to_string(m.count));
  const auto at = [&d](std::int64_t row) { return d.unit + " " + std::to_string(row); };
  if (d.bad_rows > 0) print_line(out, "bad rows", std::to_string(d.bad_rows) + ", left out of everything below");
  for (const BadRow& bad : d.first_bad_rows) print_line(out, "", at(bad.row) + ": " + bad.reason);
  if (d.nonfinite > 0) {
    print_line(out, "mean",
               "not a number: " + std::to_string(d.nonfinite) + " values are not finite, the first in " +
                   at(d.first_nonfinite));
    return;
  }
  const RunVerdict& v = d.verdict;
  const double error = m.standard_error();
  const char* doubt = v.interval_reliable() ? "" : " (unreliable, see verdict)";
  print_line(out, "mean",
             std::isfinite(error) && error > 0
                 ? with_error(m.mean, error) + "   95 % interval [" + rounded(d.interval.low, 8) + ", " +
                       rounded(d.interval.high, 8) + "]" + doubt
                 : to_text(m.mean));
  if (m.count < 2) {
    print_line(out, "warning", "one value has no standard error.");
    return;
  }
  if (!(m.m2 > 0)) {
    print_line(out, "verdict", "all values are equal: there is no variance to judge.");
    return;
  }
  if (!std::isfinite(m.m2)) {
    print_line(out, "warning", "squares of these values overflow, so there is no standard error; scale them.");
    return;
  }
  print_line(out, "in blocks",
             "95 % interval [" + rounded(d.block_interval.low, 8) + ", " + rounded(d.block_interval.high, 8) + "] by " +
                 std::to_string(d.block_means.size()) + " means of " + std::to_string(d.block_length) +
                 " neighbours, t quantiles");
  if (d.robust.groups > 0) {
    print_line(out, "robust",
               rounded(d.robust.value, 8) + " (median of " + std::to_string(d.robust.groups) +
                   " means: BIASED for skewed values, never to be averaged)");
  }
  print_line(out, "kurtosis", figure(m.kurtosis(), 4));
  print_line(out, "upper tail", text_of(v.upper));
  print_line(out, "lower tail", text_of(v.lower));
  const char* name = "largest";
  for (const LargeSample& l : d.largest) {
    print_line(out, name,
               rounded(l.value, 8) + " in " + at(l.index) + ", " + rounded(100 * square_share(d, l.value), 2) +
                   " % of the squares about the mean");
    name = "";
    if (&l - d.largest.data() == 2) break;
  }
  print_line(out, "running", "values, mean, standard error:");
  std::vector<Row> rows;
  for (const Moments& r : d.running) {
    if (r.count < 16 && r.count < m.count) continue;
    const double e = r.count > 1 ? r.standard_error() : nan;
    rows.push_back({std::string(12, ' '), std::to_string(r.count), rounded(r.mean, 8), figure(e, 3)});
  }
  print_table(out, rows);
  name = "verdict";
  for (const std::string& sentence : v.sentences()) {
    print_line(out, name, sentence);
    name = "";
  }
}

}  // namespace

void print(std::ostream& out, const Diagnosis& d) {
  print_values(out, d);
  for (const std::string& warning : d.warnings) print_line(out, "warning", warning);
}

void conclude(Diagnosis& d) {
  if (d.nonfinite > 0 || d.moments.count < 2) return;
  d.interval = interval_of(d.moments);
  d.verdict = judge(d.moments, d.upper_tail, d.lower_tail);
  if (d.moments.m2 > 0) judge_blocks(d);
  const auto values = std::span<const double>(d.block_means);
  if (values.size() >= 24) d.robust = median_of_means(values);
}

Fields fields(const Diagnosis& d) {
  const bool has_mean = d.nonfinite == 0;
  const bool has_error = has_mean && d.moments.count > 1;
  const bool varies = has_error && d.moments.m2 > 0;  // infinite where squares overflow
  const auto where = [](bool known, Node x) { return known ? std::move(x) : Node(nullptr); };
  List running;
  if (has_mean) {
    running = list_of(d.running, [&where](const Moments& r) {
      return Fields{{"values", r.count},
                    {"mean", r.mean},
                    {"standard_error", where(r.count > 1, r.count > 1 ? r.standard_error() : 0)}};
    });
  }
  Fields f = {{"file", d.file},
              {"column", where(!d.column.empty(), d.column)},
              {"values", d.moments.count},
              {"bad_rows", d.bad_rows},
              {"first_bad_rows", list_of(d.first_bad_rows,
                                         [](const BadRow& bad) {
                                           return Fields{{"row", bad.row}, {"reason", bad.reason}};
                                         })},
              {"nonfinite", d.nonfinite},
              {"first_nonfinite", where(d.nonfinite > 0, d.first_nonfinite)},
              {"mean", where(has_mean, d.moments.mean)},
              {"standard_error", where(has_error, has_error ? d.moments.standard_error() : 0)},
              {"interval", where(has_error, describe(d.interval))},
              {"block_interval", where(varies, describe(d.block_interval))},
              {"blocks", d.block_means.size()},
              {"block_length", d.block_length},
              {"biased_median_of_means", where(varies && d.robust.groups > 0, d.robust.value)},
              {"verdict", varies ? Node(describe(d.verdict)) : Node(nullptr)},
              {"largest", list_of(d.largest,
                                  [&](const LargeSample& l) {
                                    return Fields{{"row", l.index},
                                                  {"value", l.value},
                                                  {"share", where(varies, varies ? square_share(d, l.value) : 0)}};
                                  })},
              {"running", std::move(running)},
              {"warnings", d.warnings},
              {"status", d.nonfinite > 0                ? "nonfinite"
                         : d.bad_rows > 0               ? "bad_rows"
                         : !has_error                   ? "one_sample"
                         : !varies                      ? "zero_variance"
                         : !std::isfinite(d.moments.m2) ? "overflow"
                                                        : "ok"}};
  append(f, versions());
  return f;
}

}  // namespace debias::commands
