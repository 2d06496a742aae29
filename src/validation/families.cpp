#include "families.hpp"

#include <math.h>  // lgamma_r
#include <algorithm>

#include <cmath>
#include <limits>
#include <numbers>

#include "core/text.hpp"

namespace debias::validation {

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr std::int64_t table_levels = 512;
constexpr double noise_steps = 1024;  // the noise takes the first bits of a number, the sign the others
// Uniform on 1024 points: variance (1 - 2^-20) / 12 of their range; its kurtosis is a little below 9/5.
const double noise_scale = std::sqrt(12 / (1 - 0x1p-20));
constexpr double noise_kurtosis = 1.8 * (1 - 0x1p-20 * 7 / 3) / (1 - 0x1p-20);

double uniform(Stream& rng, double low, double high) { return low + (high - low) * rng.uniform(); }
double log_uniform(Stream& rng, double low, double high) {
  return std::exp(uniform(rng, std::log(low), std::log(high)));
}
bool one_in(Stream& rng, double n) { return rng.uniform() * n < 1; }

double as_double(std::int64_t k) { return static_cast<double>(k); }

bool is_zero(const Family& f, std::int64_t k) { return k >= 1 && (k <= f.pause || (f.end > 0 && k > f.end)); }
bool is_aliased(const Family& f, std::int64_t k) { return f.aliased && k == f.pause + 1; }
bool is_heavy(const Family& f, std::int64_t k) { return f.heavy_levels > 0 && k <= f.heavy_levels; }
bool never_finite(const Family& f) { return f.shape == Shape::pareto && f.shape_parameter <= 2; }

double wave(const Family& f, std::int64_t k) { return std::cos(f.wave_frequency * as_double(k) + f.wave_phase); }

/// log2 E D_k^2.
double log2_second(const Family& f, std::int64_t k) {
  const double x = as_double(k - f.pause);
  if (f.powers) return f.prefactor - f.beta * std::log2(as_double(k) + 1);
  if (f.factorial > 0) {
    int sign = 1;  // std::lgamma writes it to a global, which other threads share
    return f.prefactor + 2 * (x * std::log2(f.factorial) - ::lgamma_r(x + 1, &sign) / std::numbers::ln2);
  }
  const double early = std::min(x, as_double(f.change_level));
  double b = f.prefactor - f.early_slope * early - f.beta * (x - early);
  const double distance = (x - f.hump_level) / f.hump_width;
  if (f.hump_height != 0) b += f.hump_height * std::exp(-distance * distance);
  if (f.wave_size != 0) b += f.wave_size * wave(f, k);
  return b;
}

double nonzero(const Family& f, std::int64_t k) {
  return std::min(1.0, f.rarity * std::exp2(-f.rarity_slope * as_double(k)));
}

double bias(const Family& f, std::int64_t k) {
  double c =
      f.powers ? f.bias * std::pow(as_double(k) + 1, -f.bias_slope) : f.bias * std::exp2(-f.bias_slope * as_double(k));
  if (f.wave_signs) c *= wave(f, k) < 0 ? -1 : 1;
  return c;
}

double work(const Family& f, std::int64_t k) {
  return f.work_powers ? std::pow(as_double(k) + 1, f.gamma) : std::exp2(f.gamma * as_double(k));
}

/// Where the limit is one constant, Var I_k falls like the root of E D_k^2, but no faster than the work grows: else one
/// deep level would do.
double noise(const Family& f, std::int64_t k) {
  if (!f.constant_limit) return f.spread;
  const double slope = std::max(0.1, std::min(f.beta / 4, f.gamma / 2));
  return f.spread * std::exp2(-slope * as_double(std::max<std::int64_t>(0, k - f.pause)));
}

double heavy(const Family& f, std::int64_t k) { return k < f.heavy_levels ? f.spread * std::exp2(-as_double(k)) : 0; }

/// The feature's level: 1 ... three quarters of the levels reached, one in six up to four beyond.
std::int64_t feature_level(Stream& rng, std::int64_t reached) {
  const bool beyond = one_in(rng, 6);
  const double u = rng.uniform();
  if (beyond) return reached + 1 + static_cast<std::int64_t>(4 * u);
  return 1 + static_cast<std::int64_t>(u * std::max(1.0, 0.75 * as_double(reached)));
}

}  // namespace

const char* name_of(Kind kind) {
  constexpr const char* names[kinds] = {"plain",       "hump",  "slope",   "rarity", "tail",
                                        "oscillation", "pause", "moments", "end",    "polynomial"};
  return names[static_cast<int>(kind)];
}

Family draw_family(std::uint64_t seed, int index) {
  Stream rng = Stream(seed, static_cast<std::uint64_t>(index)).split(0x756e7365656eu);
  Family f;
  f.seed = seed;
  f.index = index;
  f.kind = static_cast<Kind>(index % kinds);
  const int turn = index / kinds % 4;

  f.gamma = uniform(rng, 0.2, 1.5);
  const double low = turn < 2 ? 0.5 : -1.5;
  const double high = turn == 2 ? -0.5 : 2.2;
  const double margin = uniform(rng, low, high);
  const bool slow = one_in(rng, 3);
  const double beta = rng.uniform();
  if (margin < 0 && !slow) f.gamma = 0.4 + 0.5 * beta - margin;
  f.beta = f.gamma + margin;
  const bool tiny = one_in(rng, 16);
  const double decades = rng.uniform();
  f.unit = std::pow(10.0, tiny ? -150 + 70 * decades : -6 + 12 * decades);
  f.mean = uniform(rng, -3, 3);
  f.spread = log_uniform(rng, 0.1, 2);
  f.prefactor = uniform(rng, -8, 6);
  f.bias = uniform(rng, -1, 1);
  f.bias_slope = uniform(rng, 0, 0.5);
  f.declares_rates = one_in(rng, 2);
  f.constant_limit = one_in(rng, 3) && f.beta > 0.4;
  if (one_in(rng, 5)) {
    f.shape = Shape::lognormal;
    f.shape_parameter = uniform(rng, 0.5, 1.2);
  }
  if (one_in(rng, 5)) f.rarity = std::pow(10.0, uniform(rng, -2, -0.3));

  const auto reached = [&] { return levels_reached(UnseenSequence(f), 1 << 16); };
  switch (f.kind) {
    case Kind::plain:
      if (one_in(rng, 4) && margin >= 0.5) {
        f.work_powers = true;
        f.constant_limit = false;
        f.beta = margin;
        f.gamma = uniform(rng, 0, 2);
      }
      break;
    case Kind::hump: {
      const bool down = one_in(rng, 4);
      f.hump_height = uniform(rng, 2, 10) * (down ? -1 : 1);
      f.hump_width = uniform(rng, 0.7, 2.5);
      f.hump_level = as_double(feature_level(rng, reached()));
      break;
    }
    case Kind::slope: {
      const bool slower = one_in(rng, 2);
      f.early_slope = f.beta + uniform(rng, 0.4, 2) * (slower ? 1 : -1);
      f.change_level = feature_level(rng, reached());
      break;
    }
    case Kind::rarity:
      switch (static_cast<int>(3 * rng.uniform())) {
        case 0:
          f.rarity = std::pow(10.0, uniform(rng, -3.5, -1));
          break;
        case 1:
          f.rarity = 1;
          f.rarity_slope = uniform(rng, 0.1, 1);
          break;
        default:
          f.rarity = std::pow(10.0, uniform(rng, -3, -1));
          f.early_slope = -uniform(rng, 0, 1.5);
          f.rarity_slope = -uniform(rng, 0.7, 2);
          f.change_level = static_cast<std::int64_t>(std::ceil(std::log2(f.rarity) / f.rarity_slope));
      }
      break;
    case Kind::tail: {
      f.rarity = 1;
      const bool power = one_in(rng, 2);
      f.shape = power ? Shape::pareto : Shape::lognormal;
      f.shape_parameter = power ? uniform(rng, 2.3, 6) : uniform(rng, 0.5, 1.2);
      break;
    }
    case Kind::oscillation:
      f.wave_size = uniform(rng, 1, 6) / 2;
      f.wave_frequency = uniform(rng, 0.4, std::numbers::pi);
      f.wave_phase = uniform(rng, 0, 2 * std::numbers::pi);
      f.wave_signs = one_in(rng, 2);
      break;
    case Kind::pause:
      f.pause = feature_level(rng, reached());
      f.aliased = one_in(rng, 2);
      f.constant_limit = f.aliased;
      if (f.aliased) f.rarity = 1;
      break;
    case Kind::moments:
      f.rarity = 1;
      if (turn % 2 == 0) {
        f.heavy_levels = 1 + static_cast<std::int64_t>(4 * rng.uniform());
        f.heavy_index = uniform(rng, 1.2, 1.9);
      } else {
        f.shape = Shape::pareto;
        f.shape_parameter = uniform(rng, 1.2, 1.9);
        f.beta = std::max(f.beta, 0.4);
      }
      break;
    case Kind::end:
      f.constant_limit = false;
      if (turn % 2 == 0) {
        f.states_end = one_in(rng, 2);
        f.end = feature_level(rng, reached());
      } else {
        f.factorial = log_uniform(rng, 0.5, 8);
      }
      f.declares_rates = false;
      break;
    case Kind::polynomial:
      f.powers = true;
      f.work_powers = !one_in(rng, 6);
      f.constant_limit = false;
      if (f.work_powers) {
        f.gamma = std::max(uniform(rng, 0, 2), 0.1 - margin);
        f.beta = 2 + f.gamma + margin;
      } else {
        f.beta = uniform(rng, 2.1, 4);
      }
      break;
  }

  // sum_k E|D_k| is finite, and so is the mean.
  if (!f.powers && f.factorial == 0) {
    if (f.beta < 0.3 && f.end == 0) f.rarity_slope = std::max(f.rarity_slope, 0.3 - f.beta);
  }
  return f;
}

std::string Family::description() const {
  const auto number = [](double x) { return format("%.2f", x); };
  std::string text;
  if (factorial > 0) {
    text = "(" + number(factorial) + "^k / k!)^2";
  } else {
    text = powers ? "(k+1)^-" + number(beta) : "2^(" + number(-beta) + " k)";
  }
  text += work_powers ? ", work (k+1)^" + number(gamma) : ", work 2^(" + number(gamma) + " k)";
  if (hump_height != 0) {
    text += ", hump " + number(hump_height) + " at " + format("%.0f", hump_level) + ", width " + number(hump_width);
  }
  if (change_level > 0) text += ", slope " + number(-early_slope) + " up to " + std::to_string(change_level);
  if (wave_size != 0) text += ", wave " + number(wave_size) + ", frequency " + number(wave_frequency);
  if (pause > 0) text += ", zero up to " + std::to_string(pause) + (aliased ? ", aliased" : "");
  if (end > 0) text += ", ends at " + std::to_string(end) + (states_end ? ", said so" : "");
  if (heavy_levels > 0) {
    text += ", no moments below " + std::to_string(heavy_levels) + ", index " + number(heavy_index);
  }
  if (shape == Shape::lognormal) text += ", lognormal " + number(shape_parameter);
  if (shape == Shape::pareto) text += ", Pareto " + number(shape_parameter);
  if (rarity < 1 || rarity_slope != 0) {
    text += ", r " + format("%.2g", rarity);
    if (rarity_slope != 0) text += " 2^(" + number(-rarity_slope) + " k)";
  }
  if (unit < 1e-20) text += ", unit " + format("%.0e", unit);
  return text;
}

UnseenSequence::UnseenSequence(const Family& family) {
  auto table = std::make_shared<Table>();
  table->family = family;
  const double p = family.shape_parameter;
  switch (family.shape) {
    case Shape::uniform:
      table->size_mean = std::sqrt(3.0) / 2;
      table->size_kurtosis = 1.8;
      break;
    case Shape::lognormal:
      table->size_mean = std::exp(-p * p / 2);
      table->size_kurtosis = std::exp(4 * p * p);
      break;
    case Shape::pareto:
      table->size_mean = (p > 2 ? std::sqrt((p - 2) / p) : 1) * p / (p - 1);
      table->size_kurtosis = p > 4 ? (p - 2) * (p - 2) / (p * (p - 4)) : infinite;
      break;
  }
  // Sums of E I_k from its limit down would lose the small ones; from level 0 on they round as a draw's own sums do.
  std::vector<double> differences(table_levels);
  for (std::int64_t k = 0; k < table_levels; ++k) {
    differences[static_cast<std::size_t>(k)] = mean_difference(*table, k);
  }
  long double sum = 0;
  for (const double d : differences) {
    sum += d;
    table->means.push_back(static_cast<double>(sum));
  }
  if (family.powers && family.end == 0) {
    // Euler-Maclaurin of A (k + 1)^-s beyond the table; the next term is x^-6 of the first.
    const double s = family.beta / 2 + family.bias_slope;
    const double x = as_double(table_levels) + 1;
    const double f = mean_difference(*table, table_levels);
    sum += f * (x / (s - 1) + 0.5 + s / (12 * x) - s * (s + 1) * (s + 2) / (720 * x * x * x));
  }
  table->truth = static_cast<double>(sum);
  for (std::int64_t k = 0; k < table_levels; ++k) table->levels.push_back(parameters(*table, k));
  table_ = std::move(table);
}

double UnseenSequence::mean_difference(const Table& table, std::int64_t k) {
  const Family& f = table.family;
  if (k == 0) return f.mean;
  if (is_zero(f, k)) return 0;
  return std::exp2(log2_second(f, k) / 2) * std::sqrt(nonzero(f, k)) * bias(f, k) * table.size_mean;
}

double UnseenSequence::mean_value(const Table& table, std::int64_t k) {
  if (k < table_levels) return table.means[static_cast<std::size_t>(k)];
  const Family& f = table.family;
  if (!f.powers) return table.truth;
  const double s = f.beta / 2 + f.bias_slope;
  const double x = as_double(k) + 2;
  return table.truth -
         mean_difference(table, k + 1) * (x / (s - 1) + 0.5 + s / (12 * x) - s * (s + 1) * (s + 2) / (720 * x * x * x));
}

LevelParameters UnseenSequence::parameters(const Table& table, std::int64_t k) {
  const Family& f = table.family;
  LevelParameters level;
  level.work = work(f, k);
  level.fine_heavy = heavy(f, k);
  if (k == 0) {
    level.coarse = f.mean;
    level.noise = noise(f, 0);
    return level;
  }
  level.coarse = mean_value(table, k - 1);
  level.noise = noise(f, k - 1);
  level.heavy = heavy(f, k - 1);
  if (is_zero(f, k)) return level;
  if (is_aliased(f, k) || is_heavy(f, k)) {
    level.shift = mean_difference(table, k);
    level.noise_change = is_aliased(f, k) ? noise(f, k) - level.noise : 0;
    return level;
  }
  level.nonzero = nonzero(f, k);
  level.size = std::exp2(log2_second(f, k) / 2) / std::sqrt(level.nonzero);
  level.positive = (1 + bias(f, k)) / 2;
  return level;
}

Draw<double> UnseenSequence::operator()(std::int64_t k, Stream& rng) const {
  const Table& table = *table_;
  const Family& f = table.family;
  const LevelParameters beyond = k < table_levels ? LevelParameters{} : parameters(table, k);
  const LevelParameters& level = k < table_levels ? table.levels[static_cast<std::size_t>(k)] : beyond;
  const double u = rng.uniform();
  const double v = noise_steps * rng.uniform();
  const double step = std::floor(v);
  const double n = ((step + 0.5) / noise_steps - 0.5) * noise_scale;

  double coarse = level.coarse + level.noise * n;
  double difference = 0;
  if (level.nonzero > 0) {
    if (u < level.nonzero) {
      const double x = u / level.nonzero;
      const double p = f.shape_parameter;
      double size = level.size;
      switch (f.shape) {
        case Shape::uniform:
          size *= std::sqrt(3.0) * x;
          break;
        case Shape::lognormal:
          size *= std::exp(p * normal_quantile(x) - p * p);
          break;
        case Shape::pareto:
          size *= (p > 2 ? std::sqrt((p - 2) / p) : 1) * std::pow(x, -1 / p);
          break;
      }
      difference = v - step < level.positive ? size : -size;
    }
  } else {
    difference = level.shift + level.noise_change * n;
    if (level.heavy > 0 || level.fine_heavy > 0) {
      const double h = std::pow(u, -1 / f.heavy_index) - f.heavy_index / (f.heavy_index - 1);
      coarse += level.heavy * h;
      difference += (level.fine_heavy - level.heavy) * h;
    }
  }
  coarse *= f.unit;
  difference *= f.unit;
  if (k == 0) return base(coarse + difference, level.work);
  return {coarse + difference, difference, level.work};
}

LevelTruth UnseenSequence::level(std::int64_t k) const {
  const Table& table = *table_;
  const Family& f = table.family;
  const LevelParameters p = k < table_levels ? table.levels[static_cast<std::size_t>(k)] : parameters(table, k);
  LevelTruth truth;
  truth.work = p.work;
  truth.difference = mean_difference(table, k);
  truth.mean = mean_value(table, k);
  const double noise_square = p.noise * p.noise;
  if (k == 0) {
    truth.nonzero = 1;
    truth.variance = p.fine_heavy > 0 ? infinite : noise_square;
    const double m = f.mean * f.mean;
    truth.second_moment = truth.variance + m;
    truth.kurtosis = (m * m + 6 * m * noise_square + noise_kurtosis * noise_square * noise_square) /
                     ((m + noise_square) * (m + noise_square));
    if (p.fine_heavy > 0) truth.kurtosis = infinite;
    return truth;
  }
  const double mean = mean_difference(table, k);
  truth.variance = noise_square;
  if (is_zero(f, k)) return truth;
  if (is_heavy(f, k)) {
    truth.nonzero = 1;
    truth.second_moment = truth.kurtosis = infinite;
    if (p.fine_heavy > 0) truth.variance = infinite;
    return truth;
  }
  if (is_aliased(f, k)) {
    const double m = mean * mean;
    const double q = p.noise_change * p.noise_change;
    const double kept = p.noise + p.noise_change;
    truth.nonzero = 1;
    truth.second_moment = m + q;
    truth.kurtosis = (m * m + 6 * m * q + noise_kurtosis * q * q) / ((m + q) * (m + q));
    truth.variance = kept * kept;
    return truth;
  }
  truth.nonzero = p.nonzero;
  if (never_finite(f)) {
    truth.second_moment = truth.kurtosis = truth.variance = infinite;
    return truth;
  }
  const double second = std::exp2(log2_second(f, k));
  truth.second_moment = second;
  truth.kurtosis = table.size_kurtosis / p.nonzero;
  truth.variance += second - mean * mean;
  return truth;
}

namespace {
/// Where decay and work are of two kinds, the slower one counts for nothing beside the other.
Rates rates_of(const Family& f) {
  if (f.powers && f.work_powers) return {f.beta, f.gamma, Decay::polynomial};
  return {f.powers ? 0 : f.beta, f.work_powers ? 0 : f.gamma, Decay::geometric};
}
}  // namespace

DeclaredRates::DeclaredRates(const Family& f) : rates(rates_of(f)) {}

std::int64_t levels_reached(const UnseenSequence& sequence, std::int64_t members) {
  const Family& f = sequence.family();
  const std::int64_t most = f.work_powers ? (f.powers ? 511 : 24) : 24;
  std::int64_t deepest = 0;
  for (std::int64_t k = 0; k <= most; ++k) {
    const LevelTruth level = sequence.level(k);
    const double draws = as_double(members) / (10 * level.work);
    double kurtosis = 1;
    if (level.nonzero > 0) kurtosis = std::isfinite(level.kurtosis) ? level.kurtosis : 256 / level.nonzero;
    if (draws / kurtosis >= 16) deepest = k;
  }
  return deepest;
}

Labels labels_of(const UnseenSequence& sequence, std::int64_t members) {
  const Family& f = sequence.family();
  Labels labels;
  labels.truth = sequence.truth();
  labels.second_moments = !never_finite(f);
  labels.reached = levels_reached(sequence, members);

  if (f.end > 0 || f.factorial > 0) {
    labels.margin = infinite;
  } else if (f.powers) {
    labels.margin = f.work_powers ? f.beta - f.gamma - 2 : -f.gamma;
  } else {
    labels.margin = f.work_powers ? f.beta : f.beta - f.gamma;
  }
  labels.exists = labels.second_moments && labels.margin > 0;

  const auto feature = [&](std::int64_t first_sign, std::int64_t settled) {
    labels.first_sign = std::max<std::int64_t>({labels.first_sign, first_sign, 1});
    labels.settled = std::max(labels.settled, settled);
  };
  if (f.hump_height != 0) {
    feature(static_cast<std::int64_t>(std::floor(f.hump_level - 2 * f.hump_width)),
            static_cast<std::int64_t>(std::ceil(f.hump_level + 2 * f.hump_width)));
  }
  if (f.change_level > 0) feature(f.change_level + 1, f.change_level);
  if (f.pause > 0) feature(f.pause + 1, f.pause + (f.aliased ? 2 : 1));
  if (f.end > 0) feature(f.end + 1, f.end + 1);
  if (f.factorial > 0) {
    feature(static_cast<std::int64_t>(std::ceil(f.factorial)),
            static_cast<std::int64_t>(std::ceil(1.5 * f.factorial)) + 1);
  }
  if (f.heavy_levels > 0) feature(f.heavy_levels, f.heavy_levels + 1);

  labels.root_of_price = infinite;
  if (!labels.exists) return labels;
  // From the deepest level up, what is beyond it by the integral of a power, or nothing.
  constexpr std::int64_t last = 4096;
  const auto price = [&](std::int64_t k) {
    const LevelTruth level = sequence.level(k);
    return std::sqrt(level.second_moment) * std::sqrt(level.work);
  };
  double beyond = 0;
  std::int64_t k = last;
  if (f.powers) {
    const double s = (f.beta - f.gamma) / 2;
    const double x = as_double(last) + 1;
    beyond = price(last) * (x / (s - 1) - 0.5);
  } else {
    while (k > 1 && !(sequence.level(k).second_moment > 0 && std::isfinite(sequence.level(k).work))) --k;
  }
  for (; k >= 0; --k) {
    const LevelTruth level = sequence.level(k);
    if (std::isfinite(level.variance)) {
      labels.root_of_price = std::min(labels.root_of_price, std::sqrt(level.variance) * std::sqrt(level.work) + beyond);
    }
    if (k > 0) beyond += price(k);
    if (!(beyond < infinite)) break;
  }
  labels.root_of_price *= f.unit;
  return labels;
}

}  // namespace debias::validation
