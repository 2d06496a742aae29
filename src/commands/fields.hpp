#pragma once

// A report as names and values, in order: what JSON and a Python dict are made of.

#include <concepts>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace debias::commands {

struct Node;
struct Entry;
using List = std::vector<Node>;
using Fields = std::vector<Entry>;

/// One value. A number may be NaN or infinite here; JSON has null for it.
struct Node {
  using Value = std::variant<std::nullptr_t, bool, std::int64_t, std::uint64_t, double, std::string, List, Fields>;

  Node(std::nullptr_t) : value(nullptr) {}
  Node(bool x) : value(x) {}
  template <std::signed_integral T>
  Node(T x) : value(static_cast<std::int64_t>(x)) {}
  template <std::unsigned_integral T>
  requires(!std::same_as<T, bool>) Node(T x) : value(static_cast<std::uint64_t>(x)) {}
  Node(double x) : value(x) {}
  Node(const char* x) : value(std::string(x)) {}
  Node(std::string_view x) : value(std::string(x)) {}
  Node(std::string x) : value(std::move(x)) {}
  Node(List x) : value(std::move(x)) {}
  Node(Fields x) : value(std::move(x)) {}
  Node(const std::vector<std::string>& x) : value(List(x.begin(), x.end())) {}

  Value value;
};

struct Entry {
  std::string name;
  Node value;
};

inline void append(Fields& fields, Fields more) {
  for (Entry& entry : more) fields.push_back(std::move(entry));
}

/// A list with what `describe` says of each.
template <class Range, class F>
List list_of(const Range& range, const F& describe) {
  List list;
  for (const auto& x : range) list.emplace_back(describe(x));
  return list;
}

/// Changes whenever a key changes its meaning or goes.
inline constexpr int schema = 1;

/// Of the stream layout, the program and the keys.
Fields versions();

/// JSON for people and for diff, one line for each entry of a list; and on one line. Doubles have the fewest digits that
/// read back as the same; bytes of a text that are no UTF-8 are replaced.
std::string pretty_json(const Node& node);
std::string json_line(const Node& node);

/// Of any report that has `fields`.
template <class Report>
std::string to_json(const Report& report) {
  return pretty_json(fields(report));
}

}  // namespace debias::commands
