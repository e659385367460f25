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

class Time {
 public:
  explicit Time(std::int64_t nanoseconds = 0) : nanoseconds_(nanoseconds) {}
  std::int64_t nanoseconds() const { return nanoseconds_; }

 private:
  std::int64_t nanoseconds_;
};

class Duration {
 public:
  explicit Duration(std::chrono::nanoseconds time) : time_(time) {}
  double seconds() const { return std::chrono::duration<double>(time_).count(); }

 private:
  std::chrono::nanoseconds time_;
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
    if (const T *found = std::get_if<T>(&value_)) return *found;
    throw std::runtime_error("parameter is of another type");
  }

 private:
  std::string name_;
  Value value_;
};

struct NodeOptions {
  std::map<std::string, Parameter::Value> overrides;
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
    declared[name] = given == overrides.end() ? Parameter::Value(by_default) : given->second;
    return get_parameter(name).template get_value<T>();
  }
};

}  // namespace rclcpp

namespace rclcpp_lifecycle {

class State {};

class LifecycleNode : public rclcpp::Node {
 public:
  LifecycleNode(std::string name, const rclcpp::NodeOptions &options) : name_(std::move(name)) {
    overrides = options.overrides;
  }
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
