/* $title. Written by holokin $version. The robot description of ROS against the exported robot. */
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#if __has_include(<urdf/model.hpp>)
#include <urdf/model.hpp>
#else
#include <urdf/model.h>
#endif

#include "exported_robot.hpp"
#include "tool_motion.hpp"

namespace $package {

/* Limits that the exported step keeps, [rad, m] and per second; HUGE_VAL: none. */
inline const std::array<double, N> LOWER = {$lower};
inline const std::array<double, N> UPPER = {$upper};
inline const std::array<double, N> FASTEST = {$fastest};

/* From here on a limit of a URDF is none [rad, m, per second]. */
constexpr double FARTHEST = 1e6;

/* How far a limit of the export may be beyond that of the description: round-off of printed numbers. */
constexpr double ROUNDED = 1e-6;

/* Says what a robot description has otherwise than the export. */
class RobotDescription {
 public:
  RobotDescription(const std::string &text, const std::string &prefix) : prefix_(prefix), read_(model_.initString(text)) {}

  /* "" where the joints are those of the export, with their limits or wider ones, and the tip is where the export has it. */
  std::string disagreement_with_export(const std::string &base, const std::string &tip, double tolerance) const {
    if (!read_) return "the robot description is no URDF";
    std::vector<std::string> missing;
    for (const char *const name : JOINTS)
      if (!model_.getJoint(prefix_ + name)) missing.push_back(prefix_ + name);
    if (!missing.empty()) return "the robot description has no joints " + listed(missing);
    if (const std::string why = limits(); !why.empty()) return why;
    std::vector<urdf::JointConstSharedPtr> chain;
    if (const std::string why = chain_of(base, tip, chain); !why.empty()) return why;
    return disagreement([&](const strategy::Joints &q) { return placed(chain, q); }, base, tip, tolerance);
  }

 private:
  /* The export's place of a joint of the description, N for none. */
  std::size_t place(const std::string &joint) const {
    for (std::size_t i = 0; i < N; i++)
      if (prefix_ + JOINTS[i] == joint) return i;
    return N;
  }

  std::string limits() const {
    std::ostringstream words;
    for (std::size_t i = 0; i < N; i++) {
      const auto joint = model_.getJoint(prefix_ + JOINTS[i]);
      const auto say = [&](const char *what, double ours, double theirs) {
        words << (words.str().empty() ? "" : "; ") << "joint '" << joint->name << "': the export's " << what << " " << ours
              << " is beyond the description's " << theirs;
      };
      if (!joint->limits) continue;
      const auto &given = *joint->limits;
      const bool bounded = joint->type != urdf::Joint::CONTINUOUS;
      if (bounded && given.lower > -FARTHEST && LOWER[i] < given.lower - ROUNDED) say("lower limit", LOWER[i], given.lower);
      if (bounded && given.upper < FARTHEST && UPPER[i] > given.upper + ROUNDED) say("upper limit", UPPER[i], given.upper);
      if (given.velocity > 0 && given.velocity < FARTHEST && FASTEST[i] > given.velocity + ROUNDED)
        say("speed", FASTEST[i], given.velocity);
    }
    if (words.str().empty()) return "";
    return words.str() + ". Export from this robot description";
  }

  /* The joints from the tip to the base. */
  std::string chain_of(const std::string &base, const std::string &tip, std::vector<urdf::JointConstSharedPtr> &chain) const {
    for (const std::string &link : {base, tip})
      if (!model_.getLink(link)) return "the robot description has no link '" + link + "'";
    for (std::string link = tip; link != base;) {
      const auto joint = model_.getLink(link)->parent_joint;
      if (!joint) return "the link '" + tip + "' is not a part of '" + base + "' in the robot description";
      const std::string leader = joint->mimic ? joint->mimic->joint_name : joint->name;
      const bool moves = joint->type != urdf::Joint::FIXED;
      if (moves && place(leader) == N) return "the export does not move the joint '" + joint->name + "' between base and tip";
      chain.push_back(joint);
      link = joint->parent_link_name;
    }
    return "";
  }

  Matrix placed(const std::vector<urdf::JointConstSharedPtr> &chain, const strategy::Joints &q) const {
    geometry_msgs::msg::Pose pose;
    pose.orientation.w = 1.0;
    for (auto joint = chain.rbegin(); joint != chain.rend(); ++joint) pose = carried(pose, **joint, q);
    Matrix T{};
    to_matrix(pose, T);
    return T;
  }

  /* The frame after a joint that begins at `pose`. */
  geometry_msgs::msg::Pose carried(const geometry_msgs::msg::Pose &pose, const urdf::Joint &joint, const strategy::Joints &q) const {
    const auto &origin = joint.parent_to_joint_origin_transform;
    geometry_msgs::msg::Pose offset;
    offset.position.x = origin.position.x, offset.position.y = origin.position.y, offset.position.z = origin.position.z;
    offset.orientation.x = origin.rotation.x, offset.orientation.y = origin.rotation.y;
    offset.orientation.z = origin.rotation.z, offset.orientation.w = origin.rotation.w;
    const geometry_msgs::msg::Pose begins = compose(pose, offset);
    if (joint.type == urdf::Joint::FIXED) return begins;
    const std::size_t i = place(joint.mimic ? joint.mimic->joint_name : joint.name);
    const double value = joint.mimic ? joint.mimic->multiplier * q[i] + joint.mimic->offset : q[i];
    const double size = std::hypot(joint.axis.x, joint.axis.y, joint.axis.z);
    const bool slides = joint.type == urdf::Joint::PRISMATIC;
    Motion motion{};
    motion[slides ? 0 : 3] = value * joint.axis.x / size;
    motion[slides ? 1 : 4] = value * joint.axis.y / size;
    motion[slides ? 2 : 5] = value * joint.axis.z / size;
    geometry_msgs::msg::Pose still;
    still.orientation.w = 1.0;
    return compose(begins, moved_by(still, motion));
  }

  static geometry_msgs::msg::Pose compose(const geometry_msgs::msg::Pose &a, const geometry_msgs::msg::Pose &b) {
    Matrix A{};
    to_matrix(a, A);
    geometry_msgs::msg::Pose found;
    found.orientation = after(a.orientation, b.orientation);
    const auto &p = b.position;
    found.position.x = A[0] * p.x + A[1] * p.y + A[2] * p.z + A[3];
    found.position.y = A[4] * p.x + A[5] * p.y + A[6] * p.z + A[7];
    found.position.z = A[8] * p.x + A[9] * p.y + A[10] * p.z + A[11];
    return found;
  }

  urdf::Model model_;
  std::string prefix_;
  bool read_;
};

}  // namespace $package
