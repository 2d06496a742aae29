// Uses a template of the headers and a function of the compiled library.
#include <cstdio>

#include <debias/core/stream.hpp>

int main() {
  debias::Stream rng(1, 0);
  const double u = rng.uniform();
  const double z = rng.normal();
  std::printf("uniform %.3f, normal %.3f\n", u, z);
  return u > 0 && u < 1 ? 0 : 1;
}
