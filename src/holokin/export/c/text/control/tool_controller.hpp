/* $title. Written by holokin $version. A controller of ros2_control over the exported control step in $name.c.

   It leads the tool to the target that it was last given, a pose or a twist, and the joints along their leaf. update()
   neither allocates nor locks. Where it cannot go on it stands still, and its status says why. */
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <controller_interface/controller_interface.hpp>
#include <diagnostic_msgs/msg/diagnostic_status.hpp>
#include <geometry_msgs/msg/pose_stamped.hpp>
#include <geometry_msgs/msg/twist_stamped.hpp>
#include <rclcpp/duration.hpp>
#include <rclcpp/publisher.hpp>
#include <rclcpp/subscription.hpp>
#include <rclcpp/time.hpp>
#include <rclcpp/timer.hpp>
#include <rclcpp_lifecycle/state.hpp>

#include "$name.hpp"
#include "latest_value.hpp"
#include "outcome.hpp"
#include "tool_motion.hpp"

namespace $package {

class ToolController : public controller_interface::ControllerInterface {
 public:
  using CallbackReturn = controller_interface::CallbackReturn;
  using Pose = geometry_msgs::msg::Pose;
  using PoseStamped = geometry_msgs::msg::PoseStamped;
  using TwistStamped = geometry_msgs::msg::TwistStamped;
  using DiagnosticStatus = diagnostic_msgs::msg::DiagnosticStatus;

  CallbackReturn on_init() override;
  CallbackReturn on_configure(const rclcpp_lifecycle::State &previous) override;
  CallbackReturn on_activate(const rclcpp_lifecycle::State &previous) override;
  CallbackReturn on_deactivate(const rclcpp_lifecycle::State &previous) override;
  CallbackReturn on_cleanup(const rclcpp_lifecycle::State &previous) override;
  controller_interface::InterfaceConfiguration command_interface_configuration() const override;
  controller_interface::InterfaceConfiguration state_interface_configuration() const override;
  controller_interface::return_type update(const rclcpp::Time &time, const rclcpp::Duration &period) override;

  /* What the subscriptions call: a target from now on. One of the thread of the node's callbacks. */
  void receive(const PoseStamped &message);
  void receive(const TwistStamped &message);

  /* What the last update did, for the thread of the node's callbacks. */
  DiagnosticStatus status();

 private:
  using Joints = $name::Joints;

  /* A pose or a twist to lead the tool to, or why it is none. */
  struct Goal {
    Outcome found = Outcome::WAITING;
    Pose pose;
    Motion twist{};
  };

  /* Of an update, for the status. */
  struct Report {
    Outcome outcome = Outcome::INACTIVE, last_stop = Outcome::INACTIVE;
    double scale = 0.0;
    std::uint64_t stops = 0, late = 0;
  };

  struct Settings {
    std::vector<std::string> joints;
    std::string prefix, base, tip;
    bool positions = true, twists = false, level_at_activation = false;
    double period = 0.0, timeout = 0.0, target_period = 0.0;
    double max_linear_velocity = 0.0, max_angular_velocity = 0.0, max_distance = 0.0, max_angle = 0.0;
    double max_lag = 0.0, max_level_error = 0.0;
    $name::Parameters step{};
  };

  template <class T>
  T value_of(const std::string &parameter) const {
    return get_node()->get_parameter(parameter).template get_value<T>();
  }
  std::string read_settings(Settings &read) const;
  std::string check_robot(const Settings &read) const;
  std::string take_interfaces();
  std::string begin_at(const Joints &q);
  void accept(const std::string &frame, std::int64_t stamp, const Goal &goal);

  bool read_joints();
  bool write_joints();
  Outcome advance(std::int64_t now, double seconds);
  Outcome follow(const Joints &q, double dt);
  Motion wanted(double dt, Pose &next) const;

  Settings set_;
  std::array<std::size_t, $n> states_{}, commands_{}; /* interfaces of the joints of the export */
  Joints measured_{}, commanded_{}, rates_{};
  Pose reference_;         /* where the tool is wanted now */
  bool referred_ = false;  /* or where it is: after each standstill */
  Goal goal_;
  std::int64_t seen_ = 0;  /* when the goal was first seen [ns], on the clock of update() */
  double remaining_ = 0.0; /* [s] in which the reference is to be at the goal */
  Outcome fault_ = Outcome::OK; /* one that ends with the next activation */
  std::size_t unread_ = 0;
  Report report_, shown_;

  LatestValue<Goal> goals_;
  LatestValue<Report> reports_;
  rclcpp::Subscription<PoseStamped>::SharedPtr poses_;
  rclcpp::Subscription<TwistStamped>::SharedPtr twists_;
  rclcpp::Publisher<DiagnosticStatus>::SharedPtr publisher_; /* no lifecycle publisher: those of controllers stay inactive */
  rclcpp::TimerBase::SharedPtr timer_;
};

}  // namespace $package
