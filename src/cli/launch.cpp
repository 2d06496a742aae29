#include "launch.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <stdexcept>
#include <string>

#ifdef DEBIAS_MPI
#include <debias/mpi.hpp>
#endif

#include "../core/communicator.hpp"
#include "output.hpp"

namespace debias::cli {
namespace {

struct Launcher {
  const char* size;
  const char* rank;
};
constexpr std::array<Launcher, 3> launchers = {{{"OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"},  // Open MPI
                                                {"PMI_SIZE", "PMI_RANK"},                          // MPICH, and others
                                                {"SLURM_NTASKS", "PMIX_RANK"}}};                   // srun --mpi=pmix

// The number of ranks that a launcher says there are; all but the first are silent from here on.
int launched_ranks() {
  for (const Launcher& launcher : launchers) {
    const char* size = std::getenv(launcher.size);
    const char* rank = std::getenv(launcher.rank);
    if (size == nullptr || rank == nullptr) continue;
    if (std::atoi(rank) > 0) be_silent();
    return std::atoi(size);
  }
  return 1;
}

}  // namespace

#ifdef DEBIAS_MPI

Launch::Launch(int* argc, char*** argv) {
  const int launched = launched_ranks();
  if (launched < 2) return;
  int threads = 0;
  int ranks = 0;
  MPI_Init_thread(argc, argv, MPI_THREAD_FUNNELED, &threads);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  if (ranks == launched) {
    ranks_ = mpi::ranks_of(MPI_COMM_WORLD);
    return;
  }
  MPI_Finalize();
  throw std::invalid_argument(
      "mpirun: (of " + std::to_string(launched) +
      " processes each would do the whole work: this "
      "launcher belongs to another MPI than debias was built with); use the mpirun of that one");
}

Launch::~Launch() {
  if (ranks_.size() < 2) return;
  ranks_ = Ranks();
  MPI_Finalize();
}

#else

Launch::Launch(int*, char***) {
  const int launched = launched_ranks();
  if (launched < 2) return;
  throw std::invalid_argument("mpirun: (of " + std::to_string(launched) +
                              " processes each would do the whole work: this "
                              "debias was built without MPI); build it with MPI, or take --shard and merge");
}

Launch::~Launch() = default;

#endif

int Launch::leave(int code, std::exception_ptr failure) {
  ranks_.communicator().leave(failure);
  return ranks_.leads() ? code : 0;
}

}  // namespace debias::cli
