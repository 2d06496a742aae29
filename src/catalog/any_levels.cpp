#include "any_levels.hpp"

#include "with_estimator.hpp"

namespace debias::catalog::detail {

template <Hooks hooks>
void AnyLevels<hooks>::carry_out(const Choice& choice, Task& task) const {
  with_estimator(*this, choice, [&task](const auto& e) { detail::carry_out(e, task); });
}

template <Hooks hooks>
LevelRuns AnyLevels<hooks>::runs() const {
  return level_runs(*this);
}

template <Hooks hooks>
LevelSums AnyLevels<hooks>::pilot(std::int64_t level, std::int64_t draws, std::uint64_t seed) const {
  LevelSums sums;
  for (std::int64_t i = 0; i < draws; ++i) {
    const Stream sample = split(Stream(seed, static_cast<std::uint64_t>(i)), Branch::pilot);
    Stream rng = split_level(sample, level);
    const auto term = difference_of(*this, level, rng);
    debias::detail::check_work(level, term.work);
    sums.add(as_scalar(term.value), term.work);
  }
  return sums;
}

// The hooks that problems have. A problem with others does not link: give them a line.
template class AnyLevels<Hooks{}>;
template class AnyLevels<Hooks{.difference_at = true}>;
template class AnyLevels<Hooks{.batches = true}>;
template class AnyLevels<Hooks{.difference_at = true, .batches = true}>;
template class AnyLevels<Hooks{.shared = true}>;
template class AnyLevels<Hooks{.shared = true, .batches = true, .batches_shared = true}>;
template class AnyLevels<Hooks{.shared = true, .batches = true, .batches_shared = true, .missed = true}>;

}  // namespace debias::catalog::detail
