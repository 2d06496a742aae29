// What a verdict says, for people.

#include <debias/core/verdict.hpp>

#include <cmath>
#include <string>
#include <vector>

#include <debias/core/result.hpp>

#include "core/text.hpp"
#include "core/words.hpp"

namespace debias {
namespace {

std::string index_text(double x) { return std::isfinite(x) ? format("%.2f", x) : "bounded"; }

std::string tails_text(const RunVerdict& v) {
  const auto side = [](const TailIndex& tail, const char* name) {
    if (tail.state != TailState::fitted) return std::string("no tail among the ") + name;
    return "Pareto k " + index_text(tail.k) + " of the " + std::to_string(tail.values) + " " + name;
  };
  return side(v.upper, "largest") + " and " + side(v.lower, "smallest") + " values";
}

std::string evidence_text(const RunVerdict& v) {
  const LevelEvidence& l = v.levels;
  if (!l.available) {
    const std::string met = v.meeting.chains > 0 ? "; " + v.meeting.sentence() : "";
    if (std::isinf(v.tail_index) && std::isinf(v.error)) return "no tail to be seen" + met;
    return tails_text(v) + met;
  }
  if (l.ends) return "every difference is zero beyond some level";
  return levels_words(l.first_level, l.last_level) + (l.contradicted ? ", which deeper ones contradict" : "");
}

// ", where it grows by 0.5 octaves a level": of the terms of the variance, which diverge.
std::string growth_text(const LevelEvidence& l) {
  if (!l.available || !std::isfinite(l.growth)) return {};
  const std::string unit = l.polynomial ? " octaves an octave of the level" : " octaves a level";
  const std::string size = format("%.2g", std::abs(l.growth));
  if (l.growth > 0 && size != "0") return ", where it grows by " + size + unit;
  if (l.growth < 0 && size != "0") return ", where it falls by no more than " + size + unit;
  return ", where it does not fall";
}

// What to do about an infinite variance.
std::string way_out(const RunVerdict& v) {
  const LevelEvidence& l = v.levels;
  const double bound = l.polynomial ? l.beta - 1 : l.beta;
  const double least = l.polynomial ? 1 : 0;  // below it masses have no sum
  if (l.available && std::isfinite(bound) && l.beta > l.beta_error) {
    if (bound > least) {
      return "take a PMF that falls more slowly, with exponent below " + format("%.2f", bound) +
             ", as long as its work is finite.";
    }
    return "no PMF falls slowly enough; a better coupling or a smoother integrand may help, or `truncated`.";
  }
  if (l.available && std::isfinite(bound)) {
    return l.beta > 0
               ? "its differences hardly fall; take a PMF that falls much more slowly, or a better coupling."
               : "its differences do not fall, which no PMF mends; a better coupling or a smoother integrand may.";
  }
  if (v.meeting.kind == MeetingKind::heavy) {
    return "a kernel that mixes or meets faster is needed, or more dispersed starts.";
  }
  if (v.grade == Grade::likely && !l.available) {
    return "a lognormal looks the same; replay the largest samples to find the cause.";
  }
  return "replay the largest samples to find the cause: a PMF that falls too fast is the usual one.";
}

// What the interval lacks.
std::string why_unreliable(const RunVerdict& v) {
  if (v.unseen_share > 0.5) return "most of its variance is in levels that were hardly drawn";
  if (std::isfinite(v.degrees)) {
    return "its variance is known like that of " + format("%.0f", v.degrees + 1) + " values";
  }
  if (!std::isfinite(v.kurtosis)) return "its variance is not known";
  const double hits = static_cast<double>(v.samples) / std::max(1.0, v.kurtosis);
  return "about " + format("%.2g", hits) + " of " + std::to_string(v.samples) + " samples carry the variance";
}

// An infinite mean, and not by chance only.
bool infinite_mean(const RunVerdict& v) {
  return v.variance == Finiteness::infinite && std::isfinite(v.tail_index) && v.tail_index - v.error > 1;
}

std::string graded(const RunVerdict& v) {
  return v.grade == Grade::open ? "" : std::string(" (") + name_of(v.grade) + ")";
}

constexpr const char* biased = "the mean is BIASED, see warning; no interval covers, and no number of samples helps.";

std::string about_work(const RunVerdict& v) {
  if (v.work != Finiteness::infinite) return {};
  return " Its expected work is INFINITE: the PMF falls more slowly than the work of a level grows.";
}

std::string about_variance(const RunVerdict& v) {
  std::string known = evidence_text(v);
  if (v.levels.available && v.unseen_share >= 0.005) {
    known += "; " + format("%.0f", 100 * std::sqrt(v.unseen_share)) + " % of the error is from levels not seen";
  }
  switch (v.variance) {
    case Finiteness::finite:
      return "variance finite" + graded(v) + (v.levels.available ? ": " : " as far as these values reach: ") + known +
             ".";
    case Finiteness::infinite:
      return "variance INFINITE" + graded(v) + ": " + known + growth_text(v.levels) +
             (infinite_mean(v) ? ", so even the mean is infinite; "
                               : ", so the standard error is too small most of the time; ") +
             way_out(v);
    case Finiteness::undecided:
      break;
  }
  return "variance open: " + known + ", so the interval may be too narrow; take more samples" +
         (v.meeting.chains > 0 ? ", or a kernel that mixes or meets faster."
                               : "; a survey of the levels, if there are any, tells sooner.");
}

bool leaves_out_bias(const RunVerdict& v) { return !(v.bias <= RunVerdict::most_bias) && !v.wrong_mean; }

RunVerdict without_bias(RunVerdict v) {
  v.bias = 0;
  return v;
}

std::string about_bias(const RunVerdict& v) {
  return "The interval leaves out the stated bias, " +
         (std::isfinite(v.bias) ? "at most " + format("%.2g", v.bias) + " standard errors." : "which has no bound.");
}

}  // namespace

const char* name_of(Finiteness finiteness) {
  switch (finiteness) {
    case Finiteness::finite:
      return "finite";
    case Finiteness::infinite:
      return "infinite";
    case Finiteness::undecided:
      break;
  }
  return "undecided";
}

std::string RunVerdict::sentence() const {
  if (wrong_mean) return biased;
  if (leaves_out_bias(*this)) return without_bias(*this).sentence() + " " + about_bias(*this);
  if (variance != Finiteness::finite || interval_reliable()) return about_variance(*this) + about_work(*this);
  return "variance finite" + graded(*this) + (levels.available ? "" : " as far as these values reach") +
         ", but the interval is unreliable: " + why_unreliable(*this) + "; take more samples." + about_work(*this);
}

std::vector<std::string> RunVerdict::sentences() const {
  std::vector<std::string> all = {about_variance(*this) + about_work(*this)};
  if (wrong_mean) all.emplace(all.begin(), biased);
  if (leaves_out_bias(*this)) {
    all = without_bias(*this).sentences();
    all.insert(all.begin() + 1, about_bias(*this));
    return all;
  }
  if (variance == Finiteness::finite && !interval_reliable() && !wrong_mean) {
    all.push_back("the interval is unreliable: " + why_unreliable(*this) + "; take more samples.");
  }
  if (infinite_mean(*this)) {
    all.push_back("even the mean is infinite: tail index " + index_text(tail_index) +
                  (std::isfinite(error) ? " +- " + index_text(error) : "") +
                  " (a mean needs one below 1), and no number of samples helps.");
  } else if (variance == Finiteness::infinite && tail_index > usable_tail_index(samples)) {
    all.push_back("even the mean is doubtful: tail index " + index_text(tail_index) + " (threshold " +
                  format("%.2f", usable_tail_index(samples)) + " for " + std::to_string(samples) +
                  " samples), so it may be far off; " +
                  (std::isfinite(samples_needed) ? "this index asks for " + format("%.1e", samples_needed) + " samples."
                                                 : "no number of samples helps."));
  }
  if (variance != Finiteness::finite && !largest.empty()) {
    const LargeSample& l = largest.front();
    all.push_back("the largest sample, index " + std::to_string(l.index) + " of level " + std::to_string(l.level) +
                  ", carries " + format("%.2g", 100 * largest_share) +
                  " % of the sum of squares; replay it to see what it is made of.");
  }
  return all;
}

}  // namespace debias
