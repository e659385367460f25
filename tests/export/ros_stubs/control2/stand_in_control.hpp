/* For the tests of holokin: what a controller uses of ros2_control 2 (ROS 2 Humble), written from its public interface. */
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

class Handle {
 public:
  Handle(const std::string &prefix, const std::string &kind, double *value) : prefix_(prefix), kind_(kind), value_(value) {}
  const std::string &get_prefix_name() const { return prefix_; }
  const std::string &get_interface_name() const { return kind_; }
  void set_value(double value) { *value_ = value; }
  double get_value() const { return *value_; }

 private:
  std::string prefix_, kind_;
  double *value_;
};
using StateInterface = Handle;
using CommandInterface = Handle;

class LoanedStateInterface {
 public:
  explicit LoanedStateInterface(Handle &handle) : handle_(handle) {}
  LoanedStateInterface(LoanedStateInterface &&) = default;
  const std::string &get_prefix_name() const { return handle_.get_prefix_name(); }
  const std::string &get_interface_name() const { return handle_.get_interface_name(); }
  double get_value() const { return handle_.get_value(); }

 protected:
  Handle &handle_;
};

class LoanedCommandInterface : public LoanedStateInterface {
 public:
  using LoanedStateInterface::LoanedStateInterface;
  void set_value(double value) { handle_.set_value(value); }
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

class ControllerInterface : public rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface {
 public:
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual CallbackReturn on_init() = 0;
  virtual return_type update(const rclcpp::Time &, const rclcpp::Duration &) = 0;

  return_type init(const std::string &name, const std::string & = "", const rclcpp::NodeOptions &options = {}) {
    node_ = std::make_shared<rclcpp_lifecycle::LifecycleNode>(name, "", options, false);
    return on_init() == CallbackReturn::SUCCESS ? return_type::OK : return_type::ERROR;
  }

  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() { return node_; }
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() const { return node_; }
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
};

}  // namespace controller_interface
