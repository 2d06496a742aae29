#pragma once

// Every estimator held against the exact answers; hard cases; and every figure of reliability on one page.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <string>
#include <utility>
#include <vector>

#include "fields.hpp"
#include "store.hpp"
#include "validation/hard.hpp"
#include "validation/reliability.hpp"
#include "validation/unseen.hpp"
#include "validation/validation.hpp"

namespace debias::commands {

/// Throws BadRequest for fewer than two samples, which have no standard error to be judged by.
void check_judged(std::int64_t samples);

// ---- cells: one estimator on one problem each

struct ValidateRequest {
  std::vector<const catalog::Problem*> problems = {};  ///< all when there is none
  std::int64_t samples = 100'000;                      ///< of each cell, two at least
  std::uint64_t seed = 1;
  int threads = 0;
};

struct ValidateReport {
  validation::Report report;
  std::int64_t samples = 0;
  std::uint64_t seed = 0;
  double seconds = 0;
};

/// Keeps the samples of each cell; `show` sees each cell as it ends.
ValidateReport validate(const ValidateRequest& request, const Caller& caller = {},
                        const std::function<void(const validation::Cell&)>& show = {});

/// Rows appear as cells end, so their widths are fixed beforehand.
class CellTable {
 public:
  explicit CellTable(const ValidateRequest& request);
  void print_header(std::ostream& out) const;
  void print(std::ostream& out, const validation::Cell& cell) const;

 private:
  std::vector<std::size_t> widths_;
};
Fields fields(const validation::Cell& cell);

/// The summary.
void print(std::ostream& out, const ValidateReport& report);
Fields fields(const ValidateReport& report);

// ---- what a recipe says of problems that nobody has met

struct UnseenRequest {
  std::uint64_t families_seed = 1;
  std::int64_t samples = 1 << 16;  ///< members of each run, two at least
  int threads = 0;
  int families = 40;
  int seeds = 20;  ///< of each family
};
struct UnseenReport {
  validation::UnseenReport report;
};

UnseenReport validate_unseen(const UnseenRequest& request, const Caller& caller = {});
void print(std::ostream& out, const UnseenReport& report);
Fields fields(const UnseenReport& report);

// ---- hard cases, and whether the result says what is wrong with it

struct HardRequest {
  std::int64_t samples = 100'000;  ///< of each case, two at least
  std::uint64_t seed = 1;
  int threads = 0;
};

struct HardReport {
  validation::HardReport report;
  std::int64_t samples = 0;
  std::uint64_t seed = 0;
};

HardReport validate_hard(const HardRequest& request, const Caller& caller = {},
                         const std::function<void(const validation::HardCell&)>& show = {});

class HardTable {
 public:
  HardTable();
  void print_header(std::ostream& out) const;
  void print(std::ostream& out, const validation::HardCell& cell) const;

 private:
  std::vector<std::size_t> widths_;
};
Fields fields(const validation::HardCell& cell);

void print(std::ostream& out, const HardReport& report);
Fields fields(const HardReport& report);

// ---- reliability

struct ReliabilityRequest {
  std::int64_t samples = 100'000;  ///< of each cell; N / 100 replications, 100 at least and 1e4 at most
  std::uint64_t seed = 1;
  std::uint64_t fresh_seed = 20261125;
  int threads = 0;
  std::string command;  ///< what the page says that it was made by
};

struct ReliabilityReport {
  std::vector<validation::Figure> figures;
  std::vector<std::pair<std::string, std::string>> facts;  ///< of machine and build: name and text

  /// The names of the figures that fail.
  [[nodiscard]] std::vector<std::string> failed() const;
};

ReliabilityReport reliability(const ReliabilityRequest& request, const Watch& watch = {});

/// A page of Markdown.
void print(std::ostream& out, const ReliabilityReport& report);
Fields fields(const ReliabilityReport& report);

}  // namespace debias::commands
