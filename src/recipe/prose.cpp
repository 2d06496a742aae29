#include "recipe/prose.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>
#include <string>
#include <utility>

#include "core/infinity.hpp"
#include "core/text.hpp"
#include "core/words.hpp"

namespace debias {
namespace {

constexpr double narrow = 0.05;  // of the work's exponent, for the PMF with finite work where none has both

std::string levels_text(const Evidence& e) {
  return e.first_usable < 0 ? "no level" : levels_words(e.first_usable, e.last_usable);
}

Decay unit_of(const Evidence& e) { return e.polynomial ? Decay::polynomial : Decay::geometric; }

// In the unit of the decay; of an exponent of the other kind nothing is left.
FittedRate growth_of_work(const Evidence& e) { return e.exponential_work != e.polynomial ? e.work : FittedRate{}; }

// What the levels show of the decay.
std::string rate_text(const Survey& s) {
  const Evidence& e = s.evidence;
  if (e.end == End::aliased) return "the differences vanish but the value still varies";
  if (e.end == End::zeros || e.end == End::stated) return "the differences are zero beyond the first levels";
  if (e.courses.empty()) return "too few levels show their second moment";
  if (s.rates.kind == RateKind::super_exponential) return "the differences fall faster than any power";
  return decay_words("E D_k^2", e.decay, unit_of(e), levels_text(e)) + ", " +
         growth_words("work", growth_of_work(e), unit_of(e));
}

std::string points_text(const Advice& a) { return std::string(name_of(a.points)) + ": " + a.why_points; }

constexpr const char* what_helps =
    "a better coupling or a smoother integrand (beta up), extrapolation (alpha up), or multilevel, whose bias is "
    "stated";

}  // namespace

void describe_none(Advice& a) {
  const Evidence& e = a.survey.evidence;
  const bool polynomial = e.polynomial;
  const double work = e.exponential_work != polynomial ? std::max(0.0, e.work.value) : 0;
  const double beta = e.decay.value;
  const double rho = work + narrow + (polynomial ? 1 : 0);
  a.pmf = polynomial ? AnyPmf(Zeta(rho)) : AnyPmf(Geometric::with_exponent(std::max(rho, narrow)));
  a.exponent = a.pmf.tail_exponent();
  const double excess = rho - beta / 2;
  a.highest_moment = !(excess > 0) ? infinity : (rho - (polynomial ? 1 : 0)) / excess;
  a.sentences.push_back("no PMF has finite variance and finite work (" + std::string(name_of(a.survey.grade)) +
                        "): " + rate_text(a.survey));
  const bool falls = beta > 0 && !is_flat(e.decay);
  std::string best = "the best with finite work is " + a.pmf.spec();
  if (std::isfinite(a.highest_moment)) {
    best += ": " + (falls || a.highest_moment <= 1 ? moments_words(a.highest_moment)
                                                   : std::string("it is open whether even the mean is finite"));
  }
  if (!polynomial && falls && work > 0) {
    best += " (stable index " + format("%.3g", std::min(2.0, 2 * work / (2 * work - beta))) +
            " in the limit), the error falls like work^-" + format("%.2g", std::min(0.5, beta / (2 * work)));
  }
  a.sentences.push_back(best);
  a.sentences.push_back(std::string("what helps: ") + what_helps);
}

void describe(Advice& a) {
  const Survey& s = a.survey;
  const double work = s.evidence.exponential_work != s.evidence.polynomial ? s.evidence.work.value : 0;
  if (s.pmf_exists == Answer::yes) {
    a.sentences.push_back("a PMF with finite variance and finite work exists (" + std::string(name_of(s.grade)) +
                          "): " + rate_text(s));
  } else {
    a.sentences.push_back("open whether a PMF has finite variance and finite work: " + rate_text(s) +
                          "; the interval allows for levels that were not seen, more samples tell more");
  }
  const char* form = a.shares_base
                         ? ", made of the draws of the difference"
                         : (a.base == Base::one_outcome ? ", one outcome of the PMF" : ", evaluated in every sample");
  const bool nets = a.points == Points::nets;
  a.sentences.push_back("base level " + std::to_string(a.base_level) + form + "; " +
                        (nets ? counted(a.members / a.block, "block") + " of " + std::to_string(a.block) +
                                    ", each level the points of a net of its own"
                         : a.block > 1 ? "systematic strata in blocks of " + std::to_string(a.block)
                                       : std::string("independent samples, too few for strata")));
  a.sentences.push_back(points_text(a));
  const bool together = a.runs_together && a.block > 1 && !nets;
  std::string efficiency = "variance " + format("%.3g", a.predicted.variance) + " x work " +
                           format("%.4g", a.predicted.work) +
                           " predicted for a member: " + format("%.3g", a.predicted.product());
  if (a.bound > 0) {
    efficiency += ", " + format("%.3g", a.predicted.product() / a.bound) +
                  " times the bound (sum of sqrt(Var D work))^2 = " + format("%.3g", a.bound) +
                  (a.shares_base || together || nets ? " of draws that share nothing" : "") +
                  (together ? " and are not stratified by their first uniform" : "");
  }
  a.sentences.push_back(efficiency);
  const double rho = a.exponent.exponent;
  std::string moments = decay_words("the tail of the PMF", {rho, 0}, a.exponent.decay);
  if (std::isfinite(a.highest_moment)) moments += ": " + moments_words(a.highest_moment);
  if (a.price != 1) {
    a.warnings.push_back({WarningCode::deepest_level,
                          (a.deepest_level == deepest_of_all
                               ? std::string("no level of 2^62 or more can be drawn (it does not fit 64 bits)")
                               : "no level beyond " + std::to_string(a.deepest_level) + " can be drawn") +
                              ": so that it hardly comes up, the PMF falls faster than the best one, at " +
                              format("%.3g", a.price) + " times its variance x work."});
  }
  if (work > 0 && a.exponent.decay == Decay::geometric) {
    moments += std::string("; the variance of the work is ") + (rho > 2 * work ? "finite" : "infinite");
  }
  a.sentences.push_back(moments);
}

namespace {

void print_line(std::ostream& out, const char* name, const std::string& text) {
  out << name << std::string(14 - std::char_traits<char>::length(name), ' ') << text << '\n';
}

std::string pilot_text(const Advice& advice) {
  return "work " + format("%.4g", advice.pilot_work) + ", " + counted(std::ssize(advice.survey.rows), "level");
}

}  // namespace

std::ostream& operator<<(std::ostream& out, const Advice& advice) {
  if (!advice.sentences.empty()) print_line(out, "recipe", advice.sentences.front());
  if (advice.usable()) {
    print_line(out, "pmf", advice.pmf.spec());
    print_line(out, "base",
               "level " + std::to_string(advice.base_level) +
                   (advice.base == Base::one_outcome ? ", one outcome of the PMF" : ", in every sample") +
                   "; blocks of " + std::to_string(advice.block));
    print_line(out, "points", points_text(advice));
    print_line(out, "predicted",
               "variance " + format("%.3g", advice.predicted.variance) + " x work " +
                   format("%.4g", advice.predicted.work) +
                   " of a member = " + format("%.3g", advice.predicted.product()));
  }
  print_line(out, "pilot", pilot_text(advice));
  for (const Warning& warning : advice.warnings) print_line(out, "warning", warning.text);
  return out;
}

void detail::print_chosen(std::ostream& out, const Advice& advice) {
  const char* name = "recipe";
  for (const std::string& sentence : advice.sentences) {
    print_line(out, name, sentence);
    name = "";
  }
  if (advice.usable()) print_line(out, "pmf", advice.pmf.spec());
  print_line(out, "pilot", pilot_text(advice));
  for (const Warning& remark : advice.survey.remarks) {
    if (is_note(remark.code)) print_line(out, "remark", remark.text);
  }
}

void print_full(std::ostream& out, const Advice& advice) {
  detail::print_chosen(out, advice);
  for (const Warning& warning : advice.warnings) print_line(out, "warning", warning.text);
}

void detail::print_points(std::ostream& out, const Advice& advice) {
  if (advice.points == Points::nets || advice.why_points != "as asked") print_line(out, "points", points_text(advice));
}

namespace {

// What an advice without a PMF has to say to who wanted one.
NoPmfError refusal_of(const Advice& advice) {
  const Evidence& e = advice.survey.evidence;
  constexpr double unknown = NoPmfError::unknown;
  NoPmfError::Facts facts;
  facts.variance_decay = e.courses.empty() ? FittedRate{unknown, unknown} : e.decay;
  facts.work_growth = {growth_of_work(e).value, unknown};
  facts.decay = unit_of(e);
  facts.grade = advice.survey.grade == Grade::shown ? NoPmfError::Grade::shown : NoPmfError::Grade::likely;
  facts.reason = rate_text(advice.survey);
  facts.help = what_helps;
  std::string what = "recipe: ";
  for (const std::string& sentence : advice.sentences) {
    what += (&sentence == &advice.sentences.front() ? "" : "; ") + sentence;
  }
  return {what, std::move(facts)};
}

}  // namespace

Plan detail::plan_of(const Plan& plan, const Advice& advice) {
  if (!advice.usable()) throw refusal_of(advice);
  Plan run = plan;
  run.samples = advice.members;
  // The pilot has fixed the number of blocks: more until the error is small would stop on a lucky one.
  if (advice.points == Points::nets) run.goal = {};
  run.pilot += {advice.pilot_work, advice.pilot_seconds, advice.survey.evidence.facts, advice.facts};
  // How long a block takes and what it varies by is known only from blocks: the goal gets a pilot of its own. The chosen
  // prediction is the best of some, and the luckiest.
  if (run.goal.seconds > 0) run.goal.seconds = std::max(1e-9, plan.goal.seconds - advice.pilot_seconds);
  return run;
}

void detail::follow(Statistics& statistics, const Advice& advice, const Goal& goal) {
  statistics.goal = goal;
  add_new(statistics.warnings, advice.warnings);
  const auto is_of_moments = [](const Warning& w) { return w.code == WarningCode::no_second_moment; };
  if (std::any_of(statistics.warnings.begin(), statistics.warnings.end(), is_of_moments)) {
    drop_answered(statistics, statistics.verdict());
  }
}

void drop_answered(Statistics& statistics, const RunVerdict& verdict) {
  if (verdict.variance != Finiteness::finite || verdict.grade != Grade::shown) return;
  std::erase_if(statistics.warnings, [](const Warning& w) { return w.code == WarningCode::no_second_moment; });
}

}  // namespace debias
