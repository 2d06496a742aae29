#pragma once

// The refusal that is no mistake of the caller: no PMF has finite variance and finite work.
//
//   E D_k^2 ~ 2^(-beta k), work_k ~ 2^(gamma k): a PMF exists iff beta > gamma (powers of the level: beta > gamma + 2)
//
// Notation: beta = variance_decay, gamma = work_growth. Thrown by default_exponent and what takes a PMF from declared rates,
// and by `recipe` where the levels show it. An invalid_argument, so that who catches those need not know it.

#include <limits>
#include <stdexcept>
#include <string>

#include <debias/core/rates.hpp>

namespace debias {

class NoPmfError : public std::invalid_argument {
 public:
  /// What the refusal rests on: rates that were stated, or levels that were seen (wrong once in 10, once in 200).
  enum class Grade { declared, likely, shown };

  static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

  struct Facts {
    FittedRate variance_decay{};  ///< its error is `unknown` where it was declared
    FittedRate work_growth{};     ///< likewise; the error of a growth of work is never known
    Decay decay = Decay::geometric;
    Grade grade = Grade::declared;
    std::string reason{};
    std::string help{};  ///< what would help
  };

  NoPmfError(const std::string& what, Facts facts);

  [[nodiscard]] const Facts& facts() const { return facts_; }
  [[nodiscard]] const FittedRate& variance_decay() const { return facts_.variance_decay; }
  [[nodiscard]] const FittedRate& work_growth() const { return facts_.work_growth; }
  /// Powers of 2, or of the level.
  [[nodiscard]] Decay decay() const { return facts_.decay; }
  [[nodiscard]] Grade grade() const { return facts_.grade; }
  [[nodiscard]] const std::string& reason() const { return facts_.reason; }
  [[nodiscard]] const std::string& help() const { return facts_.help; }

 private:
  Facts facts_;
};

/// "declared", "likely", "shown".
const char* name_of(NoPmfError::Grade grade);

}  // namespace debias
