#pragma once

// Reports as text: lines and tables, and the figures in them.

#include <cstddef>
#include <iosfwd>
#include <string>
#include <vector>

#include "catalog.hpp"

namespace debias::commands {

/// At most `digits` significant digits, for people to read.
std::string rounded(double x, int digits = 4);

using Row = std::vector<std::string>;
/// Left-aligned columns, two blanks apart.
void print_row(std::ostream& out, const Row& row, const std::vector<std::size_t>& widths);
void print_table(std::ostream& out, const std::vector<Row>& rows);
/// A name and a text in the columns of a printed Statistics.
void print_line(std::ostream& out, const std::string& name, const std::string& text);

/// Program, stream layout and compiler, a line each.
std::string version_text();

/// "A10 square-of-mean: formula"; a problem of the user's own has no id, and may have no formula.
std::string title(const catalog::Problem& problem);

/// The PMF as AnyPmf::parse reads it; empty for an estimator without one.
std::string pmf_text(const catalog::Choice& choice);

}  // namespace debias::commands
