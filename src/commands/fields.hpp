#pragma once

// A report as names and values, in order: what JSON and a Python dict are made of.

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include <debias/core/warning.hpp>

namespace debias::commands {

struct Node;
struct Entry;
using List = std::vector<Node>;
using Fields = std::vector<Entry>;

/// One value. A number may be NaN or infinite here; JSON has null for it.
struct Node {
  using Value = std::variant<std::nullptr_t, bool, std::int64_t, std::uint64_t, double, std::string, List, Fields>;

  Node(std::nullptr_t);
  Node(bool x);
  Node(int x);
  Node(long x);
  Node(long long x);
  Node(unsigned x);
  Node(unsigned long x);
  Node(unsigned long long x);
  Node(double x);
  Node(const char* x);
  Node(std::string_view x);
  Node(std::string x);
  Node(List x);
  Node(Fields x);
  Node(const std::vector<std::string>& x);
  Node(const Warning& x);
  Node(const std::vector<Warning>& x);

  Value value;
};

struct Entry {
  std::string name;
  Node value;
};

// Here, where Entry is complete.
inline Node::Node(std::nullptr_t) : value(nullptr) {}
inline Node::Node(bool x) : value(x) {}
inline Node::Node(int x) : value(std::int64_t{x}) {}
inline Node::Node(long x) : value(std::int64_t{x}) {}
inline Node::Node(long long x) : value(std::int64_t{x}) {}
inline Node::Node(unsigned x) : value(std::uint64_t{x}) {}
inline Node::Node(unsigned long x) : value(std::uint64_t{x}) {}
inline Node::Node(unsigned long long x) : value(std::uint64_t{x}) {}
inline Node::Node(double x) : value(x) {}
inline Node::Node(const char* x) : value(std::string(x)) {}
inline Node::Node(std::string_view x) : value(std::string(x)) {}
inline Node::Node(std::string x) : value(std::move(x)) {}
inline Node::Node(List x) : value(std::move(x)) {}
inline Node::Node(Fields x) : value(std::move(x)) {}
inline Node::Node(const std::vector<std::string>& x) : value(List(x.begin(), x.end())) {}
inline Node::Node(const Warning& x) : value(Fields{{"code", name_of(x.code)}, {"text", x.text}}) {}
inline Node::Node(const std::vector<Warning>& x) : value(List(x.begin(), x.end())) {}

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
inline constexpr int schema = 2;

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
