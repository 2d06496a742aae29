#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/stream.hpp>
#include <debias/statistics/evidence.hpp>

using namespace debias;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Levels 1 ... K with E D_k^2 = 2^b(k) and kurtosis kappa(k), seen in n draws each: the noise that they would have.
struct Table {
  int levels = 8;
  std::function<double(double)> b = [](double k) { return -2 * k; };
  std::function<double(double)> work = [](double k) { return std::exp2(k); };
  std::function<double(double)> kappa = [](double) { return 3.0; };
  std::int64_t draws = 16384;
  std::uint64_t seed = 1;

  [[nodiscard]] std::vector<LevelFacts> facts() const {
    Stream rng(seed, 0);
    std::vector<LevelFacts> all;
    all.push_back({.level = 0,
                   .draws = draws,
                   .mean = 1,
                   .second_moment = 2,
                   .kurtosis = 3,
                   .work = work(0),
                   .value_variance = 1,
                   .value_square = 2,
                   .is_base = true});
    for (int k = 1; k <= levels; ++k) {
      LevelFacts f;
      f.level = k;
      f.draws = draws;
      const double noise = std::sqrt((kappa(k) - 1) / static_cast<double>(draws)) * rng.normal();
      f.second_moment = std::exp2(b(k)) * std::max(0.1, 1 + noise);
      f.kurtosis = kappa(k);
      f.nonzero = 1;
      f.work = work(k);
      f.value_variance = 1;
      f.value_square = 4;
      all.push_back(f);
    }
    return all;
  }
};

Masses geometric(double rho, std::int64_t first = 1) {
  Masses m;
  m.first_level = first;
  for (int j = 0; j < 200; ++j) m.mass.push_back(std::exp2(-rho * j) * (1 - std::exp2(-rho)));
  return m;
}

std::vector<LevelFacts> with_zeros(std::vector<LevelFacts> facts, std::int64_t from, double variance_left) {
  for (LevelFacts& f : facts) {
    if (f.level < from) continue;
    f.second_moment = f.kurtosis = f.nonzero = 0;
    f.value_variance = variance_left;
  }
  return facts;
}

}  // namespace

TEST_CASE("a decay well above the work is a yes, one well below it a no, one beside it open", "[evidence][exact]") {
  const auto answer = [](double beta) {
    Table t;
    t.b = [beta](double k) { return -beta * k; };
    return weigh(t.facts());
  };
  for (const double beta : {2.0, 2.5, 4.0}) {
    INFO(beta);
    const Evidence e = answer(beta);
    CHECK(e.answer == Answer::yes);
    CHECK(e.grade == Grade::shown);
    CHECK(std::abs(e.decay.value - beta) < 0.1);
    CHECK(e.work.value == Approx(1).margin(1e-9));
    CHECK(e.exponential_work);
  }
  for (const double beta : {0.3, 0.0}) {
    INFO(beta);
    const Evidence e = answer(beta);
    CHECK(e.answer == Answer::no);
    CHECK(e.grade == Grade::shown);
  }
  // A mean of |D| that grows by as much at every level, at equal rarity, is no start and no hump.
  CHECK(answer(-1).answer == Answer::no);
  CHECK(answer(-1).grade == Grade::likely);
  for (const double beta : {0.9, 1.0, 1.1}) CHECK(answer(beta).answer == Answer::open);
}

TEST_CASE("no is not said before the budget is spent, and three levels decide nothing for sure", "[evidence][exact]") {
  Table t;
  t.b = [](double k) { return -0.3 * k; };
  CHECK(weigh(t.facts(), {}, false).answer == Answer::open);
  CHECK(weigh(t.facts(), {}, true).answer == Answer::no);
  t.levels = 3;
  CHECK(weigh(t.facts()).grade != Grade::shown);
  t.levels = 2;
  const Evidence two = weigh(t.facts());
  CHECK(two.answer == Answer::open);
  REQUIRE(two.reasons.size() == 1);
  CHECK(two.reasons[0].code == WarningCode::few_levels);
  CHECK(two.reasons[0].text.find("2 levels") != std::string::npos);
  CHECK(weigh({}).answer == Answer::open);
}

TEST_CASE("no answer of a pure decay is wrong where it is shown", "[evidence][statistical]") {
  // beta - gamma from 1/2 up, kurtosis from 2 to 200: random tables of known answer.
  int wrong = 0;
  int said = 0;
  Stream rng(20261129, 0);
  for (std::uint64_t i = 0; i < 300; ++i) {
    Table t;
    const double gamma = 0.3 + 1.2 * rng.uniform();
    const double gap = (rng.uniform() < 0.5 ? 1 : -1) * (0.5 + 1.5 * rng.uniform());
    const double kurtosis = std::exp2(1 + 6.6 * rng.uniform());
    const double bend = rng.uniform();
    t.levels = 5 + static_cast<int>(6 * rng.uniform());
    t.b = [=](double k) { return -(gamma + gap) * k + bend * std::exp2(-k); };
    t.work = [gamma](double k) { return std::exp2(gamma * k); };
    t.kappa = [kurtosis](double) { return kurtosis; };
    t.seed = 100 + i;
    const Evidence e = weigh(t.facts());
    said += e.answer != Answer::open;
    wrong += e.grade == Grade::shown && e.answer != (gap > 0 ? Answer::yes : Answer::no);
  }
  CHECK(wrong == 0);
  CHECK(said >= 220);
}

TEST_CASE("polynomial decay beside polynomial work is told from a geometric one", "[evidence][exact]") {
  Table t;
  t.levels = 20;
  t.draws = 1 << 16;
  t.b = [](double k) { return -6 * std::log2(k + 1); };
  t.work = [](double k) { return k + 1; };
  Evidence e = weigh(t.facts());
  CHECK(e.answer == Answer::yes);
  CHECK(e.polynomial);
  CHECK_FALSE(e.exponential_work);
  CHECK(std::abs(e.decay.value - 6) < 4.5 * e.decay.error);
  // .64^k beside constant work, its terms with the sign of a cosine: two octaves up and down.
  t.b = [](double k) { return 2 * k * std::log2(0.8) + 2 * std::log2(std::abs(std::cos(k))); };
  t.work = [](double) { return 1.0; };
  e = weigh(t.facts());
  CHECK(e.answer == Answer::yes);
}

TEST_CASE("a level that missed its tail inherits the rarity of its neighbours", "[evidence][exact]") {
  Table t;
  t.kappa = [](double k) { return k == 5 ? 3.0 : 1000 * std::exp2(k - 4); };
  t.draws = 16384;
  const Evidence e = weigh(t.facts());
  const LevelVoice& lucky = e.voices[5];
  CHECK(lucky.raw_hits == Approx(16384 / 3.0));
  CHECK(lucky.hits == Approx(16384 / 4000.0));
  CHECK_FALSE(lucky.usable());
  // And none below the first that fails: with fewer hits they look usable only because they missed what is rare.
  CHECK(e.last_usable == 4);
}

TEST_CASE("levels whose largest values have no second moment are not usable and are no base", "[evidence][exact]") {
  std::vector<LevelFacts> facts = Table{}.facts();
  facts[1].tail_index = facts[2].tail_index = 0.9;
  facts[1].tail_error = facts[2].tail_error = 0.1;
  const Evidence e = weigh(facts);
  CHECK(e.voices[1].tail == LevelTail::heavy);
  CHECK_FALSE(e.voices[2].usable());
  CHECK(e.lowest_base == 3);
  CHECK(e.answer == Answer::yes);
  CHECK(e.grade == Grade::likely);
  // In every level: no base at all, and nothing is known.
  for (LevelFacts& f : facts) {
    f.tail_index = 0.9;
    f.tail_error = 0.1;
  }
  CHECK(weigh(facts).answer == Answer::open);
  CHECK(weigh(facts).missing_moments);
  // Values that are not finite are wild too, and no exception.
  facts = Table{}.facts();
  facts[1].second_moment = facts[1].kurtosis = std::nan("");
  CHECK(weigh(facts).lowest_base == 2);
  facts[1].second_moment = facts[1].kurtosis = infinity;
  CHECK(weigh(facts).lowest_base == 2);
}

TEST_CASE("zeros are an end where the sequence states it, likely after three levels, open where it aliases",
          "[evidence][exact]") {
  const std::vector<LevelFacts> ends = with_zeros(Table{}.facts(), 3, 1);
  const Evidence silent = weigh(ends);
  CHECK(silent.end == End::zeros);
  CHECK(silent.answer == Answer::yes);
  CHECK(silent.grade == Grade::likely);
  const Evidence stated = weigh(ends, {.exact_from = 2});
  CHECK(stated.end == End::stated);
  CHECK(stated.grade == Grade::shown);
  // A difference above the stated end: the statement is wrong and the levels decide.
  const Evidence wrong = weigh(Table{}.facts(), {.exact_from = 2});
  CHECK(wrong.end == End::none);
  CHECK(wrong.reasons.at(0).text.find("exact_from = 2 is stated, and level") == 0);
  // Its limit is one number, but I_k varies as before.
  const Evidence aliased = weigh(ends, {.constant_limit = true});
  CHECK(aliased.end == End::aliased);
  CHECK(aliased.answer == Answer::open);
  const Evidence constant = weigh(with_zeros(Table{}.facts(), 3, 1e-30), {.constant_limit = true});
  CHECK(constant.answer == Answer::yes);
  CHECK(constant.grade == Grade::shown);
  // Two levels of zeros are too few for an end.
  CHECK(weigh(with_zeros(Table{}.facts(), 7, 1)).answer == Answer::open);
}

TEST_CASE("zeros of a rare event that none could have shown are no end", "[evidence][exact]") {
  // P(D != 0) falls tenfold a level: 16384 draws show it in levels 1 to 4.
  std::vector<LevelFacts> facts = Table{}.facts();
  for (LevelFacts& f : facts) {
    if (f.is_base) continue;
    const double p = std::pow(10.0, -static_cast<double>(f.level));
    f.nonzero = f.level < 5 ? p : 0;
    f.second_moment = f.nonzero;
    f.kurtosis = f.nonzero > 0 ? 1 / f.nonzero : 0;
  }
  const Evidence e = weigh(facts);
  CHECK(e.end == End::none);
  const std::vector<Believed> b = believed(e, 8);
  for (std::size_t k = 5; k <= 8; ++k) CHECK(b[k].log2_second > -1 - 4 * static_cast<double>(k));
}

TEST_CASE("zeros are an end only where draws enough would have shown a difference", "[evidence][exact]") {
  // A tenth of the draws differ: four levels of 20 zeros could have shown 8 of them, of 100 zeros 40.
  const auto end_after = [](std::int64_t draws) {
    std::vector<LevelFacts> facts = Table{}.facts();
    for (LevelFacts& f : facts) {
      if (f.is_base) continue;
      f.nonzero = f.level < 5 ? 0.1 : 0;
      f.second_moment = f.nonzero * std::exp2(-2 * static_cast<double>(f.level));
      f.kurtosis = f.level < 5 ? 10 : 0;
      if (f.level >= 5) f.draws = draws;
    }
    return weigh(facts).end;
  };
  CHECK(end_after(20) == End::none);
  CHECK(end_after(100) == End::zeros);
}

TEST_CASE("declared rates sharpen an answer and are dropped where the levels contradict them", "[evidence][exact]") {
  Table t;
  t.levels = 5;
  t.draws = 2048;
  t.b = [](double k) { return -1.5 * k; };
  const Evidence alone = weigh(t.facts());
  const Evidence told = weigh(t.facts(), {.declared = Rates{1.5, 1}});
  CHECK_FALSE(told.contradiction);
  CHECK(told.diverges < alone.diverges);
  CHECK(told.decay.error < alone.decay.error);
  t.levels = 10;
  t.b = [](double k) { return -1.05 * k; };
  const Evidence wrong = weigh(t.facts(), {.declared = Rates{2, 1}});
  REQUIRE(wrong.contradiction);
  CHECK(wrong.answer == Answer::open);
  CHECK(std::any_of(wrong.reasons.begin(), wrong.reasons.end(),
                    [](const Warning& w) { return w.code == WarningCode::declared_rates; }));
}

TEST_CASE("a hump, whose rarity still falls, is open and not a no", "[evidence][exact]") {
  // E D^2 rises while a rare event becomes common: 1/p with a clamp.
  Table t;
  t.levels = 7;
  t.b = [](double k) { return 1.5 * k; };
  t.kappa = [](double k) { return 200 * std::exp2(-k); };
  const Evidence e = weigh(t.facts());
  CHECK(e.changes);
  CHECK(e.answer == Answer::open);
  // The same rise at constant rarity is no hump.
  t.kappa = [](double) { return 30.0; };
  t.b = [](double k) { return 0.2 * k; };
  CHECK(weigh(t.facts()).answer == Answer::no);
}

TEST_CASE("a PMF is finite below the decay, infinite above it, open beside it", "[evidence][exact]") {
  Table t;
  const Evidence e = weigh(t.facts());
  const SumConvergence finite = judge(e, geometric(1.5));
  CHECK(finite.value == SumConvergence::Value::finite);
  CHECK(finite.grade == Grade::shown);
  CHECK(finite.growth == Approx(-0.5).margin(0.1));
  const SumConvergence infinite = judge(e, geometric(3));
  CHECK(infinite.value == SumConvergence::Value::infinite);
  CHECK(infinite.grade == Grade::shown);
  CHECK(infinite.growth == Approx(1).margin(0.1));
  CHECK(judge(e, geometric(2)).value == SumConvergence::Value::open);
  CHECK(judge(weigh({}), geometric(1)).value == SumConvergence::Value::open);
  CHECK(judge(e, {}).value == SumConvergence::Value::open);
}

TEST_CASE("under a PMF that falls faster than any power the ratio of moments and masses decides", "[evidence][exact]") {
  Masses poisson;
  poisson.first_level = 0;
  double p = std::exp(-2.0);
  for (int k = 0; k < 100; ++k) {
    poisson.mass.push_back(p);
    p *= 2.0 / (k + 1);
  }
  Table t;
  t.levels = 9;
  t.b = [](double k) { return -2 * std::lgamma(k + 1) / std::log(2.0); };
  t.work = [](double) { return 1.0; };
  CHECK(judge(weigh(t.facts()), poisson).value == SumConvergence::Value::finite);
  t.b = [](double k) { return -k; };
  t.levels = 14;
  CHECK(judge(weigh(t.facts()), poisson).value == SumConvergence::Value::infinite);
}

TEST_CASE("a level with a mass and hardly a draw widens the interval", "[evidence][exact]") {
  Table t;
  const Evidence e = weigh(t.facts());
  const Doubt good = doubt_of(e, geometric(1.5), 65536);
  CHECK(good.reliable());
  CHECK(good.unseen < 0.1 * good.seen);
  CHECK(good.degrees > 100);
  // Level 2, which the pilot knows, at less than a draw: missing from most runs, whose error then is its mean.
  Masses starved = geometric(1.5);
  starved.mass[1] = 1e-7;
  const Doubt known = doubt_of(e, starved, 65536);
  CHECK(known.undrawn == Approx(std::exp2(-4.0)).epsilon(0.1));
  CHECK(known.undrawn > 100 * known.seen);
  // Levels that nobody has seen, beyond a PMF that ends early: the sum of what their means may be.
  t.b = [](double k) { return -0.5 * k; };
  t.kappa = [](double) { return 1.0; };
  Masses steep = geometric(1.5);
  for (std::size_t j = 8; j < steep.mass.size(); ++j) steep.mass[j] *= 1e-9;
  const Doubt unseen = doubt_of(weigh(t.facts()), steep, 65536);
  const double left_out = std::exp2(-0.25 * 9) / (1 - std::exp2(-0.25));
  CHECK(unseen.unseen > 0.5 * left_out * left_out);
  CHECK_FALSE(unseen.reliable());
}

TEST_CASE("two tables of one sequence join as one of all draws", "[evidence][exact]") {
  const LevelFacts a{.level = 1, .draws = 100, .mean = 1, .second_moment = 4, .kurtosis = 20.0 / 16, .nonzero = 0.5};
  const LevelFacts b{.level = 1, .draws = 300, .mean = 2, .second_moment = 8, .kurtosis = 100.0 / 64, .nonzero = 1};
  const LevelFacts c{.level = 2, .draws = 5};
  const std::vector<LevelFacts> first = {a};
  const std::vector<LevelFacts> second = {b, c};
  const std::vector<LevelFacts> all = together(first, second);
  REQUIRE(all.size() == 2);
  CHECK(all[0].draws == 400);
  CHECK(all[0].mean == Approx(1.75));
  CHECK(all[0].second_moment == Approx(7));
  CHECK(all[0].kurtosis == Approx(80.0 / 49));
  CHECK(all[0].nonzero == Approx(0.875));
  CHECK(all[1].level == 2);
}

TEST_CASE("evidence is the same bits each time and takes milliseconds", "[evidence][exact]") {
  Table t;
  t.levels = 24;
  t.work = [](double k) { return k + 1; };
  const std::vector<LevelFacts> facts = t.facts();
  const Evidence a = weigh(facts);
  const std::clock_t start = std::clock();
  const Evidence b = weigh(facts);
  const SumConvergence verdict = judge(b, geometric(1));
  (void)doubt_of(b, geometric(1), 1e6);
  const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  CHECK(verdict.value == SumConvergence::Value::finite);
  CHECK(a.diverges == b.diverges);
  CHECK(a.unseen.high == b.unseen.high);
  CHECK(a.decay.value == b.decay.value);
  CHECK(seconds < 0.1);  // 2 ms of CPU on an idle machine
}

TEST_CASE("two levels that vote are believed without a course", "[evidence][exact]") {
  Table t;
  t.levels = 2;
  const Evidence e = weigh(t.facts());
  CHECK(e.courses.empty());
  const std::vector<Believed> b = believed(e, 2);
  for (std::size_t k = 1; k <= 2; ++k) CHECK(b[k].log2_second == Approx(std::log2(e.facts[k].second_moment)));
}

TEST_CASE("a fourth moment counts how rare the differences are", "[evidence][exact]") {
  // E D_k^4 / p_k^3 is 2^(-6k + rarity k + 5.4 k).
  const auto diverges = [](double rarity) {
    Table t{.levels = 7, .b = [](double k) { return -3 * k; }, .draws = 1 << 20};
    t.kappa = [rarity](double k) { return 3 * std::exp2(rarity * k); };
    return fourth_moment_diverges(weigh(t.facts()), geometric(1.8));
  };
  CHECK(diverges(0) < 0.1);
  CHECK(diverges(1.6) > 0.9);
}

TEST_CASE("a few noisy levels that fall like a power of 2 are not read as a power of the level", "[evidence][exact]") {
  double share = 0;
  constexpr int seeds = 40;
  for (int seed = 1; seed <= seeds; ++seed) {
    Table t{.levels = 4, .work = [](double) { return 1.0; }, .draws = 256};
    t.b = [](double k) { return -1.5 * k; };
    t.seed = static_cast<std::uint64_t>(seed);
    const Evidence e = weigh(t.facts());
    REQUIRE(!e.courses.empty());
    const auto powers = std::count_if(e.courses.begin(), e.courses.end(), [](const Course& c) { return c.polynomial; });
    share += static_cast<double>(powers) / static_cast<double>(e.courses.size()) / seeds;
  }
  CHECK(share < 0.35);
}
