/* For the tests of holokin with ros2_control's own base class: stands in for the header of this name. */
#pragma once
#include <cstdint>
namespace lifecycle_msgs::msg {
struct State {
  static constexpr std::uint8_t PRIMARY_STATE_UNKNOWN = 0, PRIMARY_STATE_UNCONFIGURED = 1, PRIMARY_STATE_INACTIVE = 2,
      PRIMARY_STATE_ACTIVE = 3, PRIMARY_STATE_FINALIZED = 4, TRANSITION_STATE_CONFIGURING = 10,
      TRANSITION_STATE_CLEANINGUP = 11, TRANSITION_STATE_SHUTTINGDOWN = 12, TRANSITION_STATE_ACTIVATING = 13,
      TRANSITION_STATE_DEACTIVATING = 14, TRANSITION_STATE_ERRORPROCESSING = 15;
};
}  // namespace lifecycle_msgs::msg
