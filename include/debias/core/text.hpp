#pragma once

// Numbers as text: the digits of printf, and the same in every locale.
//
//   format("%.3g", x)    what printf("%.3g", x) writes in the C locale: patterns %g %f %e, with or without a precision
//
// printf, streams and std::to_string(double) ask the locale of the process, which is the host's: a program that says
// setlocale(LC_NUMERIC, "de_DE") would read 0,75 in our sentences, and an imbued stream 1.000.000 samples. std::to_chars
// asks nobody. Whole numbers go through std::to_string, which does not ask either. A pattern that is not one of these
// does not compile.

#include <charconv>
#include <string>

namespace debias::detail {

/// How a number is written: %g, %f or %e, with at most two digits of precision (6 where none is given).
struct NumberPattern {
  std::chars_format kind{};
  int precision = 6;

  consteval NumberPattern(const char* pattern) {
    if (*pattern++ != '%') throw "a number's pattern is %g, %f or %e, such as %.3g";
    if (*pattern == '.') {
      precision = 0;
      const char* first = ++pattern;
      for (; '0' <= *pattern && *pattern <= '9' && pattern < first + 2; ++pattern) {
        precision = 10 * precision + (*pattern - '0');
      }
    }
    switch (*pattern++) {
      case 'g':
        kind = std::chars_format::general;
        break;
      case 'f':
        kind = std::chars_format::fixed;
        break;
      case 'e':
        kind = std::chars_format::scientific;
        break;
      default:
        throw "a number's pattern is %g, %f or %e, such as %.3g";
    }
    if (*pattern != 0) throw "a number's pattern ends after g, f or e";
  }
  constexpr NumberPattern(std::chars_format k, int digits) : kind(k), precision(digits) {}
};

/// As printf writes `x` in the C locale. What is no number is said in words: unknown, infinity, minus infinity.
std::string format(NumberPattern pattern, double x);

}  // namespace debias::detail
