#pragma once

// The PMF of a problem swept through its family: what each one costs and what it is worth.

#include <cstddef>
#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

#include <debias/diagnostics.hpp>
#include <debias/recipe.hpp>

#include "fields.hpp"
#include "store.hpp"

namespace debias::commands {

enum class Family { geometric, zeta, poisson };
/// Throws BadRequest, with the nearest name.
Family family_of(const std::string& name);
std::string name_of(Family family);

struct TradeoffRequest {
  const catalog::Problem* problem = nullptr;
  Family family = Family::geometric;
  std::int64_t points = 15;        ///< PMFs to try
  Shape shape = {};                ///< a single term; its PMF does not matter
  std::int64_t samples = 100'000;  ///< of each PMF
  std::uint64_t seed = 1;
  int threads = 0;
};

/// One PMF of a sweep.
struct TradeoffPoint {
  AnyPmf pmf;
  MeasuredFiniteness verdict;
  VarianceAndWork predicted;  ///< of one sample
  bool measured = false;      ///< not where the work is infinite, or may be
  double variance = 0;        ///< of one sample, measured
  double work = 0;
  double efficiency = 0;
};

struct TradeoffReport {
  const catalog::Problem* problem = nullptr;
  Survey survey;
  SingleTermForm form;
  bool shares_base = false;  ///< base and difference are made of the same draws
  std::int64_t samples = 0;
  std::vector<TradeoffPoint> points;
  std::size_t best = 0;  ///< of the points; their number where none is finite
  double optimum = 0;    ///< means nothing, as does the bound, where no PMF exists
  double bound = 0;
  bool complete = true;  ///< false: it was ended among its points
};

/// Keeps the samples of each PMF. Ended among its points it returns those that are complete, if there are any.
TradeoffReport tradeoff(const TradeoffRequest& request, const Caller& caller = {});

void print(std::ostream& out, const TradeoffReport& report);
/// Comma-separated values, a line for each PMF.
void print_csv(std::ostream& out, const TradeoffReport& report);
Fields fields(const TradeoffReport& report);

}  // namespace debias::commands
