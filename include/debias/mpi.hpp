#pragma once

// debias::mpi::estimate(comm, estimator, plan): one run on all ranks of an MPI communicator.
//
// Every rank calls it with the same estimator and plan, and every rank gets the Result: the bits of
// `estimate` in one process, whatever the numbers of ranks and of threads on each (same binary, machines
// alike). Ranks take aligned groups of chunks as they go, large at first and small towards the end, since the
// work of samples has heavy tails; sums go to rank 0 as nodes of the runner's tree. Only the calling thread
// touches MPI, and does nothing else: MPI_THREAD_FUNNELED.
//
// Plan::progress and Plan::save are called on rank 0, for all ranks; who says stop there stops all. What a
// callable throws on any rank, all ranks throw: the sample with the smallest index. `threads = 0` takes the
// cores that the rank has. It fails as MPI does, by ending the job, where a rank dies: save, and go on from
// there with Plan::earlier.

#include <mpi.h>

#include <debias/core/estimate.hpp>
#include <debias/core/ranks.hpp>

namespace debias::mpi {

/// The ranks of a copy of `comm`, for Plan::ranks: whatever runs that plan runs on all of them. Collective.
/// Throws std::invalid_argument where MPI is not running, or not with the threads that it takes.
Ranks ranks_of(MPI_Comm comm);

/// As debias::estimate, of an estimator or a recipe. Throws std::invalid_argument, too, where ranks differ in
/// their plans.
template <class E>
auto estimate(MPI_Comm comm, const E& estimator, Plan plan = {}) {
  plan.ranks = ranks_of(comm);
  using debias::estimate;  // unqualified: whatever is included later, a recipe's say, is found through the plan
  return estimate(estimator, plan);
}

}  // namespace debias::mpi
