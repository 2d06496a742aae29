#pragma once

// The two ways through the layout of a request: a Reader takes its fields from words, a Writer makes the words that a Reader
// takes the same fields from. They have the same members, so that one layout serves both.

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "core/text.hpp"
#include "requests.hpp"

namespace debias::cli {

using namespace debias::commands;

inline constexpr auto most = std::numeric_limits<std::int64_t>::max();

struct FormatName {
  std::string_view name;
  numbers::Format format;
  numbers::ByteOrder order;
};
inline constexpr auto little = numbers::ByteOrder::little;
inline constexpr auto big = numbers::ByteOrder::big;
inline constexpr std::array<FormatName, 7> formats = {{{"auto", numbers::Format::automatic, little},
                                                       {"text", numbers::Format::text, little},
                                                       {"npy", numbers::Format::npy, little},
                                                       {"f64", numbers::Format::f64, little},
                                                       {"f32", numbers::Format::f32, little},
                                                       {"f64be", numbers::Format::f64, big},
                                                       {"f32be", numbers::Format::f32, big}}};

// The first name of a separator is the one that is written.
inline constexpr std::array<std::pair<std::string_view, char>, 6> separators = {
    {{"auto", '\0'}, {"comma", ','}, {"semicolon", ';'}, {"tab", '\t'}, {"space", ' '}, {"\\t", '\t'}}};

inline std::uint64_t seed_of(const std::string& text, const std::string& name) {
  return parse_count(text, name, 0, std::numeric_limits<std::uint64_t>::max());
}

inline std::uint64_t random_seed() {
  std::random_device device;
  const std::uint64_t high = device();
  const std::uint64_t low = device();
  return high << 32 | low;
}

// 100000 as 1e5, 64 as 64.
inline std::string count_text(std::int64_t n) {
  std::size_t zeros = 0;
  for (; n != 0 && n % 10 == 0; n /= 10) ++zeros;
  return std::to_string(n) + (zeros > 3 ? "e" + std::to_string(zeros) : std::string(zeros, '0'));
}

class Reader {
 public:
  [[maybe_unused]] static constexpr bool reads = true;
  explicit Reader(const Words& words) : words_(words) {}

  const std::string& text(const std::string& field) const {
    const auto at = words_.values.find(field);
    if (at == words_.values.end()) throw std::invalid_argument("no " + field);
    return at->second;
  }
  void text(const std::string& field, std::string& x) const { x = text(field); }
  void flag(const std::string& field, bool& x) const {
    const auto at = words_.flags.find(field);
    if (at == words_.flags.end()) throw std::invalid_argument("no " + field);
    x = at->second;
  }
  template <class T>
  void count(const std::string& field, T& x, std::int64_t low, std::int64_t high = most) const {
    x = static_cast<T>(
        parse_count(text(field), option(field), static_cast<std::uint64_t>(low), static_cast<std::uint64_t>(high)));
  }
  void count_or(const std::string& none, const std::string& field, std::optional<std::int64_t>& x,
                std::int64_t low) const {
    if (text(field) != none) count(field, x.emplace(), low);
  }
  void positive_or(const std::string& none, const std::string& field, double& x) const {
    if (text(field) != none) x = parse_positive(text(field), option(field));
  }
  void seconds_or(const std::string& none, const std::string& field, double& x) const {
    if (text(field) != none) x = parse_seconds(text(field), option(field));
  }
  void share(const std::string& field, double& x) const { x = parse_share(text(field), option(field)); }
  void seed(const std::string& field, std::uint64_t& x) const { x = seed_of(text(field), option(field)); }
  void seed_or_random(const std::string& field, std::uint64_t& x) const {
    static constexpr std::array<std::string_view, 1> random = {"random"};
    if (text(field) == random[0]) {
      x = random_seed();
      return;
    }
    const std::string meant = suggestion(text(field), random);
    if (!meant.empty()) throw std::invalid_argument(option(field) + " = '" + text(field) + "' (not a number)" + meant);
    seed(field, x);
  }
  // One of `names`, in their order.
  void word(const std::string& field, std::size_t& x, std::span<const std::string_view> names, const std::string& what,
            const std::string& why, const std::string& help) const {
    for (x = 0; x < names.size(); ++x) {
      if (text(field) == names[x]) return;
    }
    const std::string meant = suggestion(text(field), names);
    throw std::invalid_argument(what + " '" + text(field) + "' (" + why + ")" + (meant.empty() ? help : meant));
  }
  template <std::size_t n>
  void size(const std::string& field, std::array<int, n>& x) const {
    const std::string& t = text(field);
    std::size_t begin = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t end = i + 1 < n ? t.find('x', begin) : t.size();
      if (end == std::string::npos) {
        throw std::invalid_argument(option(field) + " = '" + t + "' (not " + std::to_string(n) + " numbers); write " +
                                    (n == 2 ? "512x512" : "64x64x64"));
      }
      x[i] = static_cast<int>(
          parse_count(t.substr(begin, end - begin), option(field), 1, PictureRequest::most_pixels_a_side));
      begin = end + 1;
    }
  }
  void size_or_none(const std::string& field, std::optional<std::array<int, 3>>& x) const {
    if (!text(field).empty()) size(field, x.emplace());
  }
  void problem(const catalog::Problem*& x) const { x = &catalog::find(text("problem")); }
  void problems(std::vector<const catalog::Problem*>& x) const {
    for (const std::string& name : words_.names) x.push_back(&catalog::find(name));
  }
  void files(std::vector<std::string>& x) const { x = words_.names; }
  void estimator(std::optional<commands::Estimator>& x) const {
    if (!text("estimator").empty()) x = estimator_of(text("estimator"));
  }
  template <class Method>
  void method(const Method*& x, const Method& (*named)(const std::string&)) const {
    if (!text("estimator").empty()) x = &named(text("estimator"));
  }
  void pmf(PmfChoice& x) const { x = pmf_of(text("pmf")); }
  void points(std::optional<Points>& x) const {
    const auto at = words_.values.find("points");
    if (at != words_.values.end()) x = points_of(at->second);  // checkpoints of before have none
  }
  void format(numbers::Request& x) const {
    const std::string& t = text("format");
    std::vector<std::string_view> names;
    for (const FormatName& f : formats) {
      names.push_back(f.name);
      if (f.name != t) continue;
      x.format = f.format;
      x.order = f.order;
      return;
    }
    throw std::invalid_argument("--format = '" + t + "' (must be text, npy, f64, f32, f64be, f32be or auto)" +
                                suggestion(t, names));
  }
  void separator(char& x) const {
    const std::string& t = text("separator");
    for (const auto& [name, character] : separators) {
      if (name != t) continue;
      x = character;
      return;
    }
    if (t.size() != 1 || t.find_first_not_of(",;\t |:/&~^!$") != t.npos) {
      constexpr std::array<std::string_view, 5> names = {"auto", "comma", "semicolon", "tab", "space"};
      throw std::invalid_argument("--separator = '" + t +
                                  "' (must be comma, semicolon, tab, space, auto, or a character such as |)" +
                                  suggestion(t, names));
    }
    x = t[0];
  }
  void decimal(char& x) const {
    const std::string& t = text("decimal");
    if (t != "." && t != ",") throw std::invalid_argument("--decimal = '" + t + "' (must be . or ,)");
    x = t[0];
  }
  void family(Family& x) const { x = family_of(text("family")); }
  void shard(std::optional<Shard>& x) const {
    const std::string& t = text("shard");
    if (t.empty()) return;
    const std::size_t slash = t.find('/');
    if (slash == std::string::npos) {
      throw std::invalid_argument("--shard = '" + t + "' (must be I/N); write 1/4 for the first of four");
    }
    const auto part = [](const std::string& number, const char* name) {
      return static_cast<std::int64_t>(parse_count(number, name, 0, static_cast<std::uint64_t>(most)));
    };
    x = Shard{part(t.substr(0, slash), "--shard, I"), part(t.substr(slash + 1), "--shard, N")};
  }
  void doubts(std::vector<Warning>& x) const {
    const auto at = words_.values.find("doubts");
    if (at == words_.values.end()) return;  // checkpoints of before have none
    const std::string& t = at->second;
    for (std::size_t begin = 0; begin < t.size();) {
      const std::size_t middle = t.find('\t', begin);
      const std::size_t end = middle == t.npos ? t.npos : t.find('\t', middle + 1);
      if (end == t.npos) throw std::invalid_argument("doubts = '" + t + "' (cut short)");
      x.push_back({warning_named(t.substr(begin, middle - begin)), t.substr(middle + 1, end - middle - 1)});
      begin = end + 1;
    }
  }

 private:
  const Words& words_;
};

class Writer {
 public:
  [[maybe_unused]] static constexpr bool reads = false;

  void text(const std::string& field, const std::string& x) { words.values[field] = x; }
  void flag(const std::string& field, bool x) { words.flags[field] = x; }
  template <class T>
  void count(const std::string& field, T x, std::int64_t /*low*/, std::int64_t /*high*/ = most) {
    text(field, count_text(static_cast<std::int64_t>(x)));
  }
  void count_or(const std::string& none, const std::string& field, const std::optional<std::int64_t>& x,
                std::int64_t /*low*/) {
    text(field, x ? count_text(*x) : none);
  }
  void positive_or(const std::string& none, const std::string& field, double x) {
    text(field, x > 0 ? to_text(x) : none);
  }
  void seconds_or(const std::string& none, const std::string& field, double x) { positive_or(none, field, x); }
  void share(const std::string& field, double x) { text(field, to_text(x)); }
  void seed(const std::string& field, std::uint64_t x) { text(field, std::to_string(x)); }
  void seed_or_random(const std::string& field, std::uint64_t x) { seed(field, x); }
  void word(const std::string& field, std::size_t x, std::span<const std::string_view> names,
            const std::string& /*what*/, const std::string& /*why*/, const std::string& /*help*/) {
    text(field, std::string(names[x]));
  }
  template <std::size_t n>
  void size(const std::string& field, const std::array<int, n>& x) {
    std::string t;
    for (const int side : x) t += (t.empty() ? "" : "x") + std::to_string(side);
    text(field, t);
  }
  void size_or_none(const std::string& field, const std::optional<std::array<int, 3>>& x) {
    x ? size(field, *x) : text(field, "");
  }
  void problem(const catalog::Problem* x) { text("problem", x != nullptr ? x->id : ""); }
  void problems(const std::vector<const catalog::Problem*>& x) {
    for (const catalog::Problem* p : x) words.names.push_back(p->id);
  }
  void files(const std::vector<std::string>& x) { words.names = x; }
  void estimator(const std::optional<commands::Estimator>& x) { text("estimator", x ? name_of(*x) : ""); }
  template <class Method>
  void method(const Method* x, const Method& (*)(const std::string&)) {
    text("estimator", x != nullptr ? std::string(x->name) : "");
  }
  void pmf(const PmfChoice& x) {
    const AnyPmf* pmf = std::get_if<AnyPmf>(&x);
    text("pmf", pmf != nullptr ? pmf->spec() : "declared");
  }
  void points(const std::optional<Points>& x) { text("points", name_of(x)); }
  void format(const numbers::Request& x) {
    for (const FormatName& f : formats) {
      if (f.format == x.format && f.order == x.order) text("format", std::string(f.name));
    }
  }
  void separator(char x) {
    text("separator", std::string(1, x));
    for (const auto& [name, character] : separators) {
      if (character != x) continue;
      text("separator", std::string(name));
      return;
    }
  }
  void decimal(char x) { text("decimal", std::string(1, x)); }
  void family(Family x) { text("family", name_of(x)); }
  void shard(const std::optional<Shard>& x) {
    text("shard", x ? std::to_string(x->index) + "/" + std::to_string(x->of) : "");
  }
  // The code and the text of each, a tab behind either.
  void doubts(const std::vector<Warning>& x) {
    std::string t;
    for (const Warning& doubt : x) t += std::string(name_of(doubt.code)) + '\t' + doubt.text + '\t';
    text("doubts", t);
  }

  Words words;
};

}  // namespace debias::cli
