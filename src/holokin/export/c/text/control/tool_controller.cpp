/* $title. Written by holokin $version; see tool_controller.hpp. */
#include "tool_controller.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <limits>
#include <tuple>
#include <utility>

#include <hardware_interface/types/hardware_interface_type_values.hpp>
#include <pluginlib/class_list_macros.hpp>
#include <rclcpp/logging.hpp>
#include <rclcpp/qos.hpp>

#include "exported_robot.hpp"
#include "interface_access.hpp"

namespace $package {
namespace {

constexpr double NANO = 1e-9;

/* A longer period is cut to so many nominal ones: the tool then goes slower, and the joints make no jump. */
constexpr double LONGEST = 2.0;

/* Updates in a row that a joint's state may be held by another thread. */
constexpr std::size_t PATIENCE = 10;

/* Which numbers of the leaf are angles. */
constexpr std::array<bool, ${NAME}_R> ANGULAR = {$angular_flags};

strategy::Target target_of(const geometry_msgs::msg::Pose &pose) {
  Matrix T{};
  to_matrix(pose, T);
  strategy::Target target{};
$set_target
  return target;
}

strategy::Twist twist_of(const Motion &motion) {
  strategy::Twist twist{};
  std::copy_n(motion.begin(), twist.size(), twist.begin());
  return twist;
}

/* Of the tool: of a task of positions the turn does not count. */
Motion counted(Motion motion) {
  std::fill(motion.begin() + std::tuple_size<strategy::Twist>::value, motion.end(), 0.0);
  return motion;
}

}  // namespace

ToolController::CallbackReturn ToolController::on_configure(const rclcpp_lifecycle::State &) {
  Settings read;
  std::string why;
  try {
    why = read_settings(read);
    if (why.empty()) why = check_robot(read);
  } catch (const std::exception &problem) {
    why = std::string("a parameter is not of its type: ") + problem.what();
  }
  if (!why.empty()) {
    RCLCPP_ERROR(get_node()->get_logger(), "%s", why.c_str());
    return CallbackReturn::FAILURE;
  }
  set_ = read;
  const rclcpp::QoS newest = rclcpp::QoS(rclcpp::KeepLast(1)).best_effort();
  if (set_.twists)
    twists_ = get_node()->create_subscription<TwistStamped>("~/target_twist", newest,
        [this](const TwistStamped::SharedPtr message) { receive(*message); });
  else
    poses_ = get_node()->create_subscription<PoseStamped>("~/target_pose", newest,
        [this](const PoseStamped::SharedPtr message) { receive(*message); });
  publisher_ = get_node()->create_publisher<DiagnosticStatus>("~/status", rclcpp::SystemDefaultsQoS());
  const std::chrono::nanoseconds every(static_cast<std::int64_t>(1.0 / (NANO * value_of<double>("status_rate"))));
  timer_ = get_node()->create_wall_timer(every, [this]() {
    if (reports_.read(shown_)) publisher_->publish(status());
  });
  return CallbackReturn::SUCCESS;
}

ToolController::CallbackReturn ToolController::on_cleanup(const rclcpp_lifecycle::State &) {
  timer_.reset();
  publisher_.reset();
  poses_.reset();
  twists_.reset();
  return CallbackReturn::SUCCESS;
}

controller_interface::InterfaceConfiguration ToolController::command_interface_configuration() const {
  controller_interface::InterfaceConfiguration wanted{controller_interface::interface_configuration_type::INDIVIDUAL, {}};
  const char *const kind = set_.positions ? hardware_interface::HW_IF_POSITION : hardware_interface::HW_IF_VELOCITY;
  for (const std::string &joint : set_.joints) wanted.names.push_back(joint + "/" + kind);
  return wanted;
}

controller_interface::InterfaceConfiguration ToolController::state_interface_configuration() const {
  controller_interface::InterfaceConfiguration wanted{controller_interface::interface_configuration_type::INDIVIDUAL, {}};
  for (const std::string &joint : set_.joints) wanted.names.push_back(joint + "/" + hardware_interface::HW_IF_POSITION);
  return wanted;
}

/* Finds the interfaces of each joint by name, in whatever order they are. What lacks; "" where nothing does. */
std::string ToolController::take_interfaces() {
  const std::string kind = set_.positions ? hardware_interface::HW_IF_POSITION : hardware_interface::HW_IF_VELOCITY;
  std::vector<std::string> missing;
  for (std::size_t i = 0; i < N; i++) {
    const std::string joint = set_.prefix + JOINTS[i];
    states_[i] = place_of(state_interfaces_, joint, hardware_interface::HW_IF_POSITION);
    commands_[i] = place_of(command_interfaces_, joint, kind);
    if (states_[i] == state_interfaces_.size()) missing.push_back("state " + joint + "/" + hardware_interface::HW_IF_POSITION);
    if (commands_[i] == command_interfaces_.size()) missing.push_back("command " + joint + "/" + kind);
  }
  return missing.empty() ? "" : "there are no interfaces " + listed(missing);
}

/* Chooses the leaf, and looks whether the arm stands on it. What is wrong; "" where nothing is. */
std::string ToolController::begin_at(const Joints &q) {
  const auto value = strategy::constraint(q);
  const auto T = strategy::pose(q);
  if (!value || !T) return "the joints are at a singular posture of the strategy";
  if (set_.level_at_activation) std::copy(value.value.begin(), value.value.end(), set_.step.leaf);
  for (std::size_t i = 0; i < value.value.size(); i++) {
    const double off = value.value[i] - set_.step.leaf[i];
    const double error = std::abs(ANGULAR[i] ? std::remainder(off, 2.0 * std::acos(-1.0)) : off);
    if (!(error <= set_.max_level_error))
      return "number " + std::to_string(i + 1) + " of the leaf is " + std::to_string(value.value[i]) + " at these joints, " +
             std::to_string(error) + " from the level " + std::to_string(set_.step.leaf[i]) +
             ": move the arm to the start posture first, or set level or level_at_activation";
  }
  strategy::Parameters still = set_.step;
  still.dt = set_.period;
  if (!strategy::step(q, target_of(to_pose(T.value)), strategy::Twist{}, still)) return "the joints are at a singular posture of the strategy";
  return "";
}

ToolController::CallbackReturn ToolController::on_activate(const rclcpp_lifecycle::State &) {
  std::string why = take_interfaces();
  unread_ = 0;
  if (why.empty() && !read_joints()) why = "the position of a joint is not known";
  if (why.empty()) why = begin_at(measured_);
  if (!why.empty()) {
    RCLCPP_ERROR(get_node()->get_logger(), "%s", why.c_str());
    return CallbackReturn::FAILURE;
  }
  Goal old;
  goals_.read(old); /* of the time before */
  goal_ = Goal();
  commanded_ = measured_;
  rates_ = Joints{};
  referred_ = false;
  fault_ = Outcome::OK;
  report_ = Report();
  write_joints();
  return CallbackReturn::SUCCESS;
}

ToolController::CallbackReturn ToolController::on_deactivate(const rclcpp_lifecycle::State &) {
  rates_ = Joints{};
  write_joints(); /* the last positions again, or no velocity */
  report_.outcome = Outcome::INACTIVE;
  report_.scale = 0.0;
  reports_.write(report_);
  return CallbackReturn::SUCCESS;
}

void ToolController::accept(const std::string &frame, std::int64_t stamp, const Goal &goal) {
  Goal accepted = goal;
  if (!frame.empty() && frame != set_.base) {
    accepted.found = Outcome::BAD_TARGET;
    RCLCPP_WARN_THROTTLE(get_node()->get_logger(), *get_node()->get_clock(), 1000,
        "a target is in the frame '%s', not in '%s'", frame.c_str(), set_.base.c_str());
  } else if (accepted.found == Outcome::BAD_TARGET) {
    RCLCPP_WARN_THROTTLE(get_node()->get_logger(), *get_node()->get_clock(), 1000,
        "a target has numbers that are not finite, or a quaternion that is not of length 1");
  } else if (stamp != 0 && set_.timeout > 0) {
    const double age = static_cast<double>(get_node()->now().nanoseconds() - stamp) * NANO;
    if (std::abs(age) > set_.timeout) {
      accepted.found = Outcome::STALE;
      RCLCPP_WARN_THROTTLE(get_node()->get_logger(), *get_node()->get_clock(), 1000,
          "a target is %g s old by its stamp and the clock of this node", age);
    }
  }
  goals_.write(accepted);
}

void ToolController::receive(const PoseStamped &message) {
  Goal goal;
  Matrix T{};
  goal.pose = message.pose;
  goal.found = to_matrix(message.pose, T) ? Outcome::OK : Outcome::BAD_TARGET;
  const auto &stamp = message.header.stamp;
  accept(message.header.frame_id, std::int64_t{stamp.sec} * 1000000000 + stamp.nanosec, goal);
}

void ToolController::receive(const TwistStamped &message) {
  Goal goal;
  const auto &v = message.twist.linear;
  const auto &w = message.twist.angular;
  goal.twist = {v.x, v.y, v.z, w.x, w.y, w.z};
  const bool finite = std::all_of(goal.twist.begin(), goal.twist.end(), [](double x) { return std::isfinite(x); });
  goal.found = finite ? Outcome::OK : Outcome::BAD_TARGET;
  const auto &stamp = message.header.stamp;
  accept(message.header.frame_id, std::int64_t{stamp.sec} * 1000000000 + stamp.nanosec, goal);
}

/* False where a position is not a number, or was held by another thread for too long. */
bool ToolController::read_joints() {
  bool all = true;
  for (std::size_t i = 0; i < N; i++) all &= read_value(state_interfaces_[states_[i]], measured_[i], 0);
  unread_ = all ? 0 : unread_ + 1;
  return unread_ <= PATIENCE && std::all_of(measured_.begin(), measured_.end(), [](double x) { return std::isfinite(x); });
}

bool ToolController::write_joints() {
  bool all = true;
  for (std::size_t i = 0; i < N; i++)
    all &= write_value(command_interfaces_[commands_[i]], set_.positions ? commanded_[i] : rates_[i]);
  return all;
}

/* The motion of the reference in a step, and where it then is. */
Motion ToolController::wanted(double dt, Pose &next) const {
  const Motion whole = counted(set_.twists ? times(goal_.twist, dt) : motion_between(reference_, goal_.pose));
  double share = set_.twists ? 1.0 : std::min(1.0, dt / std::max(remaining_, dt));
  const double linear = length_of(whole, 0) * share, angular = length_of(whole, 3) * share;
  share = std::min({share, share * set_.max_linear_velocity * dt / std::max(linear, std::numeric_limits<double>::min()),
      share * set_.max_angular_velocity * dt / std::max(angular, std::numeric_limits<double>::min())});
  const bool there = !set_.twists && share >= 1.0;
  next = there ? goal_.pose : moved_by(reference_, times(whole, share));
  return times(whole, share);
}

/* One step from q; the rates are zero where it stands still. */
Outcome ToolController::follow(const Joints &q, double dt) {
  strategy::Parameters parameters = set_.step;
  parameters.dt = dt;
  Pose next;
  const Motion motion = wanted(dt, next);
  const auto step = strategy::step(q, target_of(next), twist_of(times(motion, 1.0 / dt)), parameters);
  if (!step) return outcome_of(step.status);
  Joints ahead = q;
  for (std::size_t i = 0; i < N; i++) ahead[i] += dt * step.value.rates[i];
  /* A singular posture is not entered: there the step would refuse every target, also those back. */
  if (strategy::step(ahead, target_of(next), strategy::Twist{}, parameters).status == strategy::Status::singular) return Outcome::SINGULAR;
  rates_ = step.value.rates;
  report_.scale = step.value.scale;
  if (set_.positions) commanded_ = ahead;
  reference_ = step.value.scale >= 1.0 ? next : moved_by(reference_, times(motion, step.value.scale));
  remaining_ = std::max(0.0, remaining_ - dt);
  return outcome_of(step.status);
}

/* What to do in this update. */
Outcome ToolController::advance(std::int64_t now, double seconds) {
  if (goals_.read(goal_)) {
    seen_ = now;
    remaining_ = set_.target_period;
  }
  if (!read_joints()) return Outcome::NO_STATE;
  if (fault_ != Outcome::OK) return fault_;
  const Joints &q = set_.positions ? commanded_ : measured_;
  for (std::size_t i = 0; i < N; i++)
    if (!(std::abs(q[i] - measured_[i]) <= set_.max_lag)) return fault_ = Outcome::NOT_FOLLOWING;
  if (goal_.found != Outcome::OK) return goal_.found;
  const double age = static_cast<double>(now - seen_) * NANO;
  if (set_.timeout > 0 && !(std::abs(age) <= set_.timeout)) return Outcome::STALE;
  if (!(seconds > 0)) return Outcome::BAD_PERIOD;
  if (seconds > LONGEST * set_.period) report_.late++;
  if (!referred_) {
    const auto T = strategy::pose(q);
    if (!T) return outcome_of(T.status);
    reference_ = to_pose(T.value);
    referred_ = true;
  }
  if (!set_.twists) {
    const Motion way = counted(motion_between(reference_, goal_.pose));
    if (!(length_of(way, 0) <= set_.max_distance && length_of(way, 3) <= set_.max_angle)) return Outcome::FAR;
  }
  const Outcome found = follow(q, std::min(seconds, LONGEST * set_.period));
  if (found == Outcome::LOST) fault_ = found;
  return found;
}

controller_interface::return_type ToolController::update(const rclcpp::Time &time, const rclcpp::Duration &period) {
  rates_ = Joints{};
  report_.scale = 0.0;
  report_.outcome = advance(time.nanoseconds(), period.seconds());
  if (!moves(report_.outcome)) {
    referred_ = false;
    report_.stops++;
    report_.last_stop = report_.outcome;
  }
  write_joints();
  reports_.write(report_);
  return controller_interface::return_type::OK;
}

ToolController::DiagnosticStatus ToolController::status() {
  reports_.read(shown_);
  DiagnosticStatus said;
  said.name = get_node()->get_name();
  said.message = words_of(shown_.outcome);
  said.hardware_id = $robot_string;
  said.level = DiagnosticStatus::ERROR;
  if (shown_.outcome == Outcome::OK) said.level = DiagnosticStatus::OK;
  if (shown_.outcome == Outcome::SLOWED || shown_.outcome == Outcome::LIMIT || shown_.outcome == Outcome::WAITING)
    said.level = DiagnosticStatus::WARN;
  if (shown_.outcome == Outcome::STALE || shown_.outcome == Outcome::INACTIVE) said.level = DiagnosticStatus::STALE;
  const auto tell = [&said](const char *key, const std::string &value) {
    diagnostic_msgs::msg::KeyValue pair;
    pair.key = key;
    pair.value = value;
    said.values.push_back(pair);
  };
  tell("status", std::to_string(static_cast<int>(shown_.outcome)));
  tell("scale", std::to_string(shown_.scale));
  tell("updates that stood still", std::to_string(shown_.stops));
  tell("last reason", shown_.stops > 0 ? words_of(shown_.last_stop) : "");
  tell("long periods", std::to_string(shown_.late));
  return said;
}

}  // namespace $package

PLUGINLIB_EXPORT_CLASS($package::ToolController, controller_interface::ControllerInterface)
