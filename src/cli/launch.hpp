#pragma once

// mpirun starts a program several times; what these processes are to each other.

#include <exception>

#include <debias/core/ranks.hpp>

namespace debias::cli {

/// MPI from its beginning to its end, where there is more than one rank; all but the first are silent.
class Launch {
 public:
  /// Throws std::invalid_argument where each of the processes would do the whole work: they know nothing of
  /// each other.
  Launch(int* argc, char*** argv);
  Launch(const Launch&) = delete;
  Launch& operator=(const Launch&) = delete;
  ~Launch();

  [[nodiscard]] const Ranks& ranks() const { return ranks_; }
  /// The exit code of this rank for the one that it would have alone. All ranks call it when they have ended
  /// or failed.
  int leave(int code, std::exception_ptr failure);

 private:
  Ranks ranks_;
};

}  // namespace debias::cli
