#include <debias/mpi.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <sched.h>

#include "core/chunk_queue.hpp"
#include "core/chunks.hpp"
#include "core/communicator.hpp"
#include "core/run_state_bytes.hpp"

namespace debias::mpi {
namespace {

using debias::detail::ChunkQueue;
using debias::detail::Chunks;
using Clock = std::chrono::steady_clock;
using std::chrono::microseconds;

// A rank looks for messages after these times, twice as long each time: rank 0, and one that waits for it, up
// to the second, one whose threads are busy up to the third.
constexpr microseconds shortest_pause{20};
constexpr microseconds longest_pause{1000};
constexpr microseconds longest_busy_pause{10'000};

enum Tag : int { news_tag = 1, sums_tag, order_tag };

// What a rank tells rank 0.
struct News {
  std::int64_t drawn = 0;    // samples, in all
  std::int64_t limit = 0;    // chunks that begin here or later are not wanted
  std::int64_t threads = 0;  // that want samples
  std::int64_t ended = 0;    // 1: none of them draws any more
};

// What rank 0 answers, or says of its own accord.
struct Order {
  std::int64_t first = 0;  // samples to draw; empty where there are no more
  std::int64_t last = 0;
  std::int64_t limit = 0;
  std::int64_t answers = 0;  // 1: to a rank that wants samples
  std::int64_t over = 0;     // 1: all ranks have ended
};

int size_of(std::size_t bytes) {
  if (bytes <= static_cast<std::size_t>(std::numeric_limits<int>::max())) return static_cast<int>(bytes);
  throw std::length_error("mpi: a message of " + std::to_string(bytes) + " bytes (MPI takes 2^31 - 1 at once)");
}

template <class T>
std::span<std::byte> bytes_of(T& x) {
  return std::as_writable_bytes(std::span(&x, 1));
}
template <class T>
Bytes bytes_of(const T& x) {
  const auto bytes = std::as_bytes(std::span(&x, 1));
  return {bytes.begin(), bytes.end()};
}

void send(std::span<const std::byte> bytes, int rank, Tag tag, MPI_Comm comm) {
  MPI_Send(bytes.data(), size_of(bytes.size()), MPI_BYTE, rank, tag, comm);
}

void receive(std::span<std::byte> bytes, int rank, Tag tag, MPI_Comm comm) {
  MPI_Recv(bytes.data(), size_of(bytes.size()), MPI_BYTE, rank, tag, comm, MPI_STATUS_IGNORE);
}

// The next message is of any size.
Bytes receive(int rank, Tag tag, MPI_Comm comm) {
  MPI_Status status;
  int size = 0;
  MPI_Probe(rank, tag, comm, &status);
  MPI_Get_count(&status, MPI_BYTE, &size);
  Bytes bytes(static_cast<std::size_t>(size));
  receive(std::span(bytes), rank, tag, comm);
  return bytes;
}

void broadcast(Bytes& bytes, int from, MPI_Comm comm) {
  std::int64_t size = size_of(bytes.size());
  MPI_Bcast(&size, 1, MPI_INT64_T, from, comm);
  bytes.resize(static_cast<std::size_t>(size));
  MPI_Bcast(bytes.data(), static_cast<int>(size), MPI_BYTE, from, comm);
}

Bytes bytes_of_text(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

std::string text_of_bytes(std::span<const std::byte> bytes) {
  std::string text(bytes.size(), ' ');
  std::transform(bytes.begin(), bytes.end(), text.begin(), [](std::byte b) { return static_cast<char>(b); });
  return text;
}

// A message that does not wait for its receiver, and does not begin before the last one has left.
class Outbox {
 public:
  Outbox(Tag tag, MPI_Comm comm) : tag_(tag), comm_(comm) {}
  Outbox(const Outbox&) = delete;
  Outbox& operator=(const Outbox&) = delete;
  ~Outbox() { MPI_Wait(&request_, MPI_STATUS_IGNORE); }

  [[nodiscard]] bool free() {
    int done = 0;
    MPI_Test(&request_, &done, MPI_STATUS_IGNORE);
    return done != 0;
  }
  void send(Bytes bytes) {
    bytes_ = std::move(bytes);
    MPI_Isend(bytes_.data(), size_of(bytes_.size()), MPI_BYTE, 0, tag_, comm_, &request_);
  }

 private:
  Bytes bytes_;
  MPI_Request request_ = MPI_REQUEST_NULL;
  Tag tag_;
  MPI_Comm comm_;
};

// An exception on its way to the other ranks: a letter for its kind, and its text.
Bytes pack(const std::exception_ptr& failure) {
  try {
    std::rethrow_exception(failure);
  } catch (const Interrupted& e) {
    return bytes_of_text(std::string("i") + e.what());
  } catch (const std::logic_error& e) {
    return bytes_of_text(std::string("l") + e.what());
  } catch (const std::exception& e) {
    return bytes_of_text(std::string("r") + e.what());
  } catch (...) {
    return bytes_of_text("?");
  }
}

std::exception_ptr unpack(std::span<const std::byte> bytes) {
  const std::string text = text_of_bytes(bytes.subspan(1));
  switch (static_cast<char>(bytes[0])) {
    case 'i':
      return std::make_exception_ptr(Interrupted(text));
    case 'l':
      return std::make_exception_ptr(std::invalid_argument(text));
    case 'r':
      return std::make_exception_ptr(std::runtime_error(text));
    default:
      return std::make_exception_ptr(0);
  }
}

class MpiRanks final : public debias::detail::Communicator {
 public:
  explicit MpiRanks(MPI_Comm comm);
  MpiRanks(const MpiRanks&) = delete;
  MpiRanks& operator=(const MpiRanks&) = delete;
  ~MpiRanks() override {
    int finalized = 0;
    MPI_Finalized(&finalized);
    if (finalized != 0) return;
    MPI_Comm_free(&comm_);
    MPI_Comm_free(&tree_);
  }

  [[nodiscard]] int size() const override { return size_; }
  [[nodiscard]] bool leads() const override { return rank_ == 0; }
  [[nodiscard]] int threads() const override { return threads_; }
  [[nodiscard]] bool caller_draws() const override { return false; }
  void agree(const std::string& text, const std::function<void()>& begin) override;
  Bytes share(const std::function<Bytes()>& make) override;
  void leave(std::exception_ptr failure) override;
  void serve(ChunkQueue& queue, const std::vector<ChunkQueue::Range>& samples, const Caller& caller) override;
  void end(ChunkQueue& queue, const std::function<void()>& seal) override;

 private:
  class Server;
  bool meet(const std::string& text, std::exception_ptr failure, bool leaves);
  void exchange(ChunkQueue& queue, const std::vector<ChunkQueue::Range>& samples, bool wants_sums,
                const Caller& caller);
  void gather(ChunkQueue& queue, const std::function<void()>& seal);
  template <class F>
  void or_abort(const F& f) const;

  MPI_Comm comm_ = MPI_COMM_NULL;
  MPI_Comm tree_ = MPI_COMM_NULL;  // for sums at the end, which some ranks send while others still listen to all
  int rank_ = 0;
  int size_ = 1;
  int threads_ = 1;
};

MpiRanks::MpiRanks(MPI_Comm comm) {
  const auto refuse = [](const std::string& why) { throw std::invalid_argument("mpi: " + why); };
  int running = 0;
  int ended = 0;
  MPI_Initialized(&running);
  MPI_Finalized(&ended);
  if (running == 0 || ended != 0) refuse("MPI is not running; call MPI_Init_thread before, and MPI_Finalize after");
  if (comm == MPI_COMM_NULL) refuse("comm = MPI_COMM_NULL (has no ranks); leave out those that have no part");
  int level = MPI_THREAD_SINGLE;
  int is_main = 0;
  MPI_Query_thread(&level);
  MPI_Is_thread_main(&is_main);
  if (level < (is_main != 0 ? MPI_THREAD_FUNNELED : MPI_THREAD_SERIALIZED)) {
    refuse(
        "MPI was started without threads; call MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, "
        "&provided)");
  }
  MPI_Comm_dup(comm, &comm_);
  MPI_Comm_dup(comm, &tree_);
  MPI_Comm_rank(comm_, &rank_);
  MPI_Comm_size(comm_, &size_);
  MPI_Comm local = MPI_COMM_NULL;
  int neighbours = 1;
  MPI_Comm_split_type(comm_, MPI_COMM_TYPE_SHARED, rank_, MPI_INFO_NULL, &local);
  MPI_Comm_size(local, &neighbours);
  MPI_Comm_free(&local);
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  cpu_set_t bound;
  const int mine = sched_getaffinity(0, sizeof bound, &bound) == 0 ? CPU_COUNT(&bound) : cores;
  threads_ = std::max(1, std::min(mine, cores / neighbours));
}

// One round in which all ranks take part, wherever they are: false where all leave; throws the failure of the
// first that has one.
bool MpiRanks::meet(const std::string& text, std::exception_ptr failure, bool leaves) {
  Bytes first = bytes_of_text(text);
  broadcast(first, 0, comm_);
  if (leaves && !failure) {
    failure = std::make_exception_ptr(std::logic_error("mpi: a rank has left, and others go on"));
  }
  if (!failure && text_of_bytes(first) != text) {
    failure = std::make_exception_ptr(
        std::invalid_argument("mpi: ranks differ in what they run (they must all give the same estimator and plan)"));
  }
  std::array<int, 2> votes = {failure ? rank_ : size_, leaves ? 0 : 1};
  MPI_Allreduce(MPI_IN_PLACE, &votes[0], 1, MPI_INT, MPI_MIN, comm_);
  MPI_Allreduce(MPI_IN_PLACE, &votes[1], 1, MPI_INT, MPI_MAX, comm_);
  if (votes[1] == 0) return false;
  if (votes[0] == size_) return true;
  Bytes reason;
  if (votes[0] == rank_) reason = pack(failure);
  broadcast(reason, votes[0], comm_);
  std::rethrow_exception(failure ? failure : unpack(reason));
}

void MpiRanks::agree(const std::string& text, const std::function<void()>& begin) {
  std::exception_ptr failure;
  try {
    begin();
  } catch (...) {
    failure = std::current_exception();
  }
  meet(text, failure, false);
}

Bytes MpiRanks::share(const std::function<Bytes()>& make) {
  Bytes bytes;
  agree("share", [&] {
    if (leads()) bytes = make();
  });
  broadcast(bytes, 0, comm_);
  return bytes;
}

void MpiRanks::leave(std::exception_ptr failure) {
  for (bool others_stay = true; others_stay;) {
    try {
      others_stay = meet("leave", failure, true);
    } catch (...) {
      // It is what the others have to say, or a failure that has been said.
    }
  }
}

// Rank 0's view of all: who gets which samples, and when all is over.
class MpiRanks::Server {
 public:
  Server(const std::vector<ChunkQueue::Range>& samples, std::int64_t chunk, int ranks,
         std::function<void(int, const Order&)> tell)
      : samples_(chunk), drawn_(static_cast<std::size_t>(ranks)), tell_(std::move(tell)) {
    for (const ChunkQueue::Range& some : samples) samples_.give(some);
  }

  void hear(int rank, const News& news) {
    std::int64_t& drawn = drawn_[static_cast<std::size_t>(rank)];
    all_drawn_ += news.drawn - drawn;
    drawn = news.drawn;
    const auto ranks = static_cast<int>(drawn_.size());
    if (news.limit < limit_) {
      limit_ = news.limit;
      for (int r = 0; r < ranks; ++r) tell_(r, {.limit = limit_});
    }
    if (news.threads > 0) {
      const bool more = limit_ == ChunkQueue::no_index;  // all that may hold a smaller index has been handed out
      const auto [first, last] = more ? samples_.take_share(ranks, news.threads) : ChunkQueue::Range{0, 0};
      tell_(rank, {.first = first, .last = last, .limit = limit_, .answers = 1});
    }
    if (news.ended != 0 && ++ended_ == ranks) {
      for (int r = 0; r < ranks; ++r) tell_(r, {.limit = limit_, .over = 1});
    }
  }
  [[nodiscard]] std::int64_t drawn() const { return all_drawn_; }

 private:
  Chunks samples_;
  std::vector<std::int64_t> drawn_;  // by rank
  std::int64_t all_drawn_ = 0;
  std::int64_t limit_ = ChunkQueue::no_index;
  int ended_ = 0;
  std::function<void(int, const Order&)> tell_;
};

// Where ranks wait for each other, one that cannot go on (no memory, a message too long) ends the job.
template <class F>
void MpiRanks::or_abort(const F& f) const {
  try {
    f();
  } catch (const std::exception& e) {
    std::fputs(("debias: rank " + std::to_string(rank_) + " cannot go on: " + e.what() + "\n").c_str(), stderr);
    MPI_Abort(comm_, 1);
  }
}

void MpiRanks::serve(ChunkQueue& queue, const std::vector<ChunkQueue::Range>& samples, const Caller& caller) {
  int wants_sums = caller.saves ? 1 : 0;
  MPI_Bcast(&wants_sums, 1, MPI_INT, 0, comm_);
  or_abort([&] { exchange(queue, samples, wants_sums != 0, caller); });
}

void MpiRanks::exchange(ChunkQueue& queue, const std::vector<ChunkQueue::Range>& samples, bool wants_sums,
                        const Caller& caller) {
  const int threads = queue.look().threads;

  bool waits = false;  // for samples that it asked for
  bool over = false;
  const auto obey = [&](const Order& order) {
    queue.stop_at(order.limit);
    over = over || order.over != 0;
    if (order.answers == 0) return;
    waits = false;
    order.first < order.last ? queue.give({order.first, order.last}) : queue.close();
  };
  std::optional<Server> server;
  if (leads()) {
    server.emplace(samples, queue.state.chunk(), size_, [&](int rank, Order order) {
      rank == 0 ? obey(order) : send(bytes_of(order), rank, order_tag, comm_);
    });
  }
  Outbox news_box(news_tag, comm_);
  Outbox sums_box(sums_tag, comm_);
  const auto receive_all = [&] {
    for (bool any = false;; any = true) {
      int there = 0;
      MPI_Status status;
      MPI_Iprobe(MPI_ANY_SOURCE, MPI_ANY_TAG, comm_, &there, &status);
      if (there == 0) return any;
      if (status.MPI_TAG == news_tag) {
        News news;
        receive(bytes_of(news), status.MPI_SOURCE, news_tag, comm_);
        server->hear(status.MPI_SOURCE, news);
      } else if (status.MPI_TAG == sums_tag) {
        queue.merge(decode(receive(status.MPI_SOURCE, sums_tag, comm_), false));
      } else {
        Order order;
        receive(bytes_of(order), 0, order_tag, comm_);
        obey(order);
      }
    }
  };

  // The more ranks, the less often rank 0 hears of each: at most 4000 reports, and a hundred sums, a second.
  const std::chrono::milliseconds report_interval(std::max(250, size_ / 4));
  const std::chrono::milliseconds sums_interval(std::max(1000, 10 * size_));
  auto next_report = Clock::now() + report_interval;
  auto next_sums = Clock::now() + sums_interval;
  std::int64_t limit = ChunkQueue::no_index;
  bool ended = false;
  microseconds pause = shortest_pause;
  while (!over) {
    const auto now = Clock::now();
    const auto look = queue.look();
    const News news{.drawn = look.drawn,
                    .limit = look.limit,
                    .threads = look.hungry && !waits ? threads : 0,
                    .ended = look.threads == 0 && !ended ? 1 : 0};
    const bool urgent = news.threads > 0 || news.limit < limit || news.ended != 0;
    // The next run must not hear what comes behind the end of this one.
    if ((urgent || now >= next_report) && (leads() || (!ended && news_box.free()))) {
      waits = waits || news.threads > 0;
      limit = news.limit;
      ended = ended || news.ended != 0;
      next_report = now + report_interval;
      leads() ? server->hear(0, news) : news_box.send(bytes_of(news));
    }
    const bool heard = receive_all();
    if (!leads() && wants_sums && !ended && now >= next_sums && sums_box.free()) {
      next_sums = now + sums_interval;
      sums_box.send(encode(queue.take_finished()));
    }
    if (leads() && limit != 0) {
      try {
        caller.tell(server->drawn());
      } catch (...) {
        queue.interrupt(std::current_exception());
        continue;  // and says so
      }
    }
    const bool busy = !leads() && !waits && !ended;
    pause = urgent || heard ? shortest_pause : std::min(2 * pause, busy ? longest_busy_pause : longest_pause);
    if (!over) queue.wait(pause);
  }
}

void MpiRanks::end(ChunkQueue& queue, const std::function<void()>& seal) {
  or_abort([&] { gather(queue, seal); });
}

void MpiRanks::gather(ChunkQueue& queue, const std::function<void()>& seal) {
  // Sums go up a binomial tree.
  for (int step = 1; step < size_; step *= 2) {
    if ((rank_ & step) != 0) {
      send(encode(queue.take_finished()), rank_ - step, sums_tag, tree_);
      break;
    }
    if (rank_ + step < size_) queue.merge(decode(receive(rank_ + step, sums_tag, tree_), false));
  }
  if (leads()) {
    try {
      seal();
    } catch (...) {
      queue.interrupt(std::current_exception());
    }
  }
  // The failure that counts: the sample with the smallest index, else what another reason there is.
  struct {
    long index;
    int rank;
  } first{queue.failed_index, rank_};
  if (queue.failed_index == ChunkQueue::no_index && queue.failure) --first.index;
  static_assert(sizeof first.index == sizeof queue.failed_index);
  MPI_Allreduce(MPI_IN_PLACE, &first, 1, MPI_LONG_INT, MPI_MINLOC, comm_);
  if (first.index == ChunkQueue::no_index) {
    Bytes sums;
    if (leads()) sums = encode(queue.state);
    broadcast(sums, 0, comm_);
    if (!leads()) queue.state = decode(sums);
    return;
  }
  Bytes failure;
  if (first.rank == rank_) failure = pack(queue.failure);
  broadcast(failure, first.rank, comm_);
  if (first.rank == rank_) return;
  queue.failure = unpack(failure);
  queue.failed_index = first.index == ChunkQueue::no_index - 1 ? ChunkQueue::no_index : first.index;
}

}  // namespace

Ranks ranks_of(MPI_Comm comm) { return Ranks(std::make_shared<MpiRanks>(comm)); }

}  // namespace debias::mpi
