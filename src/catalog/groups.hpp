#pragma once

// The problems, one function each; src/catalog.cpp lists them in its table.

#include "../catalog.hpp"

namespace debias::catalog {

// A: functions of a mean (means.cpp)
Problem exp_of_mean();
Problem reciprocal_of_mean();
Problem log_of_mean();
Problem sqrt_of_mean();
Problem power_of_mean();
Problem ratio_of_means();
Problem square_of_mean();
Problem logistic_of_mean();
Problem log_evidence();
Problem log_cosh();
Problem posterior_mean();
Problem entropy();
Problem median();
Problem newsvendor();

// B: functions of an integral (integrals.cpp)
Problem transmittance_constant();
Problem transmittance_linear();
Problem transmittance_exponential();
Problem transmittance_sinusoid();
Problem transmittance_step();
Problem transmittance_bump();
Problem transmittance_thick();
Problem transmittance_davis();
Problem transmittance_pink();
Problem transmittance_straight();
Problem reciprocal_of_integral();
Problem transmittance_singular();
Problem kink_of_integral();
// the same media at optical depths 1, 4 and 16 (media.cpp)
Problem sinusoid_tau_1();
Problem sinusoid_tau_4();
Problem sinusoid_tau_16();
Problem step_tau_1();
Problem step_tau_4();
Problem step_tau_16();
Problem linear_tau_1();
Problem linear_tau_4();
Problem linear_tau_16();

// C: finite differences (derivatives.cpp)
Problem derivative_of_sine();
Problem derivative_of_exp();
Problem derivative_of_fast_sine();
Problem derivative_of_kink();
Problem second_derivative_of_log();
Problem black_scholes_delta();
Problem derivative_of_expectation();
Problem black_scholes_gamma();

// D: series (sums.cpp)
Problem geometric_series();
Problem slow_geometric_series();
Problem zeta_of_two();
Problem series_for_e();
Problem machin_pi();
Problem bessel_j0();
Problem neumann_matrix();
Problem furnace();
Problem facing_walls();
Problem log_determinant_by_probes();
Problem log_series();
Problem wallis_product();

// E: stochastic differential equations (paths.cpp)
Problem european_call();
Problem asian_call();
Problem lookback_call();
Problem barrier_call();
Problem gbm_by_euler();
Problem mean_of_gbm();
Problem second_moment_of_ou();
Problem geometric_asian_call();
Problem clark_cameron();
// and their derivatives in parameters (greeks.cpp)
Problem digital_call();
Problem call_delta();
Problem call_vega();
Problem digital_delta();
Problem call_rho();
Problem call_theta();
Problem lookback_delta();
Problem barrier_delta();
Problem asian_delta();
Problem smoothed_digital_call();

// F: nested expectations (nested.cpp)
Problem nested_max();
Problem nested_square();
Problem value_of_information();
Problem nested_exp();
Problem doubly_nested_exp();

// H: steady states (chains.cpp)
Problem autoregression();
Problem waiting_time();
Problem bernoulli_convolution();
Problem cantor_law();
Problem dickman_law();

// I: functions of an integral over a cube (cubes.cpp)
Problem evidence_in_2();
Problem evidence_in_4();
Problem evidence_in_8();
Problem sobol_g();
Problem reciprocal_over_cube();
Problem information_gain();

// K: chains that meet (coupled_chains.cpp)
Problem chain_square();
Problem chain_product();
Problem chain_modes();
Problem chain_ising();
Problem exp_of_chain();

// M: deterministic limits (limits.cpp)
Problem newton_sqrt();
Problem archimedes_pi();
// and matrices of known determinant (operators.cpp)
Problem log_determinant_of_chain();
Problem log_determinant_of_grid();
Problem log_determinant_of_kernel();

}  // namespace debias::catalog
