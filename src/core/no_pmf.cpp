#include <debias/core/no_pmf.hpp>

#include <array>
#include <cstddef>
#include <utility>

namespace debias {

NoPmfError::NoPmfError(const std::string& what, Facts facts) : std::invalid_argument(what), facts_(std::move(facts)) {}

const char* name_of(NoPmfError::Grade grade) {
  constexpr std::array names = {"declared", "likely", "shown"};
  return names[static_cast<std::size_t>(grade)];
}

}  // namespace debias
