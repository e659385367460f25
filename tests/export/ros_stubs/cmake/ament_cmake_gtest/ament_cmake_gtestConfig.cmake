# For the tests of holokin: stands in for the package of this name, with GoogleTest itself.
function(ament_add_gtest name)
  add_executable(${name} ${ARGN})
  target_link_libraries(${name} gtest gtest_main pthread)
  add_test(NAME ${name} COMMAND ${name})
endfunction()
