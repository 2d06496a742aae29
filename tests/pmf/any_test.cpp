#include <debias/pmf/any.hpp>

#include <cstdint>
#include <stdexcept>
#include <string>

#include "catch_shim.hpp"
#include "laws/pmf_laws.hpp"

using debias::AnyPmf;

static_assert(debias::DescribedPmf<AnyPmf>);

TEST_CASE("A PMF and the PMF that its spec is parsed to are the same, bit for bit", "[pmf][exact]") {
  const AnyPmf any_pmfs[] = {
      AnyPmf(debias::Geometric(0.6)),
      AnyPmf(debias::Geometric::with_exponent(1.3)),
      AnyPmf(debias::Geometric(1e-6 / 3)),
      AnyPmf(debias::Zeta(2.5)),
      AnyPmf(debias::Zeta(1 + 1.0 / 3)),
      AnyPmf(debias::Poisson(3)),
      AnyPmf(debias::Poisson(1e4 / 7)),
      AnyPmf(debias::Tabulated({0.5, 0.3, 0.2}, 0.4)),
      AnyPmf(debias::Tabulated({1e-30 / 3, 1e20 / 7, 5}, 1.0 / 3)),
      AnyPmf(debias::Dyadic({9, 7, 7, 0}, 4.0 / 3)),
  };
  for (const AnyPmf& pmf : any_pmfs) {
    CAPTURE(pmf.spec());
    const AnyPmf again = AnyPmf::parse(pmf.spec());
    CHECK(again.spec() == pmf.spec());
    CHECK(again.tail_exponent().exponent == pmf.tail_exponent().exponent);
    CHECK(again.tail_exponent().decay == pmf.tail_exponent().decay);
    for (std::int64_t j = 0; j < 2000; ++j) {
      if (again.mass(j) != pmf.mass(j) || again.tail(j) != pmf.tail(j)) FAIL_CHECK("level " << j);
    }
    for (double u = 0.99; u > 1e-6; u *= 0.9) CHECK(again.sample(u) == pmf.sample(u));
  }
}

TEST_CASE("Every form of a PMF on the command line says which PMF it is", "[pmf][exact]") {
  CHECK(AnyPmf::parse("geometric:r=0.6").spec() == "geometric:r=0.6");
  CHECK(AnyPmf::parse("geometric:theta=1").spec() == "geometric:r=0.5");
  CHECK(AnyPmf::parse("zeta:s=2.5").spec() == "zeta:s=2.5");
  CHECK(AnyPmf::parse("poisson:lambda=3").spec() == "poisson:lambda=3");
  CHECK(AnyPmf::parse("tabulated:0.5,0.3,0.2;tail=0.4").spec() == "tabulated:0.5,0.3,0.2;tail=0.4");
  CHECK(AnyPmf::parse("tabulated:1e0;tail=5e-1").spec() == "tabulated:1;tail=0.5");
  for (const AnyPmf::Form& form : AnyPmf::forms()) {
    const std::string example(form.example.substr(0, form.example.find(' ')));
    CAPTURE(example);
    CHECK(AnyPmf::parse(example).spec() == example);
  }
}

TEST_CASE("A PMF chosen at run time is a PMF", "[pmf][law]") {
  for (const char* spec : {"geometric:r=0.6", "zeta:s=2.5", "poisson:lambda=3", "tabulated:0.5,0.3,0.2;tail=0.4"}) {
    CAPTURE(spec);
    CHECK(debias::laws::pmf_laws(AnyPmf::parse(spec)) == debias::laws::Failures{});
  }
}

TEST_CASE("A PMF that cannot be read is refused with what is wrong and what is near", "[pmf][exact]") {
  struct Wrong {
    const char* text;
    const char* message;
  };
  static constexpr Wrong wrong[] = {
      {"", "no PMF is called ''"},
      {":", "no PMF is called ''"},
      {"banana:r=1", "write one of geometric zeta poisson tabulated dyadic"},
      {"geometrc:r=0.5", "did you mean 'geometric'?"},
      {"Zeta:s=2", "did you mean 'zeta'?"},
      {" zeta:s=2", "did you mean 'zeta'?"},
      {"poison:lambda=3", "did you mean 'poisson'?"},
      {"geometric", "no parameters; write geometric:r=0.6"},
      {"geometric:", "no parameters; write geometric:r=0.6"},
      {"geometric:0.5", "'0.5' (not of the form key=value)"},
      {"geometric:p=0.5", "'p' (no such parameter); write geometric:r=0.6"},
      {"geometric:thta=0.5", "'thta' (no such parameter); did you mean 'theta'?"},
      {"geometric:r=0.5,r=0.5", "'r' (given twice)"},
      {"geometric:r=0.5;theta=1", "'r' and 'theta' (one of them is enough)"},
      {"geometric:r=0.5,", "'' (not of the form key=value)"},
      {"geometric:r=", "geometric: r = '' (not a number)"},
      {"geometric:r=nan", "geometric: r = 'nan' (must be finite)"},
      {"geometric:r=inf", "geometric: r = 'inf' (must be finite)"},
      {"geometric:r=0x1p-1", "geometric: r = '0x1p-1' ('x1p-1' follows the number)"},
      {"geometric:r=0.5 ", "geometric: r = '0.5 ' (' ' follows the number)"},
      {"geometric:r=0.5=0.5", "('=0.5' follows the number)"},
      {"geometric:r=1.2", "Geometric: r = 1.2 (must lie in"},
      {"zeta:s=1", "Zeta: s = 1 (must be greater than 1"},
      {"zeta:s=1e999", "zeta: s = '1e999' (beyond the range of a double)"},
      {"zeta:s=1e300", "zeta: s = 1e+300 (no double holds the mass"},
      {"poisson:lambda=1e-320", "Poisson: lambda = 1e-320 (no double holds the mass"},
      {"poisson:lamda=3", "did you mean 'lambda'?"},
      {"poisson:lambda=-3", "Poisson: lambda = -3 (must lie in"},
      {"tabulated:0.5,0.3", "no tail"},
      {"tabulated:0.5,tail=0.3", "no tail"},
      {"tabulated:0.5;", "'' (not of the form key=value)"},
      {"tabulated:0.5,,0.3;tail=0.4", "tabulated: mass 1 = '' (not a number)"},
      {"tabulated:;tail=0.4", "tabulated: mass 0 = '' (not a number)"},
      {"tabulated:0.5;tale=0.4", "'tale' (no such parameter); did you mean 'tail'?"},
      {"tabulated:0.5,0;tail=0.4", "Tabulated: mass 1 = 0 (must be positive"},
      {"tabulated:0.5;tail=0", "Tabulated: tail = 0 (a PMF that ends"},
  };
  for (const auto& [text, message] : wrong) {
    CAPTURE(text);
    CHECK_THROWS_AS(AnyPmf::parse(text), std::invalid_argument);
    CHECK_THROWS_WITH(AnyPmf::parse(text), Catch::Contains(message));
  }
}
