#include "property.hpp"

#include <cmath>
#include <cstdint>
#include <map>

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>

using namespace debias;
using namespace debias::properties;

namespace {

/// D_k = 2^-k, whatever the random numbers: I_k = 2 - 2^-k, the limit is 2.
Draw<double> halves(std::int64_t level, Stream&) {
  const double d = std::exp2(-static_cast<double>(level));
  return {2 - d, d};
}

/// Its levels fit 64 bits: a PMF that is too slow for that refuses its deepest ones.
bool fits(const AnyPmf& pmf) { return pmf.tail(std::int64_t{1} << 60) < 1e-12; }

}  // namespace

TEST_CASE("in systematic blocks a level comes up within one of n p_k times, and is divided by p_k", "[property][law]") {
  holds("counts of a block", [] {
    const AnyPmf pmf = any_pmf();
    RC_PRE(fits(pmf));
    const std::int64_t n = *rc::gen::inRange<std::int64_t>(1, 200);
    const auto e = stratified(single_term(halves, pmf, {.base = Base::one_outcome}), n);
    const auto block = trace(e, *rc::gen::arbitrary<std::uint64_t>(), *rc::gen::inRange(0, 1000));
    std::map<std::int64_t, double> counts;
    for (const TracedLevel& l : block.levels) ++counts[l.level];
    double members = 0;
    double value = 0;
    for (const auto& [level, count] : counts) {
      members += count;
      value += count * std::exp2(-static_cast<double>(level)) / pmf.mass(level) / static_cast<double>(n);
    }
    RC_ASSERT(members == static_cast<double>(n));
    for (std::int64_t level = 0; level < 400; ++level) {
      const double expected = static_cast<double>(n) * pmf.mass(level);
      const auto found = counts.find(level);
      const double count = found == counts.end() ? 0 : found->second;
      if (std::abs(count - expected) >= 1 + 1e-9) {
        RC_FAIL(pmf.spec() + ": level " + std::to_string(level) + " came up " + std::to_string(count) + " times, not " +
                std::to_string(expected));
      }
    }
    RC_ASSERT(std::abs(block.sample.value - value) <= 1e-12 * std::abs(value));
  });
}

TEST_CASE("blocks of any kind draw level k n p_k times on average", "[property][law]") {
  holds("E counts", [] {
    const AnyPmf pmf = any_pmf();
    const Strata strata = *rc::gen::element(Strata::systematic, Strata::uniform, Strata::residual);
    const std::int64_t n = *rc::gen::inRange<std::int64_t>(1, 40);
    RC_PRE(fits(pmf));
    RC_PRE(strata != Strata::residual || pmf.tail(1 << 15) < 1e-3);
    constexpr std::int64_t blocks = 300;
    const auto r = estimate(stratified(single_term(halves, pmf, {.base = Base::one_outcome}), n, strata),
                            {.samples = blocks * n, .seed = *rc::gen::arbitrary<std::uint64_t>(), .threads = 1});
    for (const LevelRow& row : r.levels) {
      if (row.level != row.last_level) continue;
      const double expected = static_cast<double>(blocks * n) * pmf.mass(row.level);
      if (expected < 25) continue;
      // no kind of strata varies more than independent draws do
      if (std::abs(static_cast<double>(row.count) - expected) > 6.5 * std::sqrt(expected) + 1) {
        RC_FAIL(pmf.spec() + ", " + name_of(strata) + ", n = " + std::to_string(n) + ": level " +
                std::to_string(row.level) + " came up " + std::to_string(row.count) + " times, not " +
                std::to_string(expected));
      }
    }
  });
}
