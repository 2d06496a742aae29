#include <debias/chains/advise.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>
#include <stdexcept>
#include <string>

#include <debias/core/accumulator.hpp>
#include <debias/core/report.hpp>

#include "core/text.hpp"

namespace debias {
namespace {

constexpr double share_met = 0.99;
constexpr std::int64_t single_times = 4096;
constexpr std::int64_t no_time = std::numeric_limits<std::int64_t>::max();
constexpr std::size_t most_bounds = 24;

// Of times in ascending order.
std::int64_t quantile(const std::vector<std::int64_t>& times, double share) {
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(times.size())));
  return times[std::min(times.size() - 1, rank - 1)];
}

std::vector<MeetingInterval> intervals_of(const std::vector<std::int64_t>& times) {
  std::vector<MeetingInterval> all;
  for (const std::int64_t t : times) {
    MeetingInterval here{t, t, 1};
    if (t > single_times) {
      here.first = single_times;
      while (t / 2 >= here.first) here.first *= 2;
      here.last = here.first + (here.first - 1);
      if (here.first == single_times) ++here.first;
    }
    if (!all.empty() && all.back().first == here.first) {
      ++all.back().chains;
    } else {
      all.push_back(here);
    }
  }
  return all;
}

double bound_at(const std::vector<std::int64_t>& times, std::int64_t lag, std::int64_t t) {
  double sum = 0;
  for (const std::int64_t tau : times) {
    const std::int64_t late = tau - lag - t;
    if (late > 0) sum += static_cast<double>((late + lag - 1) / lag);
  }
  return std::min(1.0, sum / static_cast<double>(times.size()));
}

std::vector<DistanceBound> bounds_of(const std::vector<std::int64_t>& times, std::int64_t lag) {
  const std::int64_t last = std::max<std::int64_t>(1, times.back() - lag);
  const auto steps = static_cast<std::int64_t>(most_bounds);
  const std::int64_t stride = (last + steps - 2) / (steps - 1);
  std::vector<DistanceBound> bounds;
  for (std::int64_t t = 0; t < last + stride; t += stride) bounds.push_back({t, bound_at(times, lag, t)});
  return bounds;
}

// E work x Var H / (n Var average), of the chains that are not left out.
double ratio(const std::vector<detail::PilotChain>& chains, double n, std::size_t groups, std::size_t left_out) {
  double work = 0;
  double count = 0;
  std::vector<Moments> of_estimate(chains.front().estimate.size());
  std::vector<Moments> of_average(of_estimate.size());
  const auto add = [](Moments& m, double x) {
    ++m.count;
    const double delta = x - m.mean;
    m.mean += delta / static_cast<double>(m.count);
    m.m2 += delta * (x - m.mean);
  };
  for (std::size_t i = 0; i < chains.size(); ++i) {
    if (i % groups == left_out) continue;
    work += chains[i].work;
    ++count;
    for (std::size_t c = 0; c < of_estimate.size(); ++c) {
      add(of_estimate[c], chains[i].estimate[c]);
      add(of_average[c], chains[i].average[c]);
    }
  }
  double estimates = 0;
  double averages = 0;
  for (std::size_t c = 0; c < of_estimate.size(); ++c) {
    estimates += of_estimate[c].m2;
    averages += of_average[c].m2;
  }
  return work / count * estimates / (n * averages);
}

}  // namespace

namespace detail {

ChainAdvice advise_chain(const ChainPilot& pilot, const ChainAdviceOptions& options) {
  if (options.chains < 100) {
    throw std::invalid_argument("advise: chains = " + std::to_string(options.chains) +
                                " (must be at least 100: a 99 % quantile is asked of them)");
  }
  if (options.multiple < 2) {
    throw std::invalid_argument("advise: multiple = " + std::to_string(options.multiple) +
                                " (must be at least 2: a chain of its own burn-in averages nothing)");
  }
  ChainAdvice advice;
  const auto chains_of = [&](const ChainOptions& of, std::uint64_t stage, std::int64_t count) {
    std::vector<PilotChain> chains = pilot(of, stage, count);
    for (const PilotChain& c : chains) advice.pilot_work += c.work;
    return chains;
  };
  const auto times_of = [](const std::vector<PilotChain>& chains) {
    std::vector<std::int64_t> times;
    for (const PilotChain& c : chains) times.push_back(c.cut ? no_time : c.meeting);
    std::sort(times.begin(), times.end());
    return times;
  };
  const auto tail_of = [&](const std::vector<std::int64_t>& times) {
    const std::vector<MeetingInterval> all = intervals_of(times);
    return meeting_tail(all, options.limit > 0 ? options.limit : no_time - 1);
  };

  // A quarter of the chains knows the lag well enough.
  ChainOptions of{.limit = options.limit};
  std::vector<std::int64_t> times = times_of(chains_of(of, 0, std::max<std::int64_t>(100, options.chains / 4)));
  std::int64_t lag = quantile(times, share_met);
  if (lag == no_time || (options.limit > 0 && lag >= options.limit)) {
    times = times_of(chains_of(of, 1, options.chains));
    advice.tail = tail_of(times);
    advice.meetings = intervals_of(times);
    return advice;
  }
  of.lag = lag;
  times = times_of(chains_of(of, 1, options.chains));
  advice.tail = tail_of(times);
  advice.meetings = intervals_of(times);
  const std::int64_t late = quantile(times, share_met);
  if (late == no_time) return advice;
  if (times.back() != no_time) advice.distance = bounds_of(times, lag);

  const std::int64_t burn_in = std::max<std::int64_t>(1, late - lag);
  advice.options = {.burn_in = burn_in, .length = options.multiple * burn_in, .lag = lag};
  // Chains that the pilot cuts count in the inefficiency as they are; their number stands in the tail.
  of = advice.options;
  if (options.limit > 0) of.limit = std::max({options.limit, of.length, of.lag + 1});
  const std::vector<PilotChain> chains = chains_of(of, 2, std::max<std::int64_t>(100, options.chains / 2));
  const auto n = static_cast<double>(of.length - of.burn_in + 1);
  constexpr std::size_t groups = 20;
  advice.inefficiency = ratio(chains, n, groups, groups);
  std::vector<double> without;
  for (std::size_t g = 0; g < groups; ++g) without.push_back(ratio(chains, n, groups, g));
  const Moments jackknife = Moments::of(without);
  advice.inefficiency_error = std::sqrt(jackknife.m2 * (groups - 1) / groups);
  for (const PilotChain& c : chains) advice.work += c.work / static_cast<double>(chains.size());
  return advice;
}

}  // namespace detail

std::int64_t ChainAdvice::burn_in_for(double distance_bound) const {
  for (const DistanceBound& d : distance) {
    if (d.bound <= distance_bound) return d.time;
  }
  return -1;
}

std::ostream& operator<<(std::ostream& out, const ChainAdvice& advice) {
  const auto line = [&out](const std::string& name, const std::string& text) {
    out << name << std::string(14 - name.size(), ' ') << text << '\n';
  };
  if (advice.available()) {
    line("advice", "burn_in " + std::to_string(advice.options.burn_in) + ", length " +
                       std::to_string(advice.options.length) + ", lag " + std::to_string(advice.options.lag));
  } else {
    line("advice",
         "none: more than 1 % of the chains had not met; take a kernel that mixes or meets faster, or a larger limit");
  }
  line("meeting", advice.tail.sentence() + ".");
  if (!advice.available()) return out;
  line("inefficiency", with_error(advice.inefficiency, advice.inefficiency_error) +
                           ": variance x work beside a plain chain without end and without burn-in");
  line("work", format("%.4g", advice.work) + " steps a sample, " + format("%.4g", advice.pilot_work) + " by the pilot");
  if (advice.distance.empty()) return out;
  line("distance", "a plain chain is after t steps at most so far from its steady state (total variation):");
  constexpr double width = 40;
  for (const DistanceBound& d : advice.distance) {
    const auto bar = static_cast<std::size_t>(std::lround(width * d.bound));
    out << right(std::to_string(d.time), 14) << right(format("%.3g", d.bound), 10) << "  " << std::string(bar, '#')
        << '\n';
  }
  return out;
}

}  // namespace debias
