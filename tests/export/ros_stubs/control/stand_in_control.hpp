/* For the tests of holokin: what a controller uses of ros2_control 4 to 6 (ROS 2 Jazzy, Kilted, Rolling), written from
   its public interface. */
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <stand_in_node.hpp>

namespace hardware_interface {

constexpr char HW_IF_POSITION[] = "position";
constexpr char HW_IF_VELOCITY[] = "velocity";

/* A number; `held` reads or writes fail, as while another thread has it. */
class Handle {
 public:
  using SharedPtr = std::shared_ptr<Handle>;
  Handle(const std::string &prefix, const std::string &kind) : prefix_(prefix), kind_(kind), name_(prefix + "/" + kind) {}
  const std::string &get_name() const { return name_; }
  const std::string &get_prefix_name() const { return prefix_; }
  const std::string &get_interface_name() const { return kind_; }
  [[nodiscard]] bool set_value(double value) {
    if (free()) value_ = value;
    return freed_;
  }
  std::optional<double> get_optional() const { return free() ? std::optional<double>(value_) : std::nullopt; }
  mutable int held = 0;

 private:
  bool free() const { return freed_ = held <= 0 || held-- <= 0; }
  std::string prefix_, kind_, name_;
  double value_ = __builtin_nan("");
  mutable bool freed_ = true;
};
using StateInterface = Handle;
using CommandInterface = Handle;

class LoanedStateInterface {
 public:
  LoanedStateInterface(std::shared_ptr<const Handle> handle, std::nullptr_t) : handle_(std::move(handle)) {}
  LoanedStateInterface(LoanedStateInterface &&) = default;
  const std::string &get_prefix_name() const { return handle_->get_prefix_name(); }
  const std::string &get_interface_name() const { return handle_->get_interface_name(); }
  [[nodiscard]] std::optional<double> get_optional(unsigned int = 10) const { return handle_->get_optional(); }

 private:
  std::shared_ptr<const Handle> handle_;
};

class LoanedCommandInterface {
 public:
  LoanedCommandInterface(std::shared_ptr<Handle> handle, std::nullptr_t) : handle_(std::move(handle)) {}
  LoanedCommandInterface(LoanedCommandInterface &&) = default;
  const std::string &get_prefix_name() const { return handle_->get_prefix_name(); }
  const std::string &get_interface_name() const { return handle_->get_interface_name(); }
  template <typename T>
  [[nodiscard]] bool set_value(const T &value, unsigned int = 10) { return handle_->set_value(value); }

 private:
  std::shared_ptr<Handle> handle_;
};

}  // namespace hardware_interface

namespace controller_interface {

using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;
enum class return_type : std::uint8_t { OK = 0, ERROR = 1 };
enum class interface_configuration_type : std::uint8_t { ALL = 0, INDIVIDUAL = 1, NONE = 2 };

struct InterfaceConfiguration {
  interface_configuration_type type;
  std::vector<std::string> names = {};
};

struct ControllerInterfaceParams {
  std::string controller_name, robot_description, node_namespace;
  unsigned int update_rate = 0, controller_manager_update_rate = 0;
  rclcpp::NodeOptions node_options;
};

class ControllerInterface : public rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface {
 public:
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual CallbackReturn on_init() = 0;
  virtual return_type update(const rclcpp::Time &, const rclcpp::Duration &) = 0;
  virtual rclcpp::NodeOptions define_custom_node_options() const { return {}; }

  return_type init(const ControllerInterfaceParams &given) {
    node_ = std::make_shared<rclcpp_lifecycle::LifecycleNode>(given.controller_name, "", given.node_options, false);
    description_ = given.robot_description;
    rate_ = given.controller_manager_update_rate;
    return on_init() == CallbackReturn::SUCCESS ? return_type::OK : return_type::ERROR;
  }
  const std::string &get_robot_description() const { return description_; }

  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() { return node_; }
  std::shared_ptr<const rclcpp_lifecycle::LifecycleNode> get_node() const { return node_; }
  unsigned int get_update_rate() const { return rate_; }

  template <typename T>
  auto auto_declare(const std::string &name, const T &by_default) {
    if (node_->has_parameter(name)) return node_->get_parameter(name).template get_value<T>();
    return node_->template declare_parameter<T>(name, by_default);
  }

  void assign_interfaces(std::vector<hardware_interface::LoanedCommandInterface> &&commands,
      std::vector<hardware_interface::LoanedStateInterface> &&states) {
    release_interfaces();
    for (auto &one : commands) command_interfaces_.push_back(std::move(one));
    for (auto &one : states) state_interfaces_.push_back(std::move(one));
  }
  void release_interfaces() {
    command_interfaces_.clear();
    state_interfaces_.clear();
  }

 protected:
  std::vector<hardware_interface::LoanedCommandInterface> command_interfaces_;
  std::vector<hardware_interface::LoanedStateInterface> state_interfaces_;

 private:
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_;
  unsigned int rate_ = 0;
  std::string description_;
};

}  // namespace controller_interface
