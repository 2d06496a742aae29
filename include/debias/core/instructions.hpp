#pragma once

// Which vector instructions the compiled parts use, chosen when the program starts.
//
// Random numbers, and everything made of + - * / and sqrt, are the same bits with each of them. Vector exp, log and
// sin (vector_math.hpp) are not: they are those of the C library, within 4 ulp, and differ in the last digits.

namespace debias {

enum class Instructions { sse2, avx2, avx512 };  ///< sse2 also stands for what any other machine has

/// What this machine has; less where the environment variable DEBIAS_INSTRUCTIONS is sse2 or avx2.
Instructions instructions();

inline const char* name_of(Instructions i) {
  return i == Instructions::avx512 ? "avx512" : i == Instructions::avx2 ? "avx2" : "sse2";
}

}  // namespace debias
