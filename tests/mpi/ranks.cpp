// debias::mpi::estimate as a user calls it, under mpirun: every rank checks what it got against one process.
//   mpirun -n R debias_ranks

#include <complex>
#include <cstdint>
#include <functional>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>

#include <debias/debias.hpp>
#include <debias/mpi.hpp>

#include "catalog.hpp"

using namespace debias;

namespace {

int failures = 0;
int rank = 0;
int ranks = 1;

void check(bool holds, const std::string& what) {
  if (holds) return;
  ++failures;
  std::cerr << "FAILED on rank " << rank << " of " << ranks << ": " << what << "\n";
}

double draw(Stream& rng) { return rng.uniform() * rng.normal(); }

bool same(const Statistics& a, const Statistics& b) {
  return a.components[0].mean == b.components[0].mean && a.moments.m2 == b.moments.m2 && a.moments.m4 == b.moments.m4 &&
         a.work - a.pilot_work == b.work - b.pilot_work && a.samples == b.samples && a.upper_tail == b.upper_tail &&
         a.lower_tail == b.lower_tail && a.largest == b.largest && a.nonfinite == b.nonfinite &&
         a.first_nonfinite == b.first_nonfinite;
}

// What is thrown, as text.
template <class Error>
std::string thrown_by(const std::function<void()>& f) {
  try {
    f();
  } catch (const Error& e) {
    return e.what();
  } catch (...) {
    return "another exception";
  }
  return "nothing";
}

void bits() {
  const auto by = [](catalog::Method method, std::int64_t block) {
    return catalog::Choice{.method = method, .pmf = AnyPmf(Geometric(0.6)), .block = block};
  };
  const catalog::Choice meeting{.special = "coupled_chain"};
  const std::pair<const char*, catalog::Choice> problems[] = {{"A03", by(catalog::Method::single_term, 1)},
                                                              {"D01", by(catalog::Method::roulette, 1)},
                                                              {"E02", by(catalog::Method::single_term_outcome, 64)},
                                                              {"K01", meeting},
                                                              {"K04", meeting}};
  for (const auto& [name, choice] : problems) {
    for (const std::int64_t n : {1000, 4096, 4097, 100'000, 1'000'000}) {
      if (n * choice.block > (choice.special.empty() ? 1'000'000 : 4097)) continue;  // chains take hundreds of steps
      const std::int64_t samples = n * choice.block;
      const catalog::Problem& problem = catalog::find(name);
      Plan plan{.samples = samples, .seed = 4};
      const Statistics alone = problem.run(choice, plan);
      plan.ranks = mpi::ranks_of(MPI_COMM_WORLD);
      check(same(problem.run(choice, plan), alone), std::string(name) + " at " + std::to_string(n));
    }
  }
  for (const std::int64_t n : {1, 513}) {
    for (const std::int64_t first : {0, 300}) {
      for (const int threads : {1, 3}) {
        const Plan plan{.samples = n, .seed = 5, .first = first, .threads = threads};
        check(same(mpi::estimate(MPI_COMM_WORLD, draw, plan), estimate(draw, plan)), "bits of " + std::to_string(n));
      }
    }
  }
  const auto some_infinite = [](Stream& rng) { return rng.uniform() < 1e-3 ? 1 / 0.0 : 1.0; };
  const Plan plan{.samples = 50'000, .seed = 2};
  const auto with_infinities = mpi::estimate(MPI_COMM_WORLD, some_infinite, plan);
  check(with_infinities.first_nonfinite == estimate(some_infinite, plan).first_nonfinite,
        "first sample that is infinite");
  const auto vectors = [](Stream& rng) { return Sample<std::complex<double>>{{rng.normal(), rng.uniform()}, 1, 0}; };
  check(mpi::estimate(MPI_COMM_WORLD, vectors, plan).mean == estimate(vectors, plan).mean, "two components");
}

void goals() {
  const Plan plan{.seed = 5, .goal = {.error = 1e-3}};
  const auto by_error = mpi::estimate(MPI_COMM_WORLD, draw, plan);
  const auto alone = estimate(draw, plan);
  check(same(by_error, alone), "bits of a goal");
  check(by_error.work == alone.work && by_error.pilot_work > 0, "work of its pilot");
  auto by_time = mpi::estimate(MPI_COMM_WORLD, draw, {.seed = 5, .goal = {.seconds = 0.3}});
  std::int64_t samples = by_time.samples;
  MPI_Bcast(&samples, 1, MPI_INT64_T, 0, MPI_COMM_WORLD);
  check(samples == by_time.samples, "samples of a time");
  check(by_time.seconds < 3, "the time itself");
  const auto more = extend(draw, by_error, {.goal = {.error = 5e-4}, .ranks = mpi::ranks_of(MPI_COMM_WORLD)});
  check(same(more, estimate(draw, {.seed = 5, .goal = {.error = 5e-4}})), "bits of more samples");
}

void failing() {
  for (const std::uint64_t rare : {std::uint64_t{0}, std::uint64_t{1000}, std::uint64_t{30'000}}) {
    const auto throws = [=](Stream& rng) {
      if (rng.index() >= rare && rng.index() % 7777 >= 7700)
        throw std::domain_error("sample " + std::to_string(rng.index()));
      return rng.uniform();
    };
    const Plan plan{.samples = 200'000, .threads = 2};
    const auto alone = thrown_by<SampleError>([&] { estimate(throws, plan); });
    const auto together = thrown_by<SampleError>([&] { mpi::estimate(MPI_COMM_WORLD, throws, plan); });
    check(alone == together, "'" + together + "' is not '" + alone + "'");
  }
  const auto odd = [](Stream& rng) -> double { throw static_cast<int>(rng.index()); };
  check(thrown_by<SampleError>([&] { mpi::estimate(MPI_COMM_WORLD, odd); }).find("sample 0 of seed 1") == 0,
        "an odd exception");
  const auto none = thrown_by<std::invalid_argument>([&] { mpi::estimate(MPI_COMM_WORLD, draw, {.samples = 0}); });
  check(none.find("samples = 0") != std::string::npos, "no samples: " + none);
  if (ranks == 1) return;
  const auto differ = [&](const Plan& plan) {
    return thrown_by<std::invalid_argument>([&] { mpi::estimate(MPI_COMM_WORLD, draw, plan); });
  };
  check(differ({.seed = static_cast<std::uint64_t>(rank)}).find("differ") != std::string::npos, "other seeds");
  check(differ({.samples = rank + 10}).find("differ") != std::string::npos, "other samples");
  check(differ({.samples = rank == 1 ? 0 : 10}).find("samples = 0") != std::string::npos, "one bad plan");
}

void interrupted() {
  std::int64_t most = 0;
  Plan plan{.samples = std::int64_t{1} << 40};
  plan.progress = [&](std::int64_t drawn) {
    most = drawn;
    return drawn < 100'000;
  };
  check(thrown_by<Interrupted>([&] { mpi::estimate(MPI_COMM_WORLD, draw, plan); }).find("interrupted") !=
            std::string::npos,
        "an interrupt");
  check(rank != 0 || most >= 100'000, "progress");
  plan.progress = [&](std::int64_t) -> bool { throw std::runtime_error("no progress"); };
  check(thrown_by<std::runtime_error>([&] { mpi::estimate(MPI_COMM_WORLD, draw, plan); }) == "no progress",
        "what progress throws");
  plan.progress = {};
  plan.samples = 1000;
  plan.save = [&](const RunState&, const Plan&) { throw std::runtime_error("no disk"); };
  check(thrown_by<std::runtime_error>([&] { mpi::estimate(MPI_COMM_WORLD, draw, plan); }) == "no disk",
        "what save throws");
}

// Rank 0 saves, all are stopped, and all go on from what it saved.
void resumed() {
  RunState saved;
  Plan plan{.samples = std::int64_t{1} << 40, .seed = 3};
  std::int64_t others = 0;
  plan.save = [&](const RunState& finished, const Plan&) {
    saved = finished;
    others = finished.total().moments.count;
  };
  plan.progress = [&](std::int64_t) { return others == 0; };
  thrown_by<Interrupted>([&] { mpi::estimate(MPI_COMM_WORLD, draw, plan); });
  check(rank != 0 || (others > 0 && others < plan.samples), "sums of a part");
  // `earlier` is part of the plan, and so the same on all ranks; a user would broadcast the file.
  const auto part = mpi::estimate(MPI_COMM_WORLD, draw, {.samples = 50'000, .seed = 3});
  plan = {.samples = 150'001, .seed = 3, .earlier = std::make_shared<RunState>(part.state)};
  check(same(mpi::estimate(MPI_COMM_WORLD, draw, plan), estimate(draw, {.samples = 150'001, .seed = 3})),
        "an earlier part");
}

}  // namespace

int main(int argc, char** argv) {
  std::string early = thrown_by<std::invalid_argument>([] { mpi::estimate(MPI_COMM_WORLD, draw); });
  int threads = 0;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &threads);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  check(early.find("MPI_Init_thread") != std::string::npos, "before MPI runs: " + early);
  bits();
  goals();
  failing();
  interrupted();
  resumed();
  MPI_Allreduce(MPI_IN_PLACE, &failures, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
  if (rank == 0) std::cout << failures << " failures on " << ranks << " ranks\n";
  MPI_Finalize();
  return failures > 0 ? 1 : 0;
}
