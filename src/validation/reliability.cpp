#include "reliability.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include <boost/math/distributions/chi_squared.hpp>

#include <debias/core/estimate.hpp>
#include <debias/diagnostics.hpp>
#include <debias/survey.hpp>

#include "bits.hpp"
#include "catalog.hpp"
#include "core/text.hpp"
#include "validation.hpp"

namespace debias::validation {
namespace {

constexpr double single_claim = 4.5;
// Two-sided binomial bands of 95 % intervals at 1e-6: the exact ones, [0.939, 0.960], at 10,000 replications, normal
// ones moved by as much at fewer.
double band_low(std::int64_t n) { return 0.95 - 4.9 * std::sqrt(0.95 * 0.05 / static_cast<double>(n)) - 0.0003; }
double band_high(std::int64_t n) { return 0.95 + 4.9 * std::sqrt(0.95 * 0.05 / static_cast<double>(n)) - 0.0006; }

std::string number(double x, int digits = 3) { return format({std::chars_format::general, digits}, x); }

// A problem under the geometric PMF that gives its samples this tail index.
struct Regime {
  const char* problem;
  double index;
  Method method = Method::single_term;

  [[nodiscard]] const Problem& the_problem() const { return catalog::find(problem); }
  [[nodiscard]] Choice choice() const {
    const Problem& p = the_problem();
    return {.method = method, .pmf = pmf_with_tail_index(p, index), .base_level = p.lowest_base};
  }
  [[nodiscard]] std::string text() const {
    return std::string(problem) + " " + std::string(name_of(method)) + ", tail index " + number(index);
  }
};

// Fourth moments are finite below 1/4.
constexpr std::array<Regime, 10> regimes = {{{"A10", 0.1},
                                             {"A13", 0.2},
                                             {"B02", 0.2},
                                             {"C01", 0.2},
                                             {"D01", 0.2, Method::roulette},
                                             {"D14", 0.1, Method::roulette},
                                             {"E02", 0.1},
                                             {"F02", 0.2},
                                             {"D11", 0.1, Method::roulette},
                                             {"A10", 0.1, Method::independent_sum}}};

class Measurement {
 public:
  Measurement(const ReliabilityPlan& plan, const std::function<void(const Figure&)>& show) : plan_(plan), show_(show) {}

  std::vector<Figure> all() {
    std::vector<double> z;
    for (const std::uint64_t seed : {plan_.seed, plan_.fresh_seed}) cells(seed, z);
    distribution_of(z);
    broken_estimators();
    intervals();
    goals();
    pmfs();
    verdicts();
    telescoping();
    bits();
    nonfinite_values();
    speed();
    return std::move(figures_);
  }

 private:
  void add(std::string name, std::string measured, std::string demanded, bool holds) {
    figures_.push_back({std::move(name), std::move(measured), std::move(demanded), holds});
    if (show_) show_(figures_.back());
  }
  void say(std::string_view what) const {
    if (plan_.progress && !plan_.progress(what)) throw Interrupted("reliability: interrupted by the caller");
  }
  [[nodiscard]] Plan plan_of(std::int64_t samples, std::uint64_t seed, std::string_view what) const {
    Plan plan{.samples = samples, .seed = seed, .threads = plan_.threads};
    plan.progress = [this, what = std::string(what)](std::int64_t) { return !plan_.progress || plan_.progress(what); };
    return plan;
  }

  // Cells of one seed share their streams; here each has a seed of its own, so that their z are independent.
  void cells(std::uint64_t seed, std::vector<double>& z) {
    std::vector<const Problem*> all;
    for (const Problem& p : catalog::problems()) all.push_back(&p);
    std::uint64_t own = seed << 20;
    const Report report = validate(all, plan_of(plan_.samples, seed, "cells of the catalogue"), {},
                                   [&own](const Problem&, const Choice&, Plan& plan) { plan.seed = own++; });
    for (const Cell& cell : report.cells) {
      if (cell.status != Status::pass && cell.status != Status::fail) continue;
      const bool rounding =
          cell.statistics.components.front().standard_error < believed_error(cell.statistics, cell.problem->truth);
      if (!rounding) z.push_back(cell.z);
    }
    add("z of all cells, seed " + std::to_string(seed),
        std::to_string(report.passed + report.failed) + " cells of " + std::to_string(all.size()) + " problems, " +
            std::to_string(plan_.samples) + " samples each: max \\|z\\| " + number(report.max_abs_z) + ", " +
            std::to_string(report.failed) + " failed; a bias of " + number(report.smallest_detectable_bias) +
            " standard deviations of a sample is found with 99 %",
        "max \\|z\\| < " + number(report.threshold), report.failed == 0);
  }

  void distribution_of(const std::vector<double>& z) {
    std::vector<double> u;
    for (const double x : z) u.push_back(normal_cdf(x));
    const Moments m = Moments::of(z);
    const double p = kolmogorov_smirnov(u);
    const double noise = single_claim / std::sqrt(2 * static_cast<double>(z.size()));
    const double spread = std::sqrt(m.variance());
    add("distribution of these z",
        std::to_string(z.size()) + " z: mean " + number(m.mean) + ", spread " + number(spread, 4) +
            ", Kolmogorov-Smirnov p = " + number(p),
        "p > 1e-6, spread 1 +- " + number(noise, 2), p > 1e-6 && std::abs(spread - 1) < noise);
  }

  void broken_estimators() {
    std::int64_t wrong = 0;
    std::int64_t rejected = 0;
    std::int64_t right = 0;
    std::int64_t accepted = 0;
    std::string missed;
    const double threshold = family_threshold(static_cast<std::int64_t>(suspects().size()));
    for (const Suspect& s : suspects()) {
      const Statistics run = s.run(plan_of(plan_.samples, plan_.seed, "estimators that are wrong on purpose"));
      const double z = (run.components.front().mean - s.truth) / believed_error(run, s.truth);
      const bool off = !(std::abs(z) < threshold);
      (s.wrong ? wrong : right) += 1;
      if (s.wrong && off) ++rejected;
      if (!s.wrong && !off) ++accepted;
      if (s.wrong != off) missed += (missed.empty() ? ": " : "; ") + s.name;
    }
    add("estimators that are wrong on purpose",
        std::to_string(rejected) + " of " + std::to_string(wrong) + " rejected, " + std::to_string(accepted) + " of " +
            std::to_string(right) + " right ones accepted" + missed,
        "all", rejected == wrong && accepted == right);
  }

  void intervals() {
    constexpr std::int64_t samples = 4096;
    for (const Regime& r : regimes) {
      say("coverage");
      const Choice choice = r.choice();
      const Coverage c = validation::coverage(
          [&](std::uint64_t seed) {
            return r.the_problem().run(choice, {.samples = samples, .seed = seed, .threads = 1});
          },
          r.the_problem().truth, plan_.replications, plan_.threads);
      add_coverage(r.text() + ", " + std::to_string(samples) + " samples", c);
    }
  }

  void add_coverage(const std::string& what, const Coverage& c) {
    const double most_spread = std::max(0.05, single_claim / std::sqrt(2 * static_cast<double>(c.replications)));
    const double low = band_low(c.replications);
    const double high = band_high(c.replications);
    add("95 % interval, " + what,
        "covers " + number(c.covered(), 4) + " (" + std::to_string(c.low) + " below, " + std::to_string(c.high) +
            " above, of " + std::to_string(c.replications) + "), spread of z " + number(c.spread_z, 4),
        "in [" + number(low) + ", " + number(high) + "], spread 1 +- " + number(most_spread),
        c.covered() >= low && c.covered() <= high && std::abs(c.spread_z - 1) < most_spread);
  }

  // A wish for an error: neither the mean nor the interval may notice that a pilot chose the samples.
  void goals() {
    for (const Regime& r : {Regime{"A10", 0.1}, Regime{"C01", 0.1}, Regime{"D01", 0.1, Method::roulette}}) {
      say("goals");
      const Problem& p = r.the_problem();
      const Choice choice = r.choice();
      const Statistics one = p.run(choice, {.samples = 1 << 16, .seed = plan_.seed, .threads = 1});
      Goal goal;
      goal.error = std::sqrt(one.components.front().variance / 1024);
      std::vector<double> deviations(static_cast<std::size_t>(plan_.replications));
      const Coverage c = validation::coverage(
          [&](std::uint64_t seed) {
            Plan plan{.samples = 4096, .seed = seed, .threads = 1, .goal = goal};
            Statistics s = p.run(choice, plan);
            deviations[static_cast<std::size_t>(seed - 1)] = s.components.front().mean - p.truth;
            return s;
          },
          p.truth, plan_.replications, plan_.threads);
      const Moments m = Moments::of(deviations);
      const double bias = m.mean / std::sqrt(m.variance());
      const double most = single_claim / std::sqrt(static_cast<double>(plan_.replications));
      const double least = band_low(plan_.replications) + 0.001;  // 0.94 at 10,000 replications
      add("a goal of error, " + r.text(),
          "bias " + number(bias, 2) + " standard errors, covers " + number(c.covered(), 4),
          "\\|bias\\| < " + number(most) + ", covers > " + number(least), std::abs(bias) < most && c.covered() > least);
    }
  }

  // The variance of a series without noise is known: sum d_k^2 / p_k - (sum d_k)^2.
  void pmfs() {
    say("pmfs");
    const Problem& p = catalog::find("D01");
    double worst_variance = 0;
    double least_p = 1;
    int count = 0;
    for (const char* spec :
         {"geometric:r=0.6", "geometric:r=0.4", "geometric:r=0.5", "zeta:s=3", "tabulated:0.5,0.3,0.2;tail=0.5"}) {
      const AnyPmf pmf = AnyPmf::parse(spec);
      const Choice choice{.method = Method::single_term_outcome, .pmf = pmf};
      const Statistics run = p.run(choice, plan_of(plan_.samples, plan_.seed, "pmfs"));
      double sum = 0;
      double second = 0;
      for (std::int64_t k = 0; k < 50; ++k) {
        const LevelSums one = p.pilot(k, 1, 1);
        const double mass = pmf.mass(k);
        sum += one.difference;
        second += one.square / mass;
      }
      const double variance = second - sum * sum;
      // Where the PMF is that of the differences there is no variance, and rounding is what is left.
      const double rounding = 16 * std::numeric_limits<double>::epsilon() * second;
      const double error =
          std::max(rounding, variance * std::sqrt((run.moments.kurtosis() - 1) / static_cast<double>(run.samples)));
      worst_variance = std::max(worst_variance, std::abs(run.moments.variance() - variance) / error);
      least_p = std::min(least_p, frequencies(run));
      ++count;
    }
    add("variance under " + std::to_string(count) + " PMFs against its closed form",
        "largest deviation " + number(worst_variance) + " standard errors", "< 5", worst_variance < 5);
    add("levels drawn under these PMFs", "smallest chi-square p = " + number(least_p), "> 1e-6", least_p > 1e-6);
  }

  // Levels against their probabilities, in bins that expect 25 at least.
  static double frequencies(const Statistics& run) {
    double chi_square = 0;
    int bins = 0;
    const auto n = static_cast<double>(run.samples);
    double expected_rest = n;
    double observed_rest = n;
    for (const LevelRow& row : run.levels) {
      const double expected = row.is_base && row.probability == 0 ? 0 : n * row.probability;
      if (expected < 25 || expected_rest - expected < 25) continue;
      const auto observed = static_cast<double>(row.count);
      chi_square += (observed - expected) * (observed - expected) / expected;
      expected_rest -= expected;
      observed_rest -= observed;
      ++bins;
    }
    chi_square += (observed_rest - expected_rest) * (observed_rest - expected_rest) / expected_rest;
    return bins == 0 ? 1 : cdf(complement(boost::math::chi_squared(bins), chi_square));
  }

  void verdicts() {
    constexpr std::array<Regime, 16> cases = {{{"A10", 0.2},
                                               {"A10", 0.7},
                                               {"A13", 0.25},
                                               {"A13", 0.65},
                                               {"B02", 0.3},
                                               {"B02", 0.7},
                                               {"C01", 0.2},
                                               {"C01", 0.8},
                                               {"D01", 0.2},
                                               {"D01", 0.8},
                                               {"D14", 0.37, Method::roulette},
                                               {"D14", 0.68, Method::roulette},
                                               {"E02", 0.3},
                                               {"E02", 0.7},
                                               {"F02", 0.3},
                                               {"F02", 0.7}}};
    constexpr int runs = 50;
    const std::int64_t samples = std::max<std::int64_t>(plan_.samples / 10, 1000);
    int analytic = 0;
    int wrong = 0;
    int undecided = 0;
    double worst_index = 0;
    for (const Regime& r : cases) {
      const Choice choice = r.choice();
      const bool finite = r.index < 0.5;
      const DeclaredFiniteness v = judge(rates_of(r.the_problem(), r.method), choice.pmf.tail_exponent());
      analytic += v.finite_variance == finite;
      std::vector<double> indices;
      for (int i = 1; i <= runs; ++i) {
        const RunVerdict said =
            r.the_problem().run(choice, plan_of(samples, static_cast<std::uint64_t>(i), "verdicts")).verdict();
        wrong += said.variance == (finite ? Finiteness::infinite : Finiteness::finite);
        undecided += said.variance == Finiteness::undecided;
        indices.push_back(said.tail_index);
      }
      std::nth_element(indices.begin(), indices.begin() + runs / 2, indices.end());
      worst_index = std::max(worst_index, std::abs(indices[runs / 2] - r.index));
    }
    const int all = runs * static_cast<int>(cases.size());
    add("verdict on the variance, " + std::to_string(cases.size()) + " known tail indices",
        "from rates right in " + std::to_string(analytic) + " of " + std::to_string(cases.size()) + "; from " +
            std::to_string(samples) + " samples wrong in " + std::to_string(wrong) + " and undecided in " +
            std::to_string(undecided) + " of " + std::to_string(all) + " runs; median tail index off by at most " +
            number(worst_index, 2),
        "all; wrong < 1 %; index within 0.1",
        analytic == static_cast<int>(cases.size()) && 100 * wrong < all && worst_index < 0.1);
  }

  // E[I_k] - E[I_(k-1)] = E[D_k] for each pair of levels, and Giles' |a - b + c| / (3 (s_a + s_b + s_c)).
  void telescoping() {
    double worst = 0;
    double giles = 0;
    std::int64_t pairs = 0;
    const auto draws = std::clamp<std::int64_t>(plan_.samples, 256, 4096);
    for (const Problem& p : catalog::problems()) {
      if (!p.levels.draw) continue;
      const Survey s = debias::survey(p.levels, p.lowest_base + 6, plan_of(draws, plan_.seed, "telescoping"));
      for (std::size_t k = 1; k < s.rows.size(); ++k) {
        const SurveyRow& coarse = s.rows[k - 1];
        const SurveyRow& fine = s.rows[k];
        if (coarse.level < p.lowest_base) continue;  // its moments are not there
        worst = std::max(worst, std::abs(fine.consistency));
        if (fine.values.size() == 1) {
          const double errors = 3 * (coarse.mean_error + fine.mean_error + fine.difference_error);
          const double gap = std::abs(coarse.values[0].mean - fine.values[0].mean + fine.difference);
          if (errors > 1e-14 * std::abs(fine.mean)) giles = std::max(giles, gap / errors);
        }
        ++pairs;
      }
    }
    const double threshold = family_threshold(pairs);
    add("telescoping of " + std::to_string(pairs) + " pairs of levels",
        "max \\|z\\| " + number(worst) + ", Giles' check " + number(giles, 2),
        "max \\|z\\| < " + number(threshold) + ", check < 1", worst < threshold && giles < 1);
  }

  void bits() {
    say("bits");
    std::int64_t runs = 0;
    std::int64_t different = 0;
    for (const char* id : {"A10", "B02", "C01", "D14", "E02", "F02"}) {
      const Problem& p = catalog::find(id);
      for (const std::int64_t block : {1, 64}) {
        const Choice choice{
            .method = Method::single_term, .pmf = default_pmf(p), .base_level = p.lowest_base, .block = block};
        for (const std::int64_t n : {1000, 4096, 4097, 50'000, 100'000}) {
          const std::int64_t samples = std::max<std::int64_t>(n / block, 2) * block;
          const std::int64_t chunk = block > 1 ? debias::detail::chunk_of_blocks(block) : default_chunk;
          const auto run = [&](std::int64_t first, std::int64_t count, int threads) {
            return Result<double>(
                p.run(choice, {.samples = count, .seed = plan_.seed, .first = first, .threads = threads}), 0.0);
          };
          const auto expected = bits_of(run(0, samples, 1));
          const auto hold = [&](const Statistics& s) {
            ++runs;
            different += bits_of(s) != expected;
          };
          for (const int threads : {2, 3, 7}) hold(run(0, samples, threads));
          for (const std::int64_t shards : {2, 5}) {  // merged from the last to the first
            const std::int64_t chunks = (samples - 1) / chunk + 1;
            if (chunks < shards) continue;
            std::optional<Result<double>> whole;
            for (std::int64_t i = shards - 1; i >= 0; --i) {
              const std::int64_t first = chunks * i / shards * chunk;
              const std::int64_t last = i + 1 == shards ? samples : chunks * (i + 1) / shards * chunk;
              const auto part = run(first, last - first, 2);
              whole = whole ? merge(*whole, part) : part;
            }
            hold(*whole);
          }
        }
      }
    }
    add("bits over threads 2, 3, 7 and shards 2, 5",
        std::to_string(different) + " of " + std::to_string(runs) +
            " results differ from that of one thread (12 runs at five N)",
        "none", different == 0);
  }

  void nonfinite_values() {
    const std::vector<std::string> failures = failures_on_nonfinite_values();
    std::string text;
    for (const std::string& f : failures) text += "; " + f;
    add("NaN, infinity, denormals and exceptions in five estimators",
        std::to_string(failures.size()) + " broken promises" + text, "none", failures.empty());
  }

  void speed() {
    for (const char* id : {"A10", "B02", "C01", "E02", "H01"}) {
      const Problem& p = catalog::find(id);
      const Choice choice{.method = Method::single_term, .pmf = default_pmf(p), .base_level = p.lowest_base};
      const auto seconds = [&](int threads) {
        std::vector<double> all;
        for (int round = 0; round < 5; ++round) {
          Plan plan = plan_of(plan_.samples, plan_.seed, "speed");
          plan.threads = threads;
          all.push_back(p.run(choice, plan).seconds);
        }
        std::nth_element(all.begin(), all.begin() + 2, all.end());
        return all[2];
      };
      const double one = seconds(1);
      const double more = seconds(plan_.threads);
      const Statistics s = p.run(choice, {.samples = plan_.samples, .seed = plan_.seed, .threads = 1});
      add("speed, " + std::string(id) + " single_term",
          number(static_cast<double>(plan_.samples) / one, 3) + " samples a second on one core, " +
              number(one / more, 3) + " times that on all; efficiency " +
              number(1 / (s.components.front().variance * one / static_cast<double>(plan_.samples)), 3) +
              " = 1 / (variance x seconds)",
          "", true);
    }
  }

  const ReliabilityPlan& plan_;
  const std::function<void(const Figure&)>& show_;
  std::vector<Figure> figures_;
};

}  // namespace

AnyPmf pmf_with_tail_index(const Problem& problem, double index) {
  return AnyPmf(Geometric::with_exponent(problem.rates.variance_decay / (2 * (1 - index))));
}

double normal_cdf(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

double kolmogorov_smirnov(std::vector<double> uniforms) {
  std::sort(uniforms.begin(), uniforms.end());
  const auto n = static_cast<double>(uniforms.size());
  double distance = 0;
  for (std::size_t i = 0; i < uniforms.size(); ++i) {
    const auto rank = static_cast<double>(i);
    distance = std::max({distance, uniforms[i] - rank / n, (rank + 1) / n - uniforms[i]});
  }
  const double x = (std::sqrt(n) + 0.12 + 0.11 / std::sqrt(n)) * distance;
  double p = 0;
  for (int k = 1; k < 100; ++k) p += (k % 2 == 1 ? 2 : -2) * std::exp(-2.0 * k * k * x * x);
  return std::clamp(p, 0.0, 1.0);
}

Coverage coverage(const std::function<Statistics(std::uint64_t seed)>& run, double truth, std::int64_t replications,
                  int threads) {
  const double limit = 1.959963984540054;
  const auto z = [&](Stream& rng) {
    const Statistics s = run(rng.index() + 1);
    return (s.components.front().mean - truth) / believed_error(s, truth);
  };
  std::vector<double> all(static_cast<std::size_t>(replications));
  const auto kept = [&](Stream& rng) { return all[rng.index()] = z(rng); };
  const Statistics s = estimate(kept, {.samples = replications, .threads = threads});
  Coverage c{replications, 0, 0, s.components.front().mean, std::sqrt(s.components.front().variance)};
  for (const double x : all) (x < -limit ? c.low : c.high) += std::abs(x) > limit;
  return c;
}

std::vector<Figure> reliability(const ReliabilityPlan& plan, const std::function<void(const Figure&)>& show) {
  return Measurement(plan, show).all();
}

}  // namespace debias::validation
