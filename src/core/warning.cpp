#include <debias/core/warning.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <ostream>
#include <stdexcept>
#include <string>

namespace debias {
namespace {

struct Row {
  WarningCode code;
  const char* name;
  bool is_note = false;
};

constexpr std::array table = {Row{WarningCode::nonfinite_samples, "nonfinite_samples"},
                              Row{WarningCode::one_sample, "one_sample"},
                              Row{WarningCode::mean_overflow, "mean_overflow"},
                              Row{WarningCode::square_overflow, "square_overflow"},
                              Row{WarningCode::square_underflow, "square_underflow"},
                              Row{WarningCode::equal_samples, "equal_samples"},
                              Row{WarningCode::dominant_sample, "dominant_sample"},
                              Row{WarningCode::uncertain_error, "uncertain_error"},
                              Row{WarningCode::single_precision, "single_precision"},
                              Row{WarningCode::coupling, "coupling"},
                              Row{WarningCode::wrong_masses, "wrong_masses"},
                              Row{WarningCode::coupling_unchecked, "coupling_unchecked"},
                              Row{WarningCode::zero_differences, "zero_differences"},
                              Row{WarningCode::base_level, "base_level"},
                              Row{WarningCode::unexplained_time, "unexplained_time"},
                              Row{WarningCode::declared_rates, "declared_rates"},
                              Row{WarningCode::no_second_moment, "no_second_moment"},
                              Row{WarningCode::aliased_differences, "aliased_differences"},
                              Row{WarningCode::unstated_end, "unstated_end", true},
                              Row{WarningCode::unsettled_levels, "unsettled_levels", true},
                              Row{WarningCode::few_levels, "few_levels", true},
                              Row{WarningCode::few_draws, "few_draws", true},
                              Row{WarningCode::rates_unknown, "rates_unknown", true},
                              Row{WarningCode::scattered_moments, "scattered_moments", true},
                              Row{WarningCode::shallow_levels, "shallow_levels", true},
                              Row{WarningCode::rounding, "rounding", true},
                              Row{WarningCode::exact_end, "exact_end", true},
                              Row{WarningCode::fast_decay, "fast_decay", true},
                              Row{WarningCode::deepest_level, "deepest_level"},
                              Row{WarningCode::dependence, "dependence"},
                              Row{WarningCode::alternation, "alternation"},
                              Row{WarningCode::missing_values, "missing_values"},
                              Row{WarningCode::reading, "reading"},
                              Row{WarningCode::threads, "threads"},
                              Row{WarningCode::interrupted, "interrupted"}};

constexpr bool is_in_order() {
  for (std::size_t i = 0; i < table.size(); ++i) {
    if (static_cast<std::size_t>(table[i].code) != i) return false;
  }
  return table.size() == static_cast<std::size_t>(WarningCode::interrupted) + 1;
}
static_assert(is_in_order(), "a row for each code, in their order");

}  // namespace

const char* name_of(WarningCode code) { return table[static_cast<std::size_t>(code)].name; }

WarningCode warning_named(std::string_view name) {
  for (const Row& row : table) {
    if (row.name == name) return row.code;
  }
  throw std::invalid_argument("no warning '" + std::string(name) + "'");
}

bool is_note(WarningCode code) { return table[static_cast<std::size_t>(code)].is_note; }

void detail::add_new(std::vector<Warning>& warnings, const std::vector<Warning>& doubts) {
  const std::vector<Warning> known = warnings;
  for (const Warning& doubt : doubts) {
    const auto same = [&doubt](const Warning& w) { return w.code == doubt.code; };
    if (std::none_of(known.begin(), known.end(), same)) warnings.push_back(doubt);
  }
}

std::ostream& operator<<(std::ostream& out, const Warning& warning) { return out << warning.text; }

}  // namespace debias
