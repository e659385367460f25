# For the tests of holokin: stands in for the package of this name, with Debian's library.
add_library(urdf::urdf INTERFACE IMPORTED)
target_link_libraries(urdf::urdf INTERFACE urdf)
