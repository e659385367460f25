/* For the tests of holokin with ros2_control's own base class: stands in for the header of this name. */
#pragma once
#include <chrono>
#include <functional>
#include <memory>
#include <utility>
#include <rclcpp_lifecycle/lifecycle_node.hpp>
namespace realtime_tools {
enum class AsyncSchedulingPolicy { SYNCHRONIZED, DETACHED };
struct AsyncFunctionHandlerParams {
  int thread_priority = 50;
  AsyncSchedulingPolicy scheduling_policy = AsyncSchedulingPolicy::SYNCHRONIZED;
  template <class Node>
  void initialize(Node &, const char *) {}
};
template <class T>
struct AsyncFunctionHandler {
  template <class Function>
  void init(const Function &, const AsyncFunctionHandlerParams &) {}
  void start_thread() {}
  void stop_thread() {}
  void reset_variables() {}
  void wait_for_trigger_cycle_to_finish() {}
  bool is_running() const { return false; }
  rclcpp::Time get_current_callback_time() const { return rclcpp::Time(0); }
  std::pair<bool, T> trigger_async_callback(const rclcpp::Time &, const rclcpp::Duration &) { return {false, T{}}; }
  std::chrono::nanoseconds get_last_execution_time() const { return {}; }
};
}  // namespace realtime_tools
