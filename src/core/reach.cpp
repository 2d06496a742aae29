#include <debias/core/reach.hpp>

#include <array>
#include <charconv>
#include <cmath>

#include "core/text.hpp"

namespace debias {
namespace detail {

double chance_beyond(double beyond, double members) { return -std::expm1(members * std::log1p(-beyond)); }

double allowed_beyond(double members) { return -std::expm1(std::log1p(-Reach::threshold) / members); }

namespace {

// The largest number of members that the chance allows.
double most_members(double beyond) {
  if (!(beyond < 1)) return 0;
  return std::floor(std::log1p(-Reach::threshold) / std::log1p(-beyond) * (1 + 1e-12));
}

std::string percent(double share) {
  if (share > 0.995) return share < 1 ? "nearly 100 %" : "100 %";
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), 100 * share, std::chars_format::general, 2);
  return std::string(text.data(), end.ptr) + " %";
}

}  // namespace

void require_reach(const Reach& reach, std::int64_t samples) {
  const auto members = static_cast<double>(samples);
  const double chance = chance_beyond(reach.beyond, members);
  if (chance <= Reach::threshold) return;
  const double most = most_members(reach.beyond);
  const std::int64_t most_samples =
      most < 0x1p62 ? static_cast<std::int64_t>(most) / reach.block * reach.block : samples;
  const Steeper other = steeper_pmf(reach, allowed_beyond(members));
  if (reach.first_level > reach.deepest) {
    throw UndrawableError("base_level: levels are drawn from " + std::to_string(reach.first_level) +
                              " on (every one needs a level beyond " + std::to_string(reach.deepest) +
                              ", the deepest that the sequence can draw); take a lower base level",
                          reach.deepest, chance, 0, "");
  }
  std::string text = "samples = " + std::to_string(samples);
  if (reach.block > 1) text += " in blocks of " + std::to_string(reach.block);
  const std::string deepest = reach.deepest == deepest_of_all ? "a level of 2^62 or more, which does not fit 64 bits,"
                                                              : "a level beyond " + std::to_string(reach.deepest) +
                                                                    ", the deepest that the sequence can draw,";
  text += " (the chance that one of them needs " + deepest + " is " + percent(chance) + " under " +
          (reach.pmf.empty() ? "this PMF" : reach.pmf) + ", and 0.1 % is allowed); ";
  text += most_samples > 0  ? "take at most " + std::to_string(most_samples) + " samples, or "
          : reach.block > 1 ? "not even one block can be drawn; take "
                            : "not even one sample can be drawn; take ";
  if (!other.pmf.empty()) {
    text += "the PMF " + other.pmf;
    if (reach.rates) {
      const double bound = finite_exponents(*reach.rates).high;
      const bool same_kind = reach.rates->decay == reach.decay;
      if (!same_kind || !(other.exponent < bound)) {
        text += " (whose variance is infinite by the declared rates), or better " +
                std::string(most_samples > 0 ? "fewer samples or " : "") + "a lower base level";
      } else {
        text += " (whose variance is finite by the declared rates, and larger)";
      }
    } else {
      text += " (whose variance is finite if E D_k^2 falls faster, and larger)";
    }
  } else {
    text += "a lower base level";
  }
  throw UndrawableError(text, reach.deepest, chance, most_samples, other.pmf);
}

}  // namespace detail
}  // namespace debias
