#include "core/text.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include <debias/core/result.hpp>
#include <debias/core/stream.hpp>

#include "catch_shim.hpp"

using debias::formatted;
using debias::nearest_name;
using debias::parse_double;
using debias::to_text;
using debias::with_error;

TEST_CASE("A number and its text are the same, bit for bit", "[core][exact]") {
  debias::Stream rng(1, 0);
  for (int i = 0; i < 20000; ++i) {
    const std::uint64_t bits = rng.bits();
    double x = 0;
    std::memcpy(&x, &bits, sizeof x);
    if (!std::isfinite(x)) continue;
    const double again = parse_double(to_text(x), "x");
    if (again != x) FAIL_CHECK(to_text(x));
  }
  CHECK(to_text(0.1) == "0.1");
  CHECK(to_text(3) == "3");
  CHECK(to_text(1e-7) == "1e-07");
  CHECK(std::signbit(parse_double(to_text(-0.0), "x")));
  CHECK(to_text(-std::numeric_limits<double>::min()) == "-2.2250738585072014e-308");
}

TEST_CASE("A pattern writes what printf writes in the C locale", "[core][exact]") {
  using debias::format;
  debias::Stream rng(2, 0);
  const auto printed = [](const char* pattern, double x) {
    std::array<char, 512> text{};
    std::snprintf(text.data(), text.size(), pattern, x);
    return std::string(text.data());
  };
  const auto check = [&](double x) {
    if (!std::isfinite(x)) {  // no text holds nan or inf
      const std::string words = std::isnan(x) ? "unknown" : x > 0 ? "infinity" : "minus infinity";
      if (format("%g", x) != words || format("%.3f", x) != words) FAIL_CHECK(format("%g", x));
      return;
    }
    const std::array<std::pair<std::string, std::string>, 8> pairs = {{{format("%g", x), printed("%g", x)},
                                                                       {format("%.0g", x), printed("%.0g", x)},
                                                                       {format("%.3g", x), printed("%.3g", x)},
                                                                       {format("%.15g", x), printed("%.15g", x)},
                                                                       {format("%f", x), printed("%f", x)},
                                                                       {format("%.0f", x), printed("%.0f", x)},
                                                                       {format("%.12f", x), printed("%.12f", x)},
                                                                       {format("%.1e", x), printed("%.1e", x)}}};
    for (const auto& [ours, theirs] : pairs) {
      if (ours != theirs) FAIL_CHECK(ours + " is not " + theirs);
    }
    if (format("%f", x) != std::to_string(x)) FAIL_CHECK(std::to_string(x));
  };
  for (int i = 0; i < 5000; ++i) {
    const std::uint64_t bits = rng.bits();
    double x = 0;
    std::memcpy(&x, &bits, sizeof x);  // of any size, infinities and NaN with their signs among them
    check(x);
    check(1e4 * (rng.uniform() - 0.5));
    check(static_cast<double>(bits % 200000) / 8);  // ties
  }
  const double inf = std::numeric_limits<double>::infinity();
  for (const double x : {0.0, -0.0, 0.5, 1.5, 2.5, 0.125, 999999.5, 9999995.0, inf, -inf, std::nan(""), -std::nan(""),
                         std::numeric_limits<double>::max(), std::numeric_limits<double>::denorm_min()}) {
    check(x);
  }
  CHECK(debias::right("12", 5) == "   12");
  CHECK(debias::right("123456", 5) == "123456");
}

TEST_CASE("Decimal numbers are read whole, and nothing else is", "[core][exact]") {
  CHECK(parse_double("0.6", "r") == 0.6);
  CHECK(parse_double("-1e-3", "r") == -1e-3);
  CHECK(parse_double("5e-324", "r") == std::numeric_limits<double>::denorm_min());
  for (const char* text : {"",   " ",  "nan", "NaN", "inf",   "-inf", "infinity", "0x10", "0x1p3", "1e999", "1e-999",
                           "+1", " 1", "1 ",  "1,5", "1.5.2", "1e",   "e5",       "--1",  "1f",    "1_000", "."}) {
    CAPTURE(text);
    CHECK_THROWS_AS(parse_double(text, "r"), std::invalid_argument);
  }
  CHECK_THROWS_AS(parse_double(std::string_view("1\0", 2), "r"), std::invalid_argument);
  CHECK_THROWS_WITH(parse_double("0.5z", "geometric: r"),
                    "geometric: r = '0.5z' ('z' follows the number); write a decimal number such as 0.5 or 1e-3");
}

TEST_CASE("The nearest name is found through a typing error, and only then", "[core][exact]") {
  static constexpr std::string_view names[] = {"geometric", "zeta", "poisson", "tabulated", "r"};
  CHECK(nearest_name("geometrc", names) == "geometric");
  CHECK(nearest_name("GEOMETRIC", names) == "geometric");
  CHECK(nearest_name("Possion", names) == "poisson");
  CHECK(nearest_name("tabluated", names) == "tabulated");
  CHECK(nearest_name("beta", names) == "zeta");
  CHECK(nearest_name("rr", names) == "r");
  CHECK(nearest_name("x", names).empty());
  CHECK(nearest_name("", names).empty());
  CHECK(nearest_name("uniform", names).empty());
  CHECK(nearest_name("geometric", {}).empty());
  CHECK(debias::suggestion("zta", names) == "; did you mean 'zeta'?");
  CHECK(debias::suggestion("uniform", names).empty());
}

TEST_CASE("formatted numbers are printf's, and never nan or inf", "[core][text][exact]") {
  for (const double x : {0.0, 1.0, -2.5, 0.1, 123456.789, 1e-7, 1e300, 5e-324, 1e15, 99.95}) {
    for (const char* pattern : {"%g", "%.2g", "%.15g", "%.3f", "%f", "%.0f", "%.1e", "%e"}) {
      std::array<char, 512> expected{};
      std::snprintf(expected.data(), expected.size(), pattern, x);
      CHECK(formatted(pattern, x) == expected.data());
    }
  }
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double x : {std::nan(""), -std::nan(""), infinity, -infinity}) {
    const bool is_nan = std::isnan(x);
    const std::string words = is_nan ? "unknown" : (x > 0 ? "infinity" : "minus infinity");
    CHECK(formatted("%.3g", x) == words);
    CHECK(to_text(x) == words);
  }
}

TEST_CASE("a mean without an error says so", "[core][text][exact]") {
  const double nan = std::nan("");
  const double infinity = std::numeric_limits<double>::infinity();
  CHECK(with_error(nan, nan) == "not a number");  // was nan +- -nan
  CHECK(with_error(-infinity, nan) == "not a number");
  CHECK(with_error(0.5, -nan) == "0.5 (no standard error)");
  CHECK(with_error(1e300, infinity) == "1e+300 (no standard error)");
  CHECK(with_error(0.75, 0.0123) == "0.750(12)");
  CHECK(with_error(1234567, 2345) == "1234600(2300)");
  CHECK(with_error(2.25, 0.51) == "2.25(51)");
  CHECK(with_error(12.25, 1.51) == "12.2(1.5)");
  CHECK(with_error(3, 0) == "3(0)");
  CHECK(with_error(2e-170, 1.5e-170) == "2e-170 +- 1.5e-170");
}
