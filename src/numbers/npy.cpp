// NumPy's .npy: a magic, a version, the length of a header, the header as a Python dict, and the array. Nothing that
// the header claims is believed before the bytes are there, and no memory is asked for by it.

#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "numbers/input.hpp"

namespace debias::numbers {
namespace {

constexpr std::uint64_t most = std::numeric_limits<std::int64_t>::max();

/// a b, or nothing where 63 bits do not hold it.
std::optional<std::uint64_t> product(std::uint64_t a, std::uint64_t b) {
  if (a != 0 && b > most / a) return std::nullopt;
  return a * b;
}

[[noreturn]] void corrupt(const std::string& what) { throw Error(Cause::corrupt, ".npy: " + what); }
[[noreturn]] void unsupported(const std::string& what) { throw Error(Cause::unsupported, ".npy: " + what); }

/// One field of a record, or the whole of it.
struct Field {
  std::string name;
  std::string type;  // "<f8"
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;  // of all its elements
  bool scalar = true;
};

struct Array {
  std::vector<Field> fields;
  bool structured = false;
  std::uint64_t record = 0;  // bytes
  bool fortran = false;
  std::vector<std::uint64_t> shape;
};

/// The bytes of an element of type "<f8"; U counts characters of four bytes.
std::uint64_t size_of(const std::string& type) {
  const std::size_t digits = type.find_first_of("0123456789");
  if (type == "|O" || type == "O") unsupported("Python objects, type " + excerpt(type));
  if (type.empty() || digits == std::string::npos || digits < 1) unsupported("elements of type " + excerpt(type));
  std::uint64_t size = 0;
  std::string_view rest = std::string_view(type).substr(digits);
  const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), size);
  rest = rest.substr(static_cast<std::size_t>(end - rest.data()));
  const bool has_unit = type[digits - 1] == 'M' || type[digits - 1] == 'm';  // M8[ns]
  if (error != std::errc{} || size > (std::uint64_t{1} << 40) || (!rest.empty() && !has_unit)) {
    unsupported("elements of type " + excerpt(type));
  }
  return type[digits - 1] == 'U' ? 4 * size : size;
}

/// The header: {'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }
class Parser {
 public:
  explicit Parser(std::string_view text) : rest_(text) {}

  Array parse() {
    Array array;
    bool has_type = false;
    bool has_order = false;
    bool has_shape = false;
    expect('{');
    while (!take('}')) {
      const std::string key = text();
      expect(':');
      if (key == "descr") {
        has_type = true;
        type(array);
      } else if (key == "fortran_order") {
        has_order = true;
        array.fortran = truth();
      } else if (key == "shape") {
        has_shape = true;
        array.shape = tuple();
      } else {
        corrupt("its header has a key " + excerpt(key));
      }
      if (!take(',') && peek() != '}') fail();
    }
    blanks();
    if (!rest_.empty()) fail();
    if (!has_type || !has_order || !has_shape) corrupt("its header lacks descr, fortran_order or shape");
    return array;
  }

 private:
  [[noreturn]] void fail() const { corrupt("its header cannot be read at " + excerpt(rest_, 20)); }
  void blanks() {
    while (!rest_.empty() && (rest_[0] == ' ' || rest_[0] == '\n' || rest_[0] == '\t')) rest_.remove_prefix(1);
  }
  char peek() {
    blanks();
    return rest_.empty() ? '\0' : rest_[0];
  }
  bool take(char c) {
    if (peek() != c || rest_.empty()) return false;
    rest_.remove_prefix(1);
    return true;
  }
  void expect(char c) {
    if (!take(c)) fail();
  }
  std::string text() {
    if (peek() == 'u' || peek() == 'b') rest_.remove_prefix(1);  // Python 2
    const char quote = peek();
    if (quote != '\'' && quote != '"') fail();
    const std::size_t end = rest_.find(quote, 1);
    if (end == rest_.npos) fail();
    std::string word(rest_.substr(1, end - 1));
    rest_.remove_prefix(end + 1);
    return word;
  }
  bool truth() {
    for (const bool b : {false, true}) {
      const std::string_view word = b ? "True" : "False";
      peek();
      if (!rest_.starts_with(word)) continue;
      rest_.remove_prefix(word.size());
      return b;
    }
    fail();
  }
  std::uint64_t whole() {
    peek();
    std::uint64_t n = 0;
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), n);
    if (error != std::errc{} || n > most) fail();
    rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
    if (!rest_.empty() && rest_[0] == 'L') rest_.remove_prefix(1);  // Python 2
    return n;
  }
  std::vector<std::uint64_t> tuple() {
    constexpr std::size_t most_dimensions = 64;
    std::vector<std::uint64_t> numbers;
    expect('(');
    while (!take(')')) {
      if (numbers.size() == most_dimensions) corrupt("its header has a shape of more than 64 dimensions");
      numbers.push_back(whole());
      if (!take(',') && peek() != ')') fail();
    }
    return numbers;
  }
  void type(Array& array) {
    if (peek() != '[') {
      Field f;
      f.type = text();
      f.bytes = array.record = size_of(f.type);
      array.fields.push_back(f);
      return;
    }
    array.structured = true;
    expect('[');
    while (!take(']')) {
      Field f;
      expect('(');
      if (peek() == '(') {  // a title and a name
        expect('(');
        text();
        expect(',');
        f.name = text();
        expect(')');
      } else {
        f.name = text();
      }
      expect(',');
      if (peek() == '[') unsupported("records within records (field " + excerpt(f.name) + ")");
      f.type = text();
      std::optional<std::uint64_t> bytes = size_of(f.type);
      if (take(',')) {
        f.scalar = false;
        for (const std::uint64_t n : peek() == '(' ? tuple() : std::vector<std::uint64_t>{whole()}) {
          if (bytes) bytes = product(*bytes, n);
        }
      }
      expect(')');
      f.offset = array.record;
      if (!bytes || *bytes > most - array.record) corrupt("its header claims a record beyond 64 bits");
      f.bytes = *bytes;
      array.record += *bytes;
      if (!f.name.empty()) array.fields.push_back(f);  // else padding
      if (!take(',') && peek() != ']') fail();
    }
  }

  std::string_view rest_;
};

struct Number {
  char kind = 'f';
  std::uint64_t bytes = 8;
  bool big = false;
};

/// A type of real numbers; anything else is refused by its name.
Number number_of(const Field& field) {
  const std::string& t = field.type;
  const std::string where = field.name.empty() ? "" : " (field " + excerpt(field.name) + ")";
  if (!field.scalar) unsupported("an array in each record" + where);
  const bool has_order = t[0] == '<' || t[0] == '>' || t[0] == '|' || t[0] == '=';
  const char kind = t[has_order ? 1 : 0];
  const std::uint64_t size = field.bytes;
  const std::string name = "type " + excerpt(t) + where;
  if (kind == 'c') throw Error(Cause::complex, ".npy: complex numbers, " + name);
  if (kind == 'S' || kind == 'U' || kind == 'a') unsupported("strings, " + name);
  if (kind == 'M' || kind == 'm') unsupported("dates or times, " + name);
  if (kind == 'O') unsupported("Python objects, " + name);
  if (kind == 'V') unsupported("raw bytes, " + name);
  const bool known = kind == 'f'                  ? size == 2 || size == 4 || size == 8
                     : kind == 'b'                ? size == 1
                     : kind == 'i' || kind == 'u' ? size == 1 || size == 2 || size == 4 || size == 8
                                                  : false;
  if (!known) unsupported((kind == 'f' && size > 8 ? "long doubles, " : "elements of ") + name);
  const bool native_big = std::endian::native == std::endian::big;
  const bool big = t[0] == '>' || (t[0] != '<' && native_big);
  return {kind, size, big};
}

double half(std::uint16_t bits) {
  const int exponent = (bits >> 10) & 31;
  const int digits = bits & 1023;
  double x = 0;
  if (exponent == 31) {
    x = digits == 0 ? std::numeric_limits<double>::infinity() : std::numeric_limits<double>::quiet_NaN();
  } else {
    x = exponent == 0 ? std::ldexp(digits, -24) : std::ldexp(digits + 1024, exponent - 25);
  }
  return (bits & 0x8000) != 0 ? -x : x;
}

class Reader {
 public:
  explicit Reader(const Number& type) : type_(type) {}

  double operator()(const char* bytes) {
    std::uint64_t bits = 0;
    for (std::uint64_t i = 0; i < type_.bytes; ++i) {
      const std::uint64_t byte = static_cast<unsigned char>(bytes[type_.big ? i : type_.bytes - 1 - i]);
      bits = (bits << 8) | byte;
    }
    switch (type_.kind) {
      case 'f':
        if (type_.bytes == 8) return std::bit_cast<double>(bits);
        if (type_.bytes == 4) return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
        return half(static_cast<std::uint16_t>(bits));
      case 'b':
        return bits != 0 ? 1 : 0;
      case 'u':
        rounded_ += type_.bytes == 8 && bits > exact;
        return static_cast<double>(bits);
      default: {
        const auto unused = static_cast<unsigned>(64 - 8 * type_.bytes);
        const auto n = std::bit_cast<std::int64_t>(bits << unused) >> unused;
        const std::uint64_t size = n < 0 ? 0 - static_cast<std::uint64_t>(n) : static_cast<std::uint64_t>(n);
        rounded_ += size > exact;
        return static_cast<double>(n);
      }
    }
  }
  [[nodiscard]] std::int64_t rounded() const { return rounded_; }

 private:
  static constexpr std::uint64_t exact = std::uint64_t{1} << 53;
  Number type_;
  std::int64_t rounded_ = 0;
};

std::string shape_text(const std::vector<std::uint64_t>& shape) {
  std::string text = "(";
  for (std::size_t i = 0; i < shape.size(); ++i) text += (i > 0 ? ", " : "") + std::to_string(shape[i]);
  return text + (shape.size() == 1 ? ",)" : ")");
}

Array read_header(Input& input) {
  std::string_view bytes = input.window();
  const auto byte = [&bytes](std::size_t i) { return static_cast<std::size_t>(static_cast<unsigned char>(bytes[i])); };
  if (bytes.size() < 10) corrupt("cut short within its header");
  const std::size_t version = byte(6);
  if (version < 1 || version > 3) corrupt("version " + std::to_string(version) + " of the format (1 to 3 are known)");
  const std::size_t start = version == 1 ? 10 : 12;
  if (bytes.size() < start) corrupt("cut short within its header");
  std::size_t length = byte(8) + 256 * byte(9);
  if (version > 1) length += (byte(10) << 16) + (byte(11) << 24);
  if (length > bytes.size() - start) {  // the window is as long as any header may be
    corrupt(input.at_end() ? "cut short within its header" : "its header claims " + std::to_string(length) + " bytes");
  }
  Array array = Parser(bytes.substr(start, length)).parse();
  input.consume(start + length);
  return array;
}

/// Skips bytes that are not looked at; how many there were.
std::uint64_t skip(Input& input, std::uint64_t bytes) {
  std::uint64_t skipped = 0;
  while (true) {
    const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(bytes - skipped, input.window().size()));
    input.consume(n);
    skipped += n;
    if (skipped == bytes || (n == 0 && input.at_end())) return skipped;
    if (input.window().empty() && !input.at_end()) input.fill();
  }
}

}  // namespace

void read_npy(Input& input, const Request& request, Report& report, const Take& take) {
  Sink sink(take, request, report);
  const Array array = read_header(input);
  const std::vector<std::uint64_t>& shape = array.shape;
  const std::string shown = "shape " + shape_text(shape);
  if (shape.size() > 2) {
    unsupported(std::to_string(shape.size()) + " dimensions, " + shown + " (one, or two: rows and columns)");
  }
  if (array.structured && shape.size() > 1) unsupported("records of " + shown + " (one dimension is read)");
  if (array.fields.empty()) unsupported("records without fields");

  // Which numbers of the file: `count` of them, every `stride` bytes from `offset` on.
  std::uint64_t count = shape.empty() ? 1 : shape[0];
  std::uint64_t columns = shape.size() == 2 ? shape[1] : 1;
  std::vector<std::string> names;
  if (array.structured) {
    for (const Field& f : array.fields) names.push_back(f.name);
  } else {
    for (std::uint64_t c = 1; c <= std::min<std::uint64_t>(columns, 11); ++c) names.push_back(std::to_string(c));
  }
  std::size_t chosen = 0;
  if (array.structured) {
    report.columns = names.size();
    report.header = true;
    chosen = find_column(request.column, names, true);
    report.column = names[chosen];
  } else {
    report.columns = static_cast<std::size_t>(columns);
    if (columns == 0) count = 0;
    if (request.column.empty() && columns > 1) {
      throw Error(Cause::array_column, std::to_string(columns) + " columns (.npy, " + shown + ")");
    }
    if (!request.column.empty()) {
      std::uint64_t number = 0;
      const std::string& c = request.column;
      const auto [end, error] = std::from_chars(c.data(), c.data() + c.size(), number);
      if (error != std::errc{} || end != c.data() + c.size() || number < 1 || number > columns) {
        throw Error(Cause::array_column, "column " + excerpt(c) + " (.npy, " + shown + ": a number from 1 to " +
                                             std::to_string(columns) + ")");
      }
      chosen = static_cast<std::size_t>(number - 1);
    }
  }
  report.column_number = chosen + 1;
  const Field& field = array.fields[array.structured ? chosen : 0];
  const Number type = number_of(field);

  const std::optional<std::uint64_t> cells = product(count, columns);
  const std::optional<std::uint64_t> total = cells ? product(*cells, array.record) : std::nullopt;
  if (!total) corrupt("its header claims " + shown + " (beyond 64 bits)");
  const bool by_columns = array.fortran && columns > 1;
  const std::uint64_t stride = by_columns ? array.record : array.record * columns;  // no overflow where count > 0
  const std::uint64_t offset = array.structured ? field.offset : (by_columns ? chosen * count : chosen) * type.bytes;
  report.order = type.big ? ByteOrder::big : ByteOrder::little;
  report.type = "type " + field.type + ", " + shown + (array.fortran && shape.size() > 1 ? ", Fortran order" : "");

  Reader number(type);
  const auto cut = [&](std::uint64_t there) {
    corrupt("cut short: " + std::to_string(there) + " bytes of the " + std::to_string(*total) +
            " that its header claims (" + shown + ")");
  };
  std::uint64_t position = 0;
  for (std::uint64_t row = 0; row < count; ++row) {
    const std::uint64_t here = row * stride + offset;
    if (here > position) position += skip(input, here - position);
    while (position == here && input.window().size() < type.bytes && !input.at_end()) input.fill();
    if (position < here || input.window().size() < type.bytes) cut(position + input.window().size());
    sink.add(number(input.window().data()), static_cast<std::int64_t>(row) + 1);
    input.consume(type.bytes);
    position += type.bytes;
  }
  position += skip(input, *total - position);
  if (position < *total) cut(position);
  if (input.window().empty() && !input.at_end()) input.fill();
  if (!input.window().empty()) {
    corrupt("more bytes than the " + std::to_string(*total) + " that its header claims (" + shown + ")");
  }
  sink.flush();
  if (number.rounded() > 0) {
    sink.doubt(Cause::rounded, std::to_string(number.rounded()) +
                                   (number.rounded() == 1 ? " whole number lies" : " whole numbers lie") +
                                   " beyond 2^53, where a double does not hold every one");
  }
}

}  // namespace debias::numbers
