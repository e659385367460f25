/* $title. Written by holokin $version. The exported robot, and how a model of ROS is compared with it. */
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <sstream>
#include <string>
#include <vector>

#include "$name.hpp"
#include "pose_conversions.hpp"

namespace $package {

namespace strategy = ::$name;

constexpr std::size_t N = ${NAME}_N;

inline const std::array<const char *, N> JOINTS = {
$joint_strings};
inline const char *const BASE = $base_string;
inline const char *const TIP = $tip_string;

/* By how much [rad, m] joints are moved from the start to compare a model with the export. */
constexpr double MOVED = 0.3;

/* The start posture, one joint of it moved, and at the end all of them, each by another amount. */
inline strategy::Joints posture(std::size_t k) {
  strategy::Joints q = strategy::start();
  for (std::size_t i = 0; i < N; i++) {
    if (k == i + 1) q[i] += MOVED;
    if (k == N + 1) q[i] += MOVED * static_cast<double>(i + 1) / static_cast<double>(N);
  }
  return q;
}

inline std::string posture_words(std::size_t k) {
  if (k == 0) return "at the start";
  return k > N ? "when all joints move" : std::string("when '") + JOINTS[k - 1] + "' moves";
}

inline std::string listed(const std::vector<std::string> &names) {
  std::string all;
  for (const std::string &name : names) all += (all.empty() ? "'" : ", '") + name + "'";
  return all;
}

/* The largest difference of positions [m], and of entries of the rotations. */
inline std::array<double, 2> difference(const Matrix &A, const Matrix &B) {
  std::array<double, 2> most = {0.0, 0.0};
  for (std::size_t i = 0; i < 12; i++) {
    double &worst = most[i % 4 == 3 ? 0 : 1];
    worst = std::max(worst, std::abs(A[i] - B[i]));
  }
  return most;
}

/* Where a model has another tip than the export: at the start, or where joints are moved from it. "" where nowhere.
   pose_of takes the joints of the export and gives the tip in the base. */
template <class Model>
std::string disagreement(Model &&pose_of, const std::string &base, const std::string &tip, double tolerance) {
  for (std::size_t k = 0; k < N + 2; k++) {
    const strategy::Joints q = posture(k);
    const auto T = strategy::pose(q);
    const auto [off, turned] = difference(pose_of(q), T.value);
    if (T && off <= tolerance && turned <= tolerance) continue;
    std::ostringstream words;
    words << "the link '" << tip << "' in '" << base << "' is " << off << " m and " << turned
          << " rad from where the export has its tip '" << TIP << "' " << posture_words(k)
          << ". Choose base and tip as they were exported, or export from this robot description";
    return words.str();
  }
  return "";
}

}  // namespace $package
