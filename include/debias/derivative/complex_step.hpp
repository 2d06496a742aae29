#pragma once

// The complex step: a derivative without a difference.
//
//   f'(x) = Im f(x + i h) / h + O(h^2),  h = 2^-300
//
// Notation: x = at, h = step. Assumes an analytic f that takes complex numbers; fails where f takes absolute values, or
// compares what is complex. Source: Squire & Trapp, SIAM Review 40 (1998).

#include <complex>
#include <concepts>
#include <utility>

#include <debias/core/refusals.hpp>
#include <debias/core/stream.hpp>

namespace debias {

namespace detail {
template <class F>
concept ComplexFunction = std::invocable < const F&,
        const std::complex<double>
& > || std::invocable<const F&, const std::complex<double>&, Stream&>;
}  // namespace detail

/// Im f(x + i h) / h with h = 2^-300: the derivative of an analytic f to the last digits, without a level, a
/// bias or a PMF; a random variable like any other. f takes std::complex<double> (and a Stream, if random),
/// real parts and `<` only must not lose the imaginary part: no abs, no max.
template <detail::ComplexFunction F>
auto complex_step(F f, double at) {
  constexpr double h = 0x1p-300;
  return [f = std::move(f), point = std::complex<double>(at, h)](Stream& rng) -> double {
    if constexpr (std::invocable<const F&, const std::complex<double>&, Stream&>) {
      return f(point, rng).imag() / h;
    } else {
      return f(point).imag() / h;
    }
  };
}

template <class F>
requires(!detail::ComplexFunction<F>) auto complex_step(const F& /*f*/, double /*at*/) {
  using Z = const std::complex<double>&;
  return detail::refuse<detail::first_of(
                            detail::mistake_in_call<F, Z, Stream&>(),
                            detail::first_of(detail::mistake_in_call<F, Z>(), detail::Mistake::no_complex_function)),
                        F>();
}

}  // namespace debias
