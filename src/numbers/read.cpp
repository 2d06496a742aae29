#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "numbers/input.hpp"

namespace debias::numbers {
namespace {

using namespace std::string_view_literals;

struct Magic {
  std::string_view bytes;
  const char* name;
  Cause cause;
};

// Long enough that raw numbers begin with none of them by chance.
constexpr std::array magics = {
    Magic{"\x1f\x8b\x08"sv, "gzip (compressed)", Cause::packed},
    Magic{"BZh"sv, "bzip2 (compressed)", Cause::packed},  // and six bytes more, see magic_of
    Magic{"\xfd"
          "7zXZ\0"sv,
          "xz (compressed)", Cause::packed},
    Magic{"\x28\xb5\x2f\xfd"sv, "zstd (compressed)", Cause::packed},
    Magic{"\x04\x22\x4d\x18"sv, "lz4 (compressed)", Cause::packed},
    Magic{"\x1f\x9d\x90"sv, "compress, .Z (compressed)", Cause::packed},
    Magic{"PK\x03\x04"sv, "zip (an archive, as .npz and .xlsx are)", Cause::packed},
    Magic{"PK\x05\x06"sv, "zip (an empty archive)", Cause::packed},
    Magic{"7z\xbc\xaf\x27\x1c"sv, "7z (an archive)", Cause::packed},
    Magic{"\x89HDF\r\n\x1a\n"sv, "HDF5", Cause::other_format},
    Magic{"PAR1"sv, "Parquet", Cause::other_format},
    Magic{"ARROW1"sv, "Arrow", Cause::other_format},
    Magic{"FEA1"sv, "Feather", Cause::other_format},
    Magic{"ORC\x0a"sv, "ORC", Cause::other_format},
    Magic{"CDF\x01"sv, "NetCDF", Cause::other_format},
    Magic{"CDF\x02"sv, "NetCDF", Cause::other_format},
    Magic{"CDF\x05"sv, "NetCDF", Cause::other_format},
    Magic{"MATLAB 5.0 MAT-file"sv, "a MAT-file of MATLAB", Cause::other_format},
    Magic{"SIMPLE  ="sv, "FITS", Cause::other_format},
    Magic{"SQLite format 3\0"sv, "SQLite", Cause::other_format},
    Magic{"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"sv, "an old Excel or Office file", Cause::other_format},
    Magic{"%PDF-"sv, "PDF", Cause::other_format},
};

constexpr std::string_view npy_magic = "\x93NUMPY"sv;
constexpr std::string_view npy_like = "\xc2\x93NUMPY"sv;  // that was taken for text and written as UTF-8

void refuse_magic(std::string_view bytes) {
  if (bytes.starts_with(npy_like)) {
    throw Error(Cause::corrupt, "a .npy file that was written as text (its bytes are UTF-8 now)");
  }
  for (const Magic& m : magics) {
    if (!bytes.starts_with(m.bytes)) continue;
    // gzip: the upper flags are zero; bzip2: a block size, and six digits of pi
    if (m.bytes == "\x1f\x8b\x08"sv && bytes.size() > 3 && static_cast<unsigned char>(bytes[3]) >= 0x20) continue;
    if (m.bytes == "BZh"sv && bytes.substr(std::min<std::size_t>(bytes.size(), 4), 6) != "1AY&SY"sv) continue;
    throw Error(m.cause, std::string("the file is ") + m.name + ", no text and no plain numbers");
  }
}

// Bytes that are zero at every second place, or at three of four.
void refuse_wide_characters(std::string_view bytes) {
  const auto refuse = [](const char* name) {
    throw Error(Cause::encoding, std::string("the file is ") + name + " (text must be ASCII or UTF-8)");
  };
  if (bytes.starts_with("\xff\xfe\0\0"sv) || bytes.starts_with("\0\0\xfe\xff"sv)) refuse("UTF-32");
  if (bytes.starts_with("\xff\xfe"sv) || bytes.starts_with("\xfe\xff"sv)) refuse("UTF-16");
  const std::string_view sample = bytes.substr(0, 1024);
  if (sample.size() < 4) return;
  std::array<std::size_t, 4> zeros{};
  for (std::size_t i = 0; i < sample.size(); ++i) zeros[i % 4] += sample[i] == '\0';
  const std::size_t each = sample.size() / 4;
  const auto all = [&](std::size_t i) { return zeros[i] >= each; };
  const auto none = [&](std::size_t i) { return zeros[i] == 0; };
  if ((none(0) && all(1) && all(2) && all(3)) || (all(0) && all(1) && all(2) && none(3))) refuse("UTF-32");
  if ((none(0) && all(1) && none(2) && all(3)) || (all(0) && none(1) && all(2) && none(3))) refuse("UTF-16");
}

}  // namespace

std::string excerpt(std::string_view text, std::size_t limit) {
  std::string shown(text.substr(0, limit));
  for (char& c : shown) c = static_cast<unsigned char>(c) < ' ' || c == '\x7f' ? '?' : c;
  return "'" + shown + (text.size() > limit ? "..." : "") + "'";
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < std::min<std::size_t>(names.size(), 10); ++i) text += (i > 0 ? ", " : "") + names[i];
  return names.size() > 10 ? text + ", ..." : text;
}

Report read(const Bytes& bytes, const Request& request, const Take& take) {
  Input input(bytes);
  Report report;
  const bool is_npy = input.window().starts_with(npy_magic);
  report.format = request.format;
  if (report.format == Format::automatic) report.format = is_npy ? Format::npy : Format::text;
  const bool text = report.format == Format::text;
  if (is_npy && report.format != Format::npy) {
    throw Error(Cause::npy, std::string("the file is .npy of NumPy (not ") + (text ? "text)" : "raw numbers)"));
  }
  if (!is_npy && report.format == Format::npy) {
    refuse_magic(input.window());
    throw Error(Cause::corrupt, "no .npy file (it must begin with \\x93NUMPY)");
  }
  if (!is_npy) refuse_magic(input.window());
  if (text) {
    refuse_wide_characters(input.window());
    read_text(input, request, report, take);
    return report;
  }
  if (request.separator != 0 || request.decimal != '.' || request.header != Header::guess) {
    throw Error(Cause::request, "separator, decimal mark and header (are of text)");
  }
  if (is_npy) {
    read_npy(input, request, report, take);
  } else {
    if (!request.column.empty()) throw Error(Cause::request, "a column (raw numbers have none)");
    read_raw(input, request, report, take);
  }
  return report;
}

}  // namespace debias::numbers
