# For the tests of holokin: stands in for the package of this name.
add_library(hardware_interface::hardware_interface INTERFACE IMPORTED)
target_include_directories(hardware_interface::hardware_interface INTERFACE ${CMAKE_CURRENT_LIST_DIR}/../../ros ${CMAKE_CURRENT_LIST_DIR}/../../control)
