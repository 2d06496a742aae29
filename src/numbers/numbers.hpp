#pragma once

// Numbers from a file of anyone's: rows of text, NumPy's .npy, raw floats. One pass, bounded memory, nothing guessed
// in silence.
//
//   read(bytes, request, take)   hands every number to `take`, in blocks of consecutive rows; returns what was taken
//                                for what: separator, header, column, comments, and the rows that hold no number.
//
// What cannot be read as a whole throws Error, which carries a cause: whoever asked words the advice. A single row
// that holds no number is left out, counted and named, or refused where the request is strict. Sizes that a file
// claims of itself are never allocated. Sources: NumPy enhancement proposal 1 (.npy); RFC 4180 (quotes).

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace debias::numbers {

enum class Format { automatic, text, npy, f32, f64 };
enum class ByteOrder { little, big };
enum class Header { guess, yes, no };

struct Request {
  Format format = Format::automatic;    ///< automatic: .npy by its first bytes, else text
  ByteOrder order = ByteOrder::little;  ///< of f32 and f64; .npy says its own
  std::string column;                   ///< a name, or a number from 1; empty: the only one
  char separator = 0;                   ///< between fields of text; ' ' is any run of blanks, 0 is guessed
  char decimal = '.';                   ///< or ','
  Header header = Header::guess;
  bool strict = false;  ///< refuse what would be left out, and what is in doubt
};

/// Why a file is refused, or doubted: what the reader's advice depends on.
enum class Cause {
  request,        ///< does not fit the format
  which_column,   ///< several, and none was named
  no_column,      ///< of that name or number
  array_column,   ///< of a .npy array: several and none was named, or not that number
  doubled_name,   ///< names two columns
  ragged,         ///< a row has more or fewer fields than the first one
  decimal_comma,  ///< a comma within a number
  decimal_point,  ///< a point where commas were announced
  thousands,      ///< separators of thousands within a number
  encoding,       ///< UTF-16, UTF-32
  packed,         ///< compressed, or an archive
  other_format,   ///< some other program's binary format
  npy,            ///< a .npy file where raw numbers or text were announced
  complex,        ///< complex numbers
  unsupported,    ///< a .npy type or shape that is no column of real numbers
  corrupt,        ///< a header that is none, fewer or more bytes than it says
  left_out,       ///< strict, and a row holds no number
  header,         ///< a first row that may be a header or not
  byte_order,     ///< raw numbers look like those of the other byte order
  rounded         ///< whole numbers beyond 2^53
};

class Error : public std::runtime_error {
 public:
  Error(Cause cause, const std::string& problem) : std::runtime_error(problem), cause_(cause) {}
  [[nodiscard]] Cause cause() const { return cause_; }

 private:
  Cause cause_;
};

struct BadRow {
  std::int64_t row = 0;
  std::string reason;
};

struct Doubt {
  Cause cause;
  std::string text;
};

/// What was taken for what. Rows are lines of the file, numbered from 1, header, comments and bad ones included;
/// those of binary formats are values, or rows of the array.
struct Report {
  Format format = Format::f64;
  ByteOrder order = ByteOrder::little;
  std::string type;    ///< of .npy: "float32, shape (3, 4), ..."
  char separator = 0;  ///< 0: a number a row
  bool separator_guessed = false;
  std::size_t columns = 1;
  std::size_t column_number = 1;
  std::string column;   ///< its name, if there is a header
  bool header = false;  ///< the first row was taken as one
  bool header_guessed = false;
  std::string first_row;      ///< as it stands, if it is short
  std::int64_t comments = 0;  ///< rows that begin with #
  std::int64_t values = 0;
  std::int64_t bad_rows = 0;           ///< left out
  std::vector<BadRow> first_bad_rows;  ///< at most five
  std::vector<Doubt> doubts;
};

/// Fills as much of the span as there is; fewer bytes than asked for only at the end.
using Bytes = std::function<std::size_t(std::span<char>)>;
/// Values of consecutive rows, at most 256 of them.
using Take = std::function<void(std::span<const double> values, std::int64_t first_row)>;

/// The longest row of text, and the longest header.
inline constexpr std::size_t buffer_size = std::size_t{1} << 20;

/// Throws Error, and what `bytes` and `take` throw.
Report read(const Bytes& bytes, const Request& request, const Take& take);

}  // namespace debias::numbers
