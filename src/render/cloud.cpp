#include "cloud.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include <boost/math/quadrature/gauss_kronrod.hpp>

#include <debias/core/stream.hpp>

#include "../core/text.hpp"

namespace debias::render {
namespace {

constexpr int lattice = 32;  // the noise repeats after so many cells
constexpr int octaves = 4;
constexpr double floor_height = -1.4;
const Vec eye{0, -6, 1.3};
const Vec target{0.1, 0, -0.5};
const Vec to_lamp = normalized({0.35, -0.25, 1});

// The part of a half line from `from` that lies in the box.
Segment in_box(const Vec& from, const Vec& direction, double up_to) {
  double near = 0;
  double far = up_to;
  for (const auto& [o, d] :
       {std::pair(from.x, direction.x), std::pair(from.y, direction.y), std::pair(from.z, direction.z)}) {
    const double a = (-1 - o) / d;
    const double b = (1 - o) / d;
    if (d == 0) {
      if (std::abs(o) > 1) return {};
      continue;
    }
    near = std::max(near, std::min(a, b));
    far = std::min(far, std::max(a, b));
  }
  if (!(near < far)) return {};
  return {from + near * direction, direction, far - near};
}

struct Cell {
  int low;
  double weight;  // of the higher neighbour
};
Cell cell_of(double x) {
  const double whole = std::floor(x);
  const double t = x - whole;
  return {static_cast<int>(whole), t * t * t * (t * (6 * t - 15) + 10)};  // two continuous derivatives
}

double mix(double a, double b, double t) { return a + (b - a) * t; }

template <class At>
double trilinear(const Cell& x, const Cell& y, const Cell& z, const At& at) {
  const auto along_x = [&](int j, int k) { return mix(at(x.low, j, k), at(x.low + 1, j, k), x.weight); };
  const auto along_y = [&](int k) { return mix(along_x(y.low, k), along_x(y.low + 1, k), y.weight); };
  return mix(along_y(z.low), along_y(z.low + 1), z.weight);
}

}  // namespace

Vec normalized(const Vec& v) { return 1 / std::sqrt(dot(v, v)) * v; }

Cloud::Cloud(double density) : density_(density), majorant_(density), noise_(std::size_t{lattice} * lattice * lattice) {
  Stream rng(2022, 0);
  for (float& n : noise_) n = static_cast<float>(2 * rng.uniform() - 1);
}

Cloud::Cloud(std::vector<float> grid, const std::array<int, 3>& size, double density)
    : density_(density), majorant_(0), grid_(std::move(grid)), size_(size) {
  const double count = static_cast<double>(size[0]) * size[1] * size[2];
  if (static_cast<double>(grid_.size()) != count || grid_.empty()) {
    throw std::invalid_argument("volume: " + std::to_string(grid_.size()) + " numbers (dimensions " +
                                std::to_string(size[0]) + "x" + std::to_string(size[1]) + "x" +
                                std::to_string(size[2]) + " ask for another count); give the right --dims");
  }
  for (std::size_t i = 0; i < grid_.size(); ++i) {
    if (!(grid_[i] >= 0) || !std::isfinite(grid_[i])) {
      throw std::invalid_argument("volume: number " + std::to_string(i) + " is " + format("%f", grid_[i]) +
                                  " (extinction must be finite and at least 0); clean the file");
    }
    majorant_ = std::max(majorant_, density * static_cast<double>(grid_[i]));
  }
  if (!(majorant_ > 0)) throw std::invalid_argument("volume: all numbers are 0 (nothing to see); give another file");
  if (majorant_ < 1e-12) {  // less than an image of floats can show
    throw std::invalid_argument("volume: extinction is " + to_text(majorant_) +
                                " at most (nothing to see); are these floats of the other byte order?");
  }
}

double Cloud::fractal(const Vec& p) const {
  const double shape = 0.75 - 1.7 * (p.x * p.x + p.y * p.y + 1.5 * p.z * p.z);
  if (shape < -1.96) return 0;  // no noise reaches there: |sum| < 1.4
  double sum = 0;
  double amplitude = 0.8;
  double frequency = 1.7;
  for (int o = 0; o < octaves; ++o) {
    const double shift = 17 + 5.3 * o;  // positive, so that the remainder below is a mask
    sum += amplitude * trilinear(cell_of(frequency * p.x + shift), cell_of(frequency * p.y + shift),
                                 cell_of(frequency * p.z + shift), [this](int i, int j, int k) {
                                   constexpr int mask = lattice - 1;
                                   const int index = ((k & mask) * lattice + (j & mask)) * lattice + (i & mask);
                                   return static_cast<double>(noise_[static_cast<std::size_t>(index)]);
                                 });
    amplitude *= 0.45;
    frequency *= 2.1;
  }
  return density_ * std::clamp(shape + 1.4 * sum, 0.0, 1.0);
}

double Cloud::interpolated(const Vec& p) const {
  const auto cell = [](double x, int n) {
    const double at = std::clamp(0.5 * (x + 1) * n - 0.5, 0.0, n - 1.0);  // numbers sit at the middles of voxels
    const int low = std::min(static_cast<int>(at), std::max(0, n - 2));
    return Cell{low, at - low};
  };
  return density_ *
         trilinear(cell(p.x, size_[0]), cell(p.y, size_[1]), cell(p.z, size_[2]), [this](int i, int j, int k) {
           const auto within = [](int index, int n) { return static_cast<std::size_t>(std::min(index, n - 1)); };
           const std::size_t row = within(k, size_[2]) * static_cast<std::size_t>(size_[1]) + within(j, size_[1]);
           return static_cast<double>(grid_[row * static_cast<std::size_t>(size_[0]) + within(i, size_[0])]);
         });
}

Pixel look(const Cloud& cloud, int x, int y, int width, int height) {
  const Vec forward = normalized(target - eye);
  const Vec right = normalized({forward.y, -forward.x, 0});
  const Vec up{right.y * forward.z - right.z * forward.y, right.z * forward.x - right.x * forward.z,
               right.x * forward.y - right.y * forward.x};
  const double scale = 0.56 / std::min(width, height);
  const Vec direction =
      normalized(forward + scale * (x + 0.5 - 0.5 * width) * right + scale * (0.5 * height - y - 0.5) * up);

  Pixel pixel;
  pixel.path.cloud = &cloud;
  constexpr double horizon = 1e3;
  if (direction.z >= 0) {
    const double h = std::sqrt(direction.z);
    pixel.background = {static_cast<float>(mix(0.80, 0.18, h)), static_cast<float>(mix(0.88, 0.40, h)),
                        static_cast<float>(mix(0.95, 0.85, h))};
    pixel.path.segments[0] = in_box(eye, direction, horizon);
    return pixel;
  }
  const double to_floor = (floor_height - eye.z) / direction.z;
  const Vec on_floor = eye + to_floor * direction;
  const double haze = 1 - std::exp(-0.002 * to_floor * to_floor);
  pixel.background = {static_cast<float>(mix(0.78, 0.80, haze)), static_cast<float>(mix(0.66, 0.88, haze)),
                      static_cast<float>(mix(0.48, 0.95, haze))};
  pixel.path.segments[0] = in_box(eye, direction, to_floor);
  pixel.path.segments[1] = in_box(on_floor, to_lamp, horizon);
  return pixel;
}

double exact_transmittance(const Path& path) {
  using Quadrature = boost::math::quadrature::gauss_kronrod<double, 15>;
  double depth = 0;
  for (const Segment& s : path.segments) {
    if (s.length == 0) continue;
    const auto extinction = [&](double t) { return (*path.cloud)(s.from + t * s.direction); };
    constexpr int parts = 8;  // of about the size of the finest noise: no feature falls between the nodes
    for (int i = 0; i < parts; ++i) {
      const double step = s.length / parts;
      depth += Quadrature::integrate(extinction, i * step, (i + 1) * step, 6, 1e-7);
    }
  }
  return std::exp(-depth);
}

}  // namespace debias::render
