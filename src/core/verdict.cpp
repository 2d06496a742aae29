#include <debias/core/verdict.hpp>

#include <algorithm>
#include <cmath>
#include <span>

#include <debias/core/result.hpp>

#include "core/infinity.hpp"
#include "statistics/posterior.hpp"

namespace debias {
namespace {

constexpr double half = 0.5;
constexpr double surplus_limit = 3;  // standard errors
constexpr double sure = 0.02;        // of the fourth moment
constexpr double index_error = 0.01;
constexpr double fewest_degrees = 8;  // of an interval
constexpr double draws_per_kurtosis = 16;
// A base whose own second moment is known this badly may be heavier than all the levels.
constexpr double draws_per_kurtosis_of_base = 10;
// The largest of n numbers with tail index xi has a share of about n^(2 xi - 1) of the sum of squares. A side
// whose largest has less than that of xi = 0.2 does not decide about the variance, whatever the shape of its
// values.
constexpr double irrelevant_share = -0.6;
constexpr double degrees_of_infinite = 2;  // of Student's law: the last one without a variance of its own
// Of tails.
constexpr double tail_z = 1.5;
constexpr double deep_index = 0.4;   // of the quarter of the tail, for `infinite`
constexpr double fewest_hits = 100;  // values beside the commonest one, for `finite`

double largest_square(const std::vector<LevelFacts>& facts) {
  double largest = 0;
  for (const LevelFacts& f : facts) {
    if (std::isfinite(f.second_moment)) largest = std::max(largest, f.second_moment);
  }
  return largest;
}

std::vector<LevelFacts> facts_of(const std::vector<LevelRow>& rows) {
  std::vector<LevelFacts> facts;
  for (const LevelRow& row : rows) {
    if (row.level != row.last_level) continue;
    LevelFacts f;
    f.level = row.level;
    f.draws = row.count;
    f.mean = row.mean;
    f.second_moment = row.second_moment;
    f.kurtosis = row.kurtosis;
    f.work = row.work;
    f.is_base = row.is_base;
    if (row.is_base) f.value_variance = std::max(0.0, row.second_moment - row.mean * row.mean);
    facts.push_back(f);
  }
  // What a run knows of the values: they are as large as the largest of its parts.
  const double size = largest_square(facts);
  for (LevelFacts& f : facts) {
    f.value_square = size;
    statistics::drop_rounding(f);
  }
  return facts;
}

// Values are 2^exponent in size: the levels are judged in that unit, since squares of squares of tiny values are zeros.
int exponent_of_values(const std::vector<LevelFacts>& facts) {
  const double size = largest_square(facts);
  return size > 0 ? std::ilogb(size) / 2 : 0;
}

void scale(std::vector<LevelFacts>& facts, int exponent) {
  for (LevelFacts& f : facts) {
    f.mean = std::ldexp(f.mean, exponent);
    for (double* square : {&f.second_moment, &f.value_variance, &f.value_square}) {
      *square = std::ldexp(*square, 2 * exponent);
    }
  }
}

// The masses of the rows, where nobody has told the others.
Masses masses_of(const std::vector<LevelRow>& rows) {
  Masses m;
  for (const LevelRow& row : rows) {
    if (row.is_base || !(row.probability > 0)) continue;
    if (m.mass.empty()) m.first_level = row.level;
    if (row.level != m.first_level + std::ssize(m.mass)) break;
    m.mass.push_back(row.probability);
  }
  return m;
}

// Are the levels with too few draws to be usable larger than the posterior allows? By how many standard errors.
double surplus(const Evidence& e) {
  if (e.courses.empty() || e.facts.empty() || e.facts.back().level <= e.last_usable) return 0;
  const std::vector<Believed> expected = [&] {
    Evidence usable = e;  // without what the others showed
    usable.facts.clear();
    std::erase_if(usable.voices, [](const LevelVoice& v) { return !v.usable(); });
    return believed(usable, e.facts.back().level);
  }();
  double rarity = 1;
  for (const LevelVoice& v : e.voices) rarity = v.usable() ? std::max(rarity, std::exp2(v.log2_rarity)) : rarity;
  double excess = 0;
  double draws = 0;
  for (const LevelFacts& f : e.facts) {
    if (f.is_base || f.level <= e.last_usable) continue;
    const Believed& b = expected[static_cast<std::size_t>(f.level)];
    const auto n = static_cast<double>(f.draws);
    excess += n * (f.second_moment / std::exp2(b.log2_second + b.error) - 1);
    draws += n;
  }
  return draws > 0 ? excess / std::sqrt(std::max(2.0, rarity - 1) * draws) : 0;
}

struct LevelsSay {
  LevelEvidence levels;
  SumConvergence sum;
  Doubt doubt;
  double counted = 0;    // of the levels that are doubted, in the measured variance
  bool changes = false;  // levels that are not yet typical
  std::vector<Warning> reasons;
};

Finiteness by_chance(double diverges) {
  if (diverges <= sure) return Finiteness::finite;
  return diverges >= 1 - sure ? Finiteness::infinite : Finiteness::undecided;
}

LevelsSay levels_say(const Statistics& s) {
  LevelsSay say;
  LevelEvidence& l = say.levels;
  const Masses masses = s.masses.empty() ? masses_of(s.levels) : s.masses;
  std::vector<LevelFacts> facts = facts_of(s.levels);
  double drawn = 0;  // members: draws of a level over its mass, of all levels
  double mass = 0;
  for (const LevelRow& row : s.levels) {
    if (row.is_base || !(row.probability > 0)) continue;
    drawn += static_cast<double>(row.count);
    mass += row.probability;
  }
  if (masses.empty()) return say;
  // No level without a mass speaks: it is not part of the sum.
  std::erase_if(facts, [&](const LevelFacts& f) {
    return !f.is_base && (f.level < masses.first_level || f.level >= masses.first_level + std::ssize(masses.mass));
  });
  std::vector<LevelFacts> run = facts;
  if (!s.pilot_levels.empty()) facts = together(s.pilot_levels, facts);
  const int exponent = exponent_of_values(facts);
  scale(facts, -exponent);
  scale(run, -exponent);
  const Evidence e = weigh(std::move(facts), s.sequence, true);
  say.reasons = e.reasons;
  say.changes = e.changes || e.missing_moments || e.end != End::none;
  say.sum = judge(e, masses);
  l.available = e.end != End::none ? e.grade != Grade::open : !e.courses.empty();
  for (const LevelVoice& v : e.voices) l.usable_levels += v.usable();
  l.first_level = std::max<std::int64_t>(0, e.first_usable);
  l.last_level = std::max<std::int64_t>(0, e.last_usable);
  if (mass > 0) {
    const double members = drawn / mass;
    say.doubt = doubt_of(e, masses, members);
    // The levels that are doubted have a part in the measured variance already.
    for (const LevelFacts& f : run) {
      if (f.is_base || !std::binary_search(say.doubt.levels.begin(), say.doubt.levels.end(), f.level)) continue;
      const double p = masses.mass[static_cast<std::size_t>(f.level - masses.first_level)];
      say.counted += static_cast<double>(f.draws) * part_in_variance(f.second_moment, f.mean, p, say.doubt.mu) /
                     (p * members * members);
    }
    for (double* variance : {&say.doubt.unseen, &say.doubt.undrawn, &say.doubt.seen, &say.counted}) {
      *variance = std::ldexp(*variance, 2 * exponent);
    }
    say.doubt.mu = std::ldexp(say.doubt.mu, exponent);
  }
  if (!l.available) return say;
  if (e.end != End::none) {
    l.ends = true;
    l.tail_index = -infinity;
    l.diverges = 0;
    l.fourth_moment = Finiteness::finite;
    l.work = Finiteness::finite;
    return say;
  }
  l.diverges = say.sum.diverges;
  l.growth = say.sum.growth;
  l.contradicted = surplus(e) > surplus_limit;
  l.rho = exponent_of(masses, e.last_usable, l.polynomial);
  // In the unit of the PMF: a power of the level is no fall beside powers of 2, and they are a fall beyond any power of it.
  const bool same_unit = e.polynomial == l.polynomial;
  l.beta = same_unit ? e.decay.value : e.polynomial ? 0 : infinity;
  l.beta_error = same_unit ? e.decay.error : 0;
  const double border = l.polynomial ? 1 : 0;
  const double span = std::max(l.rho - border, 1e-3);
  l.tail_index = (l.rho - l.beta / 2) / span;
  l.error = std::hypot(l.beta_error / 2 / span, index_error);
  l.fourth_moment = by_chance(fourth_moment_diverges(e, masses));
  const double room = l.rho - border - (e.exponential_work != l.polynomial ? e.work.value : 0);
  l.work = room > index_error ? Finiteness::finite : room < -index_error ? Finiteness::infinite : Finiteness::undecided;
  return say;
}

// A base that is heavier than the rows of its own can tell.
bool heavy_base(const std::vector<LevelRow>& rows) {
  for (const LevelRow& row : rows) {
    if (!row.is_base || !(row.second_moment > 0)) continue;
    if (static_cast<double>(row.count) < draws_per_kurtosis_of_base * row.kurtosis) return true;
  }
  return false;
}

// What the tails say.
struct TailsSay {
  Finiteness variance = Finiteness::undecided;
  Grade grade = Grade::open;
  double index = -infinity;
  double error = infinity;
  std::int64_t values = 0;  // that it was fitted to
};

// One side: `share` is that of its largest in the sum of squares, `hits` the values beside the commonest one.
TailsSay one_side(std::span<const double> descending, const TailIndex& full, std::int64_t samples, double center,
                  double share, double hits) {
  const auto n = static_cast<double>(samples);
  TailsSay t;
  if (full.state == TailState::too_few) return t;
  t = {Finiteness::finite, Grade::shown, full.k, full.error, full.values};
  if (full.state == TailState::bounded) {
    t.error = 0;
    return t;
  }
  if (share < std::pow(n, irrelevant_share)) {
    t.index = -infinity;
    t.error = 0;
    return t;
  }
  const auto size = static_cast<std::size_t>(full.values);
  const auto part_of = [&](std::size_t m) {
    const std::span<const double> part = descending.first(std::min(descending.size(), m + 1));
    return m < 10 ? TailIndex{} : tail_index(part, samples, center);
  };
  const TailIndex halved = part_of(size / 2);
  const TailIndex quarter = part_of(size / 4);
  double low = full.k - tail_z * full.error;
  double high = full.k + tail_z * full.error;
  if (halved.state == TailState::fitted) {
    low = std::min(low, halved.k - tail_z * halved.error);
    high = std::max(high, halved.k + tail_z * halved.error);
  }
  const bool deep = quarter.state != TailState::fitted || quarter.k > deep_index;
  if (low > half && deep) {
    t.variance = Finiteness::infinite;
    t.grade = Grade::likely;  // a lognormal looks the same
  } else if (hits < fewest_hits || (high > half && full.k > deep_index)) {
    t.variance = Finiteness::undecided;
    t.grade = Grade::open;
  } else if (high > half) {
    t.grade = Grade::likely;
  }
  return t;
}

// The worse of two.
TailsSay worse(const TailsSay& a, const TailsSay& b) {
  const auto rank = [](const TailsSay& t) {
    if (t.variance == Finiteness::infinite) return 10 + static_cast<int>(t.grade);
    return t.variance == Finiteness::undecided ? 5 : 3 - static_cast<int>(t.grade);
  };
  if (rank(a) != rank(b)) return rank(a) > rank(b) ? a : b;
  return a.index >= b.index ? a : b;
}

// Nothing but zeros, or deviations whose squares underflow: what is rare, or any variance at all, was not seen.
bool shows_no_variance(const Statistics& s) {
  const bool zeros = s.moments.count > 1 && s.moments.mean == 0 && s.moments.m2 == 0;
  return zeros || std::any_of(s.warnings.begin(), s.warnings.end(),
                              [](const Warning& w) { return w.code == WarningCode::square_underflow; });
}

// The levels of coupled chains are the times when they met.
MeetingTail meeting_of(const Statistics& s) {
  if (!s.sequence.meeting_times) return {};
  std::vector<MeetingInterval> times;
  for (const LevelRow& row : s.levels) {
    if (!row.is_base) times.push_back({row.level, row.last_level, row.count});
  }
  return meeting_tail(times, s.sequence.exact_from.value_or(std::numeric_limits<std::int64_t>::max()));
}

// Samples of coupled chains: their tails are never more than likely, and the meeting times may say that they have not been seen.
TailsSay with_meeting(TailsSay tails, const MeetingTail& meeting) {
  if (meeting.chains == 0) return tails;
  tails.grade = std::min(tails.grade, Grade::likely);
  if (meeting.kind == MeetingKind::light || tails.variance == Finiteness::infinite) return tails;
  tails.variance = meeting.kind == MeetingKind::heavy ? Finiteness::infinite : Finiteness::undecided;
  tails.grade = meeting.kind == MeetingKind::heavy ? Grade::likely : Grade::open;
  if (meeting.kind == MeetingKind::heavy) {  // a sample grows like its meeting time
    tails.index = std::max(tails.index, 1 / meeting.exponent);
    tails.error =
        std::max(std::isfinite(tails.error) ? tails.error : 0, meeting.error / (meeting.exponent * meeting.exponent));
  }
  return tails;
}

void combine(RunVerdict& v, TailsSay tails, const LevelsSay& say, bool has_levels, bool base_is_heavy) {
  const LevelEvidence& l = v.levels;
  // All values of what is rare look like a tail, some from each of many levels, until a few levels are known.
  constexpr std::int64_t fewest_values = 32;
  constexpr int fewest_levels = 2;
  const bool rare = has_levels && !l.available && (tails.values < fewest_values || l.usable_levels < fewest_levels);
  if (rare && tails.variance == Finiteness::infinite) {
    tails.variance = Finiteness::undecided;
    tails.grade = Grade::open;
  }
  v.variance = tails.variance;
  v.grade = tails.grade;
  v.tail_index = tails.index;
  v.error = tails.error;
  v.fourth_moment = tails.variance;
  if (tails.variance == Finiteness::finite) {
    v.fourth_moment = tails.index + tails.error < half / 2   ? Finiteness::finite
                      : tails.index - tails.error > half / 2 ? Finiteness::infinite
                                                             : Finiteness::undecided;
  }
  if (has_levels) {
    // Light tails prove nothing beside levels: no sample may have reached the heavy ones.
    using Value = SumConvergence::Value;
    const SumConvergence& sum = say.sum;
    Finiteness by_levels = Finiteness::undecided;
    if (sum.value == Value::finite && !l.contradicted) by_levels = Finiteness::finite;
    if (sum.value == Value::infinite) by_levels = Finiteness::infinite;
    Grade grade = by_levels == Finiteness::undecided ? Grade::open : sum.grade;
    // Too few levels to tell, or levels that lean there: the largest values have the last word, with a hedge.
    constexpr double leaning = 0.9;
    if (by_levels == Finiteness::undecided && tails.variance == Finiteness::infinite && !say.changes &&
        (!l.available || l.diverges >= leaning)) {
      by_levels = Finiteness::infinite;
      grade = Grade::likely;
    }
    const bool tails_decide = base_is_heavy && tails.variance != Finiteness::finite;
    if (!tails_decide) {
      v.variance = by_levels;
      v.grade = base_is_heavy ? std::min(grade, tails.grade) : grade;
      v.fourth_moment = l.fourth_moment;
      if (l.available) {
        v.tail_index = l.tail_index;
        v.error = l.error;
      }
    } else if (by_levels == Finiteness::infinite) {
      v.variance = by_levels;
      v.grade = grade;
    }
  }
  if (v.variance == Finiteness::undecided) v.grade = Grade::open;
  if (v.variance == Finiteness::infinite) v.fourth_moment = Finiteness::infinite;
  if (v.variance == Finiteness::undecided && v.fourth_moment == Finiteness::finite) {
    v.fourth_moment = Finiteness::undecided;
  }
  v.work = l.work;
  v.samples_needed = samples_for_mean(v.tail_index);
  v.rate = convergence_rate(v.tail_index, v.samples) / 2;
}

struct Tails {
  RunVerdict verdict;  // without the verdict itself
  TailsSay say;
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
  if (moments.count < 2 || !std::isfinite(moments.m2) || upper.empty() || lower.empty()) return t;
  if (moments.m2 == 0) {
    t.say = {Finiteness::finite, Grade::shown, -infinity, 0};
    return t;
  }
  const auto share = [&moments](double x) { return (x - moments.mean) * (x - moments.mean) / moments.m2; };
  // Both tails end in one value: the commonest one, and what lies beside it is all there.
  double hits = static_cast<double>(moments.count);
  if (upper.back() == lower.back()) {
    const auto beside = [](std::span<const double> tail) {
      return static_cast<double>(std::find(tail.begin(), tail.end(), tail.back()) - tail.begin());
    };
    hits = beside(upper) + beside(lower);
  }
  const TailsSay above = one_side(upper, v.upper, moments.count, moments.mean, share(upper.front()), hits);
  const TailsSay below = one_side(mirrored, v.lower, moments.count, -moments.mean, share(lower.front()), hits);
  // No value at all on a side: nothing to be heavy there.
  const bool none_above = !(upper.front() > upper.back()) && hits < static_cast<double>(moments.count);
  const bool none_below = !(lower.front() < lower.back()) && hits < static_cast<double>(moments.count);
  t.say = none_above ? below : none_below ? above : worse(above, below);
  v.largest_share = std::max(share(upper.front()), share(lower.front()));
  return t;
}

}  // namespace

RunVerdict judge(const Moments& moments, std::span<const double> upper, std::span<const double> lower) {
  Tails t = tails_of(moments, upper, lower);
  combine(t.verdict, t.say, {}, false, false);
  return t.verdict;
}

RunVerdict judge(const Statistics& s) {
  Tails t = tails_of(s.moments, s.upper_tail, s.lower_tail);
  RunVerdict& v = t.verdict;
  LevelsSay say;
  bool has_levels = false;
  for (const LevelRow& row : s.levels) {
    v.deepest_level = std::max(v.deepest_level, row.last_level);
    has_levels = has_levels || row.probability > 0;
  }
  if (s.nonfinite == 0 && std::isfinite(s.moments.m2)) {
    say = levels_say(s);
    v.levels = say.levels;
    v.reasons = say.reasons;
    const double missing = std::max(0.0, say.doubt.unseen + say.doubt.undrawn - say.counted);
    // Strata may have made the measured part smaller than its levels add up to.
    const double all = missing + std::pow(s.moments.standard_error(), 2);
    const double rounding = 64 * std::numeric_limits<double>::epsilon() * std::abs(s.moments.mean);
    if (!(all > rounding * rounding)) {
      v.kurtosis = 1;  // of rounding, which says nothing: the interval is never below it
    } else if (has_levels && std::isfinite(say.doubt.degrees)) {
      v.unseen_variance = missing;
      v.unseen_share = std::min(missing, say.doubt.unseen) / all;
      v.degrees = say.doubt.degrees;
    }
    if (shows_no_variance(s)) v.kurtosis = v.degrees = infinity;
  } else {
    has_levels = false;
    t.say = {};
  }
  v.wrong_mean = s.has_wrong_mean();
  if (s.bias_bound.size > 0) v.bias = s.bias_bound.size / s.total_error();
  v.meeting = meeting_of(s);
  t.say = with_meeting(t.say, v.meeting);
  v.largest.assign(s.largest.begin(), s.largest.begin() + std::min<std::ptrdiff_t>(3, std::ssize(s.largest)));
  combine(v, t.say, say, has_levels, heavy_base(s.levels));
  if (v.variance == Finiteness::infinite) v.degrees = std::min(v.degrees, degrees_of_infinite);
  return v;
}

bool RunVerdict::interval_reliable() const {
  if (wrong_mean || !(bias <= most_bias)) return false;
  if (variance != Finiteness::finite || degrees < fewest_degrees || unseen_share > half) return false;
  return std::isfinite(degrees) || static_cast<double>(samples) >= draws_per_kurtosis * kurtosis;
}

}  // namespace debias
