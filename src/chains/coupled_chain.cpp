#include <debias/chains/coupled_chain.hpp>

#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include <debias/core/accumulator.hpp>
#include <debias/core/text.hpp>

namespace debias::detail {
namespace {

// Times are added and doubled.
constexpr std::int64_t most_steps = std::int64_t{1} << 60;

}  // namespace

void check_chain(const ChainOptions& o) {
  const auto refuse = [](const std::string& what, std::int64_t value, const std::string& why) {
    throw std::invalid_argument("coupled_chain: " + what + " = " + std::to_string(value) + " (" + why + ")");
  };
  if (o.burn_in < 0) refuse("burn_in", o.burn_in, "must be at least 0, a number of steps");
  if (o.length < o.burn_in) {
    refuse("length", o.length,
           "must be at least burn_in = " + std::to_string(o.burn_in) +
               ": states burn_in ... length are averaged; 20 burn_in is usual");
  }
  if (o.lag < 1) refuse("lag", o.lag, "must be at least 1");
  if (o.length > most_steps) refuse("length", o.length, "must be at most 2^60");
  if (o.lag > most_steps) refuse("lag", o.lag, "must be at most 2^60");
  if (o.limit == 0) return;
  if (o.limit < o.length || o.limit <= o.lag || o.limit > most_steps) {
    refuse("limit", o.limit,
           "must be at least length = " + std::to_string(o.length) + " and above lag = " + std::to_string(o.lag) +
               "; 0 for none");
  }
}

std::string describe_chain(const ChainOptions& o) {
  std::string text =
      o.limit > 0 ? "truncated coupled_chain (biased), limit " + std::to_string(o.limit) + ", " : "coupled_chain, ";
  return text + "burn_in " + std::to_string(o.burn_in) + ", length " + std::to_string(o.length) + ", lag " +
         std::to_string(o.lag);
}

std::int64_t level_of_cut(std::int64_t limit) {
  if (limit + 1 < LevelTable::single_levels) return limit + 1;
  return static_cast<std::int64_t>(std::bit_ceil(static_cast<std::uint64_t>(limit) + 1));
}

BiasBound bound_of_cut(const LevelTable& levels, std::int64_t limit) {
  const std::int64_t level = level_of_cut(limit);
  std::int64_t cut = 0;
  double squares = 0;
  for (std::size_t i = 0; i < levels.rows().size(); ++i) {
    if (LevelTable::levels_of_row(i).first < level) continue;
    cut += levels.rows()[i].count;
    squares += levels.rows()[i].square;
  }
  const std::int64_t all = levels.base().count;
  if (cut == 0 || all == 0) return {};
  const auto n = static_cast<double>(cut);
  const std::string text = "truncated: " + std::to_string(cut) + " of " + std::to_string(all) +
                           " chains had not met at the limit of " + std::to_string(limit) + " steps and were cut; ";
  if (8 * cut > all) {  // the longest waits are then no exception
    return {std::numeric_limits<double>::infinity(),
            text + "more than an eighth, so that nothing says how much they left out; take a larger limit."};
  }
  return {n / static_cast<double>(all) * std::sqrt(squares / n),
          text + "holds if what they left out is no more than what they had by then."};
}

}  // namespace debias::detail
