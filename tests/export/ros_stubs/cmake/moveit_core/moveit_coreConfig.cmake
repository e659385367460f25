# For the tests of holokin: stands in for the package of this name.
foreach(part kinematics_base robot_model robot_state)
  add_library(moveit_core::moveit_${part} INTERFACE IMPORTED)
  target_include_directories(moveit_core::moveit_${part} INTERFACE ${CMAKE_CURRENT_LIST_DIR}/../../ros ${CMAKE_CURRENT_LIST_DIR}/../../robot)
endforeach()
