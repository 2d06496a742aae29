#include "catalog.hpp"

#include <algorithm>
#include <array>
#include <functional>
#include <memory>
#include <stdexcept>
#include <utility>

#include <debias/diagnostics.hpp>

#include "catalog/groups.hpp"
#include "catalog/make.hpp"
#include "catalog/unknown_name.hpp"
#include "core/text.hpp"

namespace debias::catalog {
namespace {

struct MethodName {
  Method method;
  std::string_view name;
  std::string_view description;
};

constexpr std::array method_names = {
    MethodName{Method::single_term, "single_term", "base and one weighted difference, both in every sample"},
    MethodName{Method::single_term_outcome, "single_term_outcome",
               "one weighted difference, the base being one outcome"},
    MethodName{Method::independent_sum, "independent_sum", "all levels up to a random one, independent of each other"},
    MethodName{Method::roulette, "roulette", "the terms of a series in order, up to a random one"},
    MethodName{Method::truncated, "truncated", "the biased baseline: one level, cut off there"},
};

const MethodName& entry(Method method) {
  return *std::find_if(method_names.begin(), method_names.end(),
                       [method](const MethodName& m) { return m.method == method; });
}

}  // namespace

std::string_view name_of(Method method) { return entry(method).name; }
std::string_view name_of(const Choice& choice) {
  return choice.special.empty() ? name_of(choice.method) : std::string_view(choice.special);
}
std::string_view describe(Method method) { return entry(method).description; }

const Special* find_special(const Problem& problem, std::string_view name) {
  for (const Special& s : problem.specials) {
    if (s.name == name) return &s;
  }
  return nullptr;
}

Method method_of(std::string_view name) {
  std::vector<std::string_view> names;
  for (const MethodName& m : method_names) {
    if (m.name == name) return m.method;
    names.push_back(m.name);
  }
  throw UnknownName("'" + std::string(name) + "' is not an estimator", "estimators", suggestion(name, names));
}

const std::vector<Method>& methods() {
  static const std::vector<Method> all = [] {
    std::vector<Method> list;
    for (const MethodName& m : method_names) list.push_back(m.method);
    return list;
  }();
  return all;
}

Rates rates_of(const Problem& problem, Method method) {
  const bool sums = method == Method::independent_sum || method == Method::roulette;
  return sums ? rates_of_sum(problem.rates) : problem.rates;
}

AnyPmf default_pmf(const Problem& problem, Method method) {
  if (problem.pmf) return *problem.pmf;
  const double exponent = default_exponent(rates_of(problem, method));
  if (problem.rates.decay == Decay::polynomial) return AnyPmf(Zeta(exponent));
  return AnyPmf(Geometric::with_exponent(exponent));
}

const std::vector<Problem>& problems() {
  static const std::vector<Problem> table = {
      // A: functions of a mean
      exp_of_mean(),
      reciprocal_of_mean(),
      log_of_mean(),
      sqrt_of_mean(),
      power_of_mean(),
      ratio_of_means(),
      square_of_mean(),
      posterior_mean(),
      log_evidence(),
      logistic_of_mean(),
      entropy(),
      median(),
      newsvendor(),
      log_cosh(),
      // B: functions of an integral
      transmittance_constant(),
      transmittance_linear(),
      transmittance_exponential(),
      transmittance_sinusoid(),
      transmittance_step(),
      transmittance_bump(),
      transmittance_thick(),
      transmittance_davis(),
      transmittance_pink(),
      reciprocal_of_integral(),
      transmittance_singular(),
      transmittance_straight(),
      kink_of_integral(),
      sinusoid_tau_1(),
      sinusoid_tau_4(),
      sinusoid_tau_16(),
      step_tau_1(),
      step_tau_4(),
      step_tau_16(),
      linear_tau_1(),
      linear_tau_4(),
      linear_tau_16(),
      // C: finite differences
      derivative_of_sine(),
      derivative_of_exp(),
      derivative_of_fast_sine(),
      derivative_of_kink(),
      second_derivative_of_log(),
      black_scholes_delta(),
      derivative_of_expectation(),
      black_scholes_gamma(),
      // D: series
      geometric_series(),
      slow_geometric_series(),
      zeta_of_two(),
      series_for_e(),
      machin_pi(),
      bessel_j0(),
      neumann_matrix(),
      furnace(),
      facing_walls(),
      log_determinant_by_probes(),
      log_series(),
      wallis_product(),
      // E: stochastic differential equations
      european_call(),
      asian_call(),
      lookback_call(),
      barrier_call(),
      gbm_by_euler(),
      mean_of_gbm(),
      second_moment_of_ou(),
      geometric_asian_call(),
      clark_cameron(),
      digital_call(),
      call_delta(),
      call_vega(),
      digital_delta(),
      call_rho(),
      call_theta(),
      lookback_delta(),
      barrier_delta(),
      asian_delta(),
      smoothed_digital_call(),
      // F: nested expectations
      nested_max(),
      nested_square(),
      value_of_information(),
      nested_exp(),
      doubly_nested_exp(),
      // H: steady states
      autoregression(),
      waiting_time(),
      bernoulli_convolution(),
      cantor_law(),
      dickman_law(),
      // I: functions of an integral over a cube
      evidence_in_2(),
      evidence_in_4(),
      evidence_in_8(),
      sobol_g(),
      reciprocal_over_cube(),
      information_gain(),
      // K: chains that meet
      chain_square(),
      chain_product(),
      chain_modes(),
      chain_ising(),
      exp_of_chain(),
      // M: deterministic limits, and matrices of known determinant
      newton_sqrt(),
      archimedes_pi(),
      log_determinant_of_chain(),
      log_determinant_of_grid(),
      log_determinant_of_kernel(),
  };
  return table;
}

std::vector<Special> specials() {
  std::vector<Special> all;
  for (const Problem& p : problems()) {
    for (const Special& s : p.specials) {
      const auto same = [&s](const Special& other) { return other.name == s.name; };
      if (std::none_of(all.begin(), all.end(), same)) all.push_back(s);
    }
  }
  return all;
}

const Problem& find(std::string_view id_or_name) {
  std::vector<std::string_view> names;
  for (const Problem& p : problems()) {
    if (p.id == id_or_name || p.name == id_or_name) return p;
    names.push_back(p.id);
    names.push_back(p.name);
  }
  throw UnknownName("'" + std::string(id_or_name) + "' is not a problem", "problems", suggestion(id_or_name, names));
}

namespace detail {

void set_runs(Problem& p, std::function<void(const Choice&, Task&)> work) {
  const auto shared = std::make_shared<const std::function<void(const Choice&, Task&)>>(std::move(work));
  p.run = [shared](const Choice& choice, const Plan& plan) {
    Task task{.plan = &plan};
    (*shared)(choice, task);
    return std::move(task.statistics);
  };
  p.trace = [shared](const Choice& choice, std::uint64_t seed, std::int64_t index) {
    Task task{.seed = seed, .index = index};
    (*shared)(choice, task);
    return std::move(task.trace);
  };
}

void add_special(Problem& p, Special special, std::function<void(Task&)> work) {
  const auto shared = std::make_shared<const std::function<void(Task&)>>(std::move(work));
  p.run = [shared, name = special.name, others = std::move(p.run)](const Choice& choice, const Plan& plan) {
    if (choice.special != name) return others(choice, plan);
    Task task{.plan = &plan};
    (*shared)(task);
    return std::move(task.statistics);
  };
  p.trace = [shared, name = special.name, others = std::move(p.trace)](const Choice& choice, std::uint64_t seed,
                                                                       std::int64_t index) {
    if (choice.special != name) return others(choice, seed, index);
    Task task{.seed = seed, .index = index};
    (*shared)(task);
    return std::move(task.trace);
  };
  p.specials.push_back(std::move(special));
}

}  // namespace detail

}  // namespace debias::catalog
