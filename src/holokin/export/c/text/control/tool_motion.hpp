/* $title. Written by holokin $version. How a pose moves by a twist (linear first, in the base frame). */
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <geometry_msgs/msg/pose.hpp>

namespace $package {

/* Of a tool: metres and radians, or as many per second. */
using Motion = std::array<double, 6>;

inline double length_of(const Motion &motion, std::size_t first) {
  return std::hypot(motion[first], motion[first + 1], motion[first + 2]);
}

inline Motion times(const Motion &motion, double factor) {
  Motion found = motion;
  for (double &value : found) value *= factor;
  return found;
}

/* The quaternion of one turn after another. */
inline geometry_msgs::msg::Quaternion after(const geometry_msgs::msg::Quaternion &b, const geometry_msgs::msg::Quaternion &a) {
  geometry_msgs::msg::Quaternion c;
  c.x = b.w * a.x + b.x * a.w + b.y * a.z - b.z * a.y;
  c.y = b.w * a.y - b.x * a.z + b.y * a.w + b.z * a.x;
  c.z = b.w * a.z + b.x * a.y - b.y * a.x + b.z * a.w;
  c.w = b.w * a.w - b.x * a.x - b.y * a.y - b.z * a.z;
  return c;
}

/* The straight motion from a pose to another one: the difference of positions, and the shortest turn as a vector. */
inline Motion motion_between(const geometry_msgs::msg::Pose &from, const geometry_msgs::msg::Pose &to) {
  geometry_msgs::msg::Quaternion back = from.orientation;
  back.x = -back.x, back.y = -back.y, back.z = -back.z;
  const auto r = after(to.orientation, back);
  const double sine = std::hypot(r.x, r.y, r.z), sign = r.w < 0 ? -1.0 : 1.0;
  const double factor = sign * (sine > 1e-12 ? 2.0 * std::atan2(sine, std::abs(r.w)) / sine : 2.0);
  return {to.position.x - from.position.x, to.position.y - from.position.y, to.position.z - from.position.z,
      factor * r.x, factor * r.y, factor * r.z};
}

/* The pose after a motion; its quaternion is of length 1. */
inline geometry_msgs::msg::Pose moved_by(const geometry_msgs::msg::Pose &pose, const Motion &motion) {
  const double angle = length_of(motion, 3);
  const double factor = angle > 1e-12 ? std::sin(angle / 2) / angle : 0.5;
  geometry_msgs::msg::Quaternion turn;
  turn.x = factor * motion[3], turn.y = factor * motion[4], turn.z = factor * motion[5], turn.w = std::cos(angle / 2);
  geometry_msgs::msg::Pose found = pose;
  found.position.x += motion[0], found.position.y += motion[1], found.position.z += motion[2];
  auto &o = found.orientation = after(turn, pose.orientation);
  const double size = std::sqrt(o.x * o.x + o.y * o.y + o.z * o.z + o.w * o.w);
  o.x /= size, o.y /= size, o.z /= size, o.w /= size;
  return found;
}

}  // namespace $package
