#!/bin/sh
# The line without CMake that README shows, on an installed package.
#   sh tests/consumer/pkg_config.sh PREFIX COMPILER     skipped (exit code 77) without pkg-config
set -eu
command -v pkg-config > /dev/null || { echo "skipped: no pkg-config"; exit 77; }
PKG_CONFIG_PATH=$(dirname "$(find "$1" -name debias.pc)")
export PKG_CONFIG_PATH
program=$(mktemp)
trap 'rm -f "$program"' EXIT
"$2" -std=c++20 -O2 "$(dirname "$0")/main.cpp" $(pkg-config --cflags --libs debias) -o "$program"
"$program" | grep -q '^verdict '
