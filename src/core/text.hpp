#pragma once

// Numbers as text and back, the same in every locale, and the nearest of a list of names.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include <debias/core/text.hpp>

namespace debias {

using detail::format;

/// `text` behind as many blanks as make it `width` wide, for columns: the %12s of printf.
std::string right(const std::string& text, std::size_t width);

/// The whole of `text` as a finite decimal number. Throws std::invalid_argument that names `what` for anything
/// else: nan, inf, hexadecimal digits, a leading '+', blanks, trailing characters, or a number that no double
/// holds.
double parse_double(std::string_view text, std::string_view what);

/// The whole of `text` as a whole number in [low, high]: decimal digits, with single _ or ' between them, with
/// a fraction or an exponent as long as the number is whole (1000, 1e6, 2.5e6, 1_000_000). Throws
/// std::invalid_argument that names `what` and a near miss for anything else: a sign, a leading zero (octal
/// to some), trailing characters.
std::uint64_t parse_count(std::string_view text, std::string_view what, std::uint64_t low, std::uint64_t high);

/// The same for a positive number; for one of seconds, "10" or "10s"; and for one in (0, 1), with a near miss for percents.
double parse_positive(std::string_view text, std::string_view what);
double parse_seconds(std::string_view text, std::string_view what);
double parse_share(std::string_view text, std::string_view what);

/// "1 sample", "2 samples"; with a verb behind, "1 sample is", "2 samples are".
std::string counted(std::int64_t n, std::string_view noun);
std::string are(std::int64_t n);

/// The fewest digits that parse_double reads back as the same double; of others see `format`.
std::string to_text(double x);

/// The name that is closest to `text` (edit distance, upper and lower case alike); empty when none is close.
std::string nearest_name(std::string_view text, std::span<const std::string_view> names);

/// "; did you mean 'NAME'?" for the nearest name, or nothing.
std::string suggestion(std::string_view text, std::span<const std::string_view> names);

}  // namespace debias
