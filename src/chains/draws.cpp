#include <debias/chains/draws.hpp>

#include <cmath>
#include <stdexcept>
#include <string>

#include <debias/core/text.hpp>

namespace debias::detail {
namespace {

constexpr double highest_power = 16;  // of a g that draws with exponential tails can bear

[[noreturn]] void refuse_pole(const std::string& where) {
  throw std::invalid_argument("function_of_mean: g has no finite value at " + where +
                              " (estimates by coupled chains are signed, and means of them may lie around any point, "
                              "so that no level has a mean, "
                              "whatever the base level); take a g without a pole");
}

// Sizes at 2^-2, 2^-1, ... times `sign`.
void check_side(const std::vector<double>& sizes, double sign) {
  const auto point = [&](std::size_t i) { return format("%g", sign * std::ldexp(1.0, static_cast<int>(i) - 2)); };
  constexpr std::size_t has_value = 13;  // up to 2^10; beyond, NaN may be what overflow has left
  double power = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    if (std::isnan(sizes[i])) {
      if (i >= has_value) return;
      throw std::invalid_argument(
          "function_of_mean: g has no value at " + point(i) +
          " (estimates by coupled chains are signed, whatever the sign of f: a mean of them may "
          "lie there); take a g of all real numbers");
    }
    const double before = power;
    power = i > 0 && sizes[i - 1] > 0 ? std::log2(sizes[i] / sizes[i - 1]) : 0;
    if (std::isinf(sizes[i]) && before <= highest_power && i < has_value) refuse_pole(point(i));
    if (std::isinf(sizes[i]) || (power > highest_power && before > highest_power)) {
      throw std::invalid_argument("function_of_mean: g grows faster than any power towards " + point(i) +
                                  " (estimates by coupled chains have tails no lighter than exponential: level 0 need "
                                  "not have a mean, and where f "
                                  "is not bounded no level has one, whatever the base level); take the power series: "
                                  "taylor_sum(draws_of(chain), "
                                  "g, centre, pmf) asks for moments only");
    }
  }
}

}  // namespace

void require_signed(const Probe& probe) {
  if (!std::isfinite(probe.at_zero)) refuse_pole("0");
  check_side(probe.below, -1);
  check_side(probe.above, 1);
}

}  // namespace debias::detail
