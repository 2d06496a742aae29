#include <debias/statistics/meeting.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include <debias/core/text.hpp>

#include "core/infinity.hpp"

namespace debias {
namespace {

constexpr double needed = 2;          // exponent, for a finite variance
constexpr double z = 1.5;             // standard errors
constexpr double tail_share = 0.125;  // of the chains, where a geometric tail has 3
constexpr double fewest = 30;         // chains that enter an octave which may speak for finite
constexpr double fewest_heavy = 8;    // and for a power
constexpr int fewest_octaves = 3;     // of a power

// Chains with tau >= a, and of them those with tau >= 2 a.
struct Octave {
  double entered = 0;
  double stayed = 0;

  // Half a chain more on either side: none that stayed is no infinite exponent.
  [[nodiscard]] double survival() const { return (stayed + 0.5) / (entered + 1); }
  [[nodiscard]] double exponent() const { return -std::log2(survival()); }
  [[nodiscard]] double error() const {
    const double p = survival();
    return std::sqrt((1 - p) / (p * (entered + 1))) / std::log(2.0);
  }
};

// The time by which a share of the chains has met: the end of its interval, or inside it where times are even there.
double quantile(std::span<const MeetingInterval> times, double chains, double share) {
  double met = 0;
  for (const MeetingInterval& t : times) {
    const auto here = static_cast<double>(t.chains);
    if (met + here >= share * chains && here > 0) {
      const double part = (share * chains - met) / here;
      return std::round(static_cast<double>(t.first) + part * static_cast<double>(t.last - t.first));
    }
    met += here;
  }
  return infinity;
}

}  // namespace

const char* name_of(MeetingKind kind) {
  switch (kind) {
    case MeetingKind::light:
      return "light";
    case MeetingKind::heavy:
      return "heavy";
    case MeetingKind::open:
      break;
  }
  return "open";
}

MeetingTail meeting_tail(std::span<const MeetingInterval> times, std::int64_t limit) {
  MeetingTail tail;
  std::vector<MeetingInterval> met;
  for (const MeetingInterval& t : times) {
    tail.chains += t.chains;
    if (t.first > limit) {
      tail.cut += t.chains;
    } else if (t.chains > 0) {
      met.push_back(t);
    }
  }
  if (tail.chains == 0) return tail;
  const auto all = static_cast<double>(tail.chains);
  tail.median = quantile(met, all, 0.5);
  tail.late = quantile(met, all, 0.99);
  tail.last = tail.cut > 0 || met.empty() ? infinity : static_cast<double>(met.back().last);

  // Whole octaves: intervals do not cross powers of two where times are as the level table keeps them. The octave that holds
  // the limit is censored, and says nothing.
  const auto later = [&](double a) {
    double n = static_cast<double>(tail.cut);
    for (const MeetingInterval& t : met) n += static_cast<double>(t.first) >= a ? static_cast<double>(t.chains) : 0;
    return n;
  };
  std::vector<Octave> octaves;
  for (double a = 1; 2 * a - 1 <= static_cast<double>(limit) && a < 0x1p62; a *= 2) {
    const Octave o{later(a), later(2 * a)};
    if (o.entered == 0) break;
    octaves.push_back(o);
  }
  const auto deepest =
      std::find_if(octaves.rbegin(), octaves.rend(), [](const Octave& o) { return o.entered >= fewest; });
  if (deepest != octaves.rend()) {
    tail.exponent = deepest->exponent();
    tail.error = deepest->error();
    // Those beyond it, which few chains entered, may contradict.
    Octave rest;
    for (auto o = octaves.rbegin(); o != deepest; ++o) {
      rest.entered += o->entered;
      rest.stayed += o->stayed;
    }
    const bool contradicted = rest.entered > 0 && rest.exponent() + 2 * rest.error() < needed;
    if (tail.exponent - z * tail.error > needed && !contradicted) tail.kind = MeetingKind::light;
  }
  if (tail.kind == MeetingKind::light) return tail;

  Octave power;
  int counted = 0;
  const Octave* first = nullptr;
  const Octave* last = nullptr;
  for (const Octave& o : octaves) {
    if (o.entered > tail_share * all || o.entered < fewest_heavy) continue;
    power.entered += o.entered;
    power.stayed += o.stayed;
    if (first == nullptr) first = &o;
    last = &o;
    ++counted;
  }
  if (counted >= fewest_octaves) {
    const double rise = last->exponent() - first->exponent();
    const bool rises = rise > z * std::hypot(last->error(), first->error());
    if (power.exponent() + z * power.error() < needed && !rises) {
      tail.kind = MeetingKind::heavy;
      tail.exponent = power.exponent();
      tail.error = power.error();
    }
  }
  return tail;
}

std::string MeetingTail::sentence() const {
  if (chains == 0) return "no meeting times";
  const auto time = [](double t) {
    return std::isfinite(t) ? detail::format("%.0f", t) : std::string("the limit or later");
  };
  std::string text = kind == MeetingKind::light ? "meeting times have a light tail"
                     : kind == MeetingKind::heavy
                         ? "meeting times have a HEAVY tail, like t^-" + detail::format("%.2f", exponent)
                         : "the tail of the meeting times is open";
  text += ": half of " + std::to_string(chains) + " chains met by " + time(median) + ", 99 % by " + time(late);
  text += cut > 0 ? ", " + std::to_string(cut) + " had not met when they were cut" : ", the last by " + time(last);
  return text;
}

}  // namespace debias
