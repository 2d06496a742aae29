#include <debias/core/instructions.hpp>

#include <algorithm>
#include <cstdlib>
#include <string_view>

namespace debias {
namespace {

Instructions of_this_machine() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")) {
    return Instructions::avx512;
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return Instructions::avx2;
#endif
  return Instructions::sse2;
}

Instructions allowed() {
  const char* const most = std::getenv("DEBIAS_INSTRUCTIONS");
  if (most == nullptr) return Instructions::avx512;
  const std::string_view name = most;
  return name == "sse2" ? Instructions::sse2 : name == "avx2" ? Instructions::avx2 : Instructions::avx512;
}

}  // namespace

Instructions instructions() {
  static const Instructions chosen = std::min(of_this_machine(), allowed());
  return chosen;
}

}  // namespace debias
