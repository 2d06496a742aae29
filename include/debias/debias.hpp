#pragma once

// All of debias. Each header below can be included alone.

#include <debias/core/accumulator.hpp>
#include <debias/core/estimate.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/pmf.hpp>
#include <debias/core/rates.hpp>
#include <debias/core/result.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>
#include <debias/derivative.hpp>
#include <debias/diagnostics.hpp>
#include <debias/estimators/independent_sum.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/truncated.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/nested.hpp>
#include <debias/pmf/any.hpp>
#include <debias/pmf/bhanot_kennedy.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/poisson.hpp>
#include <debias/pmf/tabulated.hpp>
#include <debias/pmf/zeta.hpp>
#include <debias/power_series.hpp>
#include <debias/reciprocal.hpp>
#include <debias/sde.hpp>
#include <debias/series.hpp>
#include <debias/steady_state.hpp>
#include <debias/taylor.hpp>
