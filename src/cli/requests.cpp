#include "requests.hpp"

#include <algorithm>
#include <limits>
#include <random>
#include <span>
#include <stdexcept>
#include <utility>

#include "core/text.hpp"

namespace debias::cli {
namespace {

using namespace debias::commands;

constexpr auto most = std::numeric_limits<std::int64_t>::max();

constexpr std::array<std::string_view, 3> topics = {"problems", "estimators", "pmfs"};
constexpr std::array<std::string_view, 2> scenes = {"direct", "sphere"};

struct FormatName {
  std::string_view name;
  numbers::Format format;
  numbers::ByteOrder order;
};
constexpr auto little = numbers::ByteOrder::little;
constexpr auto big = numbers::ByteOrder::big;
constexpr std::array<FormatName, 7> formats = {{{"auto", numbers::Format::automatic, little},
                                                {"text", numbers::Format::text, little},
                                                {"npy", numbers::Format::npy, little},
                                                {"f64", numbers::Format::f64, little},
                                                {"f32", numbers::Format::f32, little},
                                                {"f64be", numbers::Format::f64, big},
                                                {"f32be", numbers::Format::f32, big}}};

// The first name of a separator is the one that is written.
constexpr std::array<std::pair<std::string_view, char>, 6> separators = {
    {{"auto", '\0'}, {"comma", ','}, {"semicolon", ';'}, {"tab", '\t'}, {"space", ' '}, {"\\t", '\t'}}};

std::uint64_t seed_of(const std::string& text, const std::string& name) {
  return parse_count(text, name, 0, std::numeric_limits<std::uint64_t>::max());
}

std::uint64_t random_seed() {
  std::random_device device;
  const std::uint64_t high = device();
  const std::uint64_t low = device();
  return high << 32 | low;
}

// 100000 as 1e5, 64 as 64.
std::string count_text(std::int64_t n) {
  std::size_t zeros = 0;
  for (; n != 0 && n % 10 == 0; n /= 10) ++zeros;
  return std::to_string(n) + (zeros > 3 ? "e" + std::to_string(zeros) : std::string(zeros, '0'));
}

// The two ways through a layout have the same members. A reader takes fields from words.
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
    Shard s;
    s.of = static_cast<std::int64_t>(parse_count(t.substr(slash + 1), "--shard, N", 1, Shard::most));
    s.index =
        static_cast<std::int64_t>(parse_count(t.substr(0, slash), "--shard, I", 1, static_cast<std::uint64_t>(s.of)));
    x = s;
  }

 private:
  const Words& words_;
};

// A writer makes the words that a reader takes the same fields from.
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

  Words words;
};

// ---- layouts

template <class Way>
void threads(Way& way, int& x) {
  way.count("threads", x, 0, most_threads);
}

template <class Way>
void goal(Way& way, Goal& g, const std::string& before = "") {
  way.positive_or("none", before + "error", g.error);
  way.positive_or("none", before + "relative_error", g.relative_error);
  way.seconds_or("none", before + "seconds", g.seconds);
}

template <class Way>
void shape(Way& way, Shape& s) {
  way.estimator(s.estimator);
  way.pmf(s.pmf);
  way.count_or("auto", "base_level", s.base_level, 0);
  way.count("block", s.block, 1);
  way.points(s.points);
}

// Samples, seed and threads of a command that has no goal.
template <class Way, class R>
void draws(Way& way, R& r) {
  std::optional<std::int64_t> samples = r.samples;
  way.count_or("auto", "samples", samples, 1);
  r.samples = samples.value_or(Sampling::usual);
  way.seed_or_random("seed", r.seed);
  threads(way, r.threads);
}

template <class Way>
void layout(Way& way, ListRequest& r) {
  auto topic = static_cast<std::size_t>(r.topic);
  way.word("topic", topic, topics, "list:", "nothing is called so", "; write problems, estimators or pmfs");
  r.topic = static_cast<Topic>(topic);
}

template <class Way>
void layout(Way& way, RunRequest& r) {
  way.problem(r.problem);
  shape(way, r.shape);
  way.count_or("auto", "samples", r.sampling.samples, 1);
  way.seed_or_random("seed", r.sampling.seed);
  threads(way, r.sampling.threads);
  goal(way, r.sampling.goal);
  way.share("confidence", r.confidence);
  way.shard(r.shard);
  goal(way, r.served, "served_");
}

template <class Way>
void layout(Way& way, Resume& r) {
  way.text("file", r.file);
  way.count_or("auto", "samples", r.samples, 1);
  goal(way, r.goal);
  threads(way, r.threads);
}

template <class Way>
void layout(Way& way, Merge& r) {
  way.files(r.files);
}

template <class Way>
void layout(Way& way, ReplayRequest& r) {
  way.problem(r.problem);
  shape(way, r.shape);
  way.seed("seed", r.seed);
  way.count("sample", r.sample, 0);
}

template <class Way>
void layout(Way& way, ValidateRequest& r) {
  way.problems(r.problems);
  draws(way, r);
}

template <class Way>
void layout(Way& way, SurveyRequest& r) {
  way.problem(r.problem);
  way.count("levels", r.levels, 2, most_levels);
  way.count("first", r.first, 0);
  draws(way, r);
}

template <class Way>
void layout(Way& way, TradeoffRequest& r) {
  way.problem(r.problem);
  way.family(r.family);
  way.count("points", r.points, 1, most_points);
  way.estimator(r.shape.estimator);
  way.count_or("auto", "base_level", r.shape.base_level, 0);
  way.count("block", r.shape.block, 1);
  draws(way, r);
}

template <class Way>
void layout(Way& way, Diagnose& r) {
  way.text("file", r.file);
  way.text("column", r.reading.column);
  way.format(r.reading);
  way.separator(r.reading.separator);
  way.decimal(r.reading.decimal);
  bool yes = r.reading.header == numbers::Header::yes;
  bool no = r.reading.header == numbers::Header::no;
  way.flag("header", yes);
  way.flag("no_header", no);
  if (yes && no) throw std::invalid_argument("--header and --no-header (contradict each other); leave one out");
  r.reading.header = yes ? numbers::Header::yes : no ? numbers::Header::no : numbers::Header::guess;
  way.flag("strict", r.reading.strict);
}

template <class Way>
void picture(Way& way, PictureRequest& r, double& exposure) {
  std::array<int, 2> size = {r.width, r.height};
  way.size("size", size);
  r.width = size[0];
  r.height = size[1];
  way.positive_or("", "exposure", exposure);
  way.flag("compare", r.compare);
  way.seed_or_random("seed", r.seed);
  threads(way, r.threads);
}

template <class Way>
void layout(Way& way, RenderTransmittance& r) {
  way.positive_or("", "density", r.density);
  way.text("volume", r.volume);
  way.size_or_none("dims", r.dims);
  if (r.volume.empty() && r.dims) {
    Writer written;
    written.size("dims", *r.dims);
    throw std::invalid_argument("--dims = '" + written.words.values["dims"] + "' (of no volume); add --volume FILE");
  }
  if (!r.volume.empty() && !r.dims) {
    throw std::invalid_argument("--volume '" + r.volume + "' (has no dimensions); add --dims 64x64x64");
  }
  picture(way, r.request, r.exposure);
  way.count("spp", r.request.samples, 1, 1'000'000'000);
  way.seconds_or("none", "equal_time", r.request.equal_time);
  way.method(r.request.method, transmittance_method);
}

template <class Way>
void layout(Way& way, RenderPhotons& r) {
  picture(way, r.request, r.exposure);
  way.count("photons", r.request.photons, 1, std::int64_t{1} << 50);
  std::size_t scene = r.request.sphere ? 1 : 0;
  way.word("scene", scene, scenes, option("scene") + " =", "no scene", "; write sphere or direct");
  r.request.sphere = scene == 1;
  way.method(r.request.method, photon_method);
  way.flag("allow_infinite_mean", r.request.allow_infinite_mean);
}

template <class R>
R read(const Words& words) {
  R r;
  Reader reader(words);
  layout(reader, r);
  return r;
}

template <class R>
Words written(R request) {
  Writer writer;
  layout(writer, request);
  return std::move(writer.words);
}

constexpr std::string_view multilevel_name = "multilevel";

Request read_run(const Words& words) {
  const auto at = words.values.find("estimator");
  if (at == words.values.end() || at->second != multilevel_name) return read<RunRequest>(words);
  Words others = words;
  others.values["estimator"].clear();
  return multilevel_of(read<RunRequest>(others));
}

Request read_validate(const Words& words) {
  const ValidateRequest r = read<ValidateRequest>(words);
  check_judged(r.samples);
  const auto asked = [&words](const char* flag) {
    const auto at = words.flags.find(flag);
    return at != words.flags.end() && at->second;
  };
  if (asked("hard") && asked("report")) throw std::invalid_argument("--hard, --report: both (keep one)");
  if (asked("hard")) {
    if (words.values.count("unseen") > 0 && !words.values.at("unseen").empty()) {
      throw std::invalid_argument("--hard, --unseen: both (keep one)");
    }
    if (words.names.empty()) return HardRequest{r.samples, r.seed, r.threads};
    throw std::invalid_argument("--hard ('" + words.names.front() + "' is a problem of its own); leave one out");
  }
  const auto unseen = words.values.find("unseen");
  if (unseen != words.values.end() && !unseen->second.empty()) {
    if (asked("report")) throw std::invalid_argument("--unseen, --report: both (keep one)");
    if (!words.names.empty()) {
      throw std::invalid_argument("--unseen ('" + words.names.front() +
                                  "': its problems are of the seed); leave one out");
    }
    return UnseenRequest{seed_of(unseen->second, "--unseen"), r.samples, r.threads};
  }
  if (!asked("report")) return r;
  if (!words.names.empty()) {
    throw std::invalid_argument("--report ('" + words.names.front() + "': it is of all problems); leave one out");
  }
  return ReliabilityRequest{
      r.samples, r.seed, random_seed(), r.threads,
      "debias validate --report --samples " + std::to_string(r.samples) + " --seed " + std::to_string(r.seed)};
}

template <class R>
Request read_as(const Words& words) {
  return read<R>(words);
}
template <class R>
Words usual() {
  return written(R{});
}

struct Row {
  std::string_view command;
  Request (*read)(const Words&);
  Words (*usual)();
};
constexpr std::array<Row, 11> table = {{
    {"list", read_as<ListRequest>, usual<ListRequest>},
    {"run", read_run, usual<RunRequest>},
    {"resume", read_as<Resume>, usual<Resume>},
    {"merge", read_as<Merge>, usual<Merge>},
    {"replay", read_as<ReplayRequest>, usual<ReplayRequest>},
    {"validate", read_validate, usual<ValidateRequest>},
    {"survey", read_as<SurveyRequest>, usual<SurveyRequest>},
    {"tradeoff", read_as<TradeoffRequest>, usual<TradeoffRequest>},
    {"diagnose", read_as<Diagnose>, usual<Diagnose>},
    {"render transmittance", read_as<RenderTransmittance>, usual<RenderTransmittance>},
    {"render photons", read_as<RenderPhotons>, usual<RenderPhotons>},
}};

const Row& row_of(const std::string& command) {
  for (const Row& row : table) {
    if (row.command == command) return row;
  }
  throw std::invalid_argument("no command '" + command + "'");
}

}  // namespace

Request read_request(const std::string& command, const Words& words) { return row_of(command).read(words); }
Words usual_words(const std::string& command) { return row_of(command).usual(); }

namespace {

// Threads do not belong to what is computed.
template <class R>
Saved saved_as(const char* command, const R& request) {
  Saved saved{command, written(request)};
  saved.words.values["threads"] = "0";
  return saved;
}

}  // namespace

Saved saved(const RunRequest& request) { return saved_as("run", request); }
Saved saved(const ValidateRequest& request) { return saved_as("validate", request); }
Saved saved(const TradeoffRequest& request) { return saved_as("tradeoff", request); }
Saved saved(const RenderTransmittance& request) { return saved_as("render transmittance", request); }
Saved saved(const RenderPhotons& request) { return saved_as("render photons", request); }

Saved saved(const MultilevelRequest& request) {
  Saved saved = saved_as("run", RunRequest{.problem = request.problem,
                                           .sampling = {.goal = {.error = request.error}, .seed = request.seed}});
  saved.words.values["estimator"] = multilevel_name;
  return saved;
}

std::string option(std::string_view field) {
  std::string text = "--" + std::string(field);
  std::replace(text.begin(), text.end(), '_', '-');
  return text;
}

}  // namespace debias::cli
