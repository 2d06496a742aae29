// Checkpoints of any bytes. The first byte chooses: the file as it is, or its text and records in a right header with
// right checksums, or the contents of one part: the sums of a run, of an image, of a photon image. What is accepted is
// written again to the same bytes, and goes through everything that is done with it.

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <memory>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <debias/core/estimate.hpp>
#include <nlohmann/json.hpp>

#include "commands/run.hpp"
#include "core/part_file.hpp"
#include "core/run_state_bytes.hpp"
#include "render/photons.hpp"
#include "render/transmittance.hpp"

namespace {

using namespace debias;

void demand(bool holds) {
  if (!holds) std::abort();
}

template <class Read>
bool accepted(const Read& read) {
  try {
    read();
    return true;
  } catch (const std::invalid_argument& e) {
    demand(*e.what() != '\0');
    return false;
  }
}

bool equal(const Parts& a, const Parts& b) { return a == b; }

// By the file and by the bytes, and written again.
void read_file(std::span<const std::byte> bytes) {
  const int file = memfd_create("fuzz", 0);
  demand(file >= 0 && write(file, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()));
  const std::string path = "/proc/self/fd/" + std::to_string(file);
  PartFile parsed;
  PartFile read;
  const bool by_bytes = accepted([&] { parsed = parse_parts(bytes); });
  const bool by_file = accepted([&] { read = read_parts(path); });
  close(file);
  demand(by_bytes == by_file);
  demand(parsed.text == read.text && equal(parsed.parts, read.parts) && parsed.dropped == read.dropped);
}

Bytes file_of(std::span<const std::byte> text, std::span<const std::byte> records) {
  ByteWriter w;
  for (const char c : std::string_view("DEBIASCP")) w.number(static_cast<unsigned char>(c));
  constexpr auto layout = static_cast<std::uint32_t>(Stream::layout_version);
  for (const std::uint32_t number : {4U, 0x01020304U, layout}) w.number(number);
  w.text({reinterpret_cast<const char*>(text.data()), text.size()});
  w.number(crc32(w.bytes));
  ByteReader r(records);
  while (r.left() > 0) {  // a length of one byte, and as many bytes
    std::uint8_t length = 0;
    r.number(length);
    ByteWriter record;
    record.number(std::uint32_t{0x44434552});
    const auto payload = r.take(std::min<std::uint64_t>(length, r.left()));
    record.number(static_cast<std::uint64_t>(payload.size()));
    record.bytes.insert(record.bytes.end(), payload.begin(), payload.end());
    record.number(crc32(record.bytes));
    w.bytes.insert(w.bytes.end(), record.bytes.begin(), record.bytes.end());
  }
  return std::move(w.bytes);
}

double draw(Stream& rng) { return rng.uniform() * rng.normal(); }

// A result of these sums: text, JSON and verdict.
void finish(const Statistics& s) {
  const catalog::Problem& problem = catalog::find("A01");
  const catalog::Choice choice;
  const RunVerdict verdict = s.verdict();
  const Interval interval = s.interval(verdict);
  const commands::RunReport report{&problem, choice, std::nullopt, s, verdict, interval, DeclaredFiniteness(), 0.5};
  std::ostringstream out;
  print(out, report);
  demand(nlohmann::json::accept(commands::to_json(report)));
}

void go_on(const RunState& state) {
  const auto same = std::make_shared<RunState>(state);
  RunState::Range range{state.first(), state.last()};
  std::int64_t missing = 0;
  for (const auto& [first, last] : state.missing(range)) missing += last - first;
  if (range.second == 0 || missing > 10'000 || range.second > (std::int64_t{1} << 62)) return;
  for (const std::int64_t more : {0, 600}) {
    const Plan plan{.samples = range.second - range.first + more, .first = range.first, .threads = 1, .earlier = same};
    accepted([&] { finish(estimate(draw, plan)); });
  }
}

void read_sums(std::span<const std::byte> bytes) {
  RunState state;
  if (!accepted([&] { state = decode(bytes); })) return;
  const Bytes written = encode(state);
  demand(encode(decode(written)) == written);
  static_cast<void>(state.contiguous());
  static_cast<void>(state.total());
  static const RunState other = estimate(draw, {.samples = 700, .first = 512, .threads = 1}).state;
  accepted([&] {
    RunState both = state;
    both.merge(other);
    demand(encode(decode(encode(both))) == encode(both));
    go_on(both);
  });
  go_on(state);
}

template <class Plan>
Plan small_plan(std::span<const std::byte> bytes, Bytes& kept) {
  Plan plan;
  plan.width = 4;
  plan.height = 4;
  plan.threads = 1;
  plan.saving.earlier = bytes;
  plan.saving.save = [&kept](const std::function<Bytes()>& sums, bool) { kept = sums(); };
  return plan;
}

void read_image(std::span<const std::byte> bytes) {
  static const render::Cloud cloud(8);
  Bytes kept;
  Bytes again;
  auto plan = small_plan<render::RenderPlan>(bytes, kept);
  if (!accepted([&] { render::render(cloud, render::transmittance_methods()[3], plan); })) return;
  plan = small_plan<render::RenderPlan>(kept, again);
  render::transmittance_of(render::render(cloud, render::transmittance_methods()[3], plan), plan);
}

void read_photons(std::span<const std::byte> bytes) {
  Bytes kept;
  Bytes again;
  auto plan = small_plan<render::PhotonPlan>(bytes, kept);
  plan.photons = 100;
  if (!accepted([&] { render::render(render::photon_methods()[5], plan); })) return;
  plan = small_plan<render::PhotonPlan>(kept, again);
  plan.photons = 100;
  render::render(render::photon_methods()[5], plan);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::span<const std::byte> bytes = std::as_bytes(std::span(data, size)).subspan(1);
  switch (data[0] % 8) {
    case 0:
      read_file(bytes);
      break;
    case 1: {
      const std::size_t text = std::min<std::size_t>(bytes.size(), 8);
      read_file(file_of(bytes.first(text), bytes.subspan(text)));
      break;
    }
    case 2:
      read_image(bytes);
      break;
    case 3:
      read_photons(bytes);
      break;
    default:
      read_sums(bytes);
  }
  return 0;
}
