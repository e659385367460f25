/* For the tests of holokin with ros2_control's own base class: stands in for the header of this name. */
#pragma once
namespace pal_statistics {
struct RegistrationsRAII {
  void enableAll() {}
  void disableAll() {}
};
}  // namespace pal_statistics
