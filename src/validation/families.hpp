#pragma once

// Problems that nobody has met: families of biased sequences with random parameters, whose truth is known by construction.
//
//   D_k = a_k s |Y| with probability r_k, else 0;   E Y^2 = 1, s = +-1, P(s = 1) = (1 + c_k) / 2,   k >= 1
//   E D_k^2 = 2^b_k = a_k^2 r_k,   E D_k = 2^(b_k / 2) sqrt(r_k) c_k E|Y|,   kurtosis = E Y^4 / r_k
//   I_k = E I_(k-1) + sigma_(k-1) n + D_k,   Var n = 1;   I_0 = mu + sigma_0 n;   work_k = 2^(gamma k) or (k + 1)^gamma
//   b_k = b - beta k  (or - beta log2(k + 1), or 2 log2(x^k / k!)),  plus hump, change of slope, oscillation; zeros
//
// S = sum_k sqrt(E D_k^2 w_k) is finite, so that a PMF with finite variance and work exists, iff the margin is positive:
// beta - gamma, beta - gamma - 2 for powers of the level, beta for a geometric decay beside work that is a power, -gamma for
// the reverse, infinite where differences end. A draw costs two random numbers whatever its level: the work is stated, not done.
//
// Ranges, uniform where nothing else stands. Family i of a seed draws from a stream of its own, and is of kind i mod 10:
//   every kind   margin in turns of four: 1/2 ... 2.2 twice, -1.5 ... -1/2, -1.5 ... 2.2; gamma .2 ... 1.5, but where the
//                margin is negative, in two of three what makes beta .4 ... .9; r falls where E|D_k| would not be summable;
//                the unit of values 10^-6 ... 10^6, one in sixteen 10^-150 ... 10^-80; mu -3 ... 3, sigma_0 .1 ... 2 (log);
//                b -8 ... 6; c -1 ... 1, falling by 0 ... .5 octaves a level; |Y| uniform, one in five lognormal, one in
//                five rare; rates declared by every other one; the limit one constant, and said so, in every third
//   plain        one in four with work (k + 1)^gamma, gamma 0 ... 2
//   hump         of 2 ... 10 octaves up, one in four down, width .7 ... 2.5, about a level of the features' range
//   slope        another slope, .4 ... 2 away, up to a level of that range
//   rarity       in turns: r 10^-3.5 ... 10^-1; r falling by .1 ... 1 octaves a level; r from 10^-3 ... 10^-1 up to 1, while
//                E D_k^2 rises by 0 ... 1.5 octaves a level
//   tail         lognormal, s .5 ... 1.2 (kurtosis e^(4 s^2)), or Pareto of index 2.3 ... 6
//   oscillation  of b by 1 ... 6 octaves, frequency .4 ... pi; sign with cos(omega k) in half of them
//   pause        D_k = 0 up to a level of the features' range, then as always; in half of them aliased: I_k varies as I_0 does
//                up to there, and is then near its constant limit
//   moments      in turns: I_k has no second moment (Pareto 1.2 ... 1.9) up to level 0 ... 3; no D_k has one
//   end          in turns: D_k = 0 beyond a level of the features' range (one half says so); x^k / k!, x .5 ... 8 (log)
//   polynomial   beta as the margin asks for, gamma 0 ... 2, one in six with geometric work; E|D_k| summable: beta > 2.1
// The features' range is 1 ... three quarters of the levels reached, in one of six: up to four levels beyond them.
//
// Levels reached by N members: the deepest one of which a tenth of the work of N draws of level 0 buys 16 effective hits,
// draws / kurtosis (an infinite one taken as 256), or 16 draws where it is zero. No judge has a part in it.
// Source: derived here.

#include <cstdint>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include <debias/core/rates.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>

namespace debias::validation {

enum class Kind { plain, hump, slope, rarity, tail, oscillation, pause, moments, end, polynomial };
inline constexpr int kinds = 10;
/// "plain", "hump", ...
const char* name_of(Kind kind);

/// Of |Y|.
enum class Shape { uniform, lognormal, pareto };

struct Family {
  std::uint64_t seed = 0;
  int index = 0;
  Kind kind = Kind::plain;

  double unit = 1;           ///< of the values
  double mean = 0;           ///< mu, in this unit
  double spread = 1;         ///< sigma_0
  double prefactor = 0;      ///< b
  double beta = 2;           ///< in the limit
  double gamma = 1;          ///< of the work
  bool powers = false;       ///< E D_k^2 falls like (k + 1)^-beta
  bool work_powers = false;  ///< the work grows like (k + 1)^gamma
  double factorial = 0;      ///< x of x^k / k!; 0: no such decay

  double hump_height = 0;  ///< octaves
  double hump_level = 0;
  double hump_width = 1;
  std::int64_t change_level = 0;  ///< up to there b falls by `early_slope` a level
  double early_slope = 0;
  double wave_size = 0;  ///< octaves
  double wave_frequency = 0;
  double wave_phase = 0;
  bool wave_signs = false;        ///< E D_k has the sign of the wave
  std::int64_t pause = 0;         ///< D_k = 0 for 1 <= k <= pause
  bool aliased = false;           ///< D_(pause + 1) takes away what varies
  std::int64_t end = 0;           ///< D_k = 0 for k > end; 0: never
  std::int64_t heavy_levels = 0;  ///< I_k has no second moment for k < heavy_levels
  double heavy_index = 1.5;       ///< of these

  Shape shape = Shape::uniform;
  double shape_parameter = 0;  ///< s of the lognormal, index of the Pareto (at most 2: no D_k has a second moment)
  double rarity = 1;           ///< r_k = min(1, rarity 2^(-rarity_slope k))
  double rarity_slope = 0;
  double bias = 0;  ///< c_k = bias 2^(-bias_slope k), or bias (k + 1)^(-bias_slope)
  double bias_slope = 0;

  bool declares_rates = false;
  bool constant_limit = false;
  bool states_end = false;

  /// What falls and what grows, in few words.
  [[nodiscard]] std::string description() const;
};

/// Family `index` of a seed.
Family draw_family(std::uint64_t seed, int index);

/// The moments of one level in closed form, values in the unit of the family. A second moment that is infinite is infinity.
struct LevelTruth {
  double difference = 0;     ///< E D_k
  double second_moment = 0;  ///< E D_k^2
  double kurtosis = 0;       ///< E D_k^4 / (E D_k^2)^2, infinite where E D_k^4 is
  double nonzero = 0;        ///< P(D_k != 0)
  double mean = 0;           ///< E I_k
  double variance = 0;       ///< Var I_k
  double work = 1;
};

/// What a draw needs of a level.
struct LevelParameters {
  double size = 0;        ///< a_k
  double nonzero = 0;     ///< r_k
  double positive = 0;    ///< P(s = 1)
  double coarse = 0;      ///< E I_(k-1)
  double noise = 0;       ///< sigma_(k-1)
  double heavy = 0;       ///< scale of the part of I_(k-1) without a second moment
  double fine_heavy = 0;  ///< of that in I_k
  double shift = 0;       ///< E D_k where D_k = shift + noise_change n
  double noise_change = 0;
  double work = 1;
};

/// A sequence of the family; draws two numbers a level, and copies in no time.
class UnseenSequence {
 public:
  explicit UnseenSequence(const Family& family);

  Draw<double> operator()(std::int64_t level, Stream& rng) const;

  [[nodiscard]] const Family& family() const { return table_->family; }
  /// lim E I_k, summed to the last bit or so; times the unit.
  [[nodiscard]] double truth() const { return table_->truth * table_->family.unit; }
  [[nodiscard]] LevelTruth level(std::int64_t level) const;

 private:
  struct Table {
    Family family;
    double truth = 0;
    double size_mean = 1;       // E|Y|
    double size_kurtosis = 1;   // E Y^4
    std::vector<double> means;  // E I_k, in the unit
    std::vector<LevelParameters> levels;
  };
  [[nodiscard]] static LevelParameters parameters(const Table& table, std::int64_t level);
  [[nodiscard]] static double mean_difference(const Table& table, std::int64_t level);
  [[nodiscard]] static double mean_value(const Table& table, std::int64_t level);

  std::shared_ptr<const Table> table_;
};

// What a sequence may state of itself.
struct DeclaredRates {
  explicit DeclaredRates(const Family& family);
  Rates rates;
};
struct ConstantLimit {
  explicit ConstantLimit(const Family& /*family*/) {}
  Limit limit = Limit::constant;
};
struct StatedEnd {
  explicit StatedEnd(const Family& family) : exact_from(family.end) {}
  std::int64_t exact_from;
};

template <class... Facts>
struct Stating : UnseenSequence, Facts... {
  explicit Stating(const Family& family) : UnseenSequence(family), Facts(family)... {}
};

/// What is true of a family for N members, whatever anyone says of it.
struct Labels {
  double truth = 0;             ///< lim E I_k
  bool exists = false;          ///< a PMF with finite variance and finite work
  bool second_moments = true;   ///< E D_k^2 finite from some level on
  double margin = 0;            ///< beta - gamma, or what takes its place
  std::int64_t reached = 0;     ///< levels reached by N members
  std::int64_t first_sign = 0;  ///< the first level that shows the last feature; 0: no feature
  std::int64_t settled = 0;     ///< from this level on the decay is that of the limit
  /// min over m of sqrt(Var I_m w_m) + sum_(k > m) sqrt(E D_k^2 w_k): the root of variance x work of the best PMF for
  /// members that share nothing but their levels' strata. Infinite where no PMF exists.
  double root_of_price = 0;

  /// Four levels of the limit, or more, are reached: two for a line, and two that could contradict it.
  [[nodiscard]] bool within() const { return settled + 4 <= reached; }
  /// At most one level that is reached shows the feature: nobody can know.
  [[nodiscard]] bool beyond() const { return first_sign > 0 && first_sign >= reached; }
};

Labels labels_of(const UnseenSequence& sequence, std::int64_t members);

/// Levels reached by N members.
std::int64_t levels_reached(const UnseenSequence& sequence, std::int64_t members);

}  // namespace debias::validation
