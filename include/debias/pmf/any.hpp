#pragma once

// A PMF chosen at run time, from the command line or by a recipe.
//
//   geometric:r=0.6   geometric:theta=1.3   zeta:s=2.5   poisson:lambda=3   tabulated:0.5,0.3,0.2;tail=0.4
//   dyadic:10,8,5;theta=1.25
//
// spec() gives such a text, with the digits that parse() reads back as the identical PMF, bit for bit. A new
// PMF joins the variant here, and the table of forms and parse() in any.cpp. Per sample the dispatch is one
// switch.

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include <debias/core/pmf.hpp>
#include <debias/pmf/dyadic.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/poisson.hpp>
#include <debias/pmf/tabulated.hpp>
#include <debias/pmf/zeta.hpp>

namespace debias {

class AnyPmf {
 public:
  using Kind = std::variant<Geometric, Zeta, Poisson, Tabulated, Dyadic>;

  /// What can be written on the command line, for a list of PMFs.
  struct Form {
    std::string_view name;
    std::string_view example;
    std::string_view formula;
  };
  static std::span<const Form> forms();

  AnyPmf(Kind pmf);
  // In the library, and not inline: g++ 12 takes the vectors of a variant that is moved for uninitialised, and says so
  // in the user's program.
  AnyPmf(const AnyPmf& other);
  AnyPmf(AnyPmf&& other) noexcept;
  AnyPmf& operator=(const AnyPmf& other);
  AnyPmf& operator=(AnyPmf&& other) noexcept;
  ~AnyPmf();

  /// Throws std::invalid_argument that names what is wrong with the text, with the nearest name where one is
  /// close, or what is wrong with the parameters of the PMF.
  static AnyPmf parse(std::string_view text);

  double mass(std::int64_t j) const {
    return std::visit([j](const auto& pmf) { return pmf.mass(j); }, pmf_);
  }
  double tail(std::int64_t j) const {
    return std::visit([j](const auto& pmf) { return pmf.tail(j); }, pmf_);
  }
  std::int64_t sample(double u) const {
    return std::visit([u](const auto& pmf) { return pmf.sample(u); }, pmf_);
  }
  /// Members of a block, and those of them that draw outcome j without chance, of a Dyadic; 0 of all others.
  std::int64_t block() const {
    const auto* const dyadic = std::get_if<Dyadic>(&pmf_);
    return dyadic == nullptr ? 0 : dyadic->block();
  }
  std::int64_t copies(std::int64_t j) const {
    const auto* const dyadic = std::get_if<Dyadic>(&pmf_);
    return dyadic == nullptr ? 0 : dyadic->copies(j);
  }
  TailExponent tail_exponent() const {
    return std::visit([](const auto& pmf) { return pmf.tail_exponent(); }, pmf_);
  }
  std::string spec() const {
    return std::visit([](const auto& pmf) { return pmf.spec(); }, pmf_);
  }

 private:
  Kind pmf_;
};

}  // namespace debias
