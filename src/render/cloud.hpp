#pragma once

// A cloud in the box [-1, 1]^3, and the paths on which it dims what a camera sees: the sky behind it, or the
// floor below with the light of a lamp far above.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <debias/transmittance.hpp>

namespace debias::render {

struct Vec {
  double x = 0;
  double y = 0;
  double z = 0;
  friend Vec operator+(const Vec& a, const Vec& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vec operator-(const Vec& a, const Vec& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vec operator*(double s, const Vec& a) { return {s * a.x, s * a.y, s * a.z}; }
  friend double dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
};
Vec normalized(const Vec& v);

/// The extinction of the cloud, zero outside of the box.
class Cloud {
 public:
  /// Four octaves of noise in an ellipsoid; `density` is the largest extinction.
  explicit Cloud(double density);
  /// nx * ny * nz numbers, x fastest, interpolated; `density` is the extinction of a number 1. Throws
  /// std::invalid_argument for another count, or a number that is negative or not finite.
  Cloud(std::vector<float> grid, const std::array<int, 3>& size, double density);

  double operator()(const Vec& p) const { return grid_.empty() ? fractal(p) : interpolated(p); }
  [[nodiscard]] double majorant() const { return majorant_; }

 private:
  [[nodiscard]] double fractal(const Vec& p) const;
  [[nodiscard]] double interpolated(const Vec& p) const;

  double density_;
  double majorant_;
  std::vector<float> noise_;
  std::vector<float> grid_;
  std::array<int, 3> size_{};
};

/// A straight way through the box, from `from` on.
struct Segment {
  Vec from;
  Vec direction;
  double length = 0;
};

/// What a pixel's light passes: its own way through the box, and the one from the floor to the lamp.
struct Path {
  const Cloud* cloud = nullptr;
  std::array<Segment, 2> segments;
  double operator()(double t) const {
    const bool second = t > segments[0].length;
    const Segment& s = segments[second ? 1 : 0];
    return (*cloud)(s.from + (second ? t - segments[0].length : t) * s.direction);
  }
  [[nodiscard]] double length() const { return segments[0].length + segments[1].length; }
};

struct Pixel {
  Path path;
  std::array<float, 3> background{};  ///< what it sees without the cloud
};

/// The pixel's centre, as the camera sees it.
Pixel look(const Cloud& cloud, int x, int y, int width, int height);

/// exp(-tau) by adaptive quadrature, to about 1e-8.
double exact_transmittance(const Path& path);

}  // namespace debias::render
