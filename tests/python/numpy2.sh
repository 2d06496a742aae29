#!/bin/sh
# The Python package under NumPy 2, whatever NumPy the build has: a module built with pybind11 from PyPI passes the
# tests of the package, and the module of the build, if its pybind11 is older than 2.12, refuses in one sentence.
#   sh tests/python/numpy2.sh BUILD PYTHON      BUILD has the program and the libraries
# Skipped (exit 77) where pip cannot reach PyPI.
set -eu
[ $# -eq 2 ] || { echo "usage: sh $0 BUILD PYTHON" >&2; exit 2; }
build=$(CDPATH= cd -- "$1" && pwd)
python=$2
root=$(CDPATH= cd -- "$(dirname -- "$0")/../.." && pwd)
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT

skip() {
  echo "numpy2.sh: $1; skipped"
  exit 77
}
"$python" -m venv "$here/env" > "$here/log" 2>&1 || skip "no venv (Debian: package python3-venv)"
two=$here/env/bin/python
install() { "$two" -m pip install -q --timeout 10 --retries 1 "$@" > "$here/log" 2>&1; }
install 'numpy>=2' 'pybind11>=2.12' || skip "no NumPy 2 from PyPI"
install pandas || echo "numpy2.sh: without pandas"
ask() { "$two" -c "$1"; }
echo "NumPy $(ask 'import numpy; print(numpy.__version__)'), pybind11 $(ask 'import pybind11; print(pybind11.__version__)')"

# ---- the module of the build
if PYTHONPATH=$build/python "$two" -c '
import debias
assert len(set(debias.samples("A10", 50).tolist())) == 50, "one number many times"' > "$here/out" 2>&1; then
  echo "the module of the build knows NumPy 2"
else
  tail -n 1 "$here/out"
  tail -n 1 "$here/out" |
    grep -q '^ImportError: debias: built with pybind11 2[.][0-9]*, which reads arrays of NumPy 2.* wrongly; ' ||
    { cat "$here/out"; echo "FAILED: the module of the build neither works nor says why"; exit 1; }
fi

# ---- a module of its own
package=$here/python/debias
mkdir -p "$package"
cp -r "$root"/src/python/debias/* "$package"
version=$(sed -n 's/^project(debias VERSION \([0-9.]*\).*/\1/p' "$root/CMakeLists.txt")
eigen=$(pkg-config --cflags eigen3 2> /dev/null || echo -I/usr/include/eigen3)
objects=
for source in "$root"/src/python/*.cpp; do
  name=$(basename "$source" .cpp)
  "${CXX:-g++}" -std=c++20 -O1 -fPIC -fvisibility=hidden -ffp-contract=off "-DDEBIAS_VERSION=\"$version\"" \
    "-I$root/include" "-I$root/src" $eigen "-I$(ask 'import pybind11; print(pybind11.get_include())')" \
    "-I$(ask 'import sysconfig; print(sysconfig.get_paths()["include"])')" \
    -c "$source" -o "$here/$name.o"
  objects="$objects $here/$name.o"
done
suffix=$(ask 'import sysconfig; print(sysconfig.get_config_var("EXT_SUFFIX"))')
"${CXX:-g++}" -shared -o "$package/_debias$suffix" $objects \
  -L"$build" -ldebias_commands -ldebias_validation -ldebias_catalog -ldebias -Wl,-rpath,"$build" -lpthread
(
  cd "$root/tests/python"
  export PYTHONPATH="$here/python" DEBIAS_PROGRAM="$build/bin/debias" DEBIAS_SAME_BITS="$build/bin/debias_same_bits"
  # shellcheck disable=SC2035,SC2046
  "$two" -m unittest $(ls *_test.py | grep -v "^own")
  "$two" -m unittest own*_test.py
)

# ---- types
if install mypy; then
  (cd "$root" && "$two" -m mypy --strict --cache-dir "$here/mypy" src/python/debias)
else
  echo "numpy2.sh: without mypy"
fi
