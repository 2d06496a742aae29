#include "text.hpp"

#include <algorithm>
#include <ostream>

#include <debias/core/stream.hpp>

#include "core/text.hpp"
#include "fields.hpp"

namespace debias::commands {

std::string rounded(double x, int digits) { return format({std::chars_format::general, digits}, x); }

void print_row(std::ostream& out, const Row& row, const std::vector<std::size_t>& widths) {
  std::string line;
  for (std::size_t i = 0; i < row.size(); ++i) {
    line += row[i];
    const std::size_t width = i < widths.size() ? widths[i] : 0;
    line.append(row[i].size() < width ? width - row[i].size() : 0, ' ');
    line += "  ";
  }
  line.erase(line.find_last_not_of(' ') + 1);
  out << line << '\n';
}

void print_table(std::ostream& out, const std::vector<Row>& rows) {
  std::vector<std::size_t> widths;
  for (const Row& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  for (const Row& row : rows) print_row(out, row, widths);
}

void print_line(std::ostream& out, const std::string& name, const std::string& text) {
  print_row(out, {name, text}, {12});
}

std::string version_text() {
  std::string text = "debias " DEBIAS_VERSION "\nstream layout " + std::to_string(Stream::layout_version);
#ifdef __clang__
  text += "\ncompiler " __VERSION__;
#else
  text += "\ncompiler g++ " __VERSION__;
#endif
#ifdef __OPTIMIZE__
  text += ", optimised";
#else
  text += ", not optimised";
#endif
#ifndef NDEBUG
  text += ", assertions on";
#endif
  return text;
}

Fields versions() {
  return {{"stream_version", Stream::layout_version}, {"version", DEBIAS_VERSION}, {"schema", schema}};
}

std::string title(const catalog::Problem& p) {
  return (p.id.empty() ? "" : p.id + " ") + p.name + (p.formula.empty() ? "" : ": " + p.formula);
}

std::string pmf_text(const catalog::Choice& choice) {
  return choice.method == catalog::Method::truncated || !choice.special.empty() ? "" : choice.pmf.spec();
}

}  // namespace debias::commands
