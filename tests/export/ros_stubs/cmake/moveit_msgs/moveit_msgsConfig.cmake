# For the tests of holokin: stands in for the package of this name; its headers come with rclcpp.
