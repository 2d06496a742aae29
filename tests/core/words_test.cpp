#include <cmath>
#include <limits>
#include <set>
#include <string>

#include "catch_shim.hpp"

#include <debias/core/warning.hpp>
#include <debias/diagnostics.hpp>

#include "core/words.hpp"

using namespace debias;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

std::string decay(double value, double error, Decay unit = Decay::geometric) {
  return decay_words("E D_k^2", {value, error}, unit);
}

}  // namespace

TEST_CASE("a decay is said to fall only where it falls beyond its error", "[words][exact]") {
  CHECK(decay(1.02, 0.03) == "E D_k^2 falls like 2^(-1.02 k) (+- 0.03)");
  CHECK(decay(2, 0) == "E D_k^2 falls like 2^(-2 k)");
  CHECK(decay(2.5, 0.1, Decay::polynomial) == "E D_k^2 falls like k^-2.5 (+- 0.1)");
  CHECK(decay_words("E D_k^2", {1, 0.1}, Decay::geometric, "levels 1 to 9") ==
        "E D_k^2 falls like 2^(-1 k) (+- 0.1, levels 1 to 9)");
  // the two that were said to fall like 2^(k x 0.04) and 2^(k x -0.00)
  CHECK(decay(-0.04, 0.05) == "E D_k^2 does not fall (exponent -0.04 +- 0.05)");
  CHECK(decay(0.001, 0.02) == "E D_k^2 does not fall (exponent 0.001 +- 0.02)");
  CHECK(decay(0, 0) == "E D_k^2 does not fall");
  CHECK(decay(-1e-17, 0) == "E D_k^2 does not fall");
  CHECK(decay(-0.35, 0.05) == "E D_k^2 grows like 2^(0.35 k) (+- 0.05)");
  CHECK(decay(-1.5, 0, Decay::polynomial) == "E D_k^2 grows like k^1.5");
  CHECK(decay(0.8, 1.2) == "it is open whether E D_k^2 falls (exponent 0.8 +- 1.2)");
  CHECK(decay(infinity, 0) == "E D_k^2 falls faster than any power");
  CHECK(decay(-infinity, 0) == "E D_k^2 grows faster than any power");
  CHECK(decay(nan_value, 0) == "it is not known how E D_k^2 falls");
  CHECK(decay(1, infinity) == "E D_k^2 falls like 2^(-1 k)");
  CHECK(decay(1, nan_value) == "E D_k^2 falls like 2^(-1 k)");
}

TEST_CASE("work is said to grow only where it grows", "[words][exact]") {
  const auto growth = [](double value, Decay unit = Decay::geometric) {
    return growth_words("work", {value, 0}, unit);
  };
  CHECK(growth(1) == "work grows like 2^(1 k)");
  CHECK(growth(0.5, Decay::polynomial) == "work grows like k^0.5");
  CHECK(growth(0) == "work does not grow");
  CHECK(growth(1e-15, Decay::polynomial) == "work does not grow");
  CHECK(growth(-0.25) == "work falls like 2^(-0.25 k)");
  CHECK(growth(infinity) == "work grows faster than any power");
  CHECK(growth(nan_value) == "it is not known how work grows");
}

TEST_CASE("moments below 1 are no finite mean, and below 2 no finite variance", "[words][exact]") {
  CHECK(moments_words(3.2) == "moments below 3.2 are finite");
  CHECK(moments_words(0.982) == "even the mean is infinite");
  CHECK(moments_words(1) == "even the mean is infinite");
  CHECK(moments_words(-2) == "even the mean is infinite");
  CHECK(moments_words(1.5) == "the variance is infinite (moments below 1.5 are finite)");
  CHECK(moments_words(2) == "the variance is infinite (moments below 2 are finite)");
  CHECK(moments_words(1.0001) == "the variance is infinite (moments below a little more than 1 are finite)");
  CHECK(moments_words(1.9999) == "the variance is infinite (moments below a little less than 2 are finite)");
  CHECK(moments_words(2.0001) == "moments below a little more than 2 are finite");
  CHECK(moments_words(infinity) == "all moments are finite");
  CHECK(moments_words(nan_value) == "it is not known which moments are finite");
}

TEST_CASE("a tail says what follows from its index, beyond two errors", "[words][exact]") {
  const auto tail = [](double k, double error) {
    TailIndex t;
    t.state = TailState::fitted;
    t.k = k;
    t.error = error;
    t.values = 100;
    return tail_words(t);
  };
  CHECK_THAT(tail(0.2, 0.1), Catch::StartsWith("k = 0.2 +- 0.1 (100 values; "));
  CHECK_THAT(tail(0.6, 0.1), Catch::StartsWith("k = 0.6 +- 0.1 (100 values; "));
  CHECK_THAT(tail(0.8, 0.1), Catch::Contains("the variance looks infinite"));
  CHECK_THAT(tail(1.3, 0.1), Catch::Contains("even the mean looks infinite"));
  CHECK_THAT(tail(infinity, 0.1), Catch::StartsWith("k = - +- 0.1"));
  CHECK_THAT(tail_words({}), Catch::StartsWith("no shape"));
}

TEST_CASE("the verdict on rates names no PMF for differences that do not fall, and decides nothing of NaN",
          "[words][diagnostics][exact]") {
  const DeclaredFiniteness none = judge(Rates{0, 0}, TailExponent{1});
  CHECK_FALSE(none.finite_variance);
  CHECK_THAT(none.sentence, Catch::Contains("even the mean is infinite") && Catch::Contains("E D_k^2 does not fall"));
  CHECK_THAT(judge(Rates{-0.5, 0}, TailExponent{1}).sentence, Catch::Contains("E D_k^2 grows like 2^(0.5 k)"));
  CHECK_THAT(judge(Rates{1, 0.5}, TailExponent{2}).sentence, Catch::Contains("the standard error is too small"));
  for (const Rates& unknown : {Rates{nan_value, 1}, Rates{1, nan_value}}) {
    const DeclaredFiniteness v = judge(unknown, TailExponent{1});
    CHECK_FALSE(v.decided);
    CHECK_FALSE(v.finite_variance);
    CHECK_THAT(v.sentence, Catch::Contains("the rates are not known") && !Catch::Contains("INFINITE"));
  }
  MeasuredRates m;
  m.variance_decay = {-0.04, 0.05};
  m.fourth_decay = {-0.1, 0.1};
  m.work_growth = {0, 0};
  const MeasuredFiniteness flat = judge(m, TailExponent{1});
  CHECK(flat.variance == Finiteness::infinite);
  CHECK_THAT(flat.sentence, Catch::Contains("E D_k^2 does not fall") && !Catch::Contains("smaller exponent"));
  m.variance_decay = {1, 0.05};
  CHECK_THAT(judge(m, TailExponent{2}).sentence, Catch::Contains("take a PMF with a smaller exponent"));
}

TEST_CASE("every code of a warning has a name of its own, in small letters", "[warning][exact]") {
  std::set<std::string> names;
  const int codes = static_cast<int>(WarningCode::interrupted) + 1;
  for (int i = 0; i < codes; ++i) {
    const std::string name = name_of(static_cast<WarningCode>(i));
    CHECK(name.find_first_not_of("abcdefghijklmnopqrstuvwxyz_") == std::string::npos);
    names.insert(name);
  }
  CHECK(static_cast<int>(names.size()) == codes);
  CHECK(std::string(name_of(WarningCode::few_draws)) == "few_draws");
  CHECK(is_note(WarningCode::few_draws));
  CHECK_FALSE(is_note(WarningCode::coupling));
}

// 1e8 + a normal number had the interval [1e+08, 1e+08].
TEST_CASE("the ends of an interval show two digits of its width", "[words][exact]") {
  CHECK(digits_of_ends(0.7497948, 0.7502652) == 8);
  CHECK(digits_of_ends(99999999.98, 100000000.02) == 12);
  CHECK(digits_of_ends(-100000000.02, -99999999.98) == 12);
  CHECK(digits_of_ends(1e-8, 1e8) == 8);
  CHECK(digits_of_ends(1e20, 1.00000000004e20) == 13);
  CHECK(digits_of_ends(1e20, std::nextafter(1e20, infinity)) == 17);
  for (const double same : {0.0, 1.0, infinity, nan_value}) CHECK(digits_of_ends(same, same) == 8);
  CHECK(digits_of_ends(-infinity, 1) == 8);
  CHECK(digits_of(1e6, 1, 4) == 8);
  CHECK(digits_of(0.12, 1, 4) == 4);
  CHECK(digits_of(0, 1, 4) == 4);
  CHECK(digits_of(1e300, 1e-300, 4) == 17);
  CHECK(figure_of(1e6 + 0.25, 1, 4, 11) == "1000000.2");
  CHECK(figure_of(1e6 + 0.25, 1e-9, 4, 11) == "1000000.25");
  CHECK(figure_of(1e9 / 3, 1e-9, 4, 11) == "333333333.3");
  CHECK(figure_of(-1e-9 / 3, 1e-19, 4, 11) == "-3.3333e-10");
  CHECK(figure_of(0.12346, 1, 4, 11) == "0.1235");
  CHECK(figure_of(nan_value, 1, 4, 11) == "-");
}
