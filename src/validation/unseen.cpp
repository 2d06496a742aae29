#include "unseen.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <functional>
#include <limits>
#include <ostream>
#include <stdexcept>
#include <thread>
#include <type_traits>
#include <utility>

#include <boost/math/distributions/binomial.hpp>

#include <debias/recipe.hpp>

#include "core/text.hpp"

namespace debias::validation {

namespace {

constexpr double confident = 1.9599639845400545;

/// Is the variance of Z finite under a PMF with that tail?
bool finite_under(const Family& f, const Labels& labels, const TailExponent& pmf, std::int64_t base) {
  if (!labels.second_moments || base < f.heavy_levels) return false;
  if (f.end > 0) return true;
  const bool fast = f.factorial > 0;
  if (pmf.decay == Decay::polynomial) return !f.powers || f.beta - pmf.exponent > 1;
  return !f.powers && (fast ? std::isfinite(pmf.exponent) : pmf.exponent < f.beta);
}

Certainty stronger(Certainty a, Certainty b) { return std::min(a, b); }

template <class Statement>
Certainty grade_of(const Statement& statement, Certainty otherwise) {
  if constexpr (requires { statement.grade; }) {
    using Grade = std::remove_cvref_t<decltype(statement.grade)>;
    if (statement.grade == Grade::shown) return Certainty::shown;
    return statement.grade == Grade::likely ? Certainty::likely : Certainty::open;
  } else {
    return otherwise;
  }
}

template <class Survey>
Said said_of(const Survey& survey) {
  using Answer = std::remove_cvref_t<decltype(survey.pmf_exists)>;
  if (survey.pmf_exists == Answer::yes) return Said::yes;
  return survey.pmf_exists == Answer::no ? Said::no : Said::open;
}

template <class S>
Opinion ask_of(const S& sequence, const Plan& plan) {
  Opinion opinion;
  const Family& family = sequence.family();
  bool undrawable = false;
  try {
    const auto result = debias::estimate(debias::recipe(sequence), plan);
    const RunVerdict verdict = result.verdict();
    const Survey& survey = result.advice.survey;
    // Today's yes and no of a survey have no grade: taken for likely, and for shown where the run agrees.
    opinion.answer = said_of(survey);
    opinion.grade = opinion.answer == Said::open ? Certainty::open : grade_of(survey, Certainty::likely);
    if (verdict.variance != Finiteness::undecided) {
      opinion.variance_finite = verdict.variance == Finiteness::finite ? Said::yes : Said::no;
      opinion.variance_grade = grade_of(verdict, opinion.answer == Said::open ? Certainty::likely : Certainty::shown);
    }
    if (opinion.variance_finite == Said::yes) {
      opinion.answer = Said::yes;
      opinion.grade = stronger(opinion.grade, opinion.variance_grade);
    }
    const Interval interval = result.interval(verdict);
    opinion.mean = result.mean;
    opinion.low = interval.low;
    opinion.high = interval.high;
    opinion.reliable = verdict.interval_reliable();
    opinion.work = result.work - result.pilot_work;
    opinion.pilot_work = result.pilot_work;
    opinion.deepest = verdict.deepest_level;
    if (!survey.rows.empty()) opinion.deepest = std::max(opinion.deepest, survey.rows.back().level);
    opinion.variance_is_finite =
        finite_under(family, labels_of(sequence, plan.samples), result.advice.exponent, result.advice.base_level);
    return opinion;
  } catch (const std::exception& refusal) {
    opinion.refused = true;
    opinion.refusal = refusal.what();
    undrawable = dynamic_cast<const UndrawableError*>(&refusal) != nullptr;
  }
  try {
    const Advice advice = debias::advise(debias::level_runs(sequence), plan);
    // Today "cannot tell" refuses, too: that is open.
    opinion.answer = said_of(advice.survey);
    opinion.grade = opinion.answer == Said::open ? Certainty::open : grade_of(advice.survey, Certainty::shown);
    opinion.pilot_work = advice.pilot_work;
    if (!advice.survey.rows.empty()) opinion.deepest = advice.survey.rows.back().level;
    opinion.failed = advice.usable() && !undrawable;
  } catch (const std::exception&) {
    opinion.failed = true;
  }
  return opinion;
}

// ---- tables

using Chosen = std::function<bool(const UnseenRun&, const UnseenFamily&)>;

std::int64_t count(const UnseenReport& report, const Chosen& chosen) {
  std::int64_t n = 0;
  for (const UnseenRun& run : report.runs) n += chosen(run, report.family_of(run));
  return n;
}

double median_width(const UnseenReport& report, const Chosen& chosen) {
  std::vector<double> widths;
  for (const UnseenRun& run : report.runs) {
    if (run.width > 0 && chosen(run, report.family_of(run))) widths.push_back(run.width);
  }
  if (widths.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = widths.begin() + static_cast<std::ptrdiff_t>(widths.size() / 2);
  std::nth_element(widths.begin(), middle, widths.end());
  return *middle;
}

/// Of which something can be known.
bool fair(const UnseenFamily& f) { return !f.labels.beyond(); }

bool is(const UnseenRun& run, Certainty grade) { return run.opinion.grade == grade; }

double share(std::int64_t part, std::int64_t of) {
  return of > 0 ? static_cast<double>(part) / static_cast<double>(of) : std::numeric_limits<double>::quiet_NaN();
}

std::string percent(std::int64_t part, std::int64_t of) {
  return of > 0 ? format("%.1f", 100 * share(part, of)) + " %" : "-";
}

std::string whole(std::int64_t n) { return std::to_string(n); }

}  // namespace

const char* name_of(Certainty certainty) {
  switch (certainty) {
    case Certainty::shown:
      return "shown";
    case Certainty::likely:
      return "likely";
    default:
      return "open";
  }
}

Opinion ask(const Family& family, const Plan& plan) {
  if (family.states_end) return ask_of(Stating<StatedEnd>(family), plan);
  if (family.declares_rates && family.constant_limit)
    return ask_of(Stating<DeclaredRates, ConstantLimit>(family), plan);
  if (family.declares_rates) return ask_of(Stating<DeclaredRates>(family), plan);
  if (family.constant_limit) return ask_of(Stating<ConstantLimit>(family), plan);
  return ask_of(UnseenSequence(family), plan);
}

UnseenRun judge_run(const UnseenFamily& f, std::uint64_t seed, Opinion opinion) {
  UnseenRun run;
  run.family = f.family.index;
  run.seed = seed;
  run.opinion = std::move(opinion);
  const Opinion& o = run.opinion;
  run.wrong = o.answer == Said::yes ? !f.labels.exists : o.answer == Said::no && f.labels.exists;
  if (o.refused) return run;
  run.wrong_verdict =
      o.variance_finite == Said::yes ? !o.variance_is_finite : o.variance_finite == Said::no && o.variance_is_finite;
  run.covered = o.low <= f.labels.truth && f.labels.truth <= o.high;
  if (f.labels.exists && o.work > 0) {
    run.width = (o.high - o.low) / (2 * confident) * std::sqrt(o.work) / f.labels.root_of_price;
  }
  return run;
}

Band binomial_band(std::int64_t n, double chance) {
  using boost::math::cdf;
  using boost::math::complement;
  Band band{0, n};
  if (n <= 0) return band;
  const boost::math::binomial_distribution<double> binomial(static_cast<double>(n), chance);
  constexpr double each = 5e-7;
  while (band.low < n && cdf(binomial, static_cast<double>(band.low)) <= each) ++band.low;
  while (band.high > 0 && cdf(complement(binomial, static_cast<double>(band.high - 1))) <= each) --band.high;
  return band;
}

std::vector<Gate> gates_of(const UnseenReport& report) {
  std::vector<Gate> gates;
  // Of a count: at most that share of the runs, one at least where the share is not zero.
  const auto at_most = [&](std::string name, std::int64_t measured, std::int64_t of, double most) {
    const double bound = std::floor(most * static_cast<double>(of) + 1e-9);
    gates.push_back({std::move(name), static_cast<double>(measured),
                     "at most " + format("%.0f", bound) + " of " + whole(of), of,
                     static_cast<double>(measured) <= bound});
  };
  const auto at_least = [&](std::string name, std::int64_t measured, std::int64_t of, double least) {
    gates.push_back({std::move(name), share(measured, of), "at least " + format("%.2f", least), of,
                     of == 0 || static_cast<double>(measured) >= least * static_cast<double>(of)});
  };
  const auto total = static_cast<std::int64_t>(report.runs.size());
  const auto number = [&](const Chosen& chosen) { return count(report, chosen); };

  at_most("answers shown and wrong",
          number([](const auto& r, const auto& f) { return fair(f) && is(r, Certainty::shown) && r.wrong; }), total,
          2.0 / 800);
  at_most("answers likely and wrong",
          number([](const auto& r, const auto& f) { return fair(f) && is(r, Certainty::likely) && r.wrong; }),
          number([](const auto& r, const auto& f) { return fair(f) && is(r, Certainty::likely); }), 0.1);
  at_most("refusals of a good PMF, margin 1/2 or more", number([](const auto& r, const auto& f) {
            return fair(f) && r.opinion.refused && f.labels.exists && f.labels.margin >= 0.5;
          }),
          total, 4.0 / 800);
  at_most("exceptions that are no refusals", number([](const auto& r, const auto&) { return r.opinion.failed; }), total,
          0);
  at_most("verdicts shown and wrong", number([](const auto& r, const auto& f) {
            return fair(f) && r.opinion.variance_grade == Certainty::shown && r.wrong_verdict;
          }),
          total, 2.0 / 800);

  const auto with_interval = [](const UnseenRun& r, const UnseenFamily& f) {
    return fair(f) && f.labels.second_moments && !r.opinion.refused;
  };
  for (const Certainty grade : {Certainty::shown, Certainty::likely}) {
    const std::int64_t of = number([&](const auto& r, const auto& f) { return with_interval(r, f) && is(r, grade); });
    const std::int64_t covered =
        number([&](const auto& r, const auto& f) { return with_interval(r, f) && is(r, grade) && r.covered; });
    const Band band = binomial_band(of, 0.95);
    gates.push_back({"intervals that cover, answer " + std::string(name_of(grade)), static_cast<double>(covered),
                     whole(band.low) + " ... " + whole(band.high) + " of " + whole(of), of,
                     band.low <= covered && covered <= band.high});
  }
  at_least("intervals that cover, answer open", number([&](const auto& r, const auto& f) {
             return with_interval(r, f) && is(r, Certainty::open) && r.covered;
           }),
           number([&](const auto& r, const auto& f) { return with_interval(r, f) && is(r, Certainty::open); }), 0.9);
  at_most("intervals called reliable that miss",
          number([&](const auto& r, const auto& f) { return with_interval(r, f) && r.opinion.reliable && !r.covered; }),
          number([&](const auto& r, const auto& f) { return with_interval(r, f) && r.opinion.reliable; }), 0.07);

  const Chosen good = [](const UnseenRun&, const UnseenFamily& f) {
    return f.labels.within() && f.labels.exists && f.labels.margin >= 0.5;
  };
  const Chosen bad = [](const UnseenRun&, const UnseenFamily& f) {
    return f.labels.within() && f.labels.second_moments && f.labels.margin <= -0.5;
  };
  at_least("yes, margin 1/2 or more, features reached",
           number([&](const auto& r, const auto& f) { return good(r, f) && r.opinion.answer == Said::yes; }),
           number(good), 0.8);
  at_least("no, margin -1/2 or less, features reached",
           number([&](const auto& r, const auto& f) { return bad(r, f) && r.opinion.answer == Said::no; }), number(bad),
           0.6);
  // Power, too: where the last feature lies near the last level reached, or beyond it, no interval can be narrow and honest.
  const auto width = [&](std::string name, bool open, double most) {
    const Chosen chosen = [&](const UnseenRun& r, const UnseenFamily& f) {
      return f.labels.within() && is(r, Certainty::open) == open;
    };
    const double median = median_width(report, chosen);
    gates.push_back({std::move(name), median, "at most " + format("%.2f", most),
                     number([&](const auto& r, const auto& f) { return r.width > 0 && chosen(r, f); }),
                     !(median > most)});
  };
  width("median width over the best PMF's, answer open", true, 4);
  width("median width over the best PMF's, others", false, 1.25);
  return gates;
}

bool UnseenReport::holds() const {
  return std::all_of(gates.begin(), gates.end(), [](const Gate& gate) { return gate.holds; });
}

UnseenReport run_unseen(std::uint64_t seed, int families, int seeds, const Plan& plan) {
  if (families < 1 || seeds < 1) {
    throw std::invalid_argument("unseen: " + std::to_string(families) + " families, " + std::to_string(seeds) +
                                " seeds (at least one of each)");
  }
  const auto start = std::chrono::steady_clock::now();
  UnseenReport report;
  report.seed = seed;
  report.seeds = seeds;
  report.samples = plan.samples;
  for (int i = 0; i < families; ++i) {
    const Family family = draw_family(seed, i);
    report.families.push_back({family, labels_of(UnseenSequence(family), plan.samples)});
  }
  const auto total = static_cast<std::int64_t>(families) * seeds;
  report.runs.resize(static_cast<std::size_t>(total));

  std::atomic<std::int64_t> next{0};
  std::atomic<bool> stop{false};
  std::exception_ptr error;
  std::atomic<bool> has_error{false};
  const auto work = [&](bool is_caller) {
    for (std::int64_t i = next++; i < total && !stop; i = next++) {
      try {
        const UnseenFamily& family = report.families[static_cast<std::size_t>(i / seeds)];
        Plan one{.samples = plan.samples, .seed = static_cast<std::uint64_t>(i % seeds) + 1, .threads = 1};
        report.runs[static_cast<std::size_t>(i)] = judge_run(family, one.seed, ask(family.family, one));
        if (is_caller && plan.progress && !plan.progress(std::min(total, next.load()))) {
          throw Interrupted("unseen: interrupted");
        }
      } catch (...) {
        if (!has_error.exchange(true)) error = std::current_exception();
        stop = true;
      }
    }
  };
  {
    const unsigned all =
        plan.threads > 0 ? static_cast<unsigned>(plan.threads) : std::max(1U, std::thread::hardware_concurrency());
    std::vector<std::jthread> others;
    for (unsigned t = 1; t < all; ++t) others.emplace_back([&] { work(false); });
    work(true);
  }
  if (error) std::rethrow_exception(error);
  report.gates = gates_of(report);
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

namespace {

std::string padded(std::string text, std::size_t width) {
  if (text.size() < width) text.resize(width, ' ');
  return text;
}

void print_answers(std::ostream& out, const UnseenReport& report, const std::string& name, const Chosen& chosen) {
  const auto number = [&](const Chosen& also) {
    return count(report, [&](const UnseenRun& r, const UnseenFamily& f) { return chosen(r, f) && also(r, f); });
  };
  const std::int64_t all = number([](const auto&, const auto&) { return true; });
  if (all == 0) return;
  const auto said = [&](Said answer, Certainty grade) {
    return number([&](const auto& r, const auto&) { return r.opinion.answer == answer && is(r, grade); });
  };
  const auto given = number([](const auto& r, const auto&) { return !r.opinion.refused; });
  out << padded(name, 24) << right(whole(all), 6) << right(whole(said(Said::yes, Certainty::shown)), 7)
      << right(whole(said(Said::yes, Certainty::likely)), 8) << right(whole(said(Said::no, Certainty::shown)), 6)
      << right(whole(said(Said::no, Certainty::likely)), 8)
      << right(whole(number([](const auto& r, const auto&) { return is(r, Certainty::open); })), 6)
      << right(whole(number([](const auto& r, const auto&) { return r.wrong && is(r, Certainty::shown); })), 8)
      << right(whole(number([](const auto& r, const auto&) { return r.wrong && is(r, Certainty::likely); })), 8)
      << right(whole(number([](const auto& r, const auto&) { return r.wrong_verdict; })), 8)
      << right(whole(all - given), 8)
      << right(percent(number([](const auto& r, const auto&) { return !r.opinion.refused && r.covered; }), given), 9)
      << right(whole(number([](const auto& r, const auto&) { return r.opinion.reliable; })), 9)
      << right(format("%.2f", median_width(report, chosen)), 9) << '\n';
}

}  // namespace

std::ostream& operator<<(std::ostream& out, const UnseenReport& report) {
  out << "unseen        " << std::to_string(report.families.size()) << " families of seed "
      << std::to_string(report.seed) << ", " << std::to_string(report.seeds) << " seeds each, " << whole(report.samples)
      << " samples, " << format("%.3g", report.seconds) << " s\n\n";
  for (const Gate& gate : report.gates) {
    out << padded(gate.name, 50) << right(format("%.3g", gate.measured), 9) << "   " << padded(gate.demand, 22)
        << (gate.holds ? "holds" : "FAILS") << '\n';
  }
  out << '\n'
      << padded("", 24) << "            yes             no                  wrong\n"
      << padded("", 24)
      << "  runs  shown  likely shown  likely  open   shown  likely verdict refused   covers reliable    width\n";
  const auto table = [&](const std::string& name, const Chosen& chosen) { print_answers(out, report, name, chosen); };
  table("all", [](const auto&, const auto&) { return true; });
  table("margin 1/2 and more",
        [](const auto&, const auto& f) { return fair(f) && f.labels.exists && f.labels.margin >= 0.5; });
  table("margin between", [](const auto&, const auto& f) {
    return fair(f) && f.labels.second_moments && std::abs(f.labels.margin) < 0.5;
  });
  table("margin -1/2 and less",
        [](const auto&, const auto& f) { return fair(f) && f.labels.second_moments && f.labels.margin <= -0.5; });
  table("no E D^2", [](const auto&, const auto& f) { return !f.labels.second_moments; });
  table("features beyond", [](const auto&, const auto& f) { return !fair(f); });
  out << '\n';
  for (int kind = 0; kind < kinds; ++kind) {
    table(name_of(static_cast<Kind>(kind)),
          [&](const auto&, const auto& f) { return f.family.kind == static_cast<Kind>(kind); });
  }
  out << "\nfamily, what there is of a PMF, margin, levels reached: answers\n";
  for (const UnseenFamily& f : report.families) {
    const Labels& l = f.labels;
    const std::string state = l.beyond() ? "beyond" : (l.within() ? "" : (l.settled > 0 ? "edge" : "shallow"));
    out << padded(whole(f.family.index) + " " + name_of(f.family.kind), 16) << padded(l.exists ? "yes" : "no", 4)
        << right(format("%.2f", l.margin), 9) << right(whole(l.reached), 4) << " " << padded(state, 7)
        << f.family.description() << '\n';
    print_answers(out, report, "", [&](const UnseenRun&, const UnseenFamily& other) { return &other == &f; });
  }
  return out;
}

}  // namespace debias::validation
