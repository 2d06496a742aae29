#include "core/run_state_bytes.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace debias {
namespace {

void demand(bool holds) {
  if (!holds) throw std::invalid_argument("its sums contradict each other");
}

}  // namespace

// One description of the layout for both ways.
struct detail::Codec {
  template <class Io, class T, class Item>
  static void list(Io& io, std::vector<T>& items, std::size_t item_bytes, std::size_t most, const Item& item) {
    std::uint64_t n = items.size();
    io.number(n);
    if constexpr (Io::reads) {
      demand(n <= most && n <= io.left() / item_bytes);
      items.resize(static_cast<std::size_t>(n));
    }
    for (T& x : items) item(x);
  }

  template <class Io>
  static void code(Io& io, LevelSums& s) {
    io.number(s.count);
    io.number(s.difference);
    io.number(s.square);
    io.number(s.fourth);
    io.number(s.unit);
    io.number(s.work);
    demand(s.count >= 0);
  }

  template <class Io>
  static void code(Io& io, CouplingSide& s) {
    io.number(s.count);
    io.number(s.mean);
    io.number(s.m2);
    io.number(s.reach);
    demand(s.count >= 0);
  }

  template <class Io>
  static void code(Io& io, Accumulator& a) {
    io.number(a.moments.count);
    io.number(a.moments.mean);
    io.number(a.moments.m2);
    io.number(a.moments.m3);
    io.number(a.moments.m4);
    io.number(a.work);
    io.number(a.components.count_);
    list(io, a.components.entries_, 16, io_limit, [&io](ComponentMoments::Entry& e) {
      io.number(e.mean);
      io.number(e.m2);
    });
    io.number(a.levels.base_level_);
    code(io, a.levels.base_);
    list(io, a.levels.rows_, 48, most_rows, [&io](LevelSums& s) { code(io, s); });
    for (auto& rows : a.coupling.rows_) {
      list(io, rows, 96, static_cast<std::size_t>(CouplingTable::levels), [&io](CouplingRow& row) {
        code(io, row.value);
        code(io, row.coarse);
        code(io, row.difference);
      });
    }
    demand(a.moments.count >= 0);
  }

  template <class Io, class T, class Before, std::size_t capacity, class Item>
  static void code(Io& io, Leading<T, Before, capacity>& l, std::size_t item_bytes, const Item& item) {
    if constexpr (!Io::reads) l.kept_ = l.sorted();  // so that equal states have equal bytes
    list(io, l.kept_, item_bytes, capacity, item);
    if constexpr (Io::reads) {
      demand(std::is_sorted(l.kept_.begin(), l.kept_.end(), Before{}));
      if (l.kept_.size() == capacity) l.prune();
    }
  }

  template <class Io>
  static void code(Io& io, Extremes& e) {
    const auto value = [&io](double& x) {
      io.number(x);
      demand(std::isfinite(x));
    };
    code(io, e.upper_, 8, value);
    code(io, e.lower_, 8, value);
    code(io, e.largest_, 24, [&](LargeSample& s) {
      io.number(s.index);
      io.number(s.level);
      value(s.value);
    });
    io.number(e.nonfinite_);
    io.number(e.first_nonfinite_);
    demand(e.nonfinite_ >= 0 && (e.nonfinite_ > 0) == (e.first_nonfinite_ >= 0));
  }

  // What holds of the sums of every run, and is relied on.
  struct Demands {
    std::int64_t values = 0;
    std::int64_t draws = 0;
    std::optional<std::size_t> components;

    void add(const Accumulator& a) {
      const std::size_t n = a.components.entries_.size();
      demand(n == components.value_or(n) && a.components.count_ == (n > 0 ? a.moments.count : 0));
      components = n;
      values += a.moments.count;  // of ranges that do not overlap
      add(a.levels.base_);
      for (const LevelSums& s : a.levels.rows_) add(s);
      for (const auto& rows : a.coupling.rows_) {
        std::int64_t drawn = 0;  // of levels, each of them counted there, and of bases
        for (const CouplingRow& row : rows) {
          demand(row.value.count <= (std::int64_t{1} << 62) - drawn && row.coarse.count <= row.value.count &&
                 (row.difference.count == row.coarse.count || row.difference.count == 0));
          drawn += row.value.count;
        }
      }
    }
    void add(const LevelSums& s) {
      demand(s.count <= (std::int64_t{1} << 62) - draws);
      draws += s.count;
    }
    template <class T, class Before, std::size_t capacity>
    void holds_enough(const Leading<T, Before, capacity>& l, std::int64_t nonfinite) const {
      const auto kept = static_cast<std::int64_t>(l.kept_.size());
      demand(kept >= std::min(values - nonfinite, static_cast<std::int64_t>(capacity)));
    }
  };

  template <class Io, class T>
  static void code(Io& io, std::optional<T>& x, const T& none) {
    bool is_there = x.has_value();
    io.number(is_there);
    T value = x.value_or(none);
    if constexpr (std::same_as<T, Rates>) {
      bool geometric = value.decay == Decay::geometric;
      io.number(value.variance_decay);
      io.number(value.work_growth);
      io.number(geometric);
      value.decay = geometric ? Decay::geometric : Decay::polynomial;
    } else {
      io.number(value);
    }
    if constexpr (Io::reads) {
      x.reset();
      if (is_there) x = value;
    }
  }

  template <class Io>
  static void code(Io& io, PilotRun& p) {
    io.number(p.work);
    io.number(p.seconds);
    list(io, p.levels, 90, most_pilot_levels, [&io](LevelFacts& f) {
      io.number(f.level);
      io.number(f.draws);
      for (double* x : {&f.mean, &f.second_moment, &f.kurtosis, &f.nonzero, &f.work, &f.value_variance, &f.value_square,
                        &f.tail_index, &f.tail_error}) {
        io.number(*x);
      }
      io.number(f.is_base);
      demand(f.level >= 0 && f.draws >= 0);
    });
    code(io, p.sequence.declared, Rates{0, 0});
    code(io, p.sequence.exact_from, std::int64_t{0});
    auto stated = static_cast<std::uint8_t>((p.sequence.constant_limit ? 1 : 0) + (p.sequence.meeting_times ? 2 : 0));
    io.number(stated);
    if constexpr (Io::reads) {
      demand(stated < 4);
      p.sequence.constant_limit = (stated & 1) != 0;
      p.sequence.meeting_times = (stated & 2) != 0;
    }
  }

  template <class Io>
  static void code(Io& io, RunState& s, [[maybe_unused]] bool whole = true) {
    [[maybe_unused]] Demands demands;
    io.number(s.chunk_);
    io.number(s.block_);
    io.number(s.seconds);
    io.text(s.identity.estimator);
    io.text(s.identity.name);
    bool has_seed = s.seed.has_value();
    std::uint64_t seed = s.seed.value_or(0);
    io.number(has_seed);
    io.number(seed);
    if constexpr (Io::reads) {
      s.seed.reset();
      if (has_seed) s.seed = seed;
    }
    code(io, s.pilot);
    if constexpr (Io::reads) {
      demand(s.chunk_ > 0 && s.block_ > 0 && s.chunk_ % s.block_ == 0 &&
             std::has_single_bit(static_cast<std::uint64_t>(s.chunk_ / s.block_)));
    }
    std::uint64_t n = s.nodes_.size();
    io.number(n);
    if constexpr (Io::reads) {
      std::int64_t position = 0;
      for (; n > 0; --n) {
        std::int64_t first = 0;
        RunState::Node node;
        code(io, first, node);
        demand(first >= position && node.last > first && node.chunks >= 0);
        const std::int64_t samples = node.last - first;
        if (node.chunks == 0) {
          demand((node.last - 1) / s.chunk_ == first / s.chunk_ && samples < s.chunk_ && first % s.block_ == 0 &&
                 samples % s.block_ == 0);
        } else {
          demand(std::has_single_bit(static_cast<std::uint64_t>(node.chunks)) && samples % s.chunk_ == 0 &&
                 samples / s.chunk_ == node.chunks && first % samples == 0);
        }
        demand(node.sums.moments.count == samples / s.block_);
        demands.add(node.sums);
        position = node.last;
        s.insert(first, std::move(node));
      }
    } else {
      for (auto& [first, node] : s.nodes_) {
        std::int64_t begin = first;
        code(io, begin, node);
      }
    }
    code(io, s.extremes);
    if constexpr (Io::reads) {
      if (!whole) return;
      demands.holds_enough(s.extremes.upper_, s.extremes.nonfinite_);
      demands.holds_enough(s.extremes.lower_, s.extremes.nonfinite_);
      demands.holds_enough(s.extremes.largest_, s.extremes.nonfinite_);
    }
  }

  template <class Io>
  static void code(Io& io, std::int64_t& first, RunState::Node& node) {
    io.number(first);
    io.number(node.last);
    io.number(node.chunks);
    code(io, node.sums);
  }

  static constexpr std::size_t most_rows = 121;
  static constexpr std::size_t most_pilot_levels = 4096;
  static constexpr std::size_t io_limit = std::size_t{1} << 40;
};

Bytes encode(RunState state) {
  ByteWriter w;
  detail::Codec::code(w, state);
  return std::move(w.bytes);
}

RunState decode(std::span<const std::byte> bytes, bool whole) {
  ByteReader r(bytes);
  RunState state;
  try {
    detail::Codec::code(r, state, whole);
    demand(r.left() == 0);
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument(std::string("no checkpoint: ") + e.what());
  }
  return state;
}

}  // namespace debias
