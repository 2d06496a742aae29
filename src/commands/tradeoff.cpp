#include "tradeoff.hpp"

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

#include "core/text.hpp"
#include "describe.hpp"
#include "text.hpp"

namespace debias::commands {
namespace {

constexpr double pilot_share = 0.25;  // of the draws of all measurements together
constexpr double least_pilot = 1 << 17;

constexpr std::array<std::string_view, 3> family_names = {"geometric", "zeta", "poisson"};

AnyPmf member_of(Family family, double parameter) {
  if (family == Family::geometric) return AnyPmf(Geometric::with_exponent(parameter));
  return family == Family::zeta ? AnyPmf(Zeta(parameter)) : AnyPmf(Poisson(parameter));
}

// The parameters to sweep: across the exponents with finite variance and finite work, and a little beyond.
std::pair<double, double> parameters(Family family, const MeasuredRates& rates) {
  if (family == Family::poisson) return {0.5, 8};
  const bool polynomial = rates.kind == RateKind::polynomial;
  if (family == Family::zeta && !polynomial) return {1.25, 4};
  const ExponentRange range = finite_exponents(rates_of(rates));
  double low = std::isfinite(range.low) ? std::min(range.low, range.high) : 1;
  double high = std::isfinite(range.high) ? std::max(range.low, range.high) : low + 3;
  const double beyond = std::max(0.25, 0.25 * (high - low));
  // Below 1.5 a zeta PMF reaches levels beyond 64 bits, P = 2^(-62 (s - 1)), within any run worth its name.
  low = std::max(low - beyond, family == Family::zeta ? 1.5 : 0.1);
  return {low, std::max(high + beyond, low + 0.5)};
}

TradeoffPoint predicted(const AnyPmf& pmf, const MeasuredRates& rates, const TermMoments& moments) {
  TradeoffPoint point{pmf, judge(rates, pmf.tail_exponent()), predict(moments, pmf)};
  return point;
}

// A PMF so slow that a level does not fit 64 bits, or memory, stays without a measurement.
void measure(TradeoffPoint& point, const catalog::Choice& choice, const Plan& plan, const catalog::Problem& problem) {
  try {
    const Statistics s = problem.run(choice, plan);
    point.measured = true;
    point.variance = s.components.front().variance;
    point.work = s.work_per_sample();
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

std::string figure_if(bool known, double x) { return known ? rounded(x) : "-"; }

}  // namespace

Family family_of(const std::string& name) {
  for (std::size_t i = 0; i < family_names.size(); ++i) {
    if (name == family_names[i]) return static_cast<Family>(i);
  }
  throw BadRequest(
      {Field{"family"}, " = '" + name + "' (write geometric, zeta or poisson)" + suggestion(name, family_names)});
}

std::string name_of(Family family) { return std::string(family_names[static_cast<std::size_t>(family)]); }

TradeoffReport tradeoff(const TradeoffRequest& request, const Caller& caller) {
  const catalog::Problem& problem = *request.problem;
  const std::int64_t count = request.points;
  const catalog::Choice shape = sweep_of(request.shape, problem);
  check_block(request.shape, request.samples);
  Plan plan{.samples = request.samples, .seed = request.seed, .threads = request.threads};
  std::string what = "pilot";
  plan.progress = [&](std::int64_t done) {
    return caller.goes_on(problem.id + ": " + what, static_cast<double>(done), 0);
  };

  TradeoffReport t;
  t.problem = &problem;
  t.samples = plan.samples;
  t.form = {shape.base_level, shape.method == catalog::Method::single_term ? Base::every_sample : Base::one_outcome,
            shape.block};
  t.shares_base = t.form.base == Base::every_sample && problem.levels.shared;
  const double unit = problem.levels.work(shape.base_level, plan).second;
  const double budget = unit * std::max(least_pilot, pilot_share * static_cast<double>(count * plan.samples));
  Plan pilot = plan;
  pilot.samples = std::int64_t{1} << 16;
  t.survey = survey_within(problem.levels, budget, pilot);
  if (t.survey.rows.size() < static_cast<std::size_t>(shape.base_level) + 3) {
    throw BadRequest(
        {Field{"base_level"},
         " = '" + std::to_string(shape.base_level) + "' (the pilot does not reach it); a lower one, or more ",
         Field{"samples"}});
  }
  const LevelModel model = model_of(t.survey);
  const TermMoments moments = term_moments(problem.levels, t.survey, model, t.form, pilot);
  t.optimum = predict(moments, best_masses(moments)).product();
  t.bound = bound_of(t.survey, model, t.form.base_level);

  const auto [low, high] = parameters(request.family, t.survey.rates);
  try {
    for (std::int64_t i = 0; i < count; ++i) {
      const double share = count > 1 ? static_cast<double>(i) / static_cast<double>(count - 1) : 0.5;
      // Four digits: the PMF that is printed is the PMF that was run.
      const double parameter = parse_double(rounded(low + share * (high - low)), "parameter");
      TradeoffPoint point = predicted(member_of(request.family, parameter), t.survey.rates, moments);
      what = "point " + std::to_string(i + 1) + " of " + std::to_string(count);
      if (point.verdict.work == Finiteness::finite) {
        catalog::Choice choice = shape;
        choice.pmf = point.pmf;
        Plan run = plan;
        run.samples = std::max(2 * shape.block, plan.samples);
        caller.attach(run, point.pmf.spec());
        measure(point, choice, run, problem);
      }
      t.points.push_back(std::move(point));
    }
  } catch (const Interrupted&) {
    if (t.points.empty()) throw;
    t.complete = false;
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

void print(std::ostream& out, const TradeoffReport& t) {
  print_line(out, "problem", title(*t.problem));
  std::vector<Row> rows = {{"pmf", "exponent", "variance", "measured", "work", "measured", "product", "measured",
                            "efficiency", "tail index", "moments below", ""}};
  for (std::size_t i = 0; i < t.points.size(); ++i) {
    const TradeoffPoint& p = t.points[i];
    const bool finite_variance = p.verdict.variance != Finiteness::infinite;
    const bool finite_work = p.verdict.work != Finiteness::infinite;
    rows.push_back(
        {p.pmf.spec(), rounded(p.pmf.tail_exponent().exponent), figure_if(finite_variance, p.predicted.variance),
         figure_if(p.measured, p.variance), figure_if(finite_work, p.predicted.work), figure_if(p.measured, p.work),
         figure_if(finite_variance && finite_work, p.predicted.product()), figure_if(p.measured, p.variance * p.work),
         figure_if(p.measured, p.efficiency), rounded(p.verdict.tail_index, 3),
         p.verdict.tail_index > 0 ? rounded(1 / p.verdict.tail_index, 3) : "all",
         i == t.best ? "<- best of the family" : regions(p)});
  }
  print_table(out, rows);
  if (t.survey.pmf_exists == Answer::no) {
    print_line(out, "optimum", "none: no PMF has finite variance and finite work");
  } else {
    print_line(out, "optimum", rounded(t.optimum) + " = variance x work of the best of all PMFs");
    print_line(out, "bound",
               rounded(t.bound) + " = (sum of sqrt(Var D work))^2, what strata can reach" +
                   (t.shares_base ? " with draws that share nothing" : ""));
  }
  print_line(out, "base",
             "level " + std::to_string(t.form.base_level) +
                 (t.form.base == Base::one_outcome ? ", one outcome of the PMF" : ", in every sample"));
  print_line(out, "PMF exists", name_of(t.survey.pmf_exists));
}

void print_csv(std::ostream& out, const TradeoffReport& t) {
  out << "pmf,exponent,predicted_variance,measured_variance,predicted_work,measured_work,efficiency,tail_"
         "index,"
         "variance,work\n";
  for (const TradeoffPoint& p : t.points) {
    const auto known = [](bool is, double x) { return is && std::isfinite(x) ? to_text(x) : std::string(); };
    out << '"' << p.pmf.spec() << "\"," << known(true, p.pmf.tail_exponent().exponent) << ','
        << known(p.verdict.variance != Finiteness::infinite, p.predicted.variance) << ','
        << known(p.measured, p.variance) << ',' << known(p.verdict.work != Finiteness::infinite, p.predicted.work)
        << ',' << known(p.measured, p.work) << ',' << known(p.measured, p.efficiency) << ','
        << known(true, p.verdict.tail_index) << ',' << name_of(p.verdict.variance) << ',' << name_of(p.verdict.work)
        << '\n';
  }
}

Fields fields(const TradeoffReport& t) {
  const bool has_optimum = t.survey.pmf_exists != Answer::no;
  const auto figure = [](bool known, double x) { return known ? Node(x) : Node(nullptr); };
  Fields f = describe(*t.problem);
  append(f, {{"samples", t.samples},
             {"seed", t.survey.seed},
             {"base_level", t.form.base_level},
             {"base", t.form.base == Base::one_outcome ? "one_outcome" : "every_sample"},
             {"block", t.form.block},
             {"rates", describe(t.survey.rates)},
             {"pmf_exists", name_of(t.survey.pmf_exists)},
             {"optimum", figure(has_optimum, t.optimum)},
             {"bound", figure(has_optimum, t.bound)},
             {"best", t.best < t.points.size() ? Node(t.points[t.best].pmf.spec()) : Node(nullptr)},
             {"points", list_of(t.points, [&figure](const TradeoffPoint& p) {
                return Fields{
                    {"pmf", p.pmf.spec()},
                    {"exponent", p.pmf.tail_exponent().exponent},
                    {"predicted_variance", figure(p.verdict.variance != Finiteness::infinite, p.predicted.variance)},
                    {"measured_variance", figure(p.measured, p.variance)},
                    {"predicted_work", figure(p.verdict.work != Finiteness::infinite, p.predicted.work)},
                    {"measured_work", figure(p.measured, p.work)},
                    {"efficiency", figure(p.measured, p.efficiency)},
                    {"tail_index", p.verdict.tail_index},
                    {"variance", name_of(p.verdict.variance)},
                    {"work", name_of(p.verdict.work)},
                    {"fourth_moment", name_of(p.verdict.fourth_moment)}};
              })}});
  append(f, versions());
  return f;
}

}  // namespace debias::commands
