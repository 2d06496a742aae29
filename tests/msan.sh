#!/bin/sh
# The quick tests under clang's memory sanitizer, which must see through every library: libstdc++, libpng and zlib are
# built for it from Debian's sources, Catch2's main from its header. Left out: RapidCheck and MPI, which are not, and the
# tests that build programs of their own.
#   sh tests/msan.sh [CTEST ARGUMENTS]     three minutes for the libraries, once
# Needs sources of Debian 12: a line of apt with deb-src, and the signed-by of the line with deb if that has one.
set -eu
root=$(CDPATH= cd -- "$(dirname -- "$0")/.." && pwd)
libraries=$root/build/msan-libraries
jobs=${JOBS:-$(nproc)}
mkdir -p "$libraries"
cd "$libraries"
if [ ! -f libstdc++.a ]; then
  [ -d gcc-12.2.0 ] || {
    apt-get -q source --download-only gcc-12
    tar xzf gcc-12_*.orig.tar.gz
    tar xJf gcc-12-*/gcc-12.2.0-dfsg.tar.xz
    ln -sf gthr-posix.h gcc-12.2.0/libgcc/gthr-default.h
  }
  flags="-fsanitize=memory -fno-omit-frame-pointer -O1 -g1 -fPIC -D_GNU_SOURCE -Wno-everything"
  flags="$flags -fsized-deallocation -mrdrnd -mrdseed"
  flags="$flags -D__builtin_ia32_rdseed_si_step=__builtin_ia32_rdseed32_step"  # as clang calls it
  mkdir -p objects
  cd objects
  source=$libraries/gcc-12.2.0/libstdc++-v3
  CC=clang CXX=clang++ CFLAGS=$flags CXXFLAGS=$flags "$source/configure" --disable-multilib --disable-nls \
    --disable-libstdcxx-pch --disable-shared > log
  make -k -j "$jobs" > log 2>&1 || true  # not: new and delete with alignment; and two files with a flag of g++'s
  for file in src/c++11/cxx11-ios_failure src/c++98/ios_failure; do
    abi=$([ $file = src/c++98/ios_failure ] && echo 0 || echo 1)
    # shellcheck disable=SC2086
    clang++ -std=gnu++11 -D_GLIBCXX_USE_CXX11_ABI=$abi -I"$libraries/gcc-12.2.0/libgcc" -Iinclude \
      -I"$source/libsupc++" $flags -c "$source/$file.cc" -o $file.o
  done
  # new and delete are the sanitizer's
  find . -name '*.o' ! -path '*/.libs/*' ! -name 'new_op*.o' ! -name 'del_op*.o' | xargs ar qcs ../libstdc++.a
  cd ..
fi
if [ ! -f libpng.a ]; then
  apt-get -q source --download-only libpng1.6 zlib
  for archive in libpng1.6_*.orig.tar.gz zlib_*.orig.tar.bz2; do tar xf "$archive"; done
  mkdir -p png
  cd png
  cp ../libpng-*/scripts/pnglibconf.h.prebuilt pnglibconf.h
  for file in ../zlib-*/*.c ../libpng-*/png*.c; do
    [ "${file##*/}" = pngtest.c ] || clang -O1 -g1 -fsanitize=memory -w -DPNG_INTEL_SSE_OPT=0 -D_LARGEFILE64_SOURCE \
      -DHAVE_UNISTD_H -I. -c "$file"
  done
  ar qcs ../libpng.a ./*.o
  cd ..
fi
printf '#define CATCH_CONFIG_MAIN\n#include <catch2/catch.hpp>\n' > main.cpp
[ -f catch.a ] || { clang++ -std=c++20 -O1 -fsanitize=memory -c main.cpp && ar qcs catch.a main.o; }
cat > Catch2Config.cmake <<EOF
list(APPEND CMAKE_MODULE_PATH /usr/lib/cmake/Catch2)
add_library(Catch2::Catch2WithMain INTERFACE IMPORTED)
target_link_libraries(Catch2::Catch2WithMain INTERFACE "$libraries/catch.a")
EOF
cmake --preset msan -S "$root" -B "$root/build/msan" > /dev/null
cmake --build "$root/build/msan" --parallel "$jobs"
ctest --test-dir "$root/build/msan" -L quick -E '^(install|consumer_.*)$' \
  --parallel "$jobs" --output-on-failure "$@"
