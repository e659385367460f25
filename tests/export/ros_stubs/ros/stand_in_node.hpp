/* For the tests of holokin: what the plugins use of rclcpp and rclcpp_lifecycle, written from their public interface. Log
   lines go to stderr. Whoever tests hands messages to a node's subscriptions, and lets its timers ring. */
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "stand_in_messages.hpp"

namespace rclcpp {

struct Logger {
  std::string name;
};
inline Logger get_logger(const std::string &name) { return {name}; }

inline bool ok() { return true; }
inline void init(int, const char *const *) {}

class Duration {
 public:
  explicit Duration(std::chrono::nanoseconds time) : time_(time) {}
  double seconds() const { return std::chrono::duration<double>(time_).count(); }

 private:
  std::chrono::nanoseconds time_;
};

class Time {
 public:
  explicit Time(std::int64_t nanoseconds = 0) : nanoseconds_(nanoseconds) {}
  std::int64_t nanoseconds() const { return nanoseconds_; }
  int get_clock_type() const { return 1; }
  Duration operator-(const Time &other) const {
    return Duration(std::chrono::nanoseconds(nanoseconds_ - other.nanoseconds_));
  }

 private:
  std::int64_t nanoseconds_;
};

struct Clock {
  using SharedPtr = std::shared_ptr<Clock>;
  std::int64_t nanoseconds = 0;
};

struct KeepLast {
  explicit KeepLast(std::size_t) {}
};
struct QoS {
  explicit QoS(KeepLast) {}
  QoS &best_effort() { return *this; }
};
struct SystemDefaultsQoS : QoS {
  SystemDefaultsQoS() : QoS(KeepLast(1)) {}
};

class Parameter {
 public:
  using Value = std::variant<bool, std::int64_t, double, std::string, std::vector<double>, std::vector<std::string>>;
  explicit Parameter(Value value) : value_(std::move(value)) {}
  template <class T>
  Parameter(std::string name, T value) : name_(std::move(name)), value_(std::move(value)) {}
  const std::string &get_name() const { return name_; }
  const Value &stored() const { return value_; }
  template <class T>
  T get_value() const {
    using Kept = std::conditional_t<std::is_same_v<T, int>, std::int64_t, T>;
    if (const Kept *found = std::get_if<Kept>(&value_)) return static_cast<T>(*found);
    throw std::runtime_error("parameter is of another type");
  }
  std::int64_t as_int() const { return get_value<std::int64_t>(); }
  bool as_bool() const { return get_value<bool>(); }

 private:
  std::string name_;
  Value value_;
};

struct NodeOptions {
  std::map<std::string, Parameter::Value> overrides;
  NodeOptions &allow_undeclared_parameters(bool) { return *this; }
  NodeOptions &automatically_declare_parameters_from_overrides(bool) { return *this; }
  NodeOptions &enable_logger_service(bool) { return *this; }
};

template <class Message>
class Publisher {
 public:
  using SharedPtr = std::shared_ptr<Publisher>;
  std::vector<Message> sent;
  void publish(const Message &message) { sent.push_back(message); }
};

class SubscriptionBase {
 public:
  virtual ~SubscriptionBase() = default;
  std::function<void(const void *)> take;
};
template <class Message>
class Subscription : public SubscriptionBase {
 public:
  using SharedPtr = std::shared_ptr<Subscription>;
};

struct TimerBase {
  using SharedPtr = std::shared_ptr<TimerBase>;
  std::function<void()> ring;
};

class Node {
 public:
  using SharedPtr = std::shared_ptr<Node>;
  std::map<std::string, Parameter::Value> overrides, declared;
  bool has_parameter(const std::string &name) const { return declared.count(name) > 0; }
  Parameter get_parameter(const std::string &name) const { return Parameter(declared.at(name)); }
  void set_parameter(const Parameter &parameter) { declared[parameter.get_name()] = parameter.stored(); }
  template <class T>
  T declare_parameter(const std::string &name, const T &by_default,
      const rcl_interfaces::msg::ParameterDescriptor & = {}) {
    if (has_parameter(name)) throw std::runtime_error("parameter " + name + " is declared already");
    const auto given = overrides.find(name);
    if constexpr (std::is_same_v<T, int>)
      declared[name] = static_cast<std::int64_t>(by_default);
    else
      declared[name] = by_default;
    if (given != overrides.end()) declared[name] = given->second;
    return get_parameter(name).template get_value<T>();
  }
};

}  // namespace rclcpp

namespace rclcpp_lifecycle {

class State {
 public:
  explicit State(std::uint8_t id = 0) : id_(id) {}
  std::uint8_t id() const { return id_; }

 private:
  std::uint8_t id_;
};

namespace node_interfaces {
class LifecycleNodeInterface {
 public:
  enum class CallbackReturn : std::uint8_t { SUCCESS = 97, FAILURE = 98, ERROR = 99 };
  virtual ~LifecycleNodeInterface() = default;
  virtual CallbackReturn on_configure(const State &) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_cleanup(const State &) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_shutdown(const State &) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_activate(const State &) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_deactivate(const State &) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_error(const State &) { return CallbackReturn::ERROR; }
};
}  // namespace node_interfaces

class LifecycleNode : public rclcpp::Node {
 public:
  using Callback = std::function<node_interfaces::LifecycleNodeInterface::CallbackReturn(const State &)>;

  LifecycleNode(std::string name, const std::string &, const rclcpp::NodeOptions &options, bool) : name_(std::move(name)) {
    overrides = options.overrides;
  }
  void register_on_configure(Callback callback) { configure_ = std::move(callback); }
  void register_on_cleanup(const Callback &) {}
  void register_on_shutdown(const Callback &) {}
  void register_on_activate(const Callback &) {}
  void register_on_deactivate(const Callback &) {}
  void register_on_error(const Callback &) {}
  const State &get_current_state() const { return state_; }
  const State &configure() {
    if (configure_(state_) == node_interfaces::LifecycleNodeInterface::CallbackReturn::SUCCESS) state_ = State(2);
    return state_;
  }
  const State &shutdown() { return state_ = State(4); }
  const char *get_name() const { return name_.c_str(); }
  rclcpp::Logger get_logger() const { return {name_}; }
  rclcpp::Clock::SharedPtr get_clock() { return clock_; }
  rclcpp::Time now() const { return rclcpp::Time(clock_->nanoseconds); }

  template <class Message, class Callback>
  typename rclcpp::Subscription<Message>::SharedPtr create_subscription(const std::string &topic, const rclcpp::QoS &,
      Callback callback) {
    auto made = std::make_shared<rclcpp::Subscription<Message>>();
    made->take = [callback](const void *message) { callback(std::make_shared<Message>(*static_cast<const Message *>(message))); };
    subscriptions[topic] = made;
    return made;
  }
  template <class Message>
  typename rclcpp::Publisher<Message>::SharedPtr create_publisher(const std::string &topic, const rclcpp::QoS &) {
    auto made = std::make_shared<rclcpp::Publisher<Message>>();
    publishers[topic] = made;
    return made;
  }
  template <class Callback>
  rclcpp::TimerBase::SharedPtr create_wall_timer(std::chrono::nanoseconds, Callback callback) {
    auto made = std::make_shared<rclcpp::TimerBase>();
    made->ring = callback;
    timers.push_back(made);
    return made;
  }

  std::map<std::string, std::weak_ptr<rclcpp::SubscriptionBase>> subscriptions;
  std::map<std::string, std::weak_ptr<void>> publishers;
  std::vector<std::weak_ptr<rclcpp::TimerBase>> timers;

 private:
  std::string name_;
  Callback configure_;
  State state_{1};
  rclcpp::Clock::SharedPtr clock_ = std::make_shared<rclcpp::Clock>();
};

}  // namespace rclcpp_lifecycle

#define RCLCPP_ERROR(logger, ...) \
  do { \
    std::fprintf(stderr, "[%s] ", (logger).name.c_str()); \
    std::fprintf(stderr, __VA_ARGS__); \
    std::fprintf(stderr, "\n"); \
  } while (false)
#define RCLCPP_WARN_THROTTLE(logger, clock, milliseconds, ...) \
  do { \
    (void)(clock); \
    RCLCPP_ERROR(logger, __VA_ARGS__); \
  } while (false)
