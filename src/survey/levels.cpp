#include <debias/survey/levels.hpp>

#include <algorithm>
#include <bit>

namespace debias {

detail::Part detail::part_of(const Statistics& s, std::size_t i) {
  const std::size_t each = (s.components.size() - 1) / 3;
  Part part;
  for (std::size_t c = i * each; c < (i + 1) * each; ++c) {
    part.means.push_back(s.components[c].mean);
    part.square_of_mean += s.components[c].mean * s.components[c].mean;
    part.variance += s.components[c].variance;
  }
  return part;
}

SharedMoments detail::shared_moments(const Statistics& s) {
  const double base = part_of(s, 0).variance;
  return {base, (part_of(s, 2).variance - base - part_of(s, 1).variance) / 2, s.work_per_sample()};
}

void detail::variances_within_strata(std::span<double> values, std::span<double> variances) {
  // Neighbours merge, pair by pair, until two strata are left and then one [Chan, Golub, LeVeque 1983].
  const std::size_t n = values.size();
  double squares = 0;  // about the means of the strata
  std::size_t octave = static_cast<std::size_t>(std::bit_width(n)) - 1;
  for (std::size_t strata = n / 2; strata > 0; strata /= 2) {
    const double half = static_cast<double>(n / strata) / 2;  // of the values of a stratum
    for (std::size_t i = 0; i < strata; ++i) {
      const double step = values[2 * i + 1] - values[2 * i];
      squares += half / 2 * step * step;
      values[i] = values[2 * i] + step / 2;
    }
    variances[--octave] = squares / static_cast<double>(n - strata);
  }
}

StrataMoments detail::strata_moments(const Statistics& s, std::int64_t members) {
  StrataMoments moments;
  moments.work = s.work;
  const auto octaves = static_cast<std::size_t>(std::bit_width(static_cast<std::uint64_t>(members))) - 1;
  const auto left = [&](std::size_t first) {
    std::vector<double> shares;
    double share = 1;
    const double all = s.components[first].mean;
    for (std::size_t i = 0; i < octaves && all > 0; ++i) {
      share = std::min(share, s.components[first + i].mean / all);  // finer strata never leave more, but for noise
      shares.push_back(share);
    }
    return shares;
  };
  moments.base_left = left(0);
  moments.difference_left = left(strata_octaves);
  return moments;
}

NetMoments detail::net_moments(const Statistics& s, int octaves) {
  NetMoments m;
  const auto top = static_cast<std::size_t>(octaves);
  constexpr auto first = static_cast<std::size_t>(NetMoments::most_octaves);
  m.variance.resize(top + 1);
  for (std::size_t c = first; c < s.components.size(); ++c) {
    m.mean.push_back(s.components[c].mean);
    m.variance[top] += s.components[c].variance;
    m.second_moment += s.components[c].mean * s.components[c].mean;
  }
  for (std::size_t j = top; j-- > 0;) m.variance[j] = m.variance[j + 1] + s.components[j].mean;
  m.second_moment += m.variance[0];
  for (const LevelRow& row : s.levels) {
    m.points = static_cast<double>(row.count);
    m.hits = row.kurtosis > 0 ? m.points / row.kurtosis : 0;
  }
  m.work = s.work;
  m.seconds = s.seconds;
  return m;
}

template void detail::draw_levels(LevelRuns& runs, const PlainLevels& sequence);

}  // namespace debias
