#pragma once

// Runs with a known answer: a problem of the catalogue under a PMF that makes its tail index what is asked
// for.
//
//   xi = 1 - beta / (2 rho), so rho = beta / (2 (1 - xi))                  differences that scale
//   E|D|^q ~ 2^(-beta k) for every q: xi = rho / (rho + beta)              rare events of a fixed size (Rare)

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <debias/core/verdict.hpp>
#include <debias/pmf/any.hpp>

#include "catalog.hpp"
#include "validation/reliability.hpp"

namespace debias::test {

struct LabelledCase {
  std::string problem;
  double index;  ///< xi; -infinity for differences that end
  catalog::Method method = catalog::Method::single_term;
  std::string pmf{};  ///< empty: the geometric PMF with this index
  bool rare = false;

  [[nodiscard]] bool finite() const { return index < 0.5; }
  [[nodiscard]] AnyPmf the_pmf() const {
    if (!pmf.empty()) return AnyPmf::parse(pmf);
    const catalog::Problem& p = catalog::find(problem);
    if (!rare) return validation::pmf_with_tail_index(p, index);
    return AnyPmf(Geometric::with_exponent(p.rates.variance_decay * index / (1 - index)));
  }
  [[nodiscard]] Statistics run(std::int64_t samples, std::uint64_t seed) const {
    const catalog::Problem& p = catalog::find(problem);
    const std::int64_t base = std::max<std::int64_t>(p.lowest_base, 0);
    return p.run({method, the_pmf(), base}, {.samples = samples, .seed = seed, .threads = 1});
  }
};

/// On which the rule of the verdict was built.
inline std::vector<LabelledCase> labelled_cases() {
  using enum catalog::Method;
  constexpr double bounded = -std::numeric_limits<double>::infinity();
  const std::string r65 = "geometric:r=0.65";
  return {
      {"A01", 0.3},
      {"A01", 0.42},
      {"A01", 0.58},
      {"A01", 0.7},
      {"A03", 0.3, single_term_outcome},
      {"A03", 0.7, single_term_outcome},
      {"A07", 0.3, independent_sum},
      {"A07", 0.7, independent_sum},
      {"A10", 0.2},
      {"A10", 0.34},
      {"A10", 0.46},
      {"A10", 0.7},
      {"A10", 0.8},
      {"A13", 0.25},
      {"A13", 0.65},
      {"A19", 0.4},
      {"A19", 0.7},
      {"A26", 0.3},
      {"A26", 0.7},
      {"B01", bounded, single_term, r65},
      {"B02", 0.3},
      {"B02", 0.7},
      {"B04", bounded, single_term, r65},
      {"B06", 0.3},
      {"B06", 0.7},
      {"B18", 0.3},
      {"B18", 0.6},
      {"B18", 0.75},
      {"C01", 0.2},
      {"C01", 0.4},
      {"C01", 0.6},
      {"C01", 0.8},
      {"C02", 0.3},
      {"C02", 0.7},
      {"C04", 0.3},
      {"C04", 0.7},
      {"C06", 0.4, single_term, "", true},
      {"C06", 0.7, single_term, "", true},
      {"D01", 0.2},
      {"D01", 0.4, roulette},
      {"D01", 0.6, roulette},
      {"D01", 0.8},
      {"D02", 0.3, roulette},
      {"D02", 0.7, roulette},
      {"D14", 0.37, roulette},
      {"D14", 0.56, roulette},
      {"D14", 0.68, roulette},
      {"D11", 0.3, roulette},
      {"D11", 0.7, roulette},
      {"D18", 0.3, roulette},
      {"D18", 0.7, roulette},
      {"D03", 0, single_term, "zeta:s=2"},
      {"D03", 1.0 / 3, single_term, "zeta:s=2.5"},
      {"D03", 0.6, single_term, "zeta:s=3.5"},
      {"D03", 2.5 / 3.5, single_term, "zeta:s=4.5"},
      {"D03", 1, single_term, "geometric:r=0.5"},
      {"D07", 0, single_term, "poisson:lambda=1"},
      {"D19", 0.3},
      {"D19", 0.7},
      {"E02", 0.3},
      {"E02", 0.7},
      {"E06", 2.0 / 3},
      {"E07", 0.3},
      {"E07", 0.7},
      {"E08", 0.3},
      {"E08", 0.7},
      {"F01", 0.4},
      {"F01", 0.7},
      {"F02", 0.3},
      {"F02", 0.7},
      {"F05", 0.7},
      {"F06", 0.3},
      {"F06", 0.7},
      {"H01", 0.3},
      {"H01", 0.7},
      {"H04", 0.3},
      {"H04", 0.7},
      {"H05", 0.3},
      {"H07", 0.3},
      {"H07", 0.7},
      {"M02", 0.3},
      {"M02", 0.6},
      {"M01", bounded, single_term, r65},
  };
}

/// Other problems, on which it was checked afterwards; the first levels of many are far from their rates.
inline std::vector<LabelledCase> held_out_cases() {
  std::vector<LabelledCase> cases;
  for (const char* problem :
       {"A06", "A08", "A09", "A11", "A12", "A18", "A20", "B03", "B08", "B09", "B12", "B13", "B15",
        "B24", "B25", "B27", "B28", "C03", "C05", "C09", "H02", "E02", "E07", "H05", "D11", "D18"}) {
    for (const double index : {0.2, 0.3, 0.45, 0.55, 0.7, 0.8}) cases.push_back({problem, index});
  }
  return cases;
}

}  // namespace debias::test
