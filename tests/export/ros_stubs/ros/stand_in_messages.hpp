/* For the tests of holokin: what the plugins use of the messages of ROS 2, written from their public interface. */
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace builtin_interfaces::msg {
struct Time {
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
};
}  // namespace builtin_interfaces::msg

namespace std_msgs::msg {
struct Header {
  builtin_interfaces::msg::Time stamp;
  std::string frame_id;
};
}  // namespace std_msgs::msg

namespace geometry_msgs::msg {
struct Point {
  double x = 0, y = 0, z = 0;
};
struct Vector3 {
  double x = 0, y = 0, z = 0;
};
struct Quaternion {
  double x = 0, y = 0, z = 0, w = 1;
};
struct Pose {
  Point position;
  Quaternion orientation;
};
struct Twist {
  Vector3 linear, angular;
};
struct PoseStamped {
  using SharedPtr = std::shared_ptr<PoseStamped>;
  std_msgs::msg::Header header;
  Pose pose;
};
struct TwistStamped {
  using SharedPtr = std::shared_ptr<TwistStamped>;
  std_msgs::msg::Header header;
  Twist twist;
};
}  // namespace geometry_msgs::msg

namespace diagnostic_msgs::msg {
struct KeyValue {
  std::string key, value;
};
struct DiagnosticStatus {
  static constexpr unsigned char OK = 0, WARN = 1, ERROR = 2, STALE = 3;
  unsigned char level = 0;
  std::string name, message, hardware_id;
  std::vector<KeyValue> values;
};
}  // namespace diagnostic_msgs::msg

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
