#pragma once

// The names of 0.1 that have gone from the command line and from Python, as they were typed. To be removed at 0.3.

#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace debias::commands {

inline constexpr std::pair<std::string_view, std::string_view> renamed[] = {
    {"--law", "--pmf"},
    {"--law auto", "--estimator recipe"},
    {"--pmf auto", "--estimator recipe"},
    {"--time", "--seconds"},
    {"list laws", "list pmfs"},
    {"--estimator single_term_drawn", "--estimator single_term_outcome"},
    {"estimator='single_term_drawn'", "estimator='single_term_outcome'"},
    {"law=", "pmf="},
    {"law='auto'", "estimator='recipe'"},
    {"pmf='auto'", "estimator='recipe'"},
    {"time=", "seconds="},
    {"laws()", "pmfs()"},
    {"recipe()", "advise()"},
    {"['law']", "['pmf']"},
    {"['law_exists']", "['pmf_exists']"}};

/// Throws std::invalid_argument for one of those: "`--law` is `--pmf` since 0.2".
inline void refuse_if_renamed(std::string_view typed) {
  for (const auto& [was, is] : renamed) {
    if (was == typed) throw std::invalid_argument("`" + std::string(was) + "` is `" + std::string(is) + "` since 0.2");
  }
}

}  // namespace debias::commands
