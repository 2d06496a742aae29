#include "store.hpp"

#include <memory>

#include "core/run_state_bytes.hpp"

namespace debias::commands {

void Caller::attach(Plan& plan, const std::string& part) const {
  if (store == nullptr) return;
  plan.earlier = nullptr;
  if (const Bytes* contents = store->held(part)) {
    try {
      plan.earlier = std::make_shared<RunState>(decode(*contents));
    } catch (const std::invalid_argument& e) {
      throw BadPart(e.what());
    }
  }
  plan.save = [store = store, part](const RunState& state, const Plan&) { store->keep(part, encode(state)); };
}

}  // namespace debias::commands
