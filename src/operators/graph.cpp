#include <debias/operators/graph.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace debias::detail {

std::vector<int> colour_graph(std::span<const std::int64_t> outer, std::span<const std::int32_t> inner, int distance) {
  const std::size_t rows = outer.size() - 1;
  std::vector<int> colours(rows, -1);
  std::vector<std::int64_t> reached(rows, -1);  // the last row whose neighbourhood this one was in
  std::vector<std::int64_t> taken;              // by colour: the last row that must not have it
  std::vector<std::int32_t> near;
  for (std::size_t i = 0; i < rows; ++i) {
    const auto mark = static_cast<std::int64_t>(i);
    near.assign(1, static_cast<std::int32_t>(i));
    reached[i] = mark;
    std::size_t first = 0;
    for (int d = 0; d < distance; ++d) {
      const std::size_t last = near.size();
      for (; first < last; ++first) {
        const auto row = static_cast<std::size_t>(near[first]);
        for (std::int64_t k = outer[row]; k < outer[row + 1]; ++k) {
          const std::int32_t to = inner[static_cast<std::size_t>(k)];
          if (reached[static_cast<std::size_t>(to)] == mark) continue;
          reached[static_cast<std::size_t>(to)] = mark;
          near.push_back(to);
          const int colour = colours[static_cast<std::size_t>(to)];
          if (colour >= 0) taken[static_cast<std::size_t>(colour)] = mark;
        }
      }
    }
    std::size_t free = 0;
    while (free < taken.size() && taken[free] == mark) ++free;
    if (free == taken.size()) taken.push_back(-1);
    colours[i] = static_cast<int>(free);
  }
  return colours;
}

int count_colours(const char* name, std::span<const int> colours, std::size_t rows) {
  if (colours.size() != rows) {
    throw std::invalid_argument(std::string(name) + ": " + std::to_string(colours.size()) + " colours for " +
                                std::to_string(rows) + " rows (must be one for each)");
  }
  int last = 0;
  for (const int c : colours) {
    if (c < 0 || static_cast<std::size_t>(c) >= rows) {
      throw std::invalid_argument(std::string(name) + ": a colour " + std::to_string(c) +
                                  " (colours are 0, 1, ..., fewer than rows)");
    }
    last = std::max(last, c);
  }
  return last + 1;
}

void orthonormalise(std::vector<double>& basis, std::size_t rows) {
  const std::size_t vectors = basis.size() / rows;
  const auto vector = [&](std::size_t k) { return std::span(basis).subspan(k * rows, rows); };
  const auto dot = [](std::span<const double> x, std::span<const double> y) {
    double sum = 0;
    for (std::size_t i = 0; i < x.size(); ++i) sum += x[i] * y[i];
    return sum;
  };
  std::size_t kept = 0;
  for (std::size_t k = 0; k < vectors; ++k) {
    const std::span<double> v = vector(k);
    const double before = std::sqrt(dot(v, v));
    for (int turn = 0; turn < 2; ++turn) {
      for (std::size_t j = 0; j < kept; ++j) {
        const std::span<double> q = vector(j);
        const double along = dot(q, v);
        for (std::size_t i = 0; i < rows; ++i) v[i] -= along * q[i];
      }
    }
    const double length = std::sqrt(dot(v, v));
    if (!(length > 1e-12 * before)) continue;  // also where it is no number: the moments say so
    const std::span<double> to = vector(kept++);
    for (std::size_t i = 0; i < rows; ++i) to[i] = v[i] / length;
  }
  basis.resize(kept * rows);
}

}  // namespace debias::detail
