#include <debias/core/ranks.hpp>

#include <algorithm>
#include <thread>
#include <utility>

#include "core/communicator.hpp"

namespace debias {
namespace {

/// A process alone: it agrees with itself, and the thread that called draws.
class OneProcess final : public detail::Communicator {
 public:
  [[nodiscard]] int size() const override { return 1; }
  [[nodiscard]] bool leads() const override { return true; }
  [[nodiscard]] int threads() const override {
    return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  }
  [[nodiscard]] bool caller_draws() const override { return true; }
  void agree(const std::string& /*text*/, const std::function<void()>& begin) override { begin(); }
  Bytes share(const std::function<Bytes()>& make) override { return make(); }
  void leave(std::exception_ptr /*failure*/) override {}
  void serve(detail::ChunkQueue& queue, const std::vector<detail::ChunkQueue::Range>& samples,
             const Caller& caller) override {
    try {
      for (const detail::ChunkQueue::Range& some : samples) queue.give(some);
    } catch (...) {  // threads wait for an end
      queue.interrupt(std::current_exception());
    }
    queue.close();
    caller.draw();
  }
  void end(detail::ChunkQueue& /*queue*/, const std::function<void()>& seal) override { seal(); }
};

const std::shared_ptr<detail::Communicator>& one_process() {
  static const std::shared_ptr<detail::Communicator> alone = std::make_shared<OneProcess>();
  return alone;
}

}  // namespace

Ranks::Ranks() : communicator_(one_process()) {}

Ranks::Ranks(std::shared_ptr<detail::Communicator> communicator) : communicator_(std::move(communicator)) {
  if (!communicator_) communicator_ = one_process();
}

int Ranks::size() const { return communicator_->size(); }

bool Ranks::leads() const { return communicator_->leads(); }

}  // namespace debias
