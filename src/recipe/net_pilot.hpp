#pragma once

// The pilot's nets: V_k(N) of some levels, and the blocks that they ask for.
//
// R = 12 nets a level, each level about the same work, give V_k(2^j) for every j at once (survey/levels.hpp). Deeper levels fall
// from the last measured one as the posterior says, no faster than the decay that the tail is made for. A run has 32 blocks or
// more, four times their kurtosis at least, of at least 1000 draws of the base in work each, since Student's interval takes their
// means for normal ones (coverage: the [long] cases of tests/recipe/nets_test.cpp). Their number is fixed here and the run is
// drawn afresh: blocks added until the error is small would stop on a lucky one.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include <debias/recipe.hpp>
#include <debias/recipe/nets.hpp>

namespace debias {

class NetPilot {
 public:
  static constexpr std::int64_t nets = 12;
  static constexpr double fewest_blocks = 32;

  /// `unit` is the work of a draw of the lowest level.
  NetPilot(const LevelRuns& runs, const Plan& plan, const RecipeOptions& options, double unit)
      : runs_(runs), plan_(plan), options_(options), unit_(unit) {}

  /// What a run of nets would be.
  struct Found {
    std::int64_t base_level = 0;
    NetBlock block;
    double theta = 1;
    double blocks = 0;
    /// Of the work of plain numbers for the same error, as predicted.
    double share = 0;
    double run_work = 0;
  };

  /// Measures with about so much work, and chooses for the goal of the plan, or for its samples. `plain` is the choice for plain
  /// numbers, `model` that of its levels. Nothing where no run of nets was found: `why` then says why.
  std::optional<Found> choose(double work, const Plan& plan, const Advice& plain, const LevelModel& model,
                              double seconds_left);
  [[nodiscard]] const std::string& why() const { return why_; }
  /// Of all nets so far.
  [[nodiscard]] double work() const { return work_; }
  [[nodiscard]] std::int64_t last_level() const { return last_level_; }

  /// The least work that tells anything of a base and two differences.
  [[nodiscard]] double least_work(std::int64_t base_level) const;

 private:
  struct Levels;
  const NetMoments* measured(std::int64_t level, bool as_base, double work);
  /// `decay` of E D_k^2 beyond the levels that nets show.
  std::optional<Levels> levels_of(std::int64_t base_level, double work, const Survey& survey, const LevelModel& model,
                                  double decay);
  std::optional<Found> from(std::int64_t base_level, double work, const Plan& plan, const Advice& plain,
                            const LevelModel& model, double seconds_left);

  const LevelRuns& runs_;
  const Plan& plan_;
  const RecipeOptions& options_;
  double unit_;
  double work_ = 0;
  double seconds_ = 0;
  std::int64_t last_level_ = -1;
  std::optional<std::int64_t> settled_;  // base level
  std::map<std::pair<std::int64_t, bool>, NetMoments> known_;
  std::string why_;
};

}  // namespace debias
