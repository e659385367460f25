/* $title. Written by holokin $version. Poses of ROS as matrices 4x4 by rows, and back. */
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <geometry_msgs/msg/pose.hpp>

namespace $package {

using Matrix = std::array<double, 16>;

/* How far from 1 the length of a quaternion may be. */
constexpr double UNIT = 1e-3;

/* False where a number is not finite, or the quaternion is not of length 1. */
inline bool to_matrix(const geometry_msgs::msg::Pose &pose, Matrix &T) {
  const auto &p = pose.position;
  const auto &o = pose.orientation;
  const double length = std::sqrt(o.x * o.x + o.y * o.y + o.z * o.z + o.w * o.w);
  if (!(std::abs(length - 1.0) <= UNIT) || !std::isfinite(p.x + p.y + p.z)) return false;
  const double x = o.x / length, y = o.y / length, z = o.z / length, w = o.w / length;
  T = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), p.x,
       2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), p.y,
       2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), p.z,
       0, 0, 0, 1};
  return true;
}

/* By the largest of the four numbers, so that no small one divides. */
inline geometry_msgs::msg::Pose to_pose(const Matrix &T) {
  const auto at = [&T](std::size_t i, std::size_t j) { return T[4 * i + j]; };
  const std::array<double, 4> squares = {1 + at(0, 0) - at(1, 1) - at(2, 2), 1 - at(0, 0) + at(1, 1) - at(2, 2),
      1 - at(0, 0) - at(1, 1) + at(2, 2), 1 + at(0, 0) + at(1, 1) + at(2, 2)}; /* 4 x^2, 4 y^2, 4 z^2, 4 w^2 */
  const auto largest = static_cast<std::size_t>(std::max_element(squares.begin(), squares.end()) - squares.begin());
  const double twice = std::sqrt(squares[largest]);
  const double xy = at(1, 0) + at(0, 1), xz = at(2, 0) + at(0, 2), yz = at(2, 1) + at(1, 2); /* 4 x y, ... */
  const double xw = at(2, 1) - at(1, 2), yw = at(0, 2) - at(2, 0), zw = at(1, 0) - at(0, 1);
  const std::array<std::array<double, 4>, 4> products = {{{squares[0], xy, xz, xw}, {xy, squares[1], yz, yw},
      {xz, yz, squares[2], zw}, {xw, yw, zw, squares[3]}}};
  const auto &row = products[largest];
  geometry_msgs::msg::Pose pose;
  pose.position.x = at(0, 3);
  pose.position.y = at(1, 3);
  pose.position.z = at(2, 3);
  pose.orientation.x = row[0] / (2 * twice);
  pose.orientation.y = row[1] / (2 * twice);
  pose.orientation.z = row[2] / (2 * twice);
  pose.orientation.w = row[3] / (2 * twice);
  return pose;
}

}  // namespace $package
