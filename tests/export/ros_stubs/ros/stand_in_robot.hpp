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

/* A tag with its attributes; `depth` counts the tags round it. */
struct Tag {
  std::string name;
  std::map<std::string, std::string> attributes;
  bool closes = false;
};

inline std::string unescaped(std::string text) {
  for (const auto &[code, mark] : std::map<std::string, std::string>{{"&lt;", "<"}, {"&gt;", ">"}, {"&quot;", "\""}, {"&apos;", "'"}})
    for (std::size_t at; (at = text.find(code)) != std::string::npos;) text.replace(at, code.size(), mark);
  for (std::size_t at = 0; (at = text.find("&amp;", at)) != std::string::npos; at++) text.replace(at, 5, "&");
  return text;
}

/* The tags of a text of XML, comments left out. */
inline std::vector<Tag> tags(const std::string &text) {
  std::vector<Tag> found;
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos;) {
    if (text.compare(at, 4, "<!--") == 0) {
      at = text.find("-->", at);
      continue;
    }
    Tag tag;
    std::size_t i = at + 1;
    if (text[i] == '/') tag.closes = true, i++;
    const std::size_t end = text.find_first_of(" \n>/", i);
    tag.name = text.substr(i, end - i);
    for (i = end; text[i] != '>'; i++) {
      if (text[i] == '/' || text[i] == ' ' || text[i] == '\n' || text[i] == '?') continue;
      const std::size_t is = text.find('=', i), close = text.find(text[is + 1], is + 2);
      tag.attributes[text.substr(i, is - i)] = unescaped(text.substr(is + 2, close - is - 2));
      i = close;
    }
    found.push_back(tag);
    at = i;
  }
  return found;
}

inline std::array<double, 3> three(const std::string &text) {
  std::istringstream stream(text);
  std::array<double, 3> found{};
  stream >> found[0] >> found[1] >> found[2];
  return found;
}

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

namespace urdf {
struct Model {
  std::string text;
  bool initString(const std::string &xml) { return !(text = xml).empty(); }
};
}  // namespace urdf

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
    read(urdf->text);
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
  void read(const std::string &text) {
    bool inside = false;
    for (stand_in::Tag tag : stand_in::tags(text)) {
      auto &at = tag.attributes;
      if (tag.name == "link" && !tag.closes && root.empty()) root = at["name"];
      if (tag.name == "joint") inside = !tag.closes;
      if (tag.name == "joint" && !tag.closes) {
        joints.emplace_back();
        joints.back().name = at["name"];
        joints.back().kind = at["type"];
      }
      if (!inside || tag.closes) continue;
      JointModel &joint = joints.back();
      if (tag.name == "parent") joint.parent = at["link"];
      if (tag.name == "child") joint.child = at["link"];
      if (tag.name == "axis") joint.axis = stand_in::three(at["xyz"]);
      if (tag.name == "origin") {
        const auto p = stand_in::three(at["xyz"]), r = stand_in::three(at["rpy"]);
        joint.origin = stand_in::turned({0, 0, 1}, r[2]) * stand_in::turned({0, 1, 0}, r[1]) * stand_in::turned({1, 0, 0}, r[0]);
        for (int i = 0; i < 3; i++) joint.origin(i, 3) = p[static_cast<std::size_t>(i)];
      }
      if (tag.name == "limit") {
        const bool bounded = at.count("lower") && joint.kind != "continuous";
        joint.bounds = {{bounded ? std::stod(at["lower"]) : 0, bounded ? std::stod(at["upper"]) : 0, bounded}};
      }
      if (tag.name == "mimic") {
        joint.leader_name = at["joint"];
        joint.factor = at.count("multiplier") ? std::stod(at["multiplier"]) : 1;
        joint.offset = at.count("offset") ? std::stod(at["offset"]) : 0;
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
