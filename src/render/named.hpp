#pragma once

// Methods by name.

#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "../core/text.hpp"

namespace debias::render {

/// The method of that name. Throws std::invalid_argument with the nearest one.
template <class Method>
const Method& named(std::span<const Method> methods, std::string_view name) {
  std::vector<std::string_view> names;
  std::string all;
  for (const Method& m : methods) {
    if (m.name == name) return m;
    names.push_back(m.name);
    all += (all.empty() ? "" : ", ") + std::string(m.name);
  }
  const std::string meant = suggestion(name, names);
  throw std::invalid_argument("--estimator = '" + std::string(name) + "' (no estimator of this scene)" +
                              (meant.empty() ? "; there are " + all : meant));
}

}  // namespace debias::render
