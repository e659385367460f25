/* For the tests of holokin: what the plugins use of urdf::Model, written from its public interface. */
#pragma once

#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <vector>

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

}  // namespace stand_in

namespace urdf {

struct Vector3 {
  double x = 0, y = 0, z = 0;
};
struct Rotation {
  double x = 0, y = 0, z = 0, w = 1;
};
struct Pose {
  Vector3 position;
  Rotation rotation;
};
struct JointLimits {
  double lower = 0, upper = 0, effort = 0, velocity = 0;
};
struct JointMimic {
  double offset = 0, multiplier = 1;
  std::string joint_name;
};

struct Joint {
  enum { UNKNOWN, REVOLUTE, CONTINUOUS, PRISMATIC, FLOATING, PLANAR, FIXED } type = UNKNOWN;
  std::string name, parent_link_name, child_link_name;
  Vector3 axis{1, 0, 0};
  Pose parent_to_joint_origin_transform;
  std::shared_ptr<JointLimits> limits;
  std::shared_ptr<JointMimic> mimic;
};
using JointConstSharedPtr = std::shared_ptr<const Joint>;

struct Link {
  std::string name;
  std::shared_ptr<Joint> parent_joint;
};
using LinkConstSharedPtr = std::shared_ptr<const Link>;

class Model {
 public:
  std::string root;
  std::vector<std::shared_ptr<Joint>> in_order;

  bool initString(const std::string &text) {
    for (stand_in::Tag tag : stand_in::tags(text)) read(tag);
    return !root.empty();
  }
  JointConstSharedPtr getJoint(const std::string &name) const {
    for (const auto &joint : in_order)
      if (joint->name == name) return joint;
    return nullptr;
  }
  LinkConstSharedPtr getLink(const std::string &name) const {
    if (!links_.count(name)) return nullptr;
    const auto link = std::make_shared<Link>();
    link->name = name;
    for (const auto &joint : in_order)
      if (joint->child_link_name == name) link->parent_joint = joint;
    return link;
  }

 private:
  /* A turn by roll, pitch and yaw. */
  static Rotation turned(const std::array<double, 3> &rpy) {
    const double a = rpy[0] / 2, b = rpy[1] / 2, c = rpy[2] / 2;
    return {std::sin(a) * std::cos(b) * std::cos(c) - std::cos(a) * std::sin(b) * std::sin(c),
        std::cos(a) * std::sin(b) * std::cos(c) + std::sin(a) * std::cos(b) * std::sin(c),
        std::cos(a) * std::cos(b) * std::sin(c) - std::sin(a) * std::sin(b) * std::cos(c),
        std::cos(a) * std::cos(b) * std::cos(c) + std::sin(a) * std::sin(b) * std::sin(c)};
  }

  void read(stand_in::Tag &tag) {
    static const std::map<std::string, int> KINDS = {{"revolute", Joint::REVOLUTE}, {"continuous", Joint::CONTINUOUS},
        {"prismatic", Joint::PRISMATIC}, {"floating", Joint::FLOATING}, {"planar", Joint::PLANAR}, {"fixed", Joint::FIXED}};
    auto &at = tag.attributes;
    if (tag.name == "link" && !tag.closes) {
      if (root.empty()) root = at["name"];
      links_.insert(at["name"]);
    }
    if (tag.name == "joint") inside_ = !tag.closes;
    if (tag.name == "joint" && !tag.closes) {
      in_order.push_back(std::make_shared<Joint>());
      in_order.back()->name = at["name"];
      in_order.back()->type = static_cast<decltype(Joint::type)>(KINDS.at(at["type"]));
    }
    if (!inside_ || tag.closes) return;
    Joint &joint = *in_order.back();
    if (tag.name == "parent") joint.parent_link_name = at["link"];
    if (tag.name == "child") joint.child_link_name = at["link"];
    if (tag.name == "axis") {
      const auto axis = stand_in::three(at["xyz"]);
      joint.axis = {axis[0], axis[1], axis[2]};
    }
    if (tag.name == "origin") {
      const auto p = stand_in::three(at["xyz"]);
      joint.parent_to_joint_origin_transform = {{p[0], p[1], p[2]}, turned(stand_in::three(at["rpy"]))};
    }
    if (tag.name == "limit") {
      joint.limits = std::make_shared<JointLimits>();
      if (at.count("lower")) joint.limits->lower = std::stod(at["lower"]);
      if (at.count("upper")) joint.limits->upper = std::stod(at["upper"]);
      if (at.count("velocity")) joint.limits->velocity = std::stod(at["velocity"]);
    }
    if (tag.name == "mimic") {
      joint.mimic = std::make_shared<JointMimic>();
      joint.mimic->joint_name = at["joint"];
      if (at.count("multiplier")) joint.mimic->multiplier = std::stod(at["multiplier"]);
      if (at.count("offset")) joint.mimic->offset = std::stod(at["offset"]);
    }
  }

  std::set<std::string> links_;
  bool inside_ = false;
};

}  // namespace urdf
