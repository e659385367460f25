/* For the tests of holokin with ros2_control's own base class: stands in for the header of this name. */
#pragma once
#include <pal_statistics/pal_statistics_utils.hpp>
#define REGISTER_ROS2_CONTROL_INTROSPECTION(...) (void)0
#include <cxxabi.h>
#define DEFAULT_REGISTER_ROS2_CONTROL_INTROSPECTION(...) (void)f
#define DEFAULT_UNREGISTER_ROS2_CONTROL_INTROSPECTION(...) (void)0
