#pragma once

// A name that the catalogue does not have. The message names a list to look into, and each door has another one.

#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace debias::catalog {

class UnknownName : public std::invalid_argument {
 public:
  /// "'A1O' is not a problem", "problems", "; did you mean 'A10'?". what() names the list of the program.
  UnknownName(std::string problem, std::string_view topic, std::string hint)
      : std::invalid_argument(problem + " (see `debias list " + std::string(topic) + "`)" + hint),
        problem_(std::move(problem)),
        topic_(topic),
        hint_(std::move(hint)) {}
  [[nodiscard]] const std::string& topic() const { return topic_; }
  /// The message with another list.
  [[nodiscard]] std::string seen_in(const std::string& list) const { return problem_ + " (see " + list + ")" + hint_; }

 private:
  std::string problem_;
  std::string topic_;
  std::string hint_;
};

}  // namespace debias::catalog
