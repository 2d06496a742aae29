// NaN and infinity from the payoffs and models of sensitivities.

#include "faults.hpp"

#include <debias/sde/heston.hpp>
#include <debias/sde/likelihood_ratio.hpp>
#include <debias/sde/market.hpp>
#include <debias/sde/sensitivities.hpp>

using namespace debias;
using namespace debias::faults;

namespace {

// A payoff that is not finite now and then, also as an expectation.
struct BadPayoff {
  double operator()(double x) const { return bad(x); }
  template <class X>
  X operator()(const X& x) const {
    return x * bad(1);
  }
  template <class X>
  X expected(const X& mean, const X& /*deviation*/) const {
    return mean * bad(1);
  }
  template <class X>
  X lognormal(const X& forward, const X& /*deviation*/) const {
    return forward * bad(1);
  }
};

}  // namespace

TEST_CASE("no sensitivity hides a NaN or an infinity of its payoff", "[nan][exact]") {
  const auto model = []<class X>(const X& spot) { return BlackScholes<X>{.start = spot, .volatility = X(0.2)}; };
  using Tree = Branched<Smoothed<MilsteinStep>>;
  // By one estimator: batches and shared bases are those of sde.hpp, whose own test has them all.
  const auto draws = [](const auto& sequence) { return single_term(sequence, Geometric(0.6)); };
  using Tree = Branched<Smoothed<MilsteinStep>>;
  check("sensitivities", "payoff", draws(sensitivities(Branched<MilsteinStep>{}, model, BadPayoff{}, 1.0)));
  check("sensitivities", "expected", draws(sensitivities(Tree{}, model, BadPayoff{}, 1.0)));
  check("second_sensitivities", "expected", draws(second_sensitivities(Tree{}, model, BadPayoff{}, 1.0)));
  check("discounted", "expected", draws(sensitivities(Tree{}, model, discounted(BadPayoff{}), 1.0)));
  check("likelihood_ratio", "payoff", draws(likelihood_ratio(Branched<MilsteinStep>{}, model, BadPayoff{}, 1.0)));
  check("own_steps", "payoff", draws(own_steps(CoxIngersollRoss<>{}, BadPayoff{})));
  check("heston", "lognormal", draws(heston(Heston<>{}, BadPayoff{})));
  check("heston_paths", "payoff",
        draws(heston_paths(Heston<>{}, [](const HestonPaths::State& x) { return bad(x[0]); })));
}
