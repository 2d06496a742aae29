#include "core/text.hpp"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>

#include <debias/core/stream.hpp>

#include "catch_shim.hpp"

using debias::nearest_name;
using debias::parse_double;
using debias::to_text;

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
