#include "named_function.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string_view>
#include <type_traits>
#include <vector>

#include <debias/functions.hpp>

#include "../core/text.hpp"

namespace debias::python {
namespace {

template <class G>
G with_parameter([[maybe_unused]] double parameter) {
  if constexpr (std::is_empty_v<G>) {
    return G{};
  } else {
    return G{parameter};
  }
}

template <class G>
NamedFunction named(double parameter) {
  return {parameter, [](double m, double a) { return with_parameter<G>(a)(m); },
          [](double m, double d, double a) { return with_parameter<G>(a).gap(m, d); }};
}

struct FunctionName {
  std::string_view name;
  bool takes_parameter;
  NamedFunction (*make)(double parameter);
};
constexpr std::array<FunctionName, 11> function_names{{{"exp", false, named<functions::Exp>},
                                                       {"exp-minus", false, named<functions::ExpMinus>},
                                                       {"reciprocal", false, named<functions::Reciprocal>},
                                                       {"square", false, named<functions::Square>},
                                                       {"log", false, named<functions::Log>},
                                                       {"sqrt", false, named<functions::Sqrt>},
                                                       {"power", true, named<functions::Power>},
                                                       {"davis", true, named<functions::Davis>},
                                                       {"logistic", false, named<functions::Logistic>},
                                                       {"absolute", false, named<functions::Absolute>},
                                                       {"positive-part", false, named<functions::PositivePart>}}};

}  // namespace

NamedFunction function_of(const std::string& text) {
  const std::size_t colon = std::min(text.find(':'), text.size());
  const std::string name = text.substr(0, colon);
  std::vector<std::string_view> names;
  for (const FunctionName& f : function_names) {
    names.push_back(f.name);
    if (f.name != name) continue;
    if (f.takes_parameter != (colon < text.size())) {
      throw std::invalid_argument(
          "g = '" + text + "' (" +
          (f.takes_parameter ? "needs its parameter); write " + name + ":1.5" : "takes no parameter); write " + name));
    }
    return f.make(f.takes_parameter ? parse_double(text.substr(colon + 1), "g") : 0.0);
  }
  std::string all;
  for (const std::string_view n : names) all += (all.empty() ? "" : ", ") + std::string(n);
  throw std::invalid_argument("g = '" + text +
                              "' (not a function that has a form without cancellation); it is one of " + all +
                              suggestion(name, names) + ". For another one write the levels yourself");
}

}  // namespace debias::python
