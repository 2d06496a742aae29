// The library's numbers for notebooks/published/published.py: one request a line on standard input, one line of JSON each.
//
//   kind=asian side=call spot=2 strike=2 rate=.02 volatility=.1 horizon=1 seed=1 error=1e-5
//       the discounted expectation, by recipe: {"mean": ..., "error": ..., "blocks": ..., "work": ..., "warnings": [...]}
//   kind=levels option=european spot=100 ... level=1 draws=20000 replicates=32 seed=1
//       of D_k, for each of the replicates of so many draws: {"mean": [...], "variance": [...], "kurtosis": [...]}
//   kind=pareto values=0.8,0.6,...
//       the generalised Pareto law of such exceedances: {"k": ..., "sigma": ...}
//
// Stock: dS = (rate - yield) S dt + volatility S dW, by Milstein's scheme with bridges. Nothing here has a closed form in it.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <functional>
#include <iomanip>
#include <iostream>
#include <map>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <debias/core/tail_index.hpp>
#include <debias/debias.hpp>
#include <debias/sde/market.hpp>
#include <debias/sde/sensitivities.hpp>

namespace {

// With a last step of Euler's, as the published levels have it: its law is normal, and nothing else is known.
struct NormalDigital {
  static constexpr int smoothness = 0;
  debias::DigitalPayoff payoff;

  template <class X>
  X expected(const X& mean, const X& deviation) const {
    return payoff.expected(mean, deviation);
  }
};

using debias::Draw;
using debias::Stream;
using debias::StreamBatch;
using debias::Term;

/// key=value, as a line has them; numbers that are not there are 0.
struct Request {
  std::map<std::string, std::string> words;

  explicit Request(const std::string& line) {
    std::istringstream in(line);
    for (std::string word; in >> word;) {
      const auto equals = word.find('=');
      if (equals == std::string::npos) throw std::invalid_argument(word + " (must be key=value)");
      words[word.substr(0, equals)] = word.substr(equals + 1);
    }
  }
  [[nodiscard]] std::string text(const std::string& key) const {
    const auto found = words.find(key);
    return found == words.end() ? std::string() : found->second;
  }
  [[nodiscard]] double number(const std::string& key) const {
    const auto found = words.find(key);
    return found == words.end() ? 0 : std::stod(found->second);
  }
  [[nodiscard]] std::int64_t count(const std::string& key) const { return static_cast<std::int64_t>(number(key)); }
  [[nodiscard]] std::uint64_t seed() const { return static_cast<std::uint64_t>(count("seed")); }
};

/// Any sequence of numbers behind four calls, so that the estimators are compiled once for all options.
struct Levels {
  using Out = std::span<Term<double>>;
  std::function<Draw<double>(std::int64_t, Stream&)> draw;
  std::function<Term<double>(std::int64_t, Stream&)> value;
  std::function<void(std::int64_t, StreamBatch&, Out)> some_values;
  std::function<void(std::int64_t, StreamBatch&, Out)> some_differences;
  std::int64_t deepest = 0;
  debias::Rates rates;

  Draw<double> operator()(std::int64_t level, Stream& rng) const { return draw(level, rng); }
  Term<double> value_at(std::int64_t level, Stream& rng) const { return value(level, rng); }
  void values(std::int64_t level, StreamBatch& batch, Out out) const { some_values(level, batch, out); }
  void differences(std::int64_t level, StreamBatch& batch, Out out) const { some_differences(level, batch, out); }
  [[nodiscard]] std::int64_t deepest_level() const { return deepest; }
};

template <class S>
Levels erased(const S& s) {
  Levels levels;
  levels.draw = [s](std::int64_t level, Stream& rng) { return s(level, rng); };
  levels.value = [s](std::int64_t level, Stream& rng) { return debias::value_of(s, level, rng); };
  levels.some_values = [s](std::int64_t level, StreamBatch& batch, Levels::Out out) { s.values(level, batch, out); };
  levels.some_differences = [s](std::int64_t level, StreamBatch& batch, Levels::Out out) {
    s.differences(level, batch, out);
  };
  levels.deepest = debias::deepest_level_of(s);
  levels.rates = s.rates;
  return levels;
}

template <class Stays>
Levels knock(const Request& r, const debias::GeometricBrownianMotion& stock, double side, bool in) {
  const double strike = r.number("strike");
  const double rebate = in ? r.number("rebate") : 0;  // at the horizon, of an option that has not begun
  const double discount = std::exp(-r.number("rate") * stock.horizon);
  const auto payoff = [=](const Stays& path) {
    const double vanilla = std::max(side * (path.terminal - strike), 0.0);
    return discount * (vanilla * (in ? 1 - path.probability : path.probability) + rebate * path.probability);
  };
  return erased(debias::milstein(stock, Stays{r.number("barrier")}, payoff, debias::Rates{1.5, 1}));
}

Levels heston(const Request& r) {
  const debias::CoxIngersollRoss<> variance{.start = r.number("variance"),
                                            .reversion = r.number("reversion"),
                                            .mean = r.number("mean"),
                                            .volatility = r.number("volatility"),
                                            .horizon = r.number("horizon")};
  const debias::Heston<> model{.start = r.number("spot"),
                               .rate = r.number("rate"),
                               .variance = variance,
                               .correlation = r.number("correlation")};
  return erased(debias::heston(model, debias::CallPayoff{r.number("strike")}));
}

/// The option that a request names.
Levels option(const Request& r, const std::string& kind) {
  if (kind == "heston") return heston(r);
  const double side = r.text("side") == "put" ? -1 : 1;
  const double strike = r.number("strike");
  const double seen = r.number("seen");  // the extreme of the past
  const double discount = std::exp(-r.number("rate") * r.number("horizon"));
  const debias::GeometricBrownianMotion stock{.start = r.number("spot"),
                                              .growth = r.number("rate") - r.number("yield"),
                                              .volatility = r.number("volatility"),
                                              .horizon = r.number("horizon")};
  if (kind == "asian") {
    return erased(debias::milstein(stock, debias::Average{}, [=](const debias::Average& path) {
      return discount * std::max(side * (path.average() - strike), 0.0);
    }));
  }
  if (kind == "geometric_asian") {
    const auto logarithm = [](double s) { return std::log(s); };
    return erased(debias::milstein(stock, debias::AverageOf{logarithm}, [=](const auto& path) {
      return discount * std::max(side * (std::exp(path.average()) - strike), 0.0);
    }));
  }
  // What ends above a minimum, or has one below a strike; and the same of maxima.
  const bool fixed = kind == "fixed_lookback";
  if (fixed || kind == "lookback") {
    if (fixed == (side < 0)) {
      return erased(debias::milstein(stock, debias::Minimum{}, [=](const debias::Minimum& path) {
        const double least = std::min(seen, path.minimum);
        return discount * (fixed ? std::max(strike - least, 0.0) : path.terminal - least);
      }));
    }
    return erased(debias::milstein(stock, debias::Maximum{}, [=](const debias::Maximum& path) {
      const double greatest = std::max(seen, path.maximum);
      return discount * (fixed ? std::max(greatest - strike, 0.0) : greatest - path.terminal);
    }));
  }
  if (kind == "down_in" || kind == "down_out") return knock<debias::StaysAbove>(r, stock, side, kind == "down_in");
  if (kind == "up_in" || kind == "up_out") return knock<debias::StaysBelow>(r, stock, side, kind == "up_in");
  throw std::invalid_argument(kind + " (no such option)");
}

/// The draws of a table of levels: of an option above, or of those that nothing prices here.
std::function<Draw<double>(std::int64_t, Stream&)> draws_of(const Request& r) {
  const std::string name = r.text("option");
  if (name == "european") {
    const debias::BlackScholes<> stock{
        .start = r.number("spot"), .rate = r.number("rate"), .volatility = r.number("volatility")};
    return debias::milstein(stock, [strike = r.number("strike"), discount = std::exp(-stock.rate)](double s) {
      return discount * std::max(s - strike, 0.0);
    });
  }
  if (name == "digital") {
    const auto model = [&](const auto& spot) {
      return debias::BlackScholes<std::remove_cvref_t<decltype(spot)>>{
          .start = spot, .rate = r.number("rate"), .volatility = r.number("volatility")};
    };
    const auto payoff = debias::discounted(NormalDigital{{r.number("strike"), r.number("strike")}});
    const auto smoothed =
        debias::sensitivities(debias::Smoothed<debias::MilsteinStep>{}, model, payoff, r.number("spot"));
    return debias::ComponentOf(smoothed, 0, debias::Rates{1.5, 1});
  }
  if (name == "information") {
    const auto inner = [](double x, Stream& rng) {
      const double s = x + rng.normal();
      return Eigen::Array2d(std::max(s, 0.0), s);
    };
    const auto gain = [](const Eigen::Array2d& mean) { return mean[0] - std::max(mean[1], 0.0); };
    return debias::nested([](Stream& rng) { return rng.normal(); }, inner, gain, debias::Rates{1.5, 1});
  }
  return option(r, name).draw;
}

void print(const char* name, const std::vector<double>& x) {
  std::cout << '"' << name << "\": [";
  for (std::size_t i = 0; i < x.size(); ++i) std::cout << (i == 0 ? "" : ", ") << x[i];
  std::cout << ']';
}

/// Mean, variance and central kurtosis of D_k, as the tables have them.
void measure_levels(const Request& r) {
  const auto draw = draws_of(r);
  const auto draws = r.count("draws");
  std::vector<double> means;
  std::vector<double> variances;
  std::vector<double> kurtoses;
  std::vector<double> d(static_cast<std::size_t>(draws));
  for (std::int64_t replicate = 0; replicate < r.count("replicates"); ++replicate) {
    double mean = 0;
    for (std::size_t i = 0; i < d.size(); ++i) {
      Stream rng(r.seed(), static_cast<std::uint64_t>(replicate * draws) + i);
      d[i] = draw(r.count("level"), rng).difference;
      mean += d[i] / static_cast<double>(draws);
    }
    double second = 0;
    double fourth = 0;
    for (const double x : d) {
      const double square = (x - mean) * (x - mean);
      second += square / static_cast<double>(draws);
      fourth += square * square / static_cast<double>(draws);
    }
    means.push_back(mean);
    variances.push_back(second);
    kurtoses.push_back(second > 0 ? fourth / (second * second) : 0);
  }
  std::cout << '{';
  print("mean", means);
  std::cout << ", ";
  print("variance", variances);
  std::cout << ", ";
  print("kurtosis", kurtoses);
  std::cout << "}\n";
}

void fit_pareto(const Request& r) {
  std::istringstream in(r.text("values"));
  std::vector<double> values;
  for (std::string word; std::getline(in, word, ',');) values.push_back(std::stod(word));
  std::sort(values.begin(), values.end());
  const debias::ParetoFit fit = debias::fit_pareto(values);
  std::cout << "{\"k\": " << fit.k << ", \"sigma\": " << fit.sigma << "}\n";
}

void price(const Request& r) {
  const auto result = debias::estimate(debias::recipe(option(r, r.text("kind"))),
                                       {.seed = r.seed(), .threads = 1, .goal = {.error = r.number("error")}});
  std::cout << "{\"mean\": " << result.mean << ", \"error\": " << result.standard_error
            << ", \"blocks\": " << result.blocks << ", \"work\": " << result.work << ", \"warnings\": [";
  const char* comma = "";
  for (const debias::Warning& warning : result.warnings) {
    std::cout << comma << std::quoted(warning.text);
    comma = ", ";
  }
  std::cout << "]}\n";
}

}  // namespace

int main() {
  std::cout << std::setprecision(17);
  for (std::string line; std::getline(std::cin, line);) {
    try {
      const Request request(line);
      const std::string kind = request.text("kind");
      kind == "levels" ? measure_levels(request) : kind == "pareto" ? fit_pareto(request) : price(request);
    } catch (const std::exception& e) {
      std::cerr << line << ": " << e.what() << '\n';
      return 1;
    }
  }
}
