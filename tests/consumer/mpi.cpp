#include <iostream>

#include <debias/debias.hpp>
#include <debias/mpi.hpp>

int main(int argc, char** argv) {
  int threads = 0;
  int rank = 0;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &threads);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  {
    const auto x = [](debias::Stream& rng) {  // E X = 4/3
      const double u = rng.uniform();
      return 1 + u * u;
    };
    const auto estimator = debias::single_term(debias::reciprocal(x));  // of 1 / E X = 3/4
    const auto result = debias::mpi::estimate(MPI_COMM_WORLD, estimator, {.samples = 1'000'000, .seed = 7});
    if (rank == 0) std::cout << result;  // every rank has it
  }
  MPI_Finalize();
}
