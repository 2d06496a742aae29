#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "../core/text.hpp"
#include "commands.hpp"
#include "json.hpp"
#include "output.hpp"

namespace debias::cli {
namespace {

// 2^(-1.5 k) or k^(-4): how something of this exponent grows with the level.
std::string power(double exponent, Decay decay) {
  if (exponent == 0) return "1";
  return decay == Decay::geometric ? "2^(" + rounded(exponent) + " k)" : "k^(" + rounded(exponent) + ")";
}

std::string variance_text(const Rates& rates) {
  return std::isinf(rates.variance) ? "faster than any rate" : power(-rates.variance, rates.decay);
}

std::vector<Row> problem_rows() {
  std::vector<Row> rows = {{"id", "name", "module", "variance", "work", "law", "truth", "source"}};
  for (const catalog::Problem& p : catalog::problems()) {
    rows.push_back({p.id, p.name, p.module, variance_text(p.rates), power(p.rates.work, p.rates.decay),
                    law_exists(p.rates) ? catalog::default_law(p).spec() : "none", rounded(p.truth, 10), p.formula});
  }
  return rows;
}

std::vector<Row> estimator_rows() {
  std::vector<Row> rows = {{"name", "what one sample is"}};
  for (const catalog::Method m : catalog::methods()) {
    rows.push_back({std::string(catalog::name_of(m)), std::string(catalog::describe(m))});
  }
  for (const catalog::Special& s : catalog::specials()) rows.push_back({s.name, s.description});
  return rows;
}

std::vector<Row> law_rows() {
  std::vector<Row> rows = {{"name", "write", "mass of j = 0, 1, 2, ..."}};
  for (const AnyPmf::Form& form : AnyPmf::forms()) {
    rows.push_back({std::string(form.name), std::string(form.example), std::string(form.formula)});
  }
  return rows;
}

}  // namespace

int list(const Arguments& arguments) {
  struct Topic {
    std::string_view name;
    std::vector<Row> (*rows)();
    std::string (*json)();
  };
  static constexpr std::array<Topic, 3> topics = {{{"problems", problem_rows, problems_json},
                                                   {"estimators", estimator_rows, estimators_json},
                                                   {"laws", law_rows, laws_json}}};
  std::array<std::string_view, topics.size()> names;
  for (std::size_t i = 0; i < topics.size(); ++i) {
    names[i] = topics[i].name;
    if (names[i] != arguments.topic) continue;
    Output out;
    if (arguments.json) {
      out.stream() << topics[i].json() << '\n';
    } else {
      print_table(out.stream(), topics[i].rows());
    }
    out.flush();
    return done;
  }
  const std::string meant = suggestion(arguments.topic, names);
  throw std::invalid_argument("list: '" + arguments.topic + "' (nothing is called so)" +
                              (meant.empty() ? "; write problems, estimators or laws" : meant));
}

}  // namespace debias::cli
