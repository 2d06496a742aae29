#pragma once

// Who calls a command: sees how far it is, may end it, and may keep what is finished, as parts that each have a name. A part
// that is held is taken up where it was left; whatever lies between the parts (pilots, surveys) is drawn again, to the same
// bits.

#include <stdexcept>
#include <string>

#include <debias/core/result.hpp>

#include "core/bytes.hpp"
#include "request.hpp"

namespace debias::commands {

/// A part that is held, and is none of this command.
struct BadPart : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Store {
 public:
  virtual ~Store() = default;
  /// Null where nothing is held.
  [[nodiscard]] virtual const Bytes* held(const std::string& part) const = 0;
  /// True when it is time to keep what has grown.
  [[nodiscard]] virtual bool due() const = 0;
  virtual void keep(const std::string& part, Bytes contents) = 0;
};

struct Caller {
  Watch watch = {};
  Store* store = nullptr;  ///< nothing is kept

  [[nodiscard]] bool goes_on(std::string_view what, double done, double total) const {
    return !watch || watch(what, done, total);
  }
  /// Takes up the samples of a part, and keeps those to come. Throws BadPart.
  void attach(Plan& plan, const std::string& part) const;
};

}  // namespace debias::commands
