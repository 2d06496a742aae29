#pragma once

// The processes that share the samples of a run. One is enough: every plan has ranks, and those it has unless mpi.hpp gives
// it others are this process alone.
//
// Which rank drew a sample cannot matter, so that ranks, like threads, change nothing but the time.

#include <memory>

namespace debias {

namespace detail {
class Communicator;  // src/core/communicator.hpp
}

class Ranks {
 public:
  /// This process alone.
  Ranks();
  explicit Ranks(std::shared_ptr<detail::Communicator> communicator);
  // No moves, which would leave none behind.
  Ranks(const Ranks&) = default;
  Ranks& operator=(const Ranks&) = default;
  ~Ranks() = default;

  /// How many they are.
  [[nodiscard]] int size() const;
  /// True on the one that has the last word: it saves, reports progress, and prints.
  [[nodiscard]] bool leads() const;
  /// For the runner.
  [[nodiscard]] detail::Communicator& communicator() const { return *communicator_; }

 private:
  std::shared_ptr<detail::Communicator> communicator_;
};

}  // namespace debias
