#include <cmath>
#include <type_traits>

#include <nlohmann/json.hpp>

#include "fields.hpp"

namespace debias::commands {
namespace {

using Json = nlohmann::ordered_json;

Json json_of(const Node& node) {
  return std::visit(
      [](const auto& x) -> Json {
        using T = std::decay_t<decltype(x)>;
        if constexpr (std::is_same_v<T, double>) {
          return std::isfinite(x) ? Json(x) : Json(nullptr);
        } else if constexpr (std::is_same_v<T, List>) {
          Json list = Json::array();
          for (const Node& n : x) list.push_back(json_of(n));
          return list;
        } else if constexpr (std::is_same_v<T, Fields>) {
          Json object = Json::object();
          for (const Entry& e : x) object[e.name] = json_of(e.value);
          return object;
        } else {
          return Json(x);
        }
      },
      node.value);
}

std::string dumped(const Node& node, int indent) {
  return json_of(node).dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

std::string pretty_json(const Node& node) { return dumped(node, 2); }
std::string json_line(const Node& node) { return dumped(node, -1); }

}  // namespace debias::commands
