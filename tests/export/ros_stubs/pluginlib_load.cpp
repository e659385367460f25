/* For the tests of holokin: finds a plugin by the index of ament, with pluginlib, as MoveIt does. */
#include <iostream>

#include <moveit/kinematics_base/kinematics_base.hpp>
#include <pluginlib/class_loader.hpp>

int main(int, char **argv) {
  pluginlib::ClassLoader<kinematics::KinematicsBase> loader("moveit_core", "kinematics::KinematicsBase");
  const auto plugin = loader.createUniqueInstance(argv[1]);
  for (const auto &name : loader.getDeclaredClasses()) std::cout << name << "\n";
  return plugin ? 0 : 1;
}
