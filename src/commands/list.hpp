#pragma once

// What there is: problems, estimators, PMFs.

#include <iosfwd>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "catalog.hpp"
#include "fields.hpp"

namespace debias::commands {

enum class Topic { problems, estimators, pmfs };

struct ListRequest {
  Topic topic = Topic::problems;
};

struct EstimatorEntry {
  std::string name;
  std::string description;  ///< what one sample is
};

struct ListReport {
  std::variant<std::span<const catalog::Problem>, std::vector<EstimatorEntry>, std::span<const AnyPmf::Form>> entries;
};

ListReport list(const ListRequest& request);

void print(std::ostream& out, const ListReport& report);
List fields(const ListReport& report);

}  // namespace debias::commands
