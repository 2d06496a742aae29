#pragma once

// The judge judged: what a recipe says of problems that nobody has met (families.hpp), beside what is true of them.
//
//   each family x seed:  estimate(recipe(sequence), {.samples = N, .seed}) -> answer, grade, interval, or a refusal
//   answer   yes, no or open to "is there a PMF with finite variance and finite work?", after the run; grade shown, likely
//            or open. A run whose variance is called finite is a yes, since its work is.
//   verdict  on the variance of the run, beside its closed form under the PMF that was chosen
//
// Wrong: a yes where there is no such PMF, a no where there is one. Families of which no more than one level that is reached
// shows the last feature ("beyond") are a table of their own: nobody can know. So are those without E D^2, except that a
// yes to them is wrong. Widths are compared at equal work, half-width / (1.96 sqrt(price / work of the run)), where four levels
// beyond the last feature are reached, like the shares of yes and no.
// Runs share nothing, so results are the same for any number of threads.

#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

#include <debias/core/result.hpp>

#include "families.hpp"

namespace debias::validation {

enum class Said { yes, no, open };
enum class Certainty { shown, likely, open };
/// "shown", "likely", "open".
const char* name_of(Certainty certainty);

/// What the library says of one problem.
struct Opinion {
  Said answer = Said::open;
  Certainty grade = Certainty::open;  ///< open iff the answer is
  bool refused = false;               ///< there is no estimate
  bool failed = false;                ///< by another exception than a no, or that levels do not fit 64 bits: a defect
  std::string refusal = {};
  Said variance_finite = Said::open;  ///< of the run
  Certainty variance_grade = Certainty::open;
  bool variance_is_finite = true;  ///< in truth, under the PMF that was chosen
  double mean = 0;
  double low = 0;
  double high = 0;
  bool reliable = false;  ///< said of the interval
  double work = 0;        ///< of the run, without its pilot
  double pilot_work = 0;
  std::int64_t deepest = 0;  ///< level with a draw, of pilot or run
};

struct UnseenRun {
  int family = 0;
  std::uint64_t seed = 0;
  Opinion opinion;
  bool covered = false;
  bool wrong = false;          ///< the answer
  bool wrong_verdict = false;  ///< on the variance
  double width = 0;            ///< in that of the best PMF at equal work; 0: no estimate, or no such PMF
};

struct UnseenFamily {
  Family family;
  Labels labels;
};

/// A number that must be kept; `demand` says how.
struct Gate {
  std::string name;
  double measured = 0;
  std::string demand;
  std::int64_t of = 0;  ///< runs that it is from
  bool holds = true;
};

struct UnseenReport {
  std::uint64_t seed = 0;
  int seeds = 0;
  std::int64_t samples = 0;
  double seconds = 0;
  std::vector<UnseenFamily> families;
  std::vector<UnseenRun> runs;  ///< by family, then by seed
  std::vector<Gate> gates;

  [[nodiscard]] bool holds() const;
  [[nodiscard]] const UnseenFamily& family_of(const UnseenRun& run) const {
    return families[static_cast<std::size_t>(run.family)];
  }
};

/// The opinion of the library as it is on a family: the one place that knows how it answers.
Opinion ask(const Family& family, const Plan& plan);

/// Judged against the labels.
UnseenRun judge_run(const UnseenFamily& family, std::uint64_t seed, Opinion opinion);

/// What the runs must show.
std::vector<Gate> gates_of(const UnseenReport& report);

/// The smallest and the largest number of successes that n trials give, but for 1e-6 in all.
struct Band {
  std::int64_t low = 0;
  std::int64_t high = 0;
};
Band binomial_band(std::int64_t n, double chance);

/// Families 0 ... families - 1 of the seed, seeds 1 ... seeds of each, plan.samples members. `plan.threads` runs at once;
/// `plan.progress` sees the number of finished runs (Interrupted).
UnseenReport run_unseen(std::uint64_t seed, int families = 40, int seeds = 20, const Plan& plan = {});

/// Gates, answers by grade and by kind, families beyond what can be seen, and every family in a line.
std::ostream& operator<<(std::ostream& out, const UnseenReport& report);

}  // namespace debias::validation
