#include "property.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "validation/bits.hpp"

#include <debias/core/accumulator.hpp>
#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>

using namespace debias;
using namespace debias::properties;

namespace {

constexpr std::int64_t aligned = 4096;  // a multiple of every chunk

Result<double> any_run(std::int64_t first, std::int64_t samples) {
  const auto sequence = [](std::int64_t level, Stream& rng) -> Draw<double> {
    const double x = rng.uniform() * std::exp2(-static_cast<double>(level));
    return level == 0 ? base(1 + x) : Draw<double>{1 + x, x};
  };
  return estimate(single_term(sequence, Geometric(0.5)), {.samples = samples, .seed = 5, .first = first, .threads = 1});
}

}  // namespace

TEST_CASE("moments of any numbers in any pieces are those of two passes in long double", "[property][exact]") {
  holds("merge of pieces", [] {
    const double scale = any_number(1e-30, 1e30);
    const double offset = *rc::gen::element(0.0, 1.0, -100.0);
    std::vector<double> x(static_cast<std::size_t>(*rc::gen::inRange(2, 400)));
    Stream rng(*rc::gen::arbitrary<std::uint64_t>(), 0);
    for (double& v : x) v = scale * (offset + rng.normal());
    Moments m;
    for (std::span<const double> rest = x; !rest.empty();) {
      const auto piece = static_cast<std::size_t>(*rc::gen::inRange<int>(1, static_cast<int>(rest.size()) + 1));
      m.merge(Moments::of(rest.first(piece)));
      rest = rest.subspan(piece);
    }
    long double mean = 0;
    for (const double v : x) mean += v;
    mean /= static_cast<long double>(x.size());
    long double m2 = 0;
    long double m4 = 0;
    for (const double v : x) {
      m2 += (v - mean) * (v - mean);
      m4 += (v - mean) * (v - mean) * (v - mean) * (v - mean);
    }
    const auto close = [](double got, long double exact, long double size) {
      return std::abs(static_cast<long double>(got) - exact) <= 1e-10L * size;
    };
    RC_ASSERT(m.count == static_cast<std::int64_t>(x.size()));
    RC_ASSERT(close(m.mean, mean, scale * (std::abs(offset) + 1)));
    RC_ASSERT(close(m.m2, m2, m2));
    RC_ASSERT(close(m.m4, m4, m4));
  });
}

TEST_CASE("a run cut into any aligned ranges merges in any order to the bits of the whole", "[property][exact]") {
  holds("merge of results", [] {
    const std::int64_t chunks = *rc::gen::inRange<std::int64_t>(2, 9);
    const std::int64_t first = aligned * *rc::gen::inRange<std::int64_t>(0, 6);
    const std::int64_t samples = aligned * chunks - *rc::gen::inRange<std::int64_t>(0, aligned);
    std::vector<Result<double>> parts;
    for (std::int64_t at = first; at < first + samples;) {
      const std::int64_t size = std::min(first + samples - at, aligned * *rc::gen::inRange<std::int64_t>(1, 4));
      parts.push_back(any_run(at, size));
      at += size;
    }
    RunState scattered;  // in any order, holes on the way
    std::vector<std::size_t> order(parts.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    Stream shuffle(*rc::gen::arbitrary<std::uint64_t>(), 0);
    for (std::size_t i = order.size(); i > 1; --i) {
      std::swap(order[i - 1], order[static_cast<std::size_t>(shuffle.uniform() * static_cast<double>(i))]);
    }
    for (const std::size_t i : order) {
      if (i == order.front()) {
        scattered = parts[i].state;
      } else {
        scattered.merge(parts[i].state);
      }
    }
    while (parts.size() > 1) {  // neighbours, from either side
      const auto i = *rc::gen::inRange<std::size_t>(0, parts.size() - 1);
      parts[i] = *rc::gen::arbitrary<bool>() ? merge(parts[i], parts[i + 1]) : merge(parts[i + 1], parts[i]);
      parts.erase(parts.begin() + static_cast<std::ptrdiff_t>(i) + 1);
    }
    const Result<double> whole = any_run(first, samples);
    RC_ASSERT(validation::bits_of(parts.front()) == validation::bits_of(whole));
    RC_ASSERT(scattered.contiguous());
    const Accumulator total = scattered.total();
    RC_ASSERT(total.moments.count == whole.moments.count);
    RC_ASSERT(total.moments.mean == whole.moments.mean);
    RC_ASSERT(total.moments.m2 == whole.moments.m2);
    RC_ASSERT(total.moments.m4 == whole.moments.m4);
    RC_ASSERT(total.work == whole.work);
    RC_ASSERT(scattered.extremes.largest() == whole.largest);
    RC_ASSERT(scattered.extremes.upper_tail() == whole.upper_tail);
  });
}
