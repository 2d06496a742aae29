#pragma once

// Coupled Markov chains: expectations under an invariant law, without the bias of a burn-in.
//
//   chains/coupled_chain.hpp  the estimator          chains/kernel.hpp      kernels of one's own
//   chains/metropolis.hpp     random walk, Langevin  chains/gibbs.hpp       normal, Bernoulli and gamma conditionals
//   chains/hamiltonian.hpp    Hamiltonian steps
//   chains/mixture.hpp        mixtures of kernels    chains/check.hpp       is a coupling one?
//   chains/advise.hpp         how long, by a pilot   chains/draws.hpp       functions of such expectations
//
// Formula, assumptions and sources: chains/coupled_chain.hpp. For paths that contract take steady_state.hpp, which couples by
// common random numbers.

#include <debias/chains/advise.hpp>
#include <debias/chains/check.hpp>
#include <debias/chains/coupled_chain.hpp>
#include <debias/chains/draws.hpp>
#include <debias/chains/gibbs.hpp>
#include <debias/chains/hamiltonian.hpp>
#include <debias/chains/kernel.hpp>
#include <debias/chains/metropolis.hpp>
#include <debias/chains/mixture.hpp>
