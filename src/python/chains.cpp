#include "chains.hpp"

#include <algorithm>
#include <string>

#include <Eigen/Core>

#include "user_runs.hpp"

namespace debias::python {
namespace {

template <Value V>
class BlockChain {
 public:
  BlockChain(std::shared_ptr<ChainBlocks> blocks, std::size_t components)
      : blocks_(std::move(blocks)), components_(components) {}

  template <Record R>
  Sample<V> operator()(Stream& rng, R& record) const {
    if (blocks_->collecting()) {
      blocks_->ask(rng);
      return {value_of({}, 0), 1, 0};
    }
    const ChainOptions& o = blocks_->options();
    const std::span<const double> row = blocks_->next();
    const auto column = [&](ChainColumn c) { return row[2 * components_ + static_cast<std::size_t>(c)]; };
    const double share = 1 / static_cast<double>(o.length - o.burn_in + 1);
    const double steps = column(ChainColumn::steps);
    const double work = steps + column(ChainColumn::behind);
    const double base_work = std::min(static_cast<double>(o.length), steps);
    const std::int64_t level = column(ChainColumn::cut) != 0 ? debias::detail::level_of_cut(o.limit)
                                                             : static_cast<std::int64_t>(column(ChainColumn::meeting));
    V value = value_of(row.first(components_), share);
    record.base(0, debias::as_scalar(value), base_work);
    double size = 0;
    if (column(ChainColumn::corrected) != 0) {
      const V correction = value_of(row.subspan(components_, components_), share);
      size = debias::as_scalar(correction);
      value = debias::sum(std::move(value), correction);
    }
    record.difference(level, size, work - base_work);
    return {std::move(value), work, level};
  }

  [[nodiscard]] SequenceFacts facts() const {
    SequenceFacts facts;
    facts.meeting_times = true;
    if (blocks_->options().limit > 0) facts.exact_from = blocks_->options().limit;
    return facts;
  }
  [[nodiscard]] BiasBound bias_bound(const LevelTable& levels) const {
    const std::int64_t limit = blocks_->options().limit;
    return limit > 0 ? debias::detail::bound_of_cut(levels, limit) : BiasBound{};
  }
  [[nodiscard]] std::string describe() const { return debias::detail::describe_chain(blocks_->options()); }

 private:
  // No numbers in the first pass.
  [[nodiscard]] V value_of(std::span<const double> numbers, double share) const {
    if constexpr (RealValue<V>) {
      return numbers.empty() ? 0.0 : share * numbers.front();
    } else {
      V v = V::Zero(static_cast<Eigen::Index>(components_));
      for (std::size_t i = 0; i < numbers.size(); ++i) set_component(v, i, share * numbers[i]);
      return v;
    }
  }

  std::shared_ptr<ChainBlocks> blocks_;
  std::size_t components_;
};

}  // namespace

void StreamBlock::uniforms(std::span<const std::int64_t> rows, std::size_t width, std::span<double> out) {
  for (const std::int64_t row : rows) {
    Stream& rng = streams_.at(static_cast<std::size_t>(row));
    for (double& u : out.first(width)) u = rng.uniform();
    out = out.subspan(width);
  }
}

std::span<const double> ChainBlocks::next() {
  const std::size_t begin = read_++ * width_;
  if (begin + width_ > answers_.size()) throw std::logic_error("chains: more samples than in their first pass");
  return std::span(answers_).subspan(begin, width_);
}

void ChainBlocks::collect_queries(const std::function<void()>& draws) {
  asked_.clear();
  answers_.clear();
  read_ = 0;
  ask_by(collecting_, draws);
  if (!asked_.empty()) answers_ = rows_of(std::exchange(asked_, {}), options_);
}

std::vector<double> ChainBlocks::rows_of(std::vector<Stream> streams, const ChainOptions& options) const {
  const std::size_t count = streams.size();
  std::vector<double> rows = run_(StreamBlock(std::move(streams)), options);
  if (rows.size() != count * width_) throw std::logic_error("chains: not one row for each chain");
  return rows;
}

UserProblem coupled_chain_problem(const Facts& facts, std::shared_ptr<ChainBlocks> blocks, std::size_t components) {
  debias::detail::check_chain(blocks->options());
  UserProblem user = problem_of(facts);
  user.problem.specials = {{.name = "coupled_chain", .description = "two chains that meet, with all their levels"}};
  user.components = std::max<std::size_t>(components, 1);
  const auto set = [&]<Value V>(BlockChain<V> estimator) {
    set_runs(
        user, [estimator](const catalog::Choice&, const auto& use) { use(estimator); }, blocks);
  };
  if (components == 0) {
    set(BlockChain<double>(blocks, 1));
  } else {
    set(BlockChain<Eigen::ArrayXd>(blocks, components));
  }
  return user;
}

ChainAdvice advise_chains(const ChainBlocks& blocks, const ChainAdviceOptions& options) {
  const auto pilot = [&](const ChainOptions& of, std::uint64_t stage, std::int64_t count) {
    std::vector<Stream> streams;
    for (std::int64_t i = 0; i < count; ++i) {
      streams.push_back(debias::detail::pilot_stream(options, stage, i));
    }
    const std::vector<double> rows = blocks.rows_of(std::move(streams), of);
    const std::size_t width = blocks.width();
    const std::size_t components = (width - static_cast<std::size_t>(ChainColumn::count)) / 2;
    const double share = 1 / static_cast<double>(of.length - of.burn_in + 1);
    std::vector<debias::detail::PilotChain> chains;
    for (std::size_t begin = 0; begin < rows.size(); begin += width) {
      const auto column = [&](ChainColumn c) { return rows[begin + 2 * components + static_cast<std::size_t>(c)]; };
      debias::detail::PilotChain chain;
      for (std::size_t c = 0; c < components; ++c) {
        chain.average.push_back(share * rows[begin + c]);
        chain.estimate.push_back(chain.average.back() + share * rows[begin + components + c]);
      }
      chain.work = column(ChainColumn::steps) + column(ChainColumn::behind);
      chain.meeting = static_cast<std::int64_t>(column(ChainColumn::meeting));
      chain.cut = column(ChainColumn::cut) != 0;
      chains.push_back(std::move(chain));
    }
    return chains;
  };
  return debias::detail::advise_chain(pilot, options);
}

}  // namespace debias::python
