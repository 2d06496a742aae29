#pragma once

// What a result says in print: brief, or all of it.
//
//   std::cout << result;         mean with its error and interval, samples, work, seconds, one line of verdict, warnings
//   std::cout << full(result);   also estimator, coupling, efficiency, levels, tails, largest samples, reasons
//
// The same of a Survey, an Advice, a RecipeResult and MultilevelStatistics. A stated bias and a goal that was asked for are
// part of the brief report. Values of more than 16 components show their first and last three.

#include <iosfwd>
#include <string>
#include <utility>

namespace debias {

struct Statistics;

/// The brief report.
std::ostream& operator<<(std::ostream& out, const Statistics& statistics);
/// The whole one.
void print_full(std::ostream& out, const Statistics& statistics);

/// What `full` makes: it refers to a result that has a name, and keeps one that has none.
template <class Report>
struct Full {
  Report report;
};

/// The whole report where the brief one is not enough: `std::cout << full(result)`.
template <class Report>
requires requires(std::ostream& out, const Report& report) { print_full(out, report); }
Full<Report> full(Report&& report) { return {std::forward<Report>(report)}; }

template <class Report>
std::ostream& operator<<(std::ostream& out, const Full<Report>& whole) {
  print_full(out, whole.report);
  return out;
}

/// The mean with two digits of its standard error, which count in its last two digits: 0.75003(12), 1230(140).
/// An error that straddles the decimal point shows it: 123.4(1.2).
std::string with_error(double mean, double standard_error);

}  // namespace debias
