// A recipe of every kind of sequence, for the compiler: a user's warnings, all of them errors, find nothing in the headers.

#include <cmath>
#include <cstdint>
#include <iostream>

#include <debias/debias.hpp>

namespace {

using debias::Rates;
using debias::Stream;

const debias::Plan plan{.samples = 4096, .seed = 7, .threads = 1};

/// The mean, by the shortest way.
template <class S>
void print(const char* name, const S& sequence) {
  std::cout << name << ' ' << debias::estimate(debias::recipe(sequence), plan).mean << '\n';
}

}  // namespace

int main() {
  const auto x = [](Stream& rng) { return 1 + rng.uniform(); };
  const auto f = [](double t) { return 1 + t * t; };

  print("lambda", [](std::int64_t level, Stream& rng) {
    const double u = rng.uniform();
    const auto at = [u](std::int64_t k) { return u + std::ldexp(u, -static_cast<int>(k)); };
    return level == 0 ? debias::base(at(0)) : debias::coupled(at(level), at(level - 1));
  });
  print("function_of_mean", debias::function_of_mean(x, debias::functions::Log{}));
  print("reciprocal", debias::reciprocal(x));
  print("clamped_reciprocal", debias::clamped_reciprocal(x, 0.1));
  print("function_of_integral", debias::function_of_integral(f, debias::functions::Exp{}));
  print("jittered", debias::function_of_jittered_integral(f, debias::functions::Sqrt{}));
  print("nested",
        debias::nested(
            x, [](double y, Stream& rng) { return y + rng.normal(); }, [](double m) { return std::exp(-m); }));
  print("series", debias::series([](std::int64_t k) { return std::ldexp(1.0, -static_cast<int>(k)); },
                                 debias::geometric_terms(0.5)));
  print("random series",
        debias::series([](std::int64_t k, Stream& rng) { return std::ldexp(rng.uniform(), -static_cast<int>(k)); },
                       debias::geometric_terms(0.5)));
  print("blocks",
        debias::blocks(debias::series([](std::int64_t k) { return 1 / std::pow(static_cast<double>(k) + 1, 3); },
                                      debias::polynomial_terms(3))));
  print("taylor", debias::taylor(x, debias::functions::Exp{}, 1.5));
  print("finite_difference",
        debias::finite_difference([](double a, Stream& rng) { return std::exp(a * rng.uniform()); }, 1.0));
  print("steady_state", debias::steady_state([](double s, Stream& rng) { return s / 2 + rng.normal(); }, 0.0,
                                             [](double s) { return s * s; }, debias::contraction(0.5)));
  print("milstein", debias::milstein(debias::GeometricBrownianMotion{.start = 1, .volatility = 0.2},
                                     [](double s) { return s > 1 ? s - 1 : 0.0; }));
  print("euler", debias::euler(debias::OrnsteinUhlenbeck{.start = 1}, debias::Minimum{},
                               [](const debias::Minimum& path) { return path.terminal - path.minimum; }, {2, 1}));
  print("telescoping", debias::telescoping(debias::Ray(f, {.length = 1, .majorant = 2})));
}
