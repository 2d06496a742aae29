#include <debias/core/run_state.hpp>

#include <bit>
#include <iterator>
#include <stdexcept>

namespace debias {

RunState::RunState(std::int64_t chunk, std::int64_t block) : chunk_(chunk), block_(block) {
  if (block < 1) throw std::invalid_argument("block = " + std::to_string(block) + " (must be at least 1)");
  if (chunk > 0 && chunk % block == 0 && std::has_single_bit(static_cast<std::uint64_t>(chunk / block))) return;
  throw std::invalid_argument("chunk = " + std::to_string(chunk) + " (must be a power of two" +
                              (block > 1 ? " of blocks of " + std::to_string(block) : "") + ")");
}

void Identity::demand_same(const Identity& other, const std::string& who) const {
  if (!known() || !other.known()) return;
  const auto refuse = [&who](const std::string& what) {
    throw std::invalid_argument(who + ": two different estimators " + what);
  };
  if (estimator != other.estimator) refuse("(" + estimator + ", and " + other.estimator + ")");
  if (name != other.name) {
    const auto quoted = [](const std::string& text) { return text.empty() ? "no name" : "'" + text + "'"; };
    refuse("(they have the names " + quoted(name) + " and " + quoted(other.name) + ")");
  }
  if (type != nullptr && other.type != nullptr && *type != *other.type) {
    refuse("(both call themselves '" + estimator + "', but they are of two types: other functions, or other data)");
  }
}

void RunState::add_chunk(std::int64_t first, std::int64_t last, const Accumulator& sums) {
  const bool complete = first % chunk_ == 0 && last - first == chunk_;
  insert(first, Node{last, complete ? 1 : 0, sums});
}

// Puts a node into the tree and joins it with its neighbour as long as the two are the halves of one parent.
void RunState::insert(std::int64_t first, Node node) {
  const auto next = nodes_.lower_bound(first);
  const bool overlaps_next = next != nodes_.end() && next->first < node.last;
  const bool overlaps_previous = next != nodes_.begin() && std::prev(next)->second.last > first;
  if (overlaps_next || overlaps_previous) {
    throw std::invalid_argument("merge: both results hold sample " +
                                std::to_string(overlaps_next ? next->first : first) +
                                " (a sample may count once only); give the second run another `first`");
  }
  while (node.chunks > 0) {
    const std::int64_t width = node.chunks * chunk_;
    const bool is_left = first / width % 2 == 0;
    const auto sibling = nodes_.find(is_left ? first + width : first - width);
    if (sibling == nodes_.end() || sibling->second.chunks != node.chunks) break;
    if (is_left) {
      node.sums.merge(sibling->second.sums);
      node.last = sibling->second.last;
    } else {
      sibling->second.sums.merge(node.sums);
      node.sums = std::move(sibling->second.sums);
      first = sibling->first;
    }
    node.chunks *= 2;
    nodes_.erase(sibling);
  }
  nodes_.emplace(first, std::move(node));
}

void RunState::merge(const RunState& other) {
  identity.demand_same(other.identity, "merge");
  if (chunk_ != other.chunk_ || block_ != other.block_) {
    const auto shape = [](const RunState& s) {
      return std::to_string(s.chunk_) + (s.block_ > 1 ? " in blocks of " + std::to_string(s.block_) : "");
    };
    throw std::invalid_argument("merge: chunks of " + shape(*this) + " and of " + shape(other) +
                                " samples (not one estimator)");
  }
  if (seed && other.seed && *seed != *other.seed) {
    throw std::invalid_argument("merge: samples of seed " + std::to_string(*seed) + " and of seed " +
                                std::to_string(*other.seed) + " (one run has one seed)");
  }
  for (const auto& [first, node] : other.nodes_) insert(first, node);
  if (!identity.known()) identity = other.identity;
  if (identity.type == nullptr) identity.type = other.identity.type;
  if (!seed) seed = other.seed;
  extremes.merge(other.extremes);
  seconds += other.seconds;
  pilot += other.pilot;
}

std::vector<RunState::Range> RunState::missing(Range range) const {
  std::vector<Range> gaps;
  std::int64_t position = range.first;
  for (const auto& [begin, node] : nodes_) {
    if (node.last % chunk_ != 0 && node.last < range.second) continue;  // cut
    if (begin > position) gaps.emplace_back(position, begin);
    position = node.last;
  }
  if (position < range.second) gaps.emplace_back(position, range.second);
  return gaps;
}

std::int64_t RunState::reopen(std::int64_t end) {
  if (nodes_.empty()) return 0;
  const auto node = std::prev(nodes_.end());
  const std::int64_t last = node->second.last;
  if (last % chunk_ == 0 || last >= end) return 0;
  nodes_.erase(node);
  return last;
}

std::int64_t RunState::first() const { return nodes_.empty() ? 0 : nodes_.begin()->first; }

std::int64_t RunState::last() const { return nodes_.empty() ? 0 : nodes_.rbegin()->second.last; }

bool RunState::contiguous() const {
  std::int64_t position = first();
  for (const auto& [begin, node] : nodes_) {
    const bool cut = begin != first() && begin % chunk_ != 0;
    if (begin != position || cut) return false;
    position = node.last;
  }
  return true;
}

Accumulator RunState::total() const {
  Accumulator sums;
  for (const auto& [begin, node] : nodes_) sums.merge(node.sums);
  return sums;
}

}  // namespace debias
