/* $title. Written by holokin $version. What differs between versions of ros2_control. */
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <type_traits>

namespace $package {

/* The value of an interface; false where another thread holds it. ros2_control 2 has get_value alone, later ones
   get_optional. */
template <class Interface>
auto read_value(const Interface &interface, double &value, int) -> decltype(interface.get_optional(), bool()) {
  const auto found = interface.get_optional();
  if (found.has_value()) value = found.value();
  return found.has_value();
}
template <class Interface>
bool read_value(const Interface &interface, double &value, long) {
  value = interface.get_value();
  return true;
}

template <class Interface>
bool write_value(Interface &interface, double value) {
  if constexpr (std::is_void_v<decltype(interface.set_value(value))>) {
    interface.set_value(value);
    return true;
  } else {
    return interface.set_value(value);
  }
}

/* The robot description of the controller manager, which ros2_control 2 does not hand on. */
template <class Controller>
auto description_of(const Controller &controller, int) -> decltype(std::string(controller.get_robot_description())) {
  return controller.get_robot_description();
}
template <class Controller>
std::string description_of(const Controller &, long) {
  return "";
}

/* Where an interface of a joint is among those that were claimed; as many as there are where it is not. */
template <class Interfaces>
std::size_t place_of(const Interfaces &interfaces, const std::string &joint, const std::string &kind) {
  const auto found = std::find_if(interfaces.begin(), interfaces.end(), [&](const auto &one) {
    return one.get_prefix_name() == joint && one.get_interface_name() == kind;
  });
  return static_cast<std::size_t>(found - interfaces.begin());
}

}  // namespace $package
