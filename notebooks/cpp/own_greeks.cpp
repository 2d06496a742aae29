// Finance: a model and a payoff of one's own, their price and its slopes from one run.
//
//   dX = volatility (X + 50) dW, a displaced stock; 100 is paid where X_T > 100
//
// Coefficients are written once, for any number type; a payoff that jumps says its mean over a normal law instead of its slope.

#include <cstddef>
#include <iostream>

#include <debias/debias.hpp>
#include <debias/sde/sensitivities.hpp>

namespace {

template <class X>
struct Displaced {
  X start;
  X volatility;
  double horizon = 1;
  X drift(const X& /*x*/, double /*t*/) const { return X(0); }
  X diffusion(const X& x, double /*t*/) const { return volatility * (x + 50); }
  X diffusion_derivative(const X& /*x*/, double /*t*/) const { return volatility; }
};
struct Paid {
  static constexpr int smoothness = 0;  // it jumps
  template <class X>
  X expected(const X& mean, const X& deviation) const {
    return 100 * debias::normal_distribution(X((mean - 100) / deviation));
  }
};

}  // namespace

int main() {
  using Tree = debias::Branched<debias::Smoothed<debias::MilsteinStep>>;
  const auto model = []<class X>(const X& start, const X& volatility) { return Displaced<X>{start, volatility}; };
  const auto result = debias::estimate(debias::recipe(debias::sensitivities(Tree{}, model, Paid{}, 100.0, 0.2)),
                                       {.samples = 1 << 16, .seed = 1});
  const double by_black[] = {46.01721627, 1.32317516, -19.84762737};
  const char* const names[] = {"price", "delta", "vega"};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto& slope = result.components[i];
    std::cout << names[i] << ' ' << slope.mean << " +- " << slope.standard_error << ", exact " << by_black[i] << '\n';
  }
}
