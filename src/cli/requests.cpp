#include "requests.hpp"

#include <array>
#include <stdexcept>
#include <utility>

#include "ways.hpp"

namespace debias::cli {
namespace {

using namespace debias::commands;

constexpr std::array<std::string_view, 3> topics = {"problems", "estimators", "pmfs"};
constexpr std::array<std::string_view, 2> scenes = {"direct", "sphere"};

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
  way.doubts(r.doubts);
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
    if (r.seed != ValidateRequest{}.seed) {
      throw std::invalid_argument("--seed = '" + words.values.at("seed") +
                                  "' (the seed of unseen problems is that of --unseen); leave one out");
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
