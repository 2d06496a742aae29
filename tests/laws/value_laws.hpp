#pragma once

// What every type that takes part in an estimate must satisfy, as a list of the claims that failed:
//
//   CHECK(laws::value_laws<V>({a, b, c}) == laws::Failures{});
//
//   components   can be set one by one and read back; changing a copy leaves the original alone
//   arithmetic   +, -, scaled and zero_like work component by component
//   scalar       a real value itself, else the Euclidean norm; NaN and infinity in one component show in it
//
// The examples need components that a float holds with room to spare (between 1e-15 and 1e15, say).

#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include <debias/core/value.hpp>

#include "failures.hpp"

namespace debias::laws {

namespace detail {

template <Value V>
class ValueLaws {
 public:
  Failures check(const std::vector<V>& examples) {
    for (const V& a : examples) {
      components(a);
      scaling(a);
      scalar(a);
      for (const V& b : examples) arithmetic(a, b);
    }
    return std::move(failures_);
  }

 private:
  void require(bool holds, const std::string& claim) {
    if (holds) return;
    for (const std::string& known : failures_) {
      if (known == claim) return;
    }
    failures_.push_back(claim);
  }

  /// What a component of this type makes of a number.
  static double stored(V v, std::size_t i, double x) {
    set_component(v, i, x);
    return component(v, i);
  }

  void components(const V& a) {
    const std::size_t n = component_count(a);
    require(n > 0, "a value has components");
    for (std::size_t i = 0; i < n; ++i) {
      V changed = a;
      const double before = component(a, i);
      for (const double x : {0.0, 0.5, -3.0, 0x1p20, -0x1p-20}) {
        set_component(changed, i, x);
        require(component(changed, i) == x, "a component reads back what was set");
      }
      require(component(a, i) == before, "changing a copy leaves the original alone");
      for (std::size_t k = 0; k < n; ++k) {
        require(k == i || component(changed, k) == component(a, k), "setting a component leaves the others alone");
      }
    }
  }

  void arithmetic(const V& a, const V& b) {
    const V plus = sum(a, b);
    const V minus = difference(a, b);
    require(component_count(plus) == component_count(a) && component_count(minus) == component_count(a),
            "a + b and a - b have the shape of a");
    for (std::size_t i = 0; i < component_count(a); ++i) {
      const double x = component(a, i);
      const double y = component(b, i);
      require(component(plus, i) == stored(a, i, x + y), "a + b adds the components");
      require(component(minus, i) == stored(a, i, x - y), "a - b subtracts the components");
    }
  }

  void scaling(const V& a) {
    for (const double factor : {0.0, 1.0, -2.0, 1.0 / 3}) {
      const V b = scaled(a, factor);
      require(component_count(b) == component_count(a), "scaled keeps the shape");
      for (std::size_t i = 0; i < component_count(a); ++i) {
        require(component(b, i) == stored(a, i, component(a, i) * factor), "scaled multiplies every component");
      }
    }
    const V zero = zero_like(a);
    require(component_count(zero) == component_count(a), "zero_like keeps the shape");
    for (std::size_t i = 0; i < component_count(a); ++i) {
      require(component(zero, i) == 0, "zero_like is zero in every component");
    }
  }

  void scalar(const V& a) {
    const std::size_t n = component_count(a);
    long double squares = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const long double x = component(a, i);
      squares += x * x;
    }
    const auto norm = static_cast<double>(std::sqrt(squares));
    const double got = as_scalar(a);
    if constexpr (RealValue<V>) {
      require(got == component(a, 0), "the scalar of a real value is the value");
    } else {
      require(std::abs(got - norm) <= 1e-15 * static_cast<double>(n + 2) * norm, "the scalar is the Euclidean norm");
    }
    require(as_scalar(zero_like(a)) == 0, "the scalar of zero is zero");
    for (std::size_t i = 0; i < n; ++i) {
      V broken = a;
      set_component(broken, i, std::numeric_limits<double>::infinity());
      require(std::isinf(as_scalar(broken)), "an infinite component makes the scalar infinite");
      set_component(broken, i, std::numeric_limits<double>::quiet_NaN());
      require(std::isnan(as_scalar(broken)), "a component that is NaN makes the scalar NaN");
      set_component(broken, n - 1 - i, std::numeric_limits<double>::infinity());
      require(!std::isfinite(as_scalar(broken)), "NaN and infinity together are not finite");
    }
  }

  Failures failures_;
};

}  // namespace detail

/// Every broken law in words; empty when all are kept.
template <Value V>
Failures value_laws(const std::vector<V>& examples) {
  return detail::ValueLaws<V>().check(examples);
}

}  // namespace debias::laws
