#include "list.hpp"

#include <cmath>
#include <ostream>

#include "text.hpp"

namespace debias::commands {
namespace {

// 2^(-1.5 k) or k^(-4): how something of this exponent grows with the level.
std::string power(double exponent, Decay decay) {
  if (exponent == 0) return "1";
  return decay == Decay::geometric ? "2^(" + rounded(exponent) + " k)" : "k^(" + rounded(exponent) + ")";
}

std::string variance_text(const Rates& rates) {
  return std::isinf(rates.variance_decay) ? "faster than any rate" : power(-rates.variance_decay, rates.decay);
}

Row header(const catalog::Problem&) { return {"id", "name", "module", "variance", "work", "pmf", "truth", "source"}; }
Row row(const catalog::Problem& p) {
  return {p.id,
          p.name,
          p.module,
          variance_text(p.rates),
          power(p.rates.work_growth, p.rates.decay),
          pmf_exists(p.rates) ? catalog::default_pmf(p).spec() : "none",
          rounded(p.truth, 10),
          p.formula};
}
Fields entry_of(const catalog::Problem& p) {
  const bool faster = std::isinf(p.rates.variance_decay);
  return {{"id", p.id},
          {"name", p.name},
          {"module", p.module},
          {"truth", p.truth},
          {"decay", faster                              ? "faster"
                    : p.rates.decay == Decay::geometric ? "geometric"
                                                        : "polynomial"},
          {"variance_decay", p.rates.variance_decay},
          {"work_growth", p.rates.work_growth},
          {"pmf_exists", pmf_exists(p.rates)},
          {"source", p.formula}};
}

Row header(const EstimatorEntry&) { return {"name", "what one sample is"}; }
Row row(const EstimatorEntry& e) { return {e.name, e.description}; }
Fields entry_of(const EstimatorEntry& e) { return {{"name", e.name}, {"description", e.description}}; }

Row header(const AnyPmf::Form&) { return {"name", "write", "mass of j = 0, 1, 2, ..."}; }
Row row(const AnyPmf::Form& f) { return {std::string(f.name), std::string(f.example), std::string(f.formula)}; }
Fields entry_of(const AnyPmf::Form& f) { return {{"name", f.name}, {"example", f.example}, {"formula", f.formula}}; }

}  // namespace

ListReport list(const ListRequest& request) {
  if (request.topic == Topic::problems) return {std::span(catalog::problems())};
  if (request.topic == Topic::pmfs) return {AnyPmf::forms()};
  std::vector<EstimatorEntry> entries;
  for (const catalog::Method m : catalog::methods()) {
    entries.push_back({std::string(catalog::name_of(m)), std::string(catalog::describe(m))});
  }
  entries.push_back({"recipe", "the best single term for the problem: a pilot chooses PMF, base level and strata"});
  entries.push_back({"multilevel", "no sample: the biased baseline, as many draws a level as its error takes"});
  for (const catalog::Special& s : catalog::specials()) entries.push_back({s.name, s.description});
  return {std::move(entries)};
}

void print(std::ostream& out, const ListReport& report) {
  std::visit(
      [&out](const auto& entries) {
        std::vector<Row> rows = {header(entries[0])};
        for (const auto& entry : entries) rows.push_back(row(entry));
        print_table(out, rows);
      },
      report.entries);
}

List fields(const ListReport& report) {
  return std::visit(
      [](const auto& entries) { return list_of(entries, [](const auto& entry) { return entry_of(entry); }); },
      report.entries);
}

}  // namespace debias::commands
