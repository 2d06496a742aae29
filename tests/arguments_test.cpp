#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>

#include "catch_shim.hpp"
#include "core/text.hpp"

namespace {

constexpr std::uint64_t most = std::numeric_limits<std::uint64_t>::max();

std::uint64_t count(std::string_view text) { return debias::parse_count(text, "--samples", 0, most); }

std::string complaint(std::string_view text, std::uint64_t low = 0, std::uint64_t high = most) {
  try {
    return "read as " + std::to_string(debias::parse_count(text, "--samples", low, high));
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
}

}  // namespace

TEST_CASE("A count is read with exponents, fractions and separators", "[arguments][exact]") {
  CHECK(count("0") == 0);
  CHECK(count("1000") == 1000);
  CHECK(count("1e6") == 1'000'000);
  CHECK(count("1E+6") == 1'000'000);
  CHECK(count("2.5e6") == 2'500'000);
  CHECK(count("0.5e1") == 5);
  CHECK(count("5000e-3") == 5);
  CHECK(count("0e9") == 0);
  CHECK(count("1_000_000") == 1'000'000);
  CHECK(count("1'000'000") == 1'000'000);
  CHECK(count("1.000_5e4") == 10005);
  CHECK(count("1e19") == 10'000'000'000'000'000'000u);
  CHECK(count("18446744073709551615") == most);
  CHECK(debias::parse_count("7", "x", 7, 7) == 7);
}

TEST_CASE("What is no count is refused, with the argument's name, the reason and a near miss", "[arguments][exact]") {
  const std::string example = "write a whole number such as 1000, 1e6 or 1_000_000";
  CHECK(complaint("1e6x") == "--samples = '1e6x' ('x' follows the number); did you mean '1e6'?");
  CHECK(complaint("-1") == "--samples = '-1' (must not be negative); did you mean '1'?");
  CHECK(complaint("+5") == "--samples = '+5' (a sign); did you mean '5'?");
  CHECK(complaint("010") == "--samples = '010' (a leading zero); did you mean '10'?");
  CHECK(complaint("1.5") == "--samples = '1.5' (not a whole number); did you mean '1'?");
  CHECK(complaint("1,000") == "--samples = '1,000' (',000' follows the number); did you mean '1000'?");
  CHECK(complaint("") == "--samples = '' (empty); " + example);
  CHECK(complaint("nan") == "--samples = 'nan' (not a number); " + example);
  CHECK(complaint("0", 1, 1024) == "--samples = '0' (must lie in 1 ... 1024); did you mean '1'?");
  CHECK(complaint("2e3", 0, 1024) == "--samples = '2e3' (must lie in 0 ... 1024); did you mean '1024'?");
  CHECK(complaint("18446744073709551616", 0, 9) ==
        "--samples = '18446744073709551616' (must lie in 0 ... 9); did you mean '9'?");
  for (const char* wrong : {"inf",
                            "-inf",
                            " 1",
                            "1 ",
                            "1__0",
                            "_1",
                            "1_",
                            "1'",
                            "1e",
                            "1e+",
                            "1e+-5",
                            "1.",
                            ".5",
                            "1f",
                            "0x10",
                            "00",
                            "1e-3",
                            "1e99999999999",
                            "1e-99999999999",
                            "1e20",
                            "--",
                            "-x",
                            "1.5.5e9",
                            "1e6e6"}) {
    INFO(wrong);
    CHECK(complaint(wrong).rfind("--samples = '", 0) == 0);
  }
}

TEST_CASE("A count that embeds a zero byte or is very long is refused at once", "[arguments][exact]") {
  CHECK(complaint(std::string_view("1\0002", 3)).rfind("--samples = '", 0) == 0);
  CHECK(complaint(std::string(100'000, '9').append("x")).rfind("--samples = '", 0) == 0);
  CHECK(complaint("0." + std::string(100'000, '9') + "e5").rfind("--samples = '", 0) == 0);
}
