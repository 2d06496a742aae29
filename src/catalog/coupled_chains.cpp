// Expectations by chains that meet. Level j of the sequence starts j lags further in the past; coupled_chain adds all of them.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include <debias/chains.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/poisson.hpp>
#include <debias/series.hpp>
#include <debias/taylor.hpp>

#include "groups.hpp"
#include "make.hpp"

namespace debias::catalog {
namespace {

// I_j = f(X_(k + j L)), its coarse partner f(Y_(k + (j - 1) L)) of a chain that runs L steps behind; equal once they have met.
// Work: steps of both chains, 1 at least.
template <class K, class Start, class F>
class ChainLevels {
 public:
  ChainLevels(K kernel, Start start, F f, const ChainOptions& options, const Rates& declared)
      : rates(declared), kernel_(std::move(kernel)), start_(std::move(start)), f_(std::move(f)), options_(options) {}

  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    auto x = begin(rng);
    if (level == 0) {
      for (std::int64_t t = 0; t < options_.burn_in; ++t) kernel_.step(x, rng);
      return debias::base(value(x), std::max(1.0, static_cast<double>(options_.burn_in)));
    }
    auto y = begin(rng);
    std::int64_t behind = 0;
    const bool apart = run(level, x, y, behind, rng);
    const double coarse = value(y);
    const double fine_there = value(x);
    for (std::int64_t t = behind; t < last_of(level); ++t) kernel_.step(x, rng);
    const auto work = static_cast<double>(last_of(level) + options_.lag + behind);
    return {value(x), apart ? fine_there - coarse : 0, work};
  }

  /// Nothing is left to do once the chains have met.
  Term<double> difference_at(std::int64_t level, Stream& rng) const {
    if (level == 0) {
      const Draw<double> draw = (*this)(0, rng);
      return {draw.value, draw.work};
    }
    auto x = begin(rng);
    auto y = begin(rng);
    std::int64_t behind = 0;
    const bool apart = run(level, x, y, behind, rng);
    return {apart ? value(x) - value(y) : 0, static_cast<double>(options_.lag + 2 * behind)};
  }

  Rates rates;

 private:
  auto begin(Stream& rng) const { return debias::detail::begin_state(kernel_, start_(rng)); }
  template <class State>
  double value(const State& x) const {
    return f_(debias::detail::point_of(kernel_, x));
  }
  // Steps of Y at this level.
  [[nodiscard]] std::int64_t last_of(std::int64_t level) const { return options_.burn_in + (level - 1) * options_.lag; }

  template <class State>
  bool run(std::int64_t level, State& x, State& y, std::int64_t& behind, Stream& rng) const {
    const auto met = [&] {
      return debias::detail::same_point(debias::detail::point_of(kernel_, x), debias::detail::point_of(kernel_, y));
    };
    for (std::int64_t t = 0; t < options_.lag; ++t) kernel_.step(x, rng);
    while (behind < last_of(level) && !met()) {
      kernel_.coupled_step(x, y, rng);
      ++behind;
    }
    return !met();
  }

  K kernel_;
  Start start_;
  F f_;
  ChainOptions options_;
};

// The levels declare their rates; the whole estimator is a method of its own.
template <class K, class Start, class F>
Problem chains(Facts facts, K kernel, Start start, F f, const ChainOptions& options, const ChainOptions& of_levels,
               const Rates& rates) {
  Problem p = make(std::move(facts), ChainLevels<K, Start, F>(kernel, start, f, of_levels, rates));
  add(p, {"coupled_chain", "two chains that meet, with all their levels"}, coupled_chain(kernel, start, f, options));
  p.sample_cost = 4;
  return p;
}

double normal_density(double x) { return -0.5 * x * x; }
double wide_start(Stream& rng) { return 3 * rng.normal(); }

}  // namespace

Problem chain_square() {
  return chains({.id = "K01",
                 .name = "chain-square",
                 .module = "chains.hpp",
                 .truth = 1,
                 .formula = "E X^2 of N(0, 1) by a coupled random walk: 1"},
                random_walk(normal_density, 2.4), wide_start, squared, {.burn_in = 20, .length = 200, .lag = 20},
                {.burn_in = 2, .length = 2, .lag = 4}, Rates{2, 0});
}

Problem chain_product() {
  using Point = std::array<double, 2>;
  const double deviation = std::sqrt(1 - 0.81);
  const auto conditional = [deviation](std::size_t i, const Point& x) { return NormalLaw{0.9 * x[1 - i], deviation}; };
  const auto start = [](Stream& rng) {
    const double x = 3 * rng.normal();
    const double y = 3 * rng.normal();
    return Point{x, y};
  };
  return chains(
      {.id = "K02",
       .name = "chain-product",
       .module = "chains.hpp",
       .truth = 0.9,
       .formula = "E X Y of a bivariate normal of correlation .9 by coupled Gibbs steps: .9"},
      gibbs(conditional), start, [](const Point& x) { return x[0] * x[1]; }, {.burn_in = 25, .length = 250, .lag = 25},
      {.burn_in = 2, .length = 2, .lag = 4}, Rates{1.2, 0});
}

Problem chain_modes() {
  const auto density = [](double x) {
    const double near = std::abs(x) - 3;
    return -0.5 * near * near + std::log1p(std::exp(-6 * std::abs(x)));
  };
  return chains(
      {.id = "K03",
       .name = "chain-modes",
       .module = "chains.hpp",
       .truth = 3.000764308634095447191,
       .formula = "E |X| of N(-3, 1) / 2 + N(3, 1) / 2 by a coupled random walk: sqrt(2/pi) e^(-9/2) + 3 (1 - 2 "
                  "Phi(-3))"},
      random_walk(density, 4), [](Stream& rng) { return 4 * rng.normal(); }, [](double x) { return std::abs(x); },
      {.burn_in = 60, .length = 600, .lag = 60}, {.burn_in = 3, .length = 3, .lag = 6}, Rates{1.8, 0});
}

Problem chain_ising() {
  constexpr std::size_t side = 4;
  using Spins = std::array<std::int8_t, side * side>;  // 0 or 1
  const auto conditional = [](std::size_t i, const Spins& s) {
    const std::size_t row = i / side;
    const std::size_t column = i % side;
    const int ups = s[row * side + (column + 1) % side] + s[row * side + (column + side - 1) % side] +
                    s[(row + 1) % side * side + column] + s[(row + side - 1) % side * side + column];
    const double field = 2 * ups - 4;  // the sum of four spins of -1 or 1
    return BernoulliLaw{1 / (1 + std::exp(-2 * 0.3 * field))};
  };
  const auto start = [](Stream& rng) {
    Spins s{};
    for (std::int8_t& spin : s) spin = rng.uniform() < 0.5 ? 0 : 1;
    return s;
  };
  const auto energy = [](const Spins& s) {
    int aligned = 0;
    for (std::size_t i = 0; i < s.size(); ++i) {
      const std::size_t right = i / side * side + (i + 1) % side;
      const std::size_t below = (i + side) % s.size();
      aligned += (s[i] == s[right] ? 1 : -1) + (s[i] == s[below] ? 1 : -1);
    }
    return -static_cast<double>(aligned);
  };
  return chains(
      {.id = "K04",
       .name = "chain-ising",
       .module = "chains.hpp",
       .truth = -13.50486517798170671589,
       .formula = "energy of the periodic 4 x 4 Ising model at beta .3 by coupled heat baths, by enumeration"},
      gibbs(conditional), start, energy, {.burn_in = 40, .length = 200, .lag = 10},
      {.burn_in = 2, .length = 2, .lag = 4}, Rates{1.2, 0});
}

Problem exp_of_chain() {
  // Means of signed estimates have no exponential moment at any level (chains/draws.hpp); products of them have a mean.
  const auto chain =
      coupled_chain(random_walk(normal_density, 2.4), wide_start, squared, {.burn_in = 20, .length = 80, .lag = 20});
  const auto terms = taylor(draws_of(chain), functions::ExpMinus{}, 1.0);
  Problem p = make({.id = "K05",
                    .name = "exp-of-chain",
                    .module = "chains.hpp",
                    .truth = 0.3678794411714423215955,
                    .formula = "exp(-E X^2) of N(0, 1), by the power series of unbiased estimates: 1/e"},
                   terms, factorial_terms);
  add(p, {"taylor", "the power series about a centre, with roulette"}, roulette(terms, Poisson(1)));
  return p;
}

}  // namespace debias::catalog
