/* For the tests of holokin with ros2_control's own base class: stands in for the header of this name. */
#pragma once
#include <rclcpp/logging.hpp>
#include <stand_in_node.hpp>
