#include <debias/pmf/any.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include <debias/core/reach.hpp>

#include "core/text.hpp"

namespace debias {
namespace {

constexpr std::array<AnyPmf::Form, 5> all_forms{{
    {"geometric", "geometric:r=0.6 or geometric:theta=1.3", "r (1-r)^j, r = 1 - 2^-theta"},
    {"zeta", "zeta:s=2.5", "(j+1)^-s / zeta(s)"},
    {"poisson", "poisson:lambda=3", "exp(-lambda) lambda^j / j!"},
    {"tabulated", "tabulated:0.5,0.3,0.2;tail=0.4", "masses as listed, then ratio tail for ever"},
    {"dyadic", "dyadic:10,8,5;theta=1.25", "2^10, 2^8, 2^5 members of a block, one draw of a tail 2^(-theta j)"},
}};

/// One PMF's text: what it is called, what stands behind the colon, and how its complaints end.
struct Spec {
  std::string_view name;
  std::string_view parameters;
  std::string_view example;

  [[noreturn]] void refuse(const std::string& problem, const std::string& hint = "") const {
    throw std::invalid_argument(std::string(name) + ": " + problem +
                                (hint.empty() ? "; write " + std::string(example) : hint));
  }
};

/// Cuts `text` at the first of `separators`: returns what stands before, leaves what follows, or nothing.
std::string_view cut(std::optional<std::string_view>& text, std::string_view separators) {
  const std::string_view whole = *text;
  const std::size_t at = whole.find_first_of(separators);
  text = at == whole.npos ? std::nullopt : std::optional(whole.substr(at + 1));
  return whole.substr(0, at);
}

struct Parameter {
  std::string_view key;
  double value;
};

/// The one `key=value` of a PMF; several keys are ways to say the same, so a second one is refused.
Parameter read_parameter(const Spec& spec, std::string_view text, std::span<const std::string_view> keys) {
  std::optional<Parameter> found;
  std::optional<std::string_view> rest = text;
  while (rest) {
    const std::string_view item = cut(rest, ",;");
    const std::size_t equals = item.find('=');
    if (equals == item.npos) spec.refuse("'" + std::string(item) + "' (not of the form key=value)");
    const std::string_view key = item.substr(0, equals);
    bool known = false;
    for (const std::string_view k : keys) known = known || k == key;
    if (!known) spec.refuse("'" + std::string(key) + "' (no such parameter)", suggestion(key, keys));
    if (found && found->key == key) spec.refuse("'" + std::string(key) + "' (given twice)");
    if (found) {
      spec.refuse("'" + std::string(found->key) + "' and '" + std::string(key) + "' (one of them is enough)");
    }
    const std::string what = std::string(spec.name) + ": " + std::string(key);
    found = Parameter{key, parse_double(item.substr(equals + 1), what)};
  }
  return *found;
}

AnyPmf parse_geometric(const Spec& spec) {
  static constexpr std::string_view keys[] = {"r", "theta"};
  const Parameter p = read_parameter(spec, spec.parameters, keys);
  return AnyPmf(p.key == "r" ? Geometric(p.value) : Geometric::with_exponent(p.value));
}

AnyPmf parse_zeta(const Spec& spec) {
  static constexpr std::string_view keys[] = {"s"};
  const double s = read_parameter(spec, spec.parameters, keys).value;
  if (s > 1000) {  // Zeta takes it: all of its mass is that of level 0
    spec.refuse("s = " + to_text(s) + " (no double holds the mass 2^-s of level 1, and the PMF ends before it)");
  }
  return AnyPmf(Zeta(s));
}

AnyPmf parse_poisson(const Spec& spec) {
  static constexpr std::string_view keys[] = {"lambda"};
  return AnyPmf(Poisson(read_parameter(spec, spec.parameters, keys).value));
}

AnyPmf parse_tabulated(const Spec& spec) {
  static constexpr std::string_view keys[] = {"tail"};
  std::optional<std::string_view> rest = spec.parameters;
  std::optional<std::string_view> list = cut(rest, ";");
  if (!rest) spec.refuse("no tail (the ratio of neighbouring masses beyond the table)");
  std::vector<double> masses;
  while (list) {
    masses.push_back(parse_double(cut(list, ","), "tabulated: mass " + std::to_string(masses.size())));
  }
  return AnyPmf(Tabulated(std::move(masses), read_parameter(spec, *rest, keys).value));
}

AnyPmf parse_dyadic(const Spec& spec) {
  static constexpr std::string_view keys[] = {"theta"};
  std::optional<std::string_view> rest = spec.parameters;
  std::optional<std::string_view> list = cut(rest, ";");
  if (!rest) spec.refuse("no tail (theta, the exponent of the masses beyond the table)");
  std::vector<int> counts;
  while (list) {
    const std::string what = "m_" + std::to_string(counts.size());
    const double m = parse_double(cut(list, ","), "dyadic: " + what);
    if (!(m >= 0 && m <= 64) || m != static_cast<int>(m)) {
      spec.refuse(what + " = " + to_text(m) + " (must be a whole number in [0, 40]: level k gets 2^(m_k) members)");
    }
    counts.push_back(static_cast<int>(m));
  }
  return AnyPmf(Dyadic(std::move(counts), read_parameter(spec, *rest, keys).value));
}

}  // namespace

std::span<const AnyPmf::Form> AnyPmf::forms() { return all_forms; }

AnyPmf::AnyPmf(Kind pmf) : pmf_(std::move(pmf)) {}
AnyPmf::AnyPmf(const AnyPmf& other) = default;
AnyPmf::AnyPmf(AnyPmf&& other) noexcept = default;
AnyPmf& AnyPmf::operator=(const AnyPmf& other) = default;
AnyPmf& AnyPmf::operator=(AnyPmf&& other) noexcept = default;
AnyPmf::~AnyPmf() = default;

AnyPmf AnyPmf::parse(std::string_view text) {
  std::optional<std::string_view> rest = text;
  const std::string_view name = cut(rest, ":");
  std::array<std::string_view, all_forms.size()> names;
  for (std::size_t i = 0; i < names.size(); ++i) {
    names[i] = all_forms[i].name;
    if (names[i] != name) continue;
    const Spec spec{name, rest.value_or(""), all_forms[i].example};
    if (spec.parameters.empty()) spec.refuse("no parameters");
    if (name == "geometric") return parse_geometric(spec);
    if (name == "zeta") return parse_zeta(spec);
    if (name == "poisson") return parse_poisson(spec);
    if (name == "dyadic") return parse_dyadic(spec);
    return parse_tabulated(spec);
  }
  std::string hint = suggestion(name, names);
  if (hint.empty()) {
    hint = "; write one of";
    for (const AnyPmf::Form& form : all_forms) hint += " " + std::string(form.name);
  }
  throw std::invalid_argument("PMF '" + std::string(text) + "' (no PMF is called '" + std::string(name) + "')" + hint);
}

namespace detail {

Steeper steeper_pmf(const Reach& reach, double allowed) {
  const std::int64_t outcome = reach.deepest - reach.first_level + 1;  // the first that cannot be drawn
  if (outcome < 1) return {};
  const auto hundredths = [](double x) { return std::ceil(100 * x - 1e-9) / 100; };
  if (reach.decay == Decay::polynomial) {
    double low = 1;  // bisection: the tail falls with s
    double high = 2;
    while (Zeta(high).tail(outcome) > allowed) {
      low = high;
      high *= 2;
      if (high > 64) return {};
    }
    while (high - low > 1e-3) {
      const double middle = (low + high) / 2;
      (Zeta(middle).tail(outcome) > allowed ? low : high) = middle;
    }
    const Zeta pmf(hundredths(high));
    return {pmf.tail_exponent().exponent, pmf.spec()};
  }
  for (double theta = hundredths(-std::log2(allowed) / static_cast<double>(outcome)); theta <= 53; theta += 0.01) {
    theta = hundredths(std::max(theta, 0.01));
    const Geometric pmf = Geometric::with_exponent(theta);
    if (pmf.tail(outcome) <= allowed) return {theta, "geometric:theta=" + to_text(theta)};
  }
  return {};
}

}  // namespace detail

}  // namespace debias
