/* For the tests of holokin: what the plugin uses of the messages of ROS 2 and of rclcpp, written from their public
   interface. Log lines go to stderr; a node has parameters and nothing else. */
#pragma once

#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <variant>

namespace geometry_msgs::msg {
struct Point {
  double x = 0, y = 0, z = 0;
};
struct Quaternion {
  double x = 0, y = 0, z = 0, w = 1;
};
struct Pose {
  Point position;
  Quaternion orientation;
};
}  // namespace geometry_msgs::msg

namespace moveit_msgs::msg {
struct MoveItErrorCodes {
  static constexpr std::int32_t SUCCESS = 1, FAILURE = 99999, PLANNING_FAILED = -1, TIMED_OUT = -6, NO_IK_SOLUTION = -31;
  std::int32_t val = 0;
};
}  // namespace moveit_msgs::msg

namespace rcl_interfaces::msg {
struct ParameterDescriptor {
  std::string name, description;
  bool read_only = false;
};
}  // namespace rcl_interfaces::msg

namespace rclcpp {

struct Logger {
  std::string name;
};
inline Logger get_logger(const std::string &name) { return {name}; }

class Parameter {
 public:
  using Value = std::variant<bool, std::int64_t, double, std::string>;
  explicit Parameter(Value value) : value_(std::move(value)) {}
  template <class T>
  T get_value() const {
    if (const T *found = std::get_if<T>(&value_)) return *found;
    throw std::runtime_error("parameter is of another type");
  }

 private:
  Value value_;
};

class Node {
 public:
  using SharedPtr = std::shared_ptr<Node>;
  std::map<std::string, Parameter::Value> overrides, declared;
  bool has_parameter(const std::string &name) const { return declared.count(name) > 0; }
  Parameter get_parameter(const std::string &name) const { return Parameter(declared.at(name)); }
  template <class T>
  T declare_parameter(const std::string &name, const T &by_default,
      const rcl_interfaces::msg::ParameterDescriptor & = {}) {
    if (has_parameter(name)) throw std::runtime_error("parameter " + name + " is declared already");
    const auto given = overrides.find(name);
    declared[name] = given == overrides.end() ? Parameter::Value(by_default) : given->second;
    return get_parameter(name).get_value<T>();
  }
};

}  // namespace rclcpp

#define RCLCPP_ERROR(logger, ...) \
  do { \
    std::fprintf(stderr, "[%s] ", (logger).name.c_str()); \
    std::fprintf(stderr, __VA_ARGS__); \
    std::fprintf(stderr, "\n"); \
  } while (false)
