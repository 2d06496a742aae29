#pragma once

// What a law suite returns: one sentence for each claim that does not hold.

#include <algorithm>
#include <string>
#include <vector>

namespace debias::laws {

using Failures = std::vector<std::string>;

/// Is one of the failures about this claim?
inline bool names(const Failures& failures, const std::string& claim) {
  return std::any_of(failures.begin(), failures.end(),
                     [&claim](const std::string& f) { return f.rfind(claim, 0) == 0; });
}

}  // namespace debias::laws
