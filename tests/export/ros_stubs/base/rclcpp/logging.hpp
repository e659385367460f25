/* For the tests of holokin with ros2_control's own base class: stands in for the header of this name. */
#pragma once
#include <rclcpp/node.hpp>
#define RCLCPP_DEBUG(...) (void)0
#define RCLCPP_INFO(...) (void)0
#define RCLCPP_FATAL RCLCPP_ERROR
#define RCLCPP_WARN RCLCPP_ERROR
#define RCLCPP_WARN_EXPRESSION(logger, condition, ...) \
  do { \
    if (condition) RCLCPP_ERROR(logger, __VA_ARGS__); \
  } while (false)
#define RCL_CLOCK_UNINITIALIZED 0
