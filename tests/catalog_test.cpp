#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "catalog.hpp"
#include "validation/hard.hpp"
#include "validation/reliability.hpp"
#include "validation/validation.hpp"

#include "catch_shim.hpp"

#include <debias/core/rates.hpp>
#include <debias/diagnostics.hpp>

using namespace debias;
using namespace debias::catalog;
using namespace debias::validation;

TEST_CASE("every problem has an id and a name of its own, a finite truth, and at least two stand in every group",
          "[catalog][exact]") {
  std::set<std::string> names;
  std::map<char, int> groups;
  for (const Problem& p : problems()) {
    CAPTURE(p.id, p.name);
    CHECK(names.insert(p.id).second);
    CHECK(names.insert(p.name).second);
    CHECK(std::isfinite(p.truth));
    CHECK_FALSE(p.formula.empty());
    CHECK(&find(p.id) == &p);
    CHECK(&find(p.name) == &p);
    ++groups[p.id.front()];
  }
  CHECK(problems().size() >= 30);
  for (const char group : std::string("ABCDEFHIKM")) CHECK(groups[group] >= 2);
  CHECK_THROWS_WITH(find("A1O"), Catch::Contains("A10"));
}

TEST_CASE("a PMF is refused exactly where no PMF has finite variance and finite work", "[catalog][exact]") {
  std::vector<std::string> refused;
  for (const Problem& p : problems()) {
    if (!pmf_exists(p.rates)) {
      refused.push_back(p.id);
      CHECK_THROWS_AS(default_pmf(p), std::invalid_argument);
    } else {
      CHECK_NOTHROW(default_pmf(p));
    }
  }
  CHECK(refused == std::vector<std::string>{"C12", "E06", "E20"});
}

TEST_CASE("a refused cell says which rates leave no PMF", "[catalog][exact]") {
  const std::map<std::string, std::string> reasons = {{"C12", "E D_k^2 ~ 2^(1 k), work ~ 2^(0 k)"},
                                                      {"E06", "E D_k^2 ~ 2^(-1 k), work ~ 2^(1 k)"}};
  for (const auto& [id, rates] : reasons) {
    const Report report = validate({&find(id)}, {.samples = 100});
    CHECK(report.passed + report.failed == 0);
    int refused = 0;
    for (const Cell& cell : report.cells) {
      if (cell.status != Status::refused) continue;
      ++refused;
      CHECK_FALSE(cell.has_run);
      CHECK_THAT(cell.reason, Catch::Contains("no PMF has both finite variance and finite work: " + rates));
    }
    CHECK(refused == 4);
  }
}

TEST_CASE("every PMF that validation chooses has finite variance and finite work for its estimator",
          "[catalog][exact]") {
  for (const Problem& p : problems()) {
    for (const Choice& choice : choices(p)) {
      if (!choice.special.empty() || choice.method == Method::truncated) continue;
      const Rates rates = rates_of(p, choice.method);
      CAPTURE(p.id, name_of(choice), choice.pmf.spec());
      if (!pmf_exists(rates)) continue;
      const DeclaredFiniteness v = judge(rates, choice.pmf.tail_exponent());
      CHECK(v.finite_variance);
      CHECK(v.finite_work);
    }
  }
}

TEST_CASE("the threshold rejects one family in a million: 4.9 for one cell, 5.5 for 30, 6.1 for 1000",
          "[catalog][exact]") {
  CHECK(family_threshold(1) == Approx(4.89164).epsilon(1e-5));
  CHECK(family_threshold(30) == Approx(5.52296).epsilon(1e-5));
  CHECK(family_threshold(1000) == Approx(6.10941).epsilon(1e-5));
}

TEST_CASE("validation rejects a truth that is off by three times the detectable bias and passes the right one",
          "[catalog][statistical]") {
  for (const char* id : {"A10", "B02", "C02", "D01", "F02", "H01"}) {
    CAPTURE(id);
    const Problem& right = find(id);
    const Plan plan{.samples = 1 << 12, .seed = 3};
    const Report passed = validate({&right}, plan);
    CHECK(passed.failed == 0);
    REQUIRE(passed.passed > 0);
    double bias = 0;
    for (const Cell& cell : passed.cells) bias = std::max(bias, cell.detectable_bias);
    Problem wrong = right;
    wrong.truth += 3 * bias;
    const Report failed = validate({&wrong}, plan);
    CHECK(failed.passed == 0);
    CHECK(failed.failed == passed.passed);
  }
}

TEST_CASE("the kurtosis that a special method declares is that of its samples", "[catalog][statistical]") {
  constexpr std::int64_t size = 1 << 12;
  constexpr int batches = 64;
  for (const char* id : {"B25", "B28"}) {  // tau = 4: where the kurtosis is small roulette has a part in it
    for (const char* name : {"p_series_cmf", "p_series_cumulative", "ratio_tracking"}) {
      CAPTURE(id, name);
      const Special* special = find_special(find(id), name);
      REQUIRE(special != nullptr);
      std::vector<double> second;
      std::vector<double> fourth;
      for (int b = 0; b < batches; ++b) {
        const Moments m = find(id).run({.special = name}, {.samples = size, .seed = 5, .first = b * size}).moments;
        const double n = size;
        const double mean2 = m.mean * m.mean;
        second.push_back(m.m2 / n + mean2);
        fourth.push_back(m.m4 / n + 4 * m.m3 / n * m.mean + 6 * m.m2 / n * mean2 + mean2 * mean2);
      }
      // E Z^4 - kurtosis (E Z^2)^2 = 0, to first order in the noise of the second moment
      const double square = Moments::of(second).mean;
      const auto score = [&](double kurtosis) {
        std::vector<double> excess;
        for (std::size_t b = 0; b < fourth.size(); ++b)
          excess.push_back(fourth[b] - kurtosis * square * (2 * second[b] - square));
        const Moments m = Moments::of(excess);
        return m.mean / m.standard_error();
      };
      CHECK(std::abs(score(special->kurtosis)) < 4.5);
      CHECK(std::abs(score(1.5 * special->kurtosis)) > 4.5);
      CHECK(std::abs(score(special->kurtosis / 1.5)) > 4.5);
    }
  }
}

TEST_CASE("samples that cannot see a thick medium are called too few for every method that says its kurtosis",
          "[catalog][exact]") {
  const Report report = validate({&find("B26")}, {.samples = 20000});
  int underpowered = 0;
  for (const Cell& cell : report.cells) {
    const Special* special = find_special(find("B26"), cell.choice.special);
    if (special == nullptr || special->kurtosis == 0) continue;
    CAPTURE(special->name, cell.reason);
    CHECK(cell.status == Status::underpowered);
    CHECK(cell.reason.find(" a kurtosis of 1") != cell.reason.npos);
    ++underpowered;
  }
  CHECK(underpowered == 3);
}

TEST_CASE("a replay of the largest samples of a run gives their level and their bits", "[catalog][exact]") {
  for (const Problem& p : problems()) {
    if (!pmf_exists(p.rates)) continue;
    for (const Choice& choice : choices(p)) {
      const Statistics run = p.run(choice, {.samples = 500, .seed = 11});
      REQUIRE_FALSE(run.largest.empty());
      for (const LargeSample& large : {run.largest.front(), run.largest.back()}) {
        CAPTURE(p.id, name_of(choice), large.index);
        const auto sample = p.trace(choice, 11, large.index).sample;
        CHECK(sample.value == large.value);
        CHECK(sample.level == large.level);
      }
    }
  }
}

TEST_CASE("no hard case is wrong without a word, and one that is wrong without a word fails",
          "[catalog][statistical]") {
  const HardReport report = validate(hard_cases(), {.samples = 20000, .seed = 2});
  for (const HardCell& cell : report.cells) {
    CAPTURE(cell.group, cell.parameter, cell.truth, cell.error, cell.says);
    CHECK(cell.status != HardStatus::fail);
    if (cell.status == HardStatus::said) CHECK_FALSE(cell.says.empty());
  }
  CHECK(report.failed == 0);

  HardCase wrong = hard_cases().front();  // an estimate without a doubt
  const HardCell right = validate({wrong}, {.samples = 20000, .seed = 2}).cells.front();
  REQUIRE(right.status == HardStatus::pass);
  REQUIRE(right.says.empty());
  wrong.truth += 20 * right.statistics.total_error();
  CHECK(validate({wrong}, {.samples = 20000, .seed = 2}).failed == 1);
}

TEST_CASE("wrong estimators are rejected, right ones are not, and bad values are never hidden",
          "[catalog][statistical]") {
  for (const Suspect& s : suspects()) {
    const Statistics run = s.run({.samples = 200'000, .seed = 4});
    const double z = (run.components.front().mean - s.truth) / believed_error(run, s.truth);
    CAPTURE(s.name, z);
    CHECK((std::abs(z) < family_threshold(static_cast<std::int64_t>(suspects().size()))) == !s.wrong);
  }
  CHECK(failures_on_nonfinite_values().empty());
}

TEST_CASE("the distance of Kolmogorov and Smirnov has its distribution", "[catalog][exact]") {
  std::vector<double> even;
  for (int i = 0; i < 1000; ++i) even.push_back((i + 0.5) / 1000);
  CHECK(kolmogorov_smirnov(even) > 0.999);
  for (double& u : even) u = std::pow(u, 1.1);
  // The largest gap is max x^(1/1.1) - x + 1/2000 = 0.0355, and 2 exp(-2 (31.74 x 0.0355)^2) = 0.157.
  CHECK(kolmogorov_smirnov(even) == Approx(0.157).epsilon(0.01));
  for (double& u : even) u = std::pow(u, 1.3);
  CHECK(kolmogorov_smirnov(even) < 1e-6);
}

// The page of `debias validate --report --samples 1e6`.
TEST_CASE("every figure of reliability holds", "[catalog][statistical][.long]") {
  for (const Figure& f : reliability({})) {
    WARN(f.name << ": " << f.measured << " (" << f.demanded << ")");
    CHECK(f.holds);
  }
}
