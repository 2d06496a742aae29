#include "diagnose.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>

#include <debias/statistics/dependent.hpp>

#include "core/text.hpp"
#include "core/words.hpp"
#include "describe.hpp"
#include "text.hpp"

namespace debias::commands {
namespace {

std::string figure_or_dash(double x, int digits = 3) { return std::isfinite(x) ? rounded(x, digits) : "-"; }

// Values that depend on their neighbours are large together: what 400 of them say may be the word of ten. Means of blocks as long
// as the dependence have the tails of the values, and are nearly independent.
RunVerdict verdict_of_blocks(const Diagnosis& d, double time) {
  std::vector<double> means = d.block_means;
  for (auto length = static_cast<double>(d.block_length); length < time && means.size() > 1; length *= 2) {
    for (std::size_t i = 0; 2 * i + 1 < means.size(); ++i) means[i] = (means[2 * i] + means[2 * i + 1]) / 2;
    means.resize(means.size() / 2);
  }
  const Moments moments = Moments::of(means);
  std::sort(means.begin(), means.end());
  const std::vector<double> descending(means.rbegin(), means.rend());
  return judge(moments, descending, means);
}

// Values that depend on their neighbours: an error that allows for it, or a word where they alternate.
void judge_dependence(Diagnosis& d) {
  const Dependence dependence = dependence_of(d.block_means, d.block_length, d.moments);
  if (!dependence.matters()) return;
  if (dependence.time < 1) {
    d.warnings.push_back({WarningCode::alternation, "values alternate about their mean: its standard error is about " +
                                                        rounded(1 / std::sqrt(dependence.time), 2) +
                                                        " times too large; take the blocks."});
    return;
  }
  d.interval = interval_with(d.moments.mean, dependence.standard_error, dependence.degrees);
  d.standard_error = dependence.standard_error;
  d.interval_degrees = dependence.degrees;
  d.warnings.push_back(
      {WarningCode::dependence, "values depend on their neighbours: the standard error is " +
                                    rounded(dependence.standard_error / d.moments.standard_error(), 2) +
                                    " times that of independent values, and the interval allows for it."});
  RunVerdict& v = d.verdict;
  if (v.variance == Finiteness::finite && verdict_of_blocks(d, dependence.time).variance != Finiteness::finite) {
    v.variance = Finiteness::undecided;
    if (v.fourth_moment == Finiteness::finite) v.fourth_moment = Finiteness::undecided;
  }
  v.grade = v.variance == Finiteness::undecided ? Grade::open : std::min(v.grade, Grade::likely);
  // Where that is not known the interval is not reliable.
  v.degrees = dependence.known() ? dependence.degrees : std::min(dependence.degrees, 4.0);
}

// ", of big-endian float32", ", columns by ';'": what was taken for what.
std::string text_of(const numbers::Report& r) {
  using numbers::Format;
  const bool big = r.order == numbers::ByteOrder::big;
  if (r.format == Format::npy) return ".npy, " + r.type;
  if (r.format != Format::text) {
    return std::string(big ? "big-endian" : "little-endian") +
           (r.format == Format::f32 ? " 32-bit floats" : " doubles");
  }
  std::string text = "text, ";
  if (r.separator == 0) {
    text += "a number a row";
  } else {
    const std::string name = r.separator == '\t'  ? "tabs"
                             : r.separator == ' ' ? "blanks"
                                                  : std::string("'") + r.separator + "'";
    text += "column " + std::to_string(r.column_number) + " of " + std::to_string(r.columns) + " between " + name +
            (r.separator_guessed ? " (guessed)" : "");
  }
  std::string row = r.first_row.substr(0, 60);
  for (char& c : row) c = static_cast<unsigned char>(c) < ' ' || c == '\x7f' ? ' ' : c;
  text += r.header ? "; header: " + row : "; no header";
  if (r.header_guessed) text += " (guessed)";
  if (r.comments > 0) text += "; comments: " + std::to_string(r.comments);
  return text;
}

// The sum of the rows that have a value, or should.
std::string share_of_rows(const numbers::Report& r) {
  return std::to_string(r.bad_rows) + " of " + std::to_string(r.bad_rows + r.values);
}

/// What no double holds is said in words.
std::string end_of(double x, int digits) {
  if (std::isnan(x)) return "unknown";
  if (std::isinf(x)) return x > 0 ? "beyond 1.8e308" : "beyond -1.8e308";
  return rounded(x, digits);
}

std::string text_of(const Interval& interval) {
  const int digits = digits_of_ends(interval.low, interval.high);
  return "95 % interval [" + end_of(interval.low, digits) + ", " + end_of(interval.high, digits) + "]";
}

}  // namespace

double square_share(const Diagnosis& d, double value) {
  const double distance = std::ldexp(value, -d.scale) - d.moments.mean;
  return distance * distance / d.moments.m2;
}

namespace {

void print_values(std::ostream& out, const Diagnosis& d, bool full) {
  const Moments& m = d.moments;
  const numbers::Report& r = d.read;
  const auto at = [&d](std::int64_t row) { return d.unit + " " + std::to_string(row); };
  if (r.bad_rows > 0) {
    print_line(
        out, "bad rows",
        share_of_rows(r) + (r.bad_rows == 1 ? " holds" : " hold") + " no number; everything below is without them");
    for (const numbers::BadRow& bad : r.first_bad_rows) print_line(out, "", at(bad.row) + ": " + bad.reason);
  }
  print_line(out, "file", d.file + (r.column.empty() ? "" : ", column " + r.column));
  print_line(out, "read as", text_of(r));
  print_line(out, "values", std::to_string(m.count));
  if (d.nonfinite > 0) {
    print_line(out, "mean",
               "not a number: " + counted(d.nonfinite, "value") + are(d.nonfinite) + " not finite, the first in " +
                   at(d.first_nonfinite));
    return;
  }
  const RunVerdict& v = d.verdict;
  const char* doubt = v.interval_reliable() ? "" : " (unreliable, see verdict)";
  const std::string rest = r.bad_rows > 0 ? " (without " + counted(r.bad_rows, "bad row") + ")" : "";
  print_line(out, "mean",
             m.count > 1 && d.standard_error > 0
                 ? with_error(d.mean, d.standard_error) + rest + "   " + text_of(d.interval) + doubt
                 : to_text(d.mean) + rest);
  if (m.count < 2) return;
  if (!(m.m2 > 0)) {
    print_line(out, "verdict", "all values are equal: there is no variance to judge.");
    return;
  }
  if (!full) {
    print_line(out, "verdict", v.sentence());
    return;
  }
  if (!d.block_means.empty()) {
    print_line(out, "in blocks",
               text_of(d.block_interval) + " by " + std::to_string(d.block_means.size()) + " means of " +
                   std::to_string(d.block_length) + " neighbours, t quantiles");
  }
  if (d.robust.groups > 0) {
    print_line(out, "robust",
               rounded(d.robust.value, 8) + " (median of " + std::to_string(d.robust.groups) +
                   " means: BIASED for skewed values, never to be averaged)");
  }
  print_line(out, "kurtosis", figure_or_dash(m.kurtosis(), 4));
  print_line(out, "upper tail", tail_words(v.upper));
  print_line(out, "lower tail", tail_words(v.lower));
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
  for (const RunningMean& mean : d.running) {
    if (mean.count < 16 && mean.count < m.count) continue;
    rows.push_back({std::string(12, ' '), std::to_string(mean.count), rounded(mean.mean, 8),
                    figure_or_dash(mean.standard_error, 3)});
  }
  print_table(out, rows);
  name = "verdict";
  for (const std::string& sentence : v.sentences()) {
    print_line(out, name, sentence);
    name = "";
  }
}

// Values in [2^-100, 2^100] are left as they are: fourth powers of these, and of their differences, are doubles.
int scale_for(int exponent) { return std::abs(exponent) <= 100 ? 0 : exponent; }

Interval scaled(const Interval& interval, int exponent) {
  return {std::ldexp(interval.low, exponent) + 0.0, std::ldexp(interval.high, exponent) + 0.0, interval.confidence};
}

}  // namespace

// A power of two changes no digit. It follows the largest value seen: what becomes too small to count beside it could
// not be seen beside it either.
void Sums::choose_scale(std::span<const double> values) {
  double largest = largest_;
  for (const double x : values) {
    const double size = std::abs(x);
    if (size > largest && size <= std::numeric_limits<double>::max()) largest = size;
  }
  if (!(largest > largest_)) return;
  const bool first = largest_ == 0;  // only zeros so far
  largest_ = largest;
  const int wanted = scale_for(std::ilogb(largest));
  if (!first && std::ilogb(largest) - scale_ <= 100) return;
  const int change = std::exchange(scale_, wanted) - wanted;
  if (change == 0) return;
  moments_.mean = std::ldexp(moments_.mean, change);
  moments_.m2 = std::ldexp(moments_.m2, 2 * change);
  moments_.m3 = std::ldexp(moments_.m3, 3 * change);
  moments_.m4 = std::ldexp(moments_.m4, 4 * change);
  blocks_.scale(change);
}

void Sums::flush() {
  std::span<const double> values = std::span(block_).first(filled_);
  extremes_.add(values, std::span(no_levels_).first(filled_), first_row_);
  choose_scale(values);
  if (scale_ != 0) {
    for (double& x : std::span(block_).first(filled_)) x = std::ldexp(x, -scale_);
  }
  for (const double x : values) blocks_.add(x);
  while (!values.empty()) {  // stop at each doubling
    const auto room = static_cast<std::size_t>(next_ - moments_.count);
    const auto part = values.first(std::min(values.size(), room));
    moments_.merge(Moments::of(part));
    values = values.subspan(part.size());
    if (moments_.count < next_) continue;
    running_.push_back(
        {moments_.count, std::ldexp(moments_.mean, scale_), std::ldexp(moments_.standard_error(), scale_)});
    next_ *= 2;
  }
  filled_ = 0;
}

void Sums::finish(Diagnosis& d) {
  flush();
  d.scale = scale_;
  d.moments = moments_;
  d.mean = std::ldexp(moments_.mean, scale_);
  d.standard_error = std::ldexp(moments_.standard_error(), scale_);
  d.running = std::move(running_);
  const bool at_the_end = !d.running.empty() && d.running.back().count == moments_.count;
  if (!at_the_end && moments_.count > 0) d.running.push_back({moments_.count, d.mean, d.standard_error});
  d.upper_tail = extremes_.upper_tail();
  d.lower_tail = extremes_.lower_tail();
  for (std::vector<double>* tail : {&d.upper_tail, &d.lower_tail}) {
    if (scale_ == 0) continue;
    constexpr double nothing = 1e-290;  // beside values near 1; what is left of digits here has no shape
    for (double& x : *tail) {
      x = std::ldexp(x, -scale_);
      if (std::abs(x) < nothing) x = 0;
    }
  }
  d.largest = extremes_.largest();
  d.nonfinite = extremes_.nonfinite();
  d.first_nonfinite = extremes_.first_nonfinite();
  d.block_means = blocks_.means();
  d.block_length = blocks_.length();
}

void print(std::ostream& out, const Diagnosis& d, bool full) {
  print_values(out, d, full);
  for (const Warning& warning : d.warnings) print_line(out, "warning", warning.text);
}

Interval interval_at(double confidence, double mean, double error, double degrees) {
  return interval_with(mean, error, degrees, confidence);
}

void judge(Diagnosis& d) {
  if (d.nonfinite == 0 && d.moments.count == 1) {
    d.warnings.push_back({WarningCode::one_sample, "one value has no standard error."});
  }
  if (d.nonfinite > 0 || d.moments.count < 2) return;
  d.interval = interval_of(d.moments);
  d.standard_error = d.moments.standard_error();
  d.interval_degrees = static_cast<double>(d.moments.count - 1);
  if (d.block_means.size() > 1) d.block_interval = batch_interval(d.block_means);
  d.verdict = judge(d.moments, d.upper_tail, d.lower_tail);
  if (d.moments.m2 > 0) judge_dependence(d);
  const auto values = std::span<const double>(d.block_means);
  if (values.size() >= 24) {
    d.robust = median_of_means(values);
    d.robust.value = std::ldexp(d.robust.value, d.scale);
  }
  for (TailIndex* tail : {&d.verdict.upper, &d.verdict.lower}) tail->cutoff = std::ldexp(tail->cutoff, d.scale);
  d.interval = scaled(d.interval, d.scale);
  d.standard_error = std::ldexp(d.standard_error, d.scale);
  d.block_interval = scaled(d.block_interval, d.scale);
}

Diagnosis diagnose(const DiagnoseRequest& request) {
  Diagnosis d;
  Sums sums;
  d.read = numbers::read(request.bytes, request.reading,
                         [&sums](std::span<const double> values, std::int64_t row) { sums.add(values, row); });
  sums.finish(d);
  if (d.read.format != numbers::Format::text) d.unit = "value";
  judge(d);
  return d;
}

namespace {

// What was taken for what.
Fields describe(const numbers::Report& r) {
  using numbers::Format;
  const bool text = r.format == Format::text;
  const auto of_text = [text](Node value) { return text ? std::move(value) : Node(nullptr); };
  const char* separator = r.separator == '\t' ? "tab" : r.separator == ' ' ? "space" : nullptr;
  return {{"format", text                      ? "text"
                     : r.format == Format::npy ? "npy"
                     : r.format == Format::f32 ? "f32"
                                               : "f64"},
          {"byte_order", text ? Node(nullptr) : Node(r.order == numbers::ByteOrder::big ? "big" : "little")},
          {"type", r.type.empty() ? Node(nullptr) : Node(r.type)},
          {"separator", r.separator == 0       ? Node(nullptr)
                        : separator != nullptr ? Node(separator)
                                               : Node(std::string(1, r.separator))},
          {"separator_guessed", of_text(r.separator_guessed)},
          {"columns", r.columns},
          {"column", r.column_number},
          {"header", r.header},
          {"header_guessed", of_text(r.header_guessed)},
          {"first_row", of_text(r.first_row)},
          {"comments", r.comments}};
}

}  // namespace

Fields fields(const Diagnosis& d) {
  const bool has_mean = d.nonfinite == 0;
  const bool has_error = has_mean && d.moments.count > 1;
  const bool varies = has_error && d.moments.m2 > 0;
  const auto where = [](bool known, Node x) { return known ? std::move(x) : Node(nullptr); };
  List running;
  if (has_mean) {
    running = list_of(d.running, [](const RunningMean& r) {
      return Fields{{"values", r.count}, {"mean", r.mean}, {"standard_error", r.standard_error}};
    });
  }
  Fields f = {{"file", d.file},
              {"column", where(!d.read.column.empty(), d.read.column)},
              {"bad_rows", d.read.bad_rows},
              {"first_bad_rows", list_of(d.read.first_bad_rows,
                                         [](const numbers::BadRow& bad) {
                                           return Fields{{"row", bad.row}, {"reason", bad.reason}};
                                         })},
              {"read", describe(d.read)},
              {"values", d.moments.count},
              {"nonfinite", d.nonfinite},
              {"first_nonfinite", where(d.nonfinite > 0, d.first_nonfinite)},
              {"mean", where(has_mean, d.mean)},
              {"standard_error", where(has_error, d.standard_error)},
              {"interval", has_error ? Node(describe(d.interval)) : Node(nullptr)},
              {"block_interval", varies ? Node(describe(d.block_interval)) : Node(nullptr)},
              {"blocks", d.block_means.size()},
              {"block_length", d.block_length},
              {"biased_median_of_means", where(varies && d.robust.groups > 0, d.robust.value)},
              {"verdict", varies ? Node(describe(d.verdict)) : Node(nullptr)},
              {"largest", list_of(d.largest,
                                  [&](const LargeSample& l) {
                                    return Fields{{"row", l.index},
                                                  {"value", l.value},
                                                  {"share", varies ? Node(square_share(d, l.value)) : Node(nullptr)}};
                                  })},
              {"running", std::move(running)},
              {"warnings", d.warnings},
              {"status", d.nonfinite > 0       ? "nonfinite"
                         : d.read.bad_rows > 0 ? "bad_rows"
                         : !has_error          ? "one_sample"
                         : !varies             ? "zero_variance"
                                               : "ok"}};
  append(f, versions());
  return f;
}

}  // namespace debias::commands
