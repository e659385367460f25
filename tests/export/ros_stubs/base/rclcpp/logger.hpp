/* For the tests of holokin with MoveIt's own base class: stands in for the header of this name. */
#pragma once
#include <rclcpp/node.hpp>
