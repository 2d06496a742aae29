#include "core/part_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include <debias/core/stream.hpp>

namespace debias {
namespace {

constexpr std::string_view magic = "DEBIASCP";
constexpr std::uint32_t format_version = 4;
constexpr std::uint32_t byte_order = 0x01020304;
constexpr std::uint32_t record_mark = 0x44434552;  // "RECD"

Bytes header_of(const std::string& text) {
  ByteWriter w;
  for (const char c : magic) w.number(static_cast<unsigned char>(c));
  w.number(format_version);
  w.number(byte_order);
  w.number(static_cast<std::uint32_t>(Stream::layout_version));
  w.text(text);
  w.number(crc32(w.bytes));
  return std::move(w.bytes);
}

Bytes record_of(const std::string& name, std::span<const std::byte> contents) {
  ByteWriter w;
  w.number(record_mark);
  w.number(static_cast<std::uint64_t>(8 + name.size() + contents.size()));
  w.text(name);
  w.bytes.insert(w.bytes.end(), contents.begin(), contents.end());
  w.number(crc32(w.bytes));
  return std::move(w.bytes);
}

// The payload of the record at the front, if it is whole.
std::optional<std::span<const std::byte>> next_record(ByteReader& r, std::span<const std::byte> bytes) {
  const std::size_t start = r.position();
  std::uint32_t mark = 0;
  std::uint64_t size = 0;
  if (r.left() < 16) return std::nullopt;
  r.number(mark);
  r.number(size);
  if (mark != record_mark || r.left() < 4 || size > r.left() - 4) return std::nullopt;
  const auto payload = r.take(size);
  const std::uint32_t expected = crc32(bytes.subspan(start, r.position() - start));
  std::uint32_t stated = 0;
  r.number(stated);
  if (stated != expected) return std::nullopt;
  return payload;
}

[[noreturn]] void fail(const std::string& path) {
  throw std::system_error(errno, std::generic_category(), "'" + path + "'");
}

void demand_regular(const struct stat& status, const std::string& path) {
  if (S_ISREG(status.st_mode)) return;
  if (!S_ISDIR(status.st_mode)) {
    throw std::system_error(EINVAL, std::generic_category(), "'" + path + "' is no regular file");
  }
  errno = EISDIR;
  fail(path);
}

}  // namespace

namespace detail {

class File {
 public:
  File(const std::string& path, int flags) : path_(path), descriptor_(open(path.c_str(), flags | O_CLOEXEC, 0666)) {
    if (descriptor_ < 0) fail(path);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  ~File() { close(descriptor_); }
  void write_all(std::span<const std::byte> bytes) const {
    while (!bytes.empty()) {
      const auto n = write(descriptor_, bytes.data(), bytes.size());
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) fail(path_);
      bytes = bytes.subspan(static_cast<std::size_t>(n));
    }
    if (fsync(descriptor_) != 0) fail(path_);
  }
  [[nodiscard]] struct stat status() const {
    struct stat status = {};
    if (fstat(descriptor_, &status) != 0) fail(path_);
    return status;
  }
  // Those of [offset, offset + size) that there are.
  [[nodiscard]] Bytes read(std::uint64_t offset, std::uint64_t size) const {
    Bytes bytes(static_cast<std::size_t>(size));
    std::size_t filled = 0;
    while (filled < bytes.size()) {
      const auto n =
          pread(descriptor_, bytes.data() + filled, bytes.size() - filled, static_cast<off_t>(offset + filled));
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) fail(path_);
      if (n == 0) break;
      filled += static_cast<std::size_t>(n);
    }
    bytes.resize(filled);
    return bytes;
  }
  void sync() const { fsync(descriptor_); }

 private:
  std::string path_;
  int descriptor_;
};

}  // namespace detail

namespace {

using detail::File;

// Where the header and the records end that say how long they are: a tail of a terabyte is not read.
std::uint64_t end_of_records(const File& file, std::uint64_t size) {
  const auto length_at = [&](std::uint64_t position, std::uint32_t mark) {
    const Bytes bytes = file.read(position, mark == 0 ? 8 : 12);
    ByteReader r(bytes);
    std::uint32_t found = 0;
    std::uint64_t length = 0;
    if (mark != 0) r.number(found);
    r.number(length);
    return found == mark ? length : size;
  };
  constexpr std::uint64_t before_text = 20;
  if (size < before_text + 12) return size;
  const std::uint64_t text = length_at(before_text, 0);
  if (text > size - before_text - 12) return before_text + 8;
  std::uint64_t end = before_text + 8 + text + 4;
  while (size - end >= 16) {
    const std::uint64_t length = length_at(end, record_mark);
    if (length > size - end - 16) break;
    end += 16 + length;
  }
  return end;
}

}  // namespace

PartFile parse_parts(std::span<const std::byte> bytes) {
  PartFile result;
  ByteReader r(bytes);
  const auto refuse = [](const std::string& why) { throw std::invalid_argument("no checkpoint: " + why); };
  try {
    const auto name = r.take(magic.size());
    if (std::memcmp(name.data(), magic.data(), magic.size()) != 0) refuse("it does not begin with DEBIASCP");
    std::uint32_t format = 0;
    std::uint32_t order = 0;
    std::uint32_t layout = 0;
    r.number(format);
    r.number(order);
    r.number(layout);
    if (order != byte_order) refuse("its byte order is not little endian");
    if (format != format_version)
      refuse("its format is version " + std::to_string(format) + ", not " + std::to_string(format_version));
    r.text(result.text);
    const std::uint32_t expected = crc32(bytes.first(r.position()));
    std::uint32_t stated = 0;
    r.number(stated);
    if (stated != expected) refuse("the checksum of its header is wrong");
    if (layout != static_cast<std::uint32_t>(Stream::layout_version)) {
      refuse("its samples are of stream layout " + std::to_string(layout) + ", not " +
             std::to_string(Stream::layout_version));
    }
  } catch (const std::invalid_argument& e) {
    if (std::string_view(e.what()).starts_with("no checkpoint")) throw;
    refuse(e.what());
  }
  std::size_t whole = r.position();
  std::map<std::string, std::span<const std::byte>> last;
  while (const auto payload = next_record(r, bytes)) {
    ByteReader part(*payload);
    std::string name;
    try {
      part.text(name);
    } catch (const std::invalid_argument& e) {
      refuse(e.what());
    }
    last[name] = payload->subspan(part.position());
    whole = r.position();
  }
  result.dropped = bytes.size() - whole;
  for (const auto& [name, contents] : last) result.parts[name].assign(contents.begin(), contents.end());
  return result;
}

PartFile read_parts(const std::string& path) {
  const File file(path, O_RDONLY | O_NONBLOCK);  // else a pipe would be waited for
  const struct stat status = file.status();
  demand_regular(status, path);
  const auto size = static_cast<std::uint64_t>(status.st_size);
  const std::uint64_t end = end_of_records(file, size);
  PartFile parts = parse_parts(file.read(0, end));
  parts.dropped += static_cast<std::size_t>(size - end);
  return parts;
}

Bytes encode(const std::string& text, const Parts& parts) {
  Bytes bytes = header_of(text);
  for (const auto& [name, contents] : parts) {
    const Bytes record = record_of(name, contents);
    bytes.insert(bytes.end(), record.begin(), record.end());
  }
  return bytes;
}

PartWriter::PartWriter(std::string path, std::string text, Parts parts)
    : path_(std::move(path)), text_(std::move(text)), parts_(std::move(parts)) {
  write_whole();
}

void PartWriter::write_whole() {
  struct stat status = {};
  if (stat(path_.c_str(), &status) == 0) {
    demand_regular(status, path_);  // never put a file in place of a device
  } else if (errno != ENOENT) {
    fail(path_);
  }
  const Bytes bytes = encode(text_, parts_);
  const std::string temporary = path_ + ".debias-new";
  unlink(temporary.c_str());  // of a run that was killed; never written into, since it could be another run's
  auto file = std::make_unique<File>(temporary, O_WRONLY | O_CREAT | O_EXCL | O_APPEND);
  file->write_all(bytes);
  if (rename(temporary.c_str(), path_.c_str()) != 0) fail(path_);
  const std::size_t slash = path_.rfind('/');
  File(slash == std::string::npos ? "." : path_.substr(0, slash + 1), O_RDONLY | O_DIRECTORY).sync();
  least_size_ = size_ = bytes.size();
  own_ = std::move(file);
}

PartWriter::~PartWriter() = default;

// False where it was deleted. Records of two runs in one file would be a wrong result.
bool PartWriter::is_there() const {
  struct stat status = {};
  if (stat(path_.c_str(), &status) != 0) {
    if (errno == ENOENT) return false;
    fail(path_);
  }
  const struct stat own = own_->status();
  if (status.st_ino == own.st_ino && status.st_dev == own.st_dev) return true;
  throw std::system_error(EEXIST, std::generic_category(),
                          "'" + path_ + "': another run has put a file of its own here");
}

void PartWriter::restart(std::string text, Parts parts) {
  is_there();
  text_ = std::move(text);
  parts_ = std::move(parts);
  write_whole();
}

void PartWriter::save(const Parts& parts) {
  Bytes bytes;
  for (const auto& [name, contents] : parts) {
    parts_[name] = contents;
    const Bytes record = record_of(name, contents);
    bytes.insert(bytes.end(), record.begin(), record.end());
  }
  if (!is_there() || size_ + bytes.size() > 4 * least_size_ + most_waste) return write_whole();
  own_->write_all(bytes);
  size_ += bytes.size();
}

}  // namespace debias
