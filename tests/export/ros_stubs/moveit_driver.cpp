/* For the tests of holokin: opens a plugin as MoveIt does, and asks it through kinematics::KinematicsBase.

   driver LIBRARY ROBOT GROUP BASE TIPS IN OUT THREADS TIMEOUT [NAME=bool|int|double|text:VALUE ...]
   ROBOT.urdf and ROBOT.srdf are the robot. TIPS: names with commas between. IN: rows of a pose (x, y, z, quaternion x, y, z, w) and a seed. OUT: rows of an error
   code, the joints (NaN without a solution) and the nanoseconds of the call. Each thread solves all poses, in an order of its own; where their
   answers differ the program ends with 3. It prints what the plugin is. 2: it could not be initialized. */
#include <dlfcn.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iostream>
#include <iterator>
#include <thread>

#include <moveit/kinematics_base/kinematics_base.hpp>
#include <rclcpp/node.hpp>
#include <srdfdom/model.h>
#include <urdf/model.h>

using Values = std::vector<double>;

static std::string read(const std::string &file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

static rclcpp::Parameter::Value value(const std::string &kind, const std::string &text) {
  if (kind == "bool") return text == "true";
  if (kind == "int") return static_cast<std::int64_t>(std::stoll(text));
  if (kind == "double") return std::stod(text);
  return text;
}

/* Of all rows, with the row `first` first. */
static Values answers(const kinematics::KinematicsBase &plugin, const Values &in, std::size_t first, double timeout) {
  const std::size_t n = plugin.getJointNames().size(), row = 7 + n, count = in.size() / row;
  Values out(count * (n + 2));
  for (std::size_t k = 0; k < count; k++) {
    const std::size_t at = (first + k) % count;
    const double *p = &in[at * row];
    geometry_msgs::msg::Pose pose;
    pose.position = {p[0], p[1], p[2]};
    pose.orientation = {p[3], p[4], p[5], p[6]};
    const Values seed(p + 7, p + row);
    Values joints;
    moveit_msgs::msg::MoveItErrorCodes code;
    const auto began = std::chrono::steady_clock::now();
    const bool found = plugin.searchPositionIK(pose, seed, timeout, joints, code);
    const std::chrono::nanoseconds took = std::chrono::steady_clock::now() - began;
    if (found != (code.val == code.SUCCESS) || found != (joints.size() == n)) std::exit(4);
    joints.resize(n, NAN);
    double *answer = &out[at * (n + 2)];
    answer[0] = code.val;
    std::copy(joints.begin(), joints.end(), answer + 1);
    answer[n + 1] = static_cast<double>(took.count());
  }
  return out;
}

int main(int, char **argv) {
  void *library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
  if (!library) return std::cerr << dlerror() << "\n", 1;
  const auto make = reinterpret_cast<kinematics::KinematicsBase *(*)()>(dlsym(library, "make_plugin"));
  const std::unique_ptr<kinematics::KinematicsBase> plugin(make());
  const auto urdf = std::make_shared<urdf::Model>();
  const auto srdf = std::make_shared<srdf::Model>();
  urdf->initString(read(std::string(argv[2]) + ".urdf"));
  srdf->initString(*urdf, read(std::string(argv[2]) + ".srdf"));
  const moveit::core::RobotModel model(urdf, srdf);
  const auto node = std::make_shared<rclcpp::Node>();
  for (char **argument = argv + 10; *argument; argument++) {
    const std::string text = *argument, name = text.substr(0, text.find('=')), rest = text.substr(name.size() + 1);
    node->overrides["robot_description_kinematics." + std::string(argv[3]) + "." + name] =
        value(rest.substr(0, rest.find(':')), rest.substr(rest.find(':') + 1));
  }
  std::string why = "fits";
  std::vector<std::string> tips;
  std::istringstream named(argv[5]);
  for (std::string tip; std::getline(named, tip, ',');) tips.push_back(tip);
  plugin->supportsGroup(model.getJointModelGroup(argv[3]), &why);
  std::cout << "group: " << why << "\n";
  if (!plugin->initialize(node, model, argv[3], argv[4], tips, 0.005)) return 2;
  std::cout << "joints:";
  for (const std::string &name : plugin->getJointNames()) std::cout << " " << name;
  std::cout << "\nredundant: " << plugin->setRedundantJoints(std::vector<unsigned int>{0}) << plugin->setRedundantJoints(std::vector<unsigned int>{});
  std::vector<geometry_msgs::msg::Pose> poses;
  Values turned;
  for (std::size_t i = 0; i < plugin->getJointNames().size(); i++) turned.push_back(0.1 * static_cast<double>(i + 1));
  std::cout << "\nunknown link: " << plugin->getPositionFK({"no such link"}, turned, poses) << "\n";
  std::cout.precision(17);
  for (const std::string &name : plugin->getLinkNames()) {
    if (!plugin->getPositionFK({name}, turned, poses)) return 5;
    const auto &[p, o] = poses[0];
    std::cout << "link " << name;
    for (const double x : {p.x, p.y, p.z, o.x, o.y, o.z, o.w}) std::cout << " " << x;
    std::cout << "\n";
  }

  const std::string bytes = read(argv[6]);
  Values in(bytes.size() / sizeof(double));
  std::memcpy(in.data(), bytes.data(), in.size() * sizeof(double));
  std::vector<Values> all(std::stoul(argv[8]));
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < all.size(); t++)
    threads.emplace_back([&, t] { all[t] = answers(*plugin, in, 5 * t, std::stod(argv[9])); });
  for (std::thread &thread : threads) thread.join();
  const std::size_t row = plugin->getJointNames().size() + 2;
  for (const Values &out : all)
    for (std::size_t i = 0; i < out.size(); i++)
      if (i % row != row - 1 && std::memcmp(&out[i], &all[0][i], sizeof(double)) != 0) return 3;
  std::ofstream(argv[7], std::ios::binary).write(reinterpret_cast<const char *>(all[0].data()), static_cast<std::streamsize>(all[0].size() * sizeof(double)));
  return 0;
}
