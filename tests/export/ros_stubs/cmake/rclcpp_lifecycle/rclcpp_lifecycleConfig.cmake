# For the tests of holokin: stands in for the package of this name.
add_library(rclcpp_lifecycle::rclcpp_lifecycle INTERFACE IMPORTED)
target_include_directories(rclcpp_lifecycle::rclcpp_lifecycle INTERFACE ${CMAKE_CURRENT_LIST_DIR}/../../ros)
