#include <debias/core/accumulator.hpp>

#include <stdexcept>
#include <string>

namespace debias {
namespace {

// Eight independent partial sums: the order is fixed, and a compiler can keep them in vector registers.
constexpr std::size_t partial_sums = 8;

double total(const std::array<double, partial_sums>& s) {
  return ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]));
}

template <class Term>
double lane_sum(std::span<const double> values, const Term& term) {
  std::array<double, partial_sums> s{};
  std::size_t i = 0;
  for (; i + partial_sums <= values.size(); i += partial_sums) {
    for (std::size_t l = 0; l < partial_sums; ++l) s[l] += term(values[i + l]);
  }
  for (std::size_t l = 0; i < values.size(); ++i, ++l) s[l] += term(values[i]);
  return total(s);
}

// Third and fourth powers of deviations far from 1 are zeros or infinite: m3 and m4 are sums in a unit 2^octaves, that of the
// deviations, where these are not within 2^-240 ... 2^240. It is a function of m2, so that nobody has to keep it.
int octaves_of(double m2, std::int64_t count) {
  if (!(m2 > 0) || !std::isfinite(m2)) return 0;
  const int octaves = std::ilogb(m2 / static_cast<double>(count));
  return std::abs(octaves) <= 480 ? 0 : octaves / 2;
}

Moments in_unit(Moments m, int octaves) {
  const int change = octaves_of(m.m2, m.count) - octaves;
  m.mean = std::ldexp(m.mean, -octaves);
  m.m2 = std::ldexp(m.m2, -2 * octaves);
  m.m3 = std::ldexp(m.m3, 3 * change);
  m.m4 = std::ldexp(m.m4, 4 * change);
  return m;
}

}  // namespace

Moments Moments::of(std::span<const double> values) {
  Moments m;
  if (values.empty()) return m;
  const auto n = static_cast<double>(values.size());
  const double rough = lane_sum(values, [](double x) { return x; }) / n;
  // The second pass takes out what rounding left: equal values have their own value as mean, and variance 0.
  const double mean = rough + lane_sum(values, [rough](double x) { return x - rough; }) / n;
  const auto square = [mean](double x) {
    const double d = x - mean;
    return d * d;
  };
  m.count = static_cast<std::int64_t>(values.size());
  m.mean = mean;
  m.m2 = lane_sum(values, square);
  if (const int octaves = octaves_of(m.m2, m.count); octaves != 0) {
    const auto deviation = [&](double x) { return std::ldexp(x - mean, -octaves); };
    m.m3 = lane_sum(values, [&](double x) { return std::pow(deviation(x), 3); });
    m.m4 = lane_sum(values, [&](double x) { return std::pow(deviation(x), 4); });
    return m;
  }
  m.m3 = lane_sum(values, [&](double x) { return square(x) * (x - mean); });
  m.m4 = lane_sum(values, [&](double x) { return square(x) * square(x); });
  return m;
}

namespace {

// Pebay 2008, (2.1) to (2.4)
void merge_sums(Moments& a, const Moments& b) {
  const auto na = static_cast<double>(a.count);
  const auto nb = static_cast<double>(b.count);
  const double n = na + nb;
  const double delta = b.mean - a.mean;
  const double d = delta / n;
  const double d2 = d * d;
  a.m4 += b.m4 + delta * d * d2 * na * nb * (na * na - na * nb + nb * nb) + 6 * d2 * (na * na * b.m2 + nb * nb * a.m2) +
          4 * d * (na * b.m3 - nb * a.m3);
  a.m3 += b.m3 + delta * d2 * na * nb * (na - nb) + 3 * d * (na * b.m2 - nb * a.m2);
  a.m2 += b.m2 + delta * d * na * nb;
  a.mean += d * nb;
  a.count += b.count;
}

}  // namespace

void Moments::merge(const Moments& b) {
  if (b.count == 0) return;
  if (count == 0) {
    *this = b;
    return;
  }
  Moments sum = *this;
  merge_sums(sum, b);
  const int octaves = octaves_of(sum.m2, sum.count);
  if (octaves != 0 || octaves_of(m2, count) != 0 || octaves_of(b.m2, b.count) != 0) {
    Moments powers = in_unit(*this, octaves);
    merge_sums(powers, in_unit(b, octaves));
    sum.m3 = powers.m3;
    sum.m4 = powers.m4;
  }
  *this = sum;
}

double Moments::variance() const {
  return count < 2 ? std::numeric_limits<double>::quiet_NaN() : m2 / static_cast<double>(count - 1);
}

double Moments::standard_error() const { return std::sqrt(variance() / static_cast<double>(count)); }

double Moments::skewness() const {
  const double v = std::ldexp(m2 / static_cast<double>(count), -2 * octaves_of(m2, count));
  return m2 > 0 ? m3 / static_cast<double>(count) / (v * std::sqrt(v)) : 0;
}

double Moments::kurtosis() const {
  const double v = std::ldexp(m2 / static_cast<double>(count), -2 * octaves_of(m2, count));
  return m2 > 0 ? m4 / static_cast<double>(count) / (v * v) : 0;
}

void ComponentMoments::merge(const ComponentMoments& b) {
  if (b.count_ == 0) return;
  if (count_ == 0) {
    *this = b;
    return;
  }
  if (entries_.size() != b.entries_.size()) size_mismatch(b.entries_.size());
  const auto na = static_cast<double>(count_);
  const auto nb = static_cast<double>(b.count_);
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const double delta = b.entries_[i].mean - entries_[i].mean;
    entries_[i].mean += delta * (nb / (na + nb));
    entries_[i].m2 += b.entries_[i].m2 + delta * delta * (na * nb / (na + nb));
  }
  count_ += b.count_;
}

void ComponentMoments::size_mismatch(std::size_t components) const {
  throw std::invalid_argument("estimate: a sample has " + std::to_string(components) +
                              " components where an earlier one had " + std::to_string(entries_.size()) +
                              " (all samples of a run must have the same shape)");
}

void LevelSums::merge(const LevelSums& other) {
  const bool others_unit = other.square > square;  // the larger of two that differ
  const double other_unit = other.square == 0 ? unit : other.unit;
  if (unit == other_unit || square == 0) {
    unit = other_unit;
    fourth += other.fourth;
  } else {
    const double common = others_unit ? other_unit : unit;
    const auto in = [common](double sum, double own) { return sum * (common / own) * (common / own); };
    fourth = in(fourth, unit) + in(other.fourth, other_unit);
    unit = common;
  }
  count += other.count;
  difference += other.difference;
  square += other.square;
  work += other.work;
}

double LevelSums::far_unit(double d2) {
  if (!std::isfinite(d2)) return 1;
  // Room for values of 2^450 times this size.
  return std::ldexp(1.0, (d2 < 1 ? -400 : 400) - std::ilogb(d2));
}

double LevelSums::kurtosis() const {
  if (square == 0) return 0;
  const double q = square * unit;
  return fourth * static_cast<double>(count) / (q * q);
}

void LevelTable::merge(const LevelTable& other) {
  if (other.base_.count > 0) base_level_ = other.base_level_;
  base_.merge(other.base_);
  if (rows_.size() < other.rows_.size()) rows_.resize(other.rows_.size());
  for (std::size_t i = 0; i < other.rows_.size(); ++i) rows_[i].merge(other.rows_[i]);
}

std::pair<std::int64_t, std::int64_t> LevelTable::levels_of_row(std::size_t row) {
  const auto i = static_cast<std::int64_t>(row);
  if (i < single_levels) return {i, i};
  const std::int64_t first = single_levels << (i - single_levels);
  return {first, first + (first - 1)};
}

void Extremes::add(std::span<const double> values, std::span<const std::int64_t> levels, std::int64_t first_index,
                   std::int64_t step) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double x = values[i] + 0.0;  // -0 becomes 0: equal values must have equal bits
    const LargeSample candidate{first_index + static_cast<std::int64_t>(i) * step, levels[i], x};
    if (!std::isfinite(x)) [[unlikely]] {
      add_nonfinite(candidate.index);
      continue;
    }
    if (upper_.wants(x)) upper_.add(x);
    if (lower_.wants(x)) lower_.add(x);
    if (largest_.wants(candidate)) largest_.add(candidate);
  }
}

void Extremes::add_nonfinite(std::int64_t index) {
  ++nonfinite_;
  if (first_nonfinite_ < 0 || index < first_nonfinite_) first_nonfinite_ = index;
}

void Extremes::merge(const Extremes& other) {
  upper_.merge(other.upper_);
  lower_.merge(other.lower_);
  largest_.merge(other.largest_);
  if (other.nonfinite_ == 0) return;
  add_nonfinite(other.first_nonfinite_);
  nonfinite_ += other.nonfinite_ - 1;
}

void Extremes::hand_over(Extremes& others) {
  upper_.hand_over(others.upper_);
  lower_.hand_over(others.lower_);
  largest_.hand_over(others.largest_);
  if (nonfinite_ == 0) return;
  others.add_nonfinite(first_nonfinite_);
  others.nonfinite_ += nonfinite_ - 1;
  nonfinite_ = 0;
  first_nonfinite_ = -1;
}

void Accumulator::merge(const Accumulator& right) {
  moments.merge(right.moments);
  components.merge(right.components);
  levels.merge(right.levels);
  coupling.merge(right.coupling);
  work += right.work;
}

void Recorder::flush() {
  const std::span values(values_.data(), filled_);
  sums_.moments.merge(Moments::of(values));
  const auto known = static_cast<std::size_t>(
      std::clamp<std::int64_t>((known_ - first_) / block_, 0, static_cast<std::int64_t>(filled_)));
  extremes_.add(values.subspan(known), std::span(levels_.data(), filled_).subspan(known),
                first_ + static_cast<std::int64_t>(known) * block_, block_);
  first_ = next_index();
  filled_ = 0;
}

}  // namespace debias
