// A host may have another idea of numbers: std::locale::global with decimal commas and grouped thousands, or a stream of
// that kind. What the library says must not change by a byte. tests/locale_test.sh asks the same of the program under
// setlocale.

#include <functional>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <debias/debias.hpp>
#include <debias/pmf/any.hpp>
#include <debias/pmf/radius.hpp>

#include "catch_shim.hpp"

namespace {

struct German : std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

std::locale german() { return {std::locale::classic(), new German}; }

/// Runs with that locale for every stream that is made.
class Host {
 public:
  explicit Host(const std::locale& locale) : before_(std::locale::global(locale)) {}
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;
  ~Host() { std::locale::global(before_); }

 private:
  std::locale before_;
};

/// Without the lines and the columns of a clock, which stand behind numbers that stay.
std::string steady(const std::string& text) {
  std::istringstream in(text);
  std::string out;
  for (std::string line; std::getline(in, line);) {
    if (line.rfind("seconds", 0) == 0 || line.rfind("efficiency", 0) == 0) continue;
    out += line + '\n';
  }
  return out;
}

template <class T>
std::string printed(const T& x) {
  std::ostringstream out;
  out << x;
  return steady(out.str());
}

std::string refused(const std::function<void()>& f) {
  try {
    f();
  } catch (const std::exception& e) {
    return e.what();
  }
  return "nothing was refused";
}

/// What a program sees of the library, in words.
std::vector<std::string> said() {
  using namespace debias;
  const auto x = [](Stream& rng) {
    const double u = rng.uniform();
    return 1 + u * u;
  };
  const auto e = single_term(reciprocal(x));
  const Plan plan{.samples = 1234567 / 64, .seed = 1234567};
  std::vector<std::string> all;
  all.push_back(printed(estimate(e, plan)));
  all.push_back(printed(estimate(recipe(function_of_mean(x, functions::Square{})), {.samples = 4096, .seed = 3})));
  const auto square = function_of_mean(x, functions::Square{});
  const auto multilevel_result = multilevel(square, 0.02, {.samples = 1000, .seed = 2});
  all.push_back(printed(multilevel_result));
  Survey levels = survey(square, 5, {.samples = 2000, .seed = 4});
  for (SurveyRow& row : levels.rows) row.seconds = 0.00123456;
  all.push_back(printed(levels));
  const auto slope = finite_difference([](double t) { return t * t * t; }, 1.0);
  const auto s = estimate(single_term(slope), {.samples = 4096});
  all.push_back(s.bias_bound.sentence);
  all.push_back(printed(s));
  all.push_back(e.describe());
  all.push_back(RadiusPmf(0.75).spec());
  all.push_back(IndexRoulette(0.5).spec());
  all.push_back(AnyPmf::parse("zeta:s=2.5").spec());
  all.push_back(judge(Rates{2, 1}, TailExponent{1.5, Decay::geometric}).sentence);
  all.push_back(judge(Rates{1, 1}, TailExponent{1.5, Decay::geometric}).sentence);
  all.push_back(with_error(12345678.5, 1234.5));
  all.push_back(with_error(0.75, 0.00123));
  all.push_back(with_error(12.5, 0.25));
  all.push_back(with_error(1e20, 2.5));
  all.push_back(refused([] { Geometric(1.5); }));
  all.push_back(refused([] { AnyPmf::parse("geometric:r=0,5"); }));
  all.push_back(refused([] { geometric_terms(1.25); }));
  all.push_back(refused([&] { estimate(single_term(reciprocal(x)), {.samples = 10, .goal = {.error = -0.5}}); }));
  all.push_back(refused([] { finite_difference([](double t) { return t; }, 1.5, {.first_step = -0.25}); }));
  all.push_back(refused([] { default_exponent(Rates{0.5, 1.5}); }));
  all.push_back(refused([] { RadiusPmf(1.5); }));
  all.push_back(refused([] { interval_of(Moments{}, 1.5); }));
  all.push_back(refused([&] { single_term(function_of_mean(x, functions::Square{}, {0.5, 1.5})); }));
  return all;
}

}  // namespace

TEST_CASE("A host's locale changes no byte of what the library says", "[core][exact]") {
  const std::vector<std::string> plain = said();
  for (const std::string& text : plain) {
    CAPTURE(text);
    CHECK(text.find("nothing was refused") == text.npos);
    CHECK(text.find_first_of("0123456789") != text.npos);
  }
  const Host host(german());
  // There is such a host: its own stream writes as it likes.
  std::ostringstream own;
  own << 1234567 << ' ' << 0.5;
  REQUIRE(own.str() == "1.234.567 0,5");
  const std::vector<std::string> there = said();
  for (std::size_t i = 0; i < plain.size(); ++i) CHECK(there[i] == plain[i]);
}
