/* For the tests of holokin: robot models of MoveIt 2 as far as the plugin uses them, read from URDF and SRDF, with
   kinematics of their own (angle and axis), written from the public interface. */
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "stand_in_urdf.hpp"

namespace Eigen {
struct Isometry3d {
  std::array<double, 12> a{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  double &operator()(int i, int j) { return a[static_cast<std::size_t>(4 * i + j)]; }
  double operator()(int i, int j) const { return a[static_cast<std::size_t>(4 * i + j)]; }
  Isometry3d operator*(const Isometry3d &o) const {
    Isometry3d T;
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 4; j++) {
        T(i, j) = j == 3 ? (*this)(i, 3) : 0.0;
        for (int k = 0; k < 3; k++) T(i, j) += (*this)(i, k) * o(k, j);
      }
    return T;
  }
};
}  // namespace Eigen

namespace stand_in {

inline Eigen::Isometry3d turned(const std::array<double, 3> &axis, double angle) {
  const double c = std::cos(angle), s = std::sin(angle), length = std::hypot(axis[0], axis[1], axis[2]);
  const double x = axis[0] / length, y = axis[1] / length, z = axis[2] / length;
  Eigen::Isometry3d T;
  T.a = {c + x * x * (1 - c), x * y * (1 - c) - z * s, x * z * (1 - c) + y * s, 0,
      y * x * (1 - c) + z * s, c + y * y * (1 - c), y * z * (1 - c) - x * s, 0,
      z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c), 0};
  return T;
}

}  // namespace stand_in

namespace srdf {
struct Model {
  std::string text;
  bool initString(const urdf::Model &, const std::string &xml) { return !(text = xml).empty(); }
};
}  // namespace srdf

namespace moveit::core {

struct VariableBounds {
  double min_position_ = 0, max_position_ = 0;
  bool position_bounded_ = false;
};

class JointModel {
 public:
  std::string name, kind, parent, child, leader_name;
  std::array<double, 3> axis{1, 0, 0};
  Eigen::Isometry3d origin;
  std::vector<VariableBounds> bounds;
  double factor = 1, offset = 0;
  const JointModel *leader = nullptr;

  const std::string &getName() const { return name; }
  std::size_t getVariableCount() const { return kind == "fixed" ? 0 : 1; }
  const JointModel *getMimic() const { return leader; }
  double getMimicFactor() const { return factor; }
  double getMimicOffset() const { return offset; }
  const std::vector<VariableBounds> &getVariableBounds() const { return bounds; }
};

class JointModelGroup {
 public:
  std::vector<const JointModel *> joints;
  std::vector<std::string> links, variables;
  const std::vector<const JointModel *> &getJointModels() const { return joints; }
  bool isChain() const { return true; }
  const std::vector<std::string> &getLinkModelNames() const { return links; }
  const std::vector<std::string> &getVariableNames() const { return variables; }
};

class RobotModel {
 public:
  std::vector<JointModel> joints;
  std::map<std::string, JointModelGroup> groups;
  std::string root;

  RobotModel(const std::shared_ptr<urdf::Model> &urdf, const std::shared_ptr<srdf::Model> &srdf) {
    read(*urdf);
    group(srdf->text);
  }
  const JointModelGroup *getJointModelGroup(const std::string &name) const {
    return groups.count(name) ? &groups.at(name) : nullptr;
  }
  bool hasLinkModel(const std::string &name) const { return name == root || above(name) != nullptr; }
  const JointModel *above(const std::string &link) const {
    for (const JointModel &joint : joints)
      if (joint.child == link) return &joint;
    return nullptr;
  }

 private:
  void read(const urdf::Model &model) {
    root = model.root;
    for (const auto &given : model.in_order) {
      joints.emplace_back();
      JointModel &joint = joints.back();
      joint.name = given->name;
      joint.kind = given->type == urdf::Joint::FIXED ? "fixed" : given->type == urdf::Joint::PRISMATIC ? "prismatic" : "turns";
      joint.parent = given->parent_link_name;
      joint.child = given->child_link_name;
      joint.axis = {given->axis.x, given->axis.y, given->axis.z};
      const auto &place = given->parent_to_joint_origin_transform;
      const auto &o = place.rotation;
      const double length = std::hypot(o.x, o.y, o.z);
      if (length > 0) joint.origin = stand_in::turned({o.x, o.y, o.z}, 2 * std::atan2(length, o.w));
      joint.origin(0, 3) = place.position.x, joint.origin(1, 3) = place.position.y, joint.origin(2, 3) = place.position.z;
      if (given->limits) {
        const bool bounded = given->type != urdf::Joint::CONTINUOUS;
        joint.bounds = {{bounded ? given->limits->lower : 0, bounded ? given->limits->upper : 0, bounded}};
      }
      if (given->mimic) {
        joint.leader_name = given->mimic->joint_name;
        joint.factor = given->mimic->multiplier;
        joint.offset = given->mimic->offset;
      }
    }
    for (JointModel &joint : joints)
      for (const JointModel &other : joints)
        if (other.name == joint.leader_name) joint.leader = &other;
  }

  /* Joints that are named, and those of chains; in the order of the URDF. */
  void group(const std::string &text) {
    std::string name;
    std::map<std::string, std::vector<std::string>> named;
    for (stand_in::Tag tag : stand_in::tags(text)) {
      auto &at = tag.attributes;
      if (tag.name == "group" && !tag.closes) named[name = at["name"]];
      if (tag.name == "joint") named[name].push_back(at["name"]);
      if (tag.name != "chain") continue;
      for (std::string link = at["tip_link"]; link != at["base_link"]; link = above(link)->parent) named[name].push_back(above(link)->name);
    }
    for (const auto &[key, names] : named)
      for (const JointModel &joint : joints) {
        if (std::find(names.begin(), names.end(), joint.name) == names.end()) continue;
        groups[key].joints.push_back(&joint);
        groups[key].links.push_back(joint.child);
        if (joint.getVariableCount()) groups[key].variables.push_back(joint.name);
      }
  }
};

using RobotModelPtr = std::shared_ptr<RobotModel>;
using RobotModelConstPtr = std::shared_ptr<const RobotModel>;

class RobotState {
 public:
  explicit RobotState(RobotModelConstPtr model) : model_(std::move(model)) {}
  void setToDefaultValues() { q_.clear(); }
  void setVariablePosition(const std::string &name, double value) { q_[name] = value; }
  const Eigen::Isometry3d &getGlobalLinkTransform(const std::string &link) {
    Eigen::Isometry3d T;
    for (const JointModel *joint = model_->above(link); joint; joint = model_->above(joint->parent)) T = moved(*joint) * T;
    return poses_[link] = T;
  }

 private:
  Eigen::Isometry3d moved(const JointModel &joint) {
    if (joint.kind == "fixed") return joint.origin;
    const double q = joint.factor * q_[joint.leader ? joint.leader->name : joint.name] + joint.offset;
    if (joint.kind != "prismatic") return joint.origin * stand_in::turned(joint.axis, q);
    Eigen::Isometry3d slid;
    for (int i = 0; i < 3; i++) slid(i, 3) = q * joint.axis[static_cast<std::size_t>(i)];
    return joint.origin * slid;
  }
  RobotModelConstPtr model_;
  std::map<std::string, double> q_;
  std::map<std::string, Eigen::Isometry3d> poses_;
};

}  // namespace moveit::core
