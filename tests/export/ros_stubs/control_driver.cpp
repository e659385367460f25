/* For the tests of holokin: loads a controller as a controller manager does and updates it in a loop, with drives that
   are where they were told to be one update later.

   driver LIBRARY ROBOT.urdf IN OUT RATE START,START,... JOINT,JOINT,... [order=reverse] [drop=PREFIX/KIND] [NAME=kind:VALUE ...]
   IN: rows of (event, period [s], stamp, seven numbers). OUT: rows of (what the call returned, status, level, scale,
   commands, states, allocations, locks). Kinds of parameters: bool, int, double, text, list (of texts), numbers.
   It ends with 2 where on_init fails, 3 where on_configure does, 4 where the first activation does. */
#include <dlfcn.h>
#include <pthread.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <sstream>

#include <controller_interface/controller_interface.hpp>

using Values = std::vector<double>;
using Clock = rclcpp::Clock;

static thread_local bool counting = false;
static std::size_t allocations = 0, locks = 0;

extern "C" {
void *__libc_malloc(std::size_t);
void *__libc_calloc(std::size_t, std::size_t);
void *__libc_realloc(void *, std::size_t);
void __libc_free(void *);
void *malloc(std::size_t size) noexcept { return allocations += counting, __libc_malloc(size); }
void *calloc(std::size_t count, std::size_t size) noexcept { return allocations += counting, __libc_calloc(count, size); }
void *realloc(void *old, std::size_t size) noexcept { return allocations += counting, __libc_realloc(old, size); }
void free(void *old) noexcept { allocations += counting && old, __libc_free(old); }
#define COUNTED(name, type) \
  int name(type *lock) noexcept { \
    static const auto real = reinterpret_cast<int (*)(type *)>(dlsym(RTLD_NEXT, #name)); \
    return locks += counting, real(lock); \
  }
COUNTED(pthread_mutex_lock, pthread_mutex_t)
COUNTED(pthread_mutex_trylock, pthread_mutex_t)
COUNTED(pthread_rwlock_rdlock, pthread_rwlock_t)
COUNTED(pthread_rwlock_wrlock, pthread_rwlock_t)
COUNTED(pthread_cond_signal, pthread_cond_t)
}

enum Event { UPDATE, POSE, TWIST, DEACTIVATE, ACTIVATE, STATE, HELD, STUCK, CLEAN_UP, FRAME };

static std::string read(const std::string &file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

static std::vector<std::string> parts(const std::string &text) {
  std::vector<std::string> found;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, ',');) found.push_back(part);
  return found;
}

static Values numbers(const std::string &text) {
  Values found;
  for (const std::string &part : parts(text)) found.push_back(std::stod(part));
  return found;
}

static rclcpp::Parameter::Value value(const std::string &kind, const std::string &text) {
  if (kind == "bool") return text == "true";
  if (kind == "int") return static_cast<std::int64_t>(std::stoll(text));
  if (kind == "double") return std::stod(text);
  if (kind == "list") return parts(text);
  if (kind == "numbers") return numbers(text);
  return text;
}

static void hand_over(rclcpp_lifecycle::LifecycleNode &node, const std::string &topic, const void *message) {
  const auto found = node.subscriptions.find(topic);
  if (found == node.subscriptions.end()) return;
  if (const auto subscription = found->second.lock()) subscription->take(message);
}

int main(int, char **argv) {
  void *library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
  if (!library) return std::cerr << dlerror() << "\n", 1;
  using Controller = controller_interface::ControllerInterface;
  const std::unique_ptr<Controller> controller(reinterpret_cast<Controller *(*)()>(dlsym(library, "make_plugin"))());
  Values states = numbers(argv[6]);
  const auto joints = parts(argv[7]);
  controller_interface::ControllerInterfaceParams given;
  given.controller_name = "arm";
  given.robot_description = read(argv[2]);
  given.controller_manager_update_rate = static_cast<unsigned int>(std::stoul(argv[5]));
  std::string order, drop;
  for (char **argument = argv + 8; *argument; argument++) {
    const std::string text = *argument, name = text.substr(0, text.find('=')), rest = text.substr(name.size() + 1);
    if (name == "order") order = rest;
    if (name == "drop") drop = rest;
    if (name == "order" || name == "drop") continue;
    given.node_options.overrides[name] = value(rest.substr(0, rest.find(':')), rest.substr(rest.find(':') + 1));
  }
  if (controller->init(given) != controller_interface::return_type::OK) return 2;
  const rclcpp_lifecycle::State state;
  const auto good = controller_interface::CallbackReturn::SUCCESS;
  if (controller->on_configure(state) != good) return 3;
  auto &node = *controller->get_node();

  std::map<std::string, std::shared_ptr<hardware_interface::Handle>> drives, sensors;
  const auto lend = [&]() {
    std::vector<hardware_interface::LoanedCommandInterface> commands_lent;
    std::vector<hardware_interface::LoanedStateInterface> states_lent;
    auto wanted = controller->command_interface_configuration().names, known = controller->state_interface_configuration().names;
    if (order == "reverse") wanted = {wanted.rbegin(), wanted.rend()};
    for (const auto &name : wanted) {
      const std::size_t at = name.rfind('/');
      auto &drive = drives[name.substr(0, at)];
      if (!drive) drive = std::make_shared<hardware_interface::Handle>(name.substr(0, at), name.substr(at + 1));
      if (name != drop) commands_lent.emplace_back(drive, nullptr);
    }
    for (const auto &name : known) {
      auto &sensor = sensors[name.substr(0, name.rfind('/'))];
      if (!sensor) sensor = std::make_shared<hardware_interface::Handle>(name.substr(0, name.rfind('/')), "position");
      if (name + " state" != drop) states_lent.emplace_back(sensor, nullptr);
    }
    controller->assign_interfaces(std::move(commands_lent), std::move(states_lent));
  };
  lend();
  const auto show = [&]() {
    for (std::size_t i = 0; i < joints.size(); i++)
      if (sensors.count(joints[i]) && !sensors[joints[i]]->set_value(states[i])) std::abort();
  };
  show();
  std::cout << "commands:";
  for (const auto &name : controller->command_interface_configuration().names) std::cout << " " << name;
  std::cout << "\n";
  if (controller->on_activate(state) != good) return 4;

  const std::string bytes = read(argv[3]);
  Values in(bytes.size() / sizeof(double)), out;
  std::memcpy(in.data(), bytes.data(), in.size() * sizeof(double));
  node.get_clock()->nanoseconds = 5000000000;
  std::int64_t now = 7000000000; /* another clock than the node's, as a controller manager's may be */
  for (const double *row = in.data(); row < in.data() + in.size(); row += 10) {
    const auto event = static_cast<Event>(static_cast<int>(row[0]));
    const auto period = static_cast<std::int64_t>(std::llround(row[1] * 1e9));
    now += period, node.get_clock()->nanoseconds += period;
    std_msgs::msg::Header header;
    if (std::isfinite(row[2])) {
      const std::int64_t stamp = node.get_clock()->nanoseconds - static_cast<std::int64_t>(row[2] * 1e9);
      header.stamp.sec = static_cast<std::int32_t>(stamp / 1000000000), header.stamp.nanosec = static_cast<std::uint32_t>(stamp % 1000000000);
    }
    header.frame_id = event == FRAME ? "elsewhere" : "";
    const double *p = row + 3;
    if (event == POSE || event == FRAME) {
      geometry_msgs::msg::PoseStamped message{header, {{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}}};
      hand_over(node, "~/target_pose", &message);
    }
    if (event == TWIST) {
      geometry_msgs::msg::TwistStamped message{header, {{p[0], p[1], p[2]}, {p[3], p[4], p[5]}}};
      hand_over(node, "~/target_twist", &message);
    }
    const auto joint = static_cast<std::size_t>(event == STATE || event == HELD ? p[0] : 0);
    if (event == STATE) states[joint] = p[1], show();
    if (event == HELD) sensors[joints[joint]]->held = static_cast<int>(p[1]);
    double returned = 0;
    allocations = locks = 0;
    if (event == DEACTIVATE) returned = static_cast<double>(controller->on_deactivate(state));
    else if (event == ACTIVATE) returned = static_cast<double>(controller->on_activate(state));
    else if (event == CLEAN_UP) returned = static_cast<double>(controller->on_cleanup(state)), returned += static_cast<double>(controller->on_configure(state));
    else {
      counting = true;
      returned = static_cast<double>(controller->update(rclcpp::Time(now), rclcpp::Duration(std::chrono::nanoseconds(period))));
      counting = false;
    }
    Values commands;
    const bool positions = drives.begin()->second->get_interface_name() == std::string("position");
    for (std::size_t i = 0; i < joints.size(); i++) {
      commands.push_back(drives[joints[i]]->get_optional().value());
      if (event != STUCK && event != DEACTIVATE && event != ACTIVATE)
        states[i] = positions ? commands[i] : states[i] + static_cast<double>(period) * 1e-9 * commands[i];
    }
    sensors[joints[joint]]->held = 0;
    show();
    double status = NAN, level = NAN, scale = NAN;
    for (const auto &timer : node.timers)
      if (const auto alive = timer.lock()) alive->ring();
    if (const auto publisher = std::static_pointer_cast<rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticStatus>>(node.publishers["~/status"].lock()); publisher && !publisher->sent.empty()) {
      const auto &said = publisher->sent.back();
      status = std::stod(said.values[0].value), scale = std::stod(said.values[1].value), level = said.level;
      if (row + 10 >= in.data() + in.size()) {
        std::cout << said.name << ": " << said.message << "\n";
        for (const auto &[key, text] : said.values) std::cout << key << ": " << text << "\n";
      }
      publisher->sent.clear();
    }
    out.insert(out.end(), {returned, status, level, scale});
    out.insert(out.end(), commands.begin(), commands.end());
    out.insert(out.end(), states.begin(), states.end());
    out.insert(out.end(), {static_cast<double>(allocations), static_cast<double>(locks)});
  }
  std::ofstream(argv[4], std::ios::binary).write(reinterpret_cast<const char *>(out.data()), static_cast<std::streamsize>(out.size() * sizeof(double)));
  return 0;
}
