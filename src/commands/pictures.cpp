#include "pictures.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <tuple>
#include <utility>

#include "core/text.hpp"
#include "svg.hpp"
#include "text.hpp"

namespace debias::commands {
namespace {

using svg::Curve;
using svg::nothing;
using svg::Panel;
using svg::Point;
namespace colour = svg::colour;

constexpr double usual_interval = 1.96;  // standard errors, for 95 %

std::string name_of(const catalog::Problem& problem) {
  return problem.id.empty() ? problem.name : problem.id + " " + problem.name;
}

// The curve of one column of a survey; white inside where the level did not take part in the fit.
template <class F>
Curve column(const Survey& survey, const std::string& name, std::string_view colour, const F& value) {
  Curve curve{name, colour, {}};
  for (const SurveyRow& row : survey.rows)
    curve.points.push_back({static_cast<double>(row.level), value(row), nothing, !row.fitted});
  return curve;
}

// The power law of a rate through the levels that it was fitted to, at the geometric mean of what they are.
Curve slope(const Curve& of, const Survey& survey, const std::string& letter, const FittedRate& rate) {
  const bool polynomial = survey.rates.kind == RateKind::polynomial;
  Curve curve{(polynomial ? "(k + 1)^-" : "2^(-") + letter + (polynomial ? ", " : " k), ") + letter + " = " +
                  rounded(rate.value, 3) + " ± " + rounded(rate.error, 2),
              colour::black,
              {},
              true,
              false,
              true};
  const auto unit = [&](double k) { return polynomial ? std::log2(k + 1) : k; };
  double offset = 0;
  for (const Point& p : of.points) {
    if (p.open || !(p.y > 0)) continue;
    offset += std::log2(p.y) + rate.value * unit(p.x);
    curve.points.push_back({p.x, 0});
  }
  offset /= static_cast<double>(curve.points.size());
  for (Point& p : curve.points) p.y = std::exp2(offset - rate.value * unit(p.x));
  return curve;
}

// geometric:r=0.638 of more digits.
std::string brief(const std::string& spec) {
  const std::size_t at = spec.find('=') + 1;
  return at == 0 ? spec : spec.substr(0, at) + rounded(parse_double(spec.substr(at), "pmf"), 3);
}

Curve above_base(Curve curve) {
  std::erase_if(curve.points, [](const Point& p) { return p.x == 0; });
  return curve;
}

}  // namespace

std::string picture(const SurveyReport& report) {
  const Survey& s = report.survey;
  const svg::Axis level{"level k", 0, nothing, nothing, true};
  const auto fitted = [&](Panel& panel, const Curve& curve, const std::string& letter, const FittedRate& rate) {
    panel.curves.push_back(curve);
    if (std::isfinite(rate.value) && rate.value > 0) panel.curves.push_back(slope(curve, s, letter, rate));
  };
  Panel variance{name_of(*report.problem) + ": variance", level, {"second moment", 2}, {}, {}, {}, {}};
  variance.curves = {column(s, "Var I_k", colour::orange, [](const SurveyRow& r) { return r.variance; })};
  for (Point& p : variance.curves[0].points) p.open = false;
  fitted(variance, above_base(column(s, "E D_k^2", colour::blue, [](const SurveyRow& r) { return r.second_moment; })),
         "beta", s.rates.variance_decay);

  Panel mean{"mean", level, {"size of the mean", 2}, {}, {}, {}, {}};
  mean.curves = {column(s, "|E I_k|", colour::orange, [](const SurveyRow& r) { return std::abs(r.mean); })};
  for (Point& p : mean.curves[0].points) p.open = false;
  fitted(mean,
         above_base(column(s, "|E D_k|", colour::blue, [](const SurveyRow& r) { return std::abs(r.difference); })),
         "alpha", s.rates.mean_decay);

  Panel kurtosis{"kurtosis", level, {"kurtosis of the difference", 10}, {}, {}, {{"normal draws: 3", colour::black, 3}},
                 {}};
  kurtosis.curves = {
      above_base(column(s, "E D_k^4 / (E D_k^2)^2", colour::blue, [](const SurveyRow& r) { return r.kurtosis; }))};

  Panel rest{"consistency of the coupling, and work",
             level,
             {"E[I_k - D_k] - E[I_(k-1)], standard errors"},
             {},
             {},
             {},
             {"work of a difference", 2}};
  Curve consistency = column(s, "consistency: 0 ± 1 for a right coupling", colour::blue,
                             [](const SurveyRow& r) { return r.consistency; });
  consistency.points.erase(consistency.points.begin());  // the first level has none below it
  consistency.line = false;
  double most = 5.5;
  for (Point& p : consistency.points) {
    p.open = false;
    if (std::isfinite(p.y)) most = std::max(most, 1.1 * std::abs(p.y));
  }
  rest.y.low = -most, rest.y.high = most;
  Curve work =
      column(s, "work (axis on the right)", colour::purple, [](const SurveyRow& r) { return r.difference_work; });
  for (Point& p : work.points) p.open = false;
  work.dashed = work.right = true;
  rest.curves = {std::move(consistency), std::move(work)};
  rest.levels = {{"4.5 standard errors", colour::grey, 4.5}, {"", colour::grey, -4.5}};
  return svg::draw({variance, mean, kurtosis, rest}, 2);
}

std::string picture(const TradeoffReport& t) {
  Panel panel{name_of(*t.problem) + ": which PMF?", {}, {"variance x work of a sample", 10}, {}, {}, {}, {}};
  panel.x.label = t.survey.rates.kind == RateKind::polynomial ? "exponent rho of the PMF, p_k ~ k^-rho"
                                                              : "exponent rho of the PMF, p_k ~ 2^(-rho k)";
  Curve predicted{"predicted from the levels", colour::blue, {}, true, false};
  Curve measured{"measured", colour::blue, {}, false};
  Curve doubtful{"a run, not to be trusted", colour::blue, {}, false};
  const auto exponent = [&](std::size_t i) { return t.points[i].pmf.tail_exponent().exponent; };
  const std::size_t n = t.points.size();
  double least = std::numeric_limits<double>::infinity(), most = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const TradeoffPoint& p = t.points[i];
    const double x = exponent(i);
    if (!std::isfinite(x)) continue;  // Poisson falls faster than any power: it has no place on this axis
    const bool finite = p.verdict.variance == Finiteness::finite;
    const bool is_known = p.verdict.variance != Finiteness::infinite && p.verdict.work != Finiteness::infinite;
    const double y = is_known ? p.predicted.product() : nothing;
    predicted.points.push_back({x, y});
    if (finite && std::isfinite(y)) least = std::min(least, y), most = std::max(most, y);
    if (p.measured) (finite ? measured : doubtful).points.push_back({x, p.variance * p.work, nothing, !finite});
    const double low = i > 0 ? (exponent(i - 1) + x) / 2 : x, high = i + 1 < n ? (exponent(i + 1) + x) / 2 : x;
    if (p.verdict.work == Finiteness::infinite) panel.regions.push_back({"work infinite", colour::sky, low, high});
    if (p.verdict.variance == Finiteness::infinite)
      panel.regions.push_back({"variance infinite", colour::orange, low, high});
    if (p.verdict.variance == Finiteness::undecided)
      panel.regions.push_back({"variance undecided", colour::grey, low, high});
  }
  if (!predicted.points.empty()) panel.x.low = predicted.points.front().x, panel.x.high = predicted.points.back().x;
  panel.curves = {predicted, measured, doubtful};
  std::erase_if(panel.curves, [](const Curve& c) { return c.points.empty(); });
  if (t.best < n && std::isfinite(exponent(t.best))) {
    panel.curves.push_back({"best of the family: " + brief(t.points[t.best].pmf.spec()),
                            colour::red,
                            {{exponent(t.best), t.points[t.best].predicted.product()}},
                            false});
  }
  if (t.survey.pmf_exists != Answer::no) {
    const double lowest = least;
    for (const auto& [name, shown, y] : {std::tuple{"best of all PMFs", colour::green, t.optimum},
                                         std::tuple{"bound where draws share nothing", colour::black, t.bound}}) {
      if (!(y > 1e-3 * lowest) || !std::isfinite(y)) continue;  // a PMF without any variance is off the map
      panel.levels.push_back({name, shown, y});
      least = std::min(least, y);
    }
  }
  if (most > 0) panel.y.low = 0.5 * least, panel.y.high = 30 * most;  // beyond, predictions grow without bound
  return svg::draw({panel});
}

std::vector<Prefix> prefixes(const RunRequest& request, const RunReport& report, const Watch& watch) {
  const Statistics& s = report.statistics;
  std::vector<std::int64_t> wanted;
  for (std::int64_t blocks = s.blocks / 2; blocks >= 16; blocks /= 2) wanted.push_back(blocks * s.block);
  std::reverse(wanted.begin(), wanted.end());

  Plan plan{.seed = s.seed, .first = s.first, .threads = request.sampling.threads};
  plan.whole = s.first + s.samples;
  plan.ranks = request.sampling.ranks;
  const double total = wanted.empty() ? 0 : static_cast<double>(wanted.back());
  const Caller caller{watch};
  plan.progress = [&](std::int64_t done) { return caller.goes_on("picture", static_cast<double>(done), total); };
  std::vector<Prefix> all;
  const auto add = [&all](const Statistics& x) {
    all.push_back({x.samples, x.components.front().mean, x.components.front().standard_error});
  };
  for (const std::int64_t samples : wanted) {
    plan.samples = samples;
    const Statistics part = report.problem->run(report.choice, plan);
    plan.earlier = std::make_shared<RunState>(part.state);  // each goes on from the one before
    add(part);
  }
  add(s);
  return all;
}

std::string picture(const RunReport& report, const std::vector<Prefix>& prefixes) {
  Curve mean{"mean of the first samples, 95 % interval", colour::blue, {}};
  Curve error{"standard error", colour::blue, {}};
  Curve half{"slope -1/2: a finite variance", colour::black, {}, true, false, true};
  for (const Prefix& p : prefixes) {
    const auto n = static_cast<double>(p.samples);
    mean.points.push_back({n, p.mean, usual_interval * p.standard_error});
    error.points.push_back({n, p.standard_error});
    half.points.push_back({n, report.statistics.components.front().standard_error *
                                  std::sqrt(static_cast<double>(report.statistics.samples) / n)});
  }
  Panel left{name_of(*report.problem) + ": mean", {"samples", 10}, {"mean"}, {mean}, {}, {}, {}};
  if (std::isfinite(report.problem->truth)) left.levels = {{"exact value", colour::black, report.problem->truth}};
  const Panel right{"standard error", {"samples", 10}, {"standard error of the mean", 10}, {half, error}, {}, {}, {}};
  return svg::draw({left, right}, 2);
}

}  // namespace debias::commands
