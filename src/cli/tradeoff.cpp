// The law of a problem swept through its family: what each one costs and what it is worth.

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <ostream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <debias/diagnostics.hpp>
#include <debias/recipe.hpp>

#include "../core/text.hpp"
#include "commands.hpp"
#include "json.hpp"
#include "output.hpp"
#include "session.hpp"

namespace debias::cli {
namespace {

constexpr double pilot_share = 0.25;  // of the draws of all measurements together
constexpr double least_pilot = 1 << 17;

struct Family {
  std::string_view name;
  AnyPmf (*law)(double parameter);
};
constexpr std::array<Family, 3> families{{
    {"geometric", [](double x) { return AnyPmf(Geometric::with_exponent(x)); }},
    {"zeta", [](double x) { return AnyPmf(Zeta(x)); }},
    {"poisson", [](double x) { return AnyPmf(Poisson(x)); }},
}};

const Family& family_of(const std::string& name) {
  std::array<std::string_view, families.size()> names;
  for (std::size_t i = 0; i < families.size(); ++i) {
    names[i] = families[i].name;
    if (name == names[i]) return families[i];
  }
  throw std::invalid_argument("--family = '" + name + "' (write geometric, zeta or poisson)" + suggestion(name, names));
}

// The parameters to sweep: across the exponents with finite variance and finite work, and a little beyond.
std::pair<double, double> parameters(const Family& family, const MeasuredRates& rates) {
  if (family.name == "poisson") return {0.5, 8};
  const bool polynomial = rates.kind == RateKind::polynomial;
  if (family.name == "zeta" && !polynomial) return {1.25, 4};
  const ExponentRange range = finite_exponents(rates_of(rates));
  double low = std::isfinite(range.low) ? std::min(range.low, range.high) : 1;
  double high = std::isfinite(range.high) ? std::max(range.low, range.high) : low + 3;
  const double beyond = std::max(0.25, 0.25 * (high - low));
  // Below 1.5 a zeta law reaches levels beyond 64 bits, P = 2^(-62 (s - 1)), within any run worth its name.
  low = std::max(low - beyond, family.name == "zeta" ? 1.5 : 0.1);
  return {low, std::max(high + beyond, low + 0.5)};
}

TradeoffPoint predicted(const AnyPmf& law, const MeasuredRates& rates, const TermMoments& moments) {
  TradeoffPoint point{law, judge(rates, law.tail_exponent()), predict(moments, law)};
  return point;
}

// A law so slow that a level does not fit 64 bits, or memory, stays without a measurement.
void measure(TradeoffPoint& point, const catalog::Choice& choice, const Plan& plan, const catalog::Problem& problem) {
  try {
    const Statistics s = problem.run(choice, plan);
    const auto block = static_cast<double>(choice.block);
    point.measured = true;
    point.variance = s.components.front().variance * block;
    point.work = s.work_per_sample() / block;
    point.efficiency = s.efficiency();
  } catch (const UndrawableError&) {
    return;
  } catch (const SampleError& e) {
    try {
      std::rethrow_if_nested(e);
    } catch (const std::length_error&) {
      return;
    }
    throw;
  }
}

std::string regions(const TradeoffPoint& p) {
  std::string text;
  if (p.verdict.variance == Finiteness::infinite) text += "variance infinite";
  if (p.verdict.work == Finiteness::infinite) text += std::string(text.empty() ? "" : ", ") + "work infinite";
  return text;
}

std::string figure(bool known, double x) { return known ? rounded(x) : "-"; }

void print_csv(std::ostream& out, const Tradeoff& t) {
  out << "law,exponent,predicted_variance,measured_variance,predicted_work,measured_work,efficiency,tail_"
         "index,"
         "variance,work\n";
  for (const TradeoffPoint& p : t.points) {
    const auto known = [](bool is, double x) { return is && std::isfinite(x) ? to_text(x) : std::string(); };
    out << '"' << p.law.spec() << "\"," << known(true, p.law.tail_exponent().exponent) << ','
        << known(p.verdict.variance != Finiteness::infinite, p.predicted.variance) << ','
        << known(p.measured, p.variance) << ',' << known(p.verdict.work != Finiteness::infinite, p.predicted.work)
        << ',' << known(p.measured, p.work) << ',' << known(p.measured, p.efficiency) << ','
        << known(true, p.verdict.tail_index) << ',' << name_of(p.verdict.variance) << ',' << name_of(p.verdict.work)
        << '\n';
  }
}

}  // namespace

Tradeoff tradeoff_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch) {
  return prepared_tradeoff_of(problem, arguments, watch, [](const AnyPmf&, Plan&) {});
}

Tradeoff prepared_tradeoff_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch,
                              const std::function<void(const AnyPmf& law, Plan&)>& prepare) {
  const Family& family = family_of(arguments.family);
  const std::int64_t count = read_points(arguments.points);
  const catalog::Choice shape = read_shape(arguments, problem);
  Plan plan = read_plan(arguments);
  std::string what = "pilot";
  plan.progress = [&](std::int64_t done) { return watch(problem.id + ": " + what, static_cast<double>(done), 0); };

  Tradeoff t;
  t.problem = &problem;
  t.samples = plan.samples;
  t.setup = {shape.base_level, shape.method == catalog::Method::single_term ? Base::always : Base::drawn, shape.block};
  t.shares_base = t.setup.base == Base::always && problem.levels.shared;
  const double unit = problem.levels.work(shape.base_level, plan).second;
  const double budget = unit * std::max(least_pilot, pilot_share * static_cast<double>(count * plan.samples));
  Plan pilot = plan;
  pilot.samples = std::int64_t{1} << 16;
  t.survey = survey_within(problem.levels, budget, pilot);
  if (t.survey.rows.size() < static_cast<std::size_t>(shape.base_level) + 3) {
    throw std::invalid_argument("--base-level = '" + std::to_string(shape.base_level) +
                                "' (the pilot does not reach it); a lower one, or more --samples");
  }
  const LevelModel model = model_of(t.survey);
  const TermMoments moments = term_moments(problem.levels, t.survey, model, t.setup, pilot);
  t.optimum = predict(moments, best_masses(moments)).product();
  t.bound = bound_of(t.survey, model, t.setup.base_level);

  const auto [low, high] = parameters(family, t.survey.rates);
  try {
    for (std::int64_t i = 0; i < count; ++i) {
      const double share = count > 1 ? static_cast<double>(i) / static_cast<double>(count - 1) : 0.5;
      // Four digits: the law that is printed is the law that was run.
      const double parameter = parse_double(rounded(low + share * (high - low)), "parameter");
      TradeoffPoint point = predicted(family.law(parameter), t.survey.rates, moments);
      what = "point " + std::to_string(i + 1) + " of " + std::to_string(count);
      if (point.verdict.work == Finiteness::finite) {
        catalog::Choice choice = shape;
        choice.law = point.law;
        Plan run = plan;
        run.samples = std::max<std::int64_t>(2, plan.samples / shape.block);
        prepare(point.law, run);
        measure(point, choice, run, problem);
      }
      t.points.push_back(std::move(point));
    }
  } catch (const Interrupted&) {
    if (t.points.empty()) throw;
  }
  double best = std::numeric_limits<double>::infinity();
  t.best = t.points.size();
  for (std::size_t i = 0; i < t.points.size(); ++i) {
    const TradeoffPoint& p = t.points[i];
    const bool finite = p.verdict.variance == Finiteness::finite && p.verdict.work == Finiteness::finite;
    if (!finite || !(p.predicted.product() < best)) continue;
    best = p.predicted.product();
    t.best = i;
  }
  return t;
}

void print(std::ostream& out, const Tradeoff& t) {
  print_line(out, "problem", title(*t.problem));
  std::vector<Row> rows = {{"law", "exponent", "variance", "measured", "work", "measured", "product", "measured",
                            "efficiency", "tail index", "moments below", ""}};
  for (std::size_t i = 0; i < t.points.size(); ++i) {
    const TradeoffPoint& p = t.points[i];
    const bool finite_variance = p.verdict.variance != Finiteness::infinite;
    const bool finite_work = p.verdict.work != Finiteness::infinite;
    rows.push_back(
        {p.law.spec(), rounded(p.law.tail_exponent().exponent), figure(finite_variance, p.predicted.variance),
         figure(p.measured, p.variance), figure(finite_work, p.predicted.work), figure(p.measured, p.work),
         figure(finite_variance && finite_work, p.predicted.product()), figure(p.measured, p.variance * p.work),
         figure(p.measured, p.efficiency), rounded(p.verdict.tail_index, 3),
         p.verdict.tail_index > 0 ? rounded(1 / p.verdict.tail_index, 3) : "all",
         i == t.best ? "<- best of the family" : regions(p)});
  }
  print_table(out, rows);
  if (t.survey.law_exists == Answer::no) {
    print_line(out, "optimum", "none: no law has finite variance and finite work");
  } else {
    print_line(out, "optimum", rounded(t.optimum) + " = variance x work of the best of all laws");
    print_line(out, "bound",
               rounded(t.bound) + " = (sum of sqrt(Var D work))^2, what strata can reach" +
                   (t.shares_base ? " with draws that share nothing" : ""));
  }
  print_line(out, "base",
             "level " + std::to_string(t.setup.base_level) +
                 (t.setup.base == Base::drawn ? ", one outcome of the law" : ", in every sample"));
  print_line(out, "law exists", name_of(t.survey.law_exists));
}

int tradeoff(const Arguments& arguments) {
  if (arguments.json && arguments.csv) throw std::invalid_argument("--json, --csv: both (keep one)");
  const catalog::Problem& problem = catalog::find(arguments.problem);
  Arguments words = arguments;
  words.problem = problem.id;
  words.seed = std::to_string(read_plan(arguments).seed);
  Session session("tradeoff", words);
  Output out(arguments.output);
  Progress progress(arguments.quiet);
  const auto prepare = [&](const AnyPmf& law, Plan& plan) { session.attach(plan, law.spec()); };
  const Tradeoff t = session.guard([&] { return prepared_tradeoff_of(problem, words, watch_on(progress), prepare); });
  progress.erase();
  interrupted() ? session.suspend() : session.flush();
  if (arguments.json) {
    out.stream() << tradeoff_json(t) << '\n';
  } else if (arguments.csv) {
    print_csv(out.stream(), t);
  } else {
    print(out.stream(), t);
  }
  out.flush();
  if (!interrupted()) return done;
  complain("interrupted; " + std::to_string(t.points.size()) + " of " + arguments.points + " points are complete");
  return interrupted_by_signal;
}

}  // namespace debias::cli
