// The catalogue's chains against their closed forms.

#include <cmath>
#include <string>

#include "catalog.hpp"
#include "validation/validation.hpp"

#include "catch_shim.hpp"

#include <debias/core/report.hpp>
#include <debias/survey.hpp>

using namespace debias;
using catalog::find;

// Wrong weights, lags and burn-ins are rejected in coupled_chain_test.cpp.
TEST_CASE("K01 to K05 are unbiased over 20,000 estimates", "[chains][catalog][stat]") {
  for (const char* id : {"K01", "K02", "K03", "K04", "K05"}) {
    const catalog::Problem& p = find(id);
    const std::string special = id == std::string("K05") ? "taylor" : "coupled_chain";
    const Statistics s = p.run({.special = special}, {.samples = 20000, .seed = 5});
    const ComponentEstimate& e = s.components.front();
    INFO(id << '\n' << full(s));
    const double limit = validation::family_threshold(10);
    CHECK(std::abs(e.mean - p.truth) < limit * e.standard_error);
    if (special == "coupled_chain") {
      CHECK(s.verdict().meeting.kind == MeetingKind::light);
      CHECK(s.verdict().variance == Finiteness::finite);
      CHECK(s.verdict().grade == Grade::likely);
    }
  }
}

TEST_CASE("K01 to K04: the levels of chains fall no slower than they declare", "[chains][catalog][stat]") {
  for (const char* id : {"K01", "K02", "K03", "K04"}) {
    const Survey s = survey(find(id).levels, 6, {.samples = 1 << 14, .seed = 3});
    INFO(id << '\n' << s);
    CHECK(s.rates.variance_decay.value > find(id).rates.variance_decay - 0.15);
    CHECK(s.pmf_exists == Answer::yes);
  }
}
