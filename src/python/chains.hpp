#pragma once

// Coupled chains whose kernels are Python functions: all chains of a block take their steps together.
//
// In a first pass over the samples each leaves its stream here; then one call runs all their chains; then the samples that count
// read what came of them, in the same order. Formula and estimator: debias/chains/coupled_chain.hpp.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include <debias/chains.hpp>
#include <debias/core/stream.hpp>

#include "problem.hpp"

namespace debias::python {

/// The random numbers of the chains of a block, each from its own stream.
class StreamBlock {
 public:
  explicit StreamBlock(std::vector<Stream> streams) : streams_(std::move(streams)) {}
  [[nodiscard]] std::size_t size() const { return streams_.size(); }
  /// The next `width` uniforms of each of `rows`. Throws std::out_of_range for a row that is none.
  void uniforms(std::span<const std::int64_t> rows, std::size_t width, std::span<double> out);

 private:
  std::vector<Stream> streams_;
};

/// What came of a pair of chains, as a row of numbers: the sum of f over X_k ... X_m, the sum of the weighted differences
/// (`components` each), and then these.
enum class ChainColumn : std::uint8_t { corrected, cut, meeting, steps, behind, count };

/// Runs of blocks of chains.
class ChainBlocks {
 public:
  using Run = std::function<std::vector<double>(StreamBlock streams, const ChainOptions& options)>;

  ChainBlocks(Run run, std::size_t components, ChainOptions options)
      : run_(std::move(run)),
        width_(2 * components + static_cast<std::size_t>(ChainColumn::count)),
        options_(std::move(options)) {}

  [[nodiscard]] bool collecting() const { return collecting_; }
  [[nodiscard]] const ChainOptions& options() const { return options_; }
  [[nodiscard]] std::size_t width() const { return width_; }
  /// Samples of a run at once: some seconds of cheap steps, so that a run knows its time and answers Ctrl-C.
  [[nodiscard]] std::int64_t ahead() const {
    constexpr std::int64_t steps = 1 << 24;
    return std::max(default_chunk, steps / (std::max(options_.length, options_.lag) + 64));
  }

  void ask(const Stream& rng) { asked_.emplace_back(rng); }
  std::span<const double> next();
  void collect_queries(const std::function<void()>& draws);
  /// Rows of these streams, at once.
  std::vector<double> rows_of(std::vector<Stream> streams, const ChainOptions& options) const;

 private:
  Run run_;
  std::size_t width_;
  ChainOptions options_;
  std::vector<Stream> asked_;
  std::vector<double> answers_;
  std::size_t read_ = 0;
  bool collecting_ = false;
};

/// A problem with the one method coupled_chain. `components` numbers of f; 0: of a number that is no array.
/// Throws std::invalid_argument for options that no chain has.
UserProblem coupled_chain_problem(const Facts& facts, std::shared_ptr<ChainBlocks> blocks, std::size_t components);

/// As debias::advise: the pilot has the streams that it would have in C++.
ChainAdvice advise_chains(const ChainBlocks& blocks, const ChainAdviceOptions& options);

}  // namespace debias::python
