#pragma once

// g(E X) by the power series of g about a point: the terms in order for any estimator (taylor), or all draws
// of a sample averaged (taylor_sum). For a function that is not in functions.hpp: taylor/autodiff.hpp, not
// included here.
//
//   exp(-tau), a majorant a of X, E X = tau      with t = taylor(x, functions::ExpMinus{}, a)
//     ratio tracking            single_term(t, Poisson(a), {.base = Base::one_outcome})
//     p-series, cumulative      roulette(t, RunningWeight(exp(-a)))
//     p-series, CMF             roulette(t, IndexRoulette(a), {.base_level = K})
//     pivoted U-statistics      taylor_sum(comb_mean(f, M), functions::ExpMinus{}, drawn_pivot,
//                                          BhanotKennedy(0.9, 2, 2))
//   telescoping combs need no series: function_of_integral(f, functions::ExpMinus{})
// Sources: Georgiev et al. 2019 (p-series); Kettunen et al. 2021; Misso et al. 2022 (combs).

#include <debias/taylor/sum.hpp>
#include <debias/taylor/terms.hpp>
