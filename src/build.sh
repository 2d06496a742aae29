# Shared by src/setup.sh and tests/run.sh, which set `root` to the project's folder and then source this file.
#   install_packages   installs the Debian packages that are missing; asks nothing of the network if none is
#   build TARGET...    configures and builds these CMake targets
# From the environment: BUILD_DIR (default: build/release in the project), JOBS (default: all processors).

packages="g++ cmake ninja-build librandom123-dev libboost-dev libeigen3-dev nlohmann-json3-dev libcli11-dev libpng-dev catch2 librapidcheck-dev
  clang-format-14 python3-dev python3-numpy python3-matplotlib python3-nbclient python3-ipykernel pybind11-dev"
build_dir=${BUILD_DIR:-$root/build/release}
jobs=${JOBS:-$(nproc)}

install_packages() {
  if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
    echo "debias: not a Debian system, nothing is installed; CMake will name what is missing" >&2
    return 0
  fi
  missing=
  for package in $packages; do
    case $(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null) in
      installed) ;;
      *) missing="$missing $package" ;;
    esac
  done
  [ -n "$missing" ] || return 0

  echo "debias: installing$missing" >&2
  sudo=
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || cannot_install
    sudo=sudo
  fi
  # A package source that does not answer need not be one we use: let the installation decide.
  $sudo apt-get -q update </dev/null || true
  $sudo env DEBIAN_FRONTEND=noninteractive \
    apt-get -q install -y --no-install-recommends $missing </dev/null || cannot_install
}

cannot_install() {
  echo "debias: cannot install what is missing; as root, run" >&2
  echo "  apt-get update && apt-get install -y --no-install-recommends$missing" >&2
  exit 3
}

build() {
  cmake -S "$root" -B "$build_dir" -G Ninja -DDEBIAS_UNITY=ON
  cmake --build "$build_dir" --parallel "$jobs" --target "$@"
}
