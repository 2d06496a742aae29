#pragma once

// Decays, growths, moments and tails in words that stay true where the numbers degenerate: a decay of zero does not
// fall, a negative one grows, and where moments are finite below 0.9 even the mean is infinite.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include <debias/core/rates.hpp>
#include <debias/core/tail_index.hpp>

namespace debias {

/// No decay beyond its error: "does not fall". Without an error: 0 to six digits.
bool is_flat(const FittedRate& rate);

/// "E D_k^2 falls like 2^(-1.02 k) (+- 0.03, levels 1 to 9)", "E D_k^2 does not fall (...)", "E D_k^2 grows like k^0.4".
/// `where` may be empty.
std::string decay_words(const std::string& what, const FittedRate& decay, Decay unit, const std::string& where = "");
/// The same of what is meant to grow: "work does not grow", "work falls like 2^(-0.1 k)".
std::string growth_words(const std::string& what, const FittedRate& growth, Decay unit);

/// "2^(-1.5 k)" or "k^-1.5"; of an infinite exponent "faster than any power".
std::string power_text(double exponent, Decay unit);

/// Of a sample with moments below that order: "moments below 3.2 are finite", "even the mean is infinite".
std::string moments_words(double highest);

/// "level 3", "levels 1 to 9".
std::string levels_words(std::int64_t first, std::int64_t last);

/// As many significant digits as show x to two digits of `unit`, say its error; `least` at least, and where there is no unit.
int digits_of(double x, double unit, int least);
/// Those of the ends of an interval: eight, or two digits of the width of a narrow one.
int digits_of_ends(double low, double high);
/// x in a column of a table, with the digits of `digits_of` as far as there is room for them; "-" of what is not finite.
std::string figure_of(double x, double unit, int least, std::size_t room);

namespace detail {
/// Calls print(i, "") for each of n components; of more than 16 only for three at either end, with a text between them that
/// says how many are left out.
void print_ends(std::size_t n, const std::function<void(std::size_t i, const std::string& left_out)>& print);
}  // namespace detail

/// The shape of a tail, with what follows from it.
std::string tail_words(const TailIndex& tail);

}  // namespace debias
