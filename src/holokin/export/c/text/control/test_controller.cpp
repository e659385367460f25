/* $title. Written by holokin $version. The controller on the exported robot, robot.urdf, with ideal drives, against the
   joints that Python computes for the same targets. */
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <class_loader/class_loader.hpp>
#include <gtest/gtest.h>
#include <rclcpp/utilities.hpp>

#include "python_joints.h"
#include "tool_controller.hpp"

using $package::Outcome;
using $package::ToolController;
using Values = std::vector<double>;

namespace {

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t PERIOD = 1000000; /* [ns] */

std::string read(const std::string &file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

/* Drives that are where they were told to be, by one period later. */
class Drives {
 public:
  Drives() {
    for (std::size_t i = 0; i < N; i++) {
      states[i] = START[i];
#if __has_include(<controller_interface/controller_interface_params.hpp>)
      state.push_back(std::make_shared<hardware_interface::StateInterface>(NAMES[i], "position"));
      command.push_back(std::make_shared<hardware_interface::CommandInterface>(NAMES[i], "position"));
#else /* ros2_control 2, of ROS 2 Humble */
      state.push_back(std::make_shared<hardware_interface::StateInterface>(NAMES[i], "position", &states[i]));
      command.push_back(std::make_shared<hardware_interface::CommandInterface>(NAMES[i], "position", &commands[i]));
#endif
    }
    show();
  }

  void lend(ToolController &controller, bool last = true) {
    std::vector<hardware_interface::LoanedCommandInterface> commands_lent;
    std::vector<hardware_interface::LoanedStateInterface> states_lent;
    for (std::size_t i = N; i-- > (last ? 0U : 1U);) { /* in another order than the export has */
#if __has_include(<controller_interface/controller_interface_params.hpp>)
      commands_lent.emplace_back(command[i], nullptr);
      states_lent.emplace_back(state[i], nullptr);
#else
      commands_lent.emplace_back(*command[i]);
      states_lent.emplace_back(*state[i]);
#endif
    }
    controller.assign_interfaces(std::move(commands_lent), std::move(states_lent));
  }

  void show() {
#if __has_include(<controller_interface/controller_interface_params.hpp>)
    for (std::size_t i = 0; i < N; i++) (void)state[i]->set_value(states[i]);
#endif
  }

  void obey() {
    for (std::size_t i = 0; i < N; i++) states[i] = told(i);
    show();
  }

  double told(std::size_t i) const {
#if __has_include(<controller_interface/controller_interface_params.hpp>)
    return command[i]->get_optional().value();
#else
    return commands[i];
#endif
  }

  Values states = Values(N), commands = Values(N, NOT_A_NUMBER);
  std::vector<std::shared_ptr<hardware_interface::StateInterface>> state;
  std::vector<std::shared_ptr<hardware_interface::CommandInterface>> command;
};

class Controller : public testing::Test {
 protected:
  void SetUp() override {
    if (!rclcpp::ok()) rclcpp::init(0, nullptr);
#if __has_include(<controller_interface/controller_interface_params.hpp>)
    controller_interface::ControllerInterfaceParams given;
    given.controller_name = "tool_controller";
    given.robot_description = read(ROBOT);
    given.controller_manager_update_rate = 1000;
    given.node_options = controller.define_custom_node_options();
    const auto done = controller.init(given);
#else
    const auto done = controller.init("tool_controller");
    controller.get_node()->set_parameter(rclcpp::Parameter("robot_description", read(ROBOT)));
#endif
    ASSERT_TRUE(done == controller_interface::return_type::OK);
    controller.get_node()->set_parameter(rclcpp::Parameter("period", 0.001));
    controller.get_node()->set_parameter(rclcpp::Parameter("max_linear_velocity", 10.0));
    controller.get_node()->set_parameter(rclcpp::Parameter("max_angular_velocity", 10.0));
  }

  void begin() {
    ASSERT_TRUE(controller.on_configure(rclcpp_lifecycle::State()) == ToolController::CallbackReturn::SUCCESS);
    drives.lend(controller);
    ASSERT_TRUE(controller.on_activate(rclcpp_lifecycle::State()) == ToolController::CallbackReturn::SUCCESS);
  }

  geometry_msgs::msg::PoseStamped pose(std::size_t k) const {
    geometry_msgs::msg::PoseStamped found;
    found.header.frame_id = BASE;
    found.pose.position.x = POSES[k][0];
    found.pose.position.y = POSES[k][1];
    found.pose.position.z = POSES[k][2];
    found.pose.orientation.x = POSES[k][3];
    found.pose.orientation.y = POSES[k][4];
    found.pose.orientation.z = POSES[k][5];
    found.pose.orientation.w = POSES[k][6];
    return found;
  }

  void update(std::int64_t period = PERIOD) {
    now += period;
    ASSERT_TRUE(controller.update(rclcpp::Time(now), rclcpp::Duration(std::chrono::nanoseconds(period))) == controller_interface::return_type::OK);
    drives.obey();
  }

  void run(std::size_t from, std::size_t to) {
    for (std::size_t k = from; k < to; k++) {
      controller.receive(pose(k));
      update();
    }
  }

  int said() { return std::stoi(controller.status().values[0].value); }

  double off(const double (&q)[N]) const {
    double most = 0.0;
    for (std::size_t i = 0; i < N; i++) most = std::fmax(most, std::abs(drives.states[i] - q[i]));
    return most;
  }

  /* An update in which the joints stay, for a reason. */
  void expect_still(Outcome why, std::int64_t period = PERIOD) {
    const Values before = drives.states;
    update(period);
    EXPECT_EQ(said(), static_cast<int>(why));
    for (std::size_t i = 0; i < N; i++) EXPECT_EQ(drives.states[i], before[i]);
  }

  ToolController controller;
  Drives drives;
  std::int64_t now = 1000000000;
};

}  // namespace

TEST_F(Controller, IsFoundInTheLibrary) {
  class_loader::ClassLoader loader{PLUGIN};
  EXPECT_TRUE(loader.createUniqueInstance<controller_interface::ControllerInterface>("$package::ToolController") != nullptr);
}

TEST_F(Controller, HasTheJointsOfPython) {
  begin();
  for (std::size_t k = 0; k < COUNT; k++) {
    run(k, k + 1);
    ASSERT_TRUE(off(JOINTS[k]) <= 1e-9) << "step " << k;
  }
  EXPECT_EQ(said(), static_cast<int>(Outcome::OK));
}

TEST_F(Controller, WaitsForATarget) {
  begin();
  expect_still(Outcome::WAITING);
}

TEST_F(Controller, StandsStillWithoutNewTargets) {
  begin();
  run(0, 3);
  for (int k = 0; k < 200; k++) update();
  expect_still(Outcome::STALE);
  controller.receive(pose(3));
  update();
  EXPECT_EQ(said(), static_cast<int>(Outcome::OK));
}

TEST_F(Controller, RefusesTargetsThatAreNone) {
  begin();
  run(0, 3);
  auto bad = pose(3);
  bad.pose.position.x = NOT_A_NUMBER;
  controller.receive(bad);
  expect_still(Outcome::BAD_TARGET);
  bad = pose(3);
  bad.pose.orientation.w += 0.5;
  controller.receive(bad);
  expect_still(Outcome::BAD_TARGET);
  bad = pose(3);
  bad.header.frame_id = "another frame";
  controller.receive(bad);
  expect_still(Outcome::BAD_TARGET);
  bad = pose(3);
  bad.pose.position.x += 1.0;
  controller.receive(bad);
  expect_still(Outcome::FAR);
  run(3, 4);
  EXPECT_EQ(said(), static_cast<int>(Outcome::OK));
}

TEST_F(Controller, StandsStillInAPeriodOfZero) {
  begin();
  run(0, 3);
  controller.receive(pose(3));
  expect_still(Outcome::BAD_PERIOD, 0);
}

TEST_F(Controller, StandsStillWhereAJointIsNotKnown) {
  begin();
  run(0, 3);
  const double known = drives.states[0];
  drives.states[0] = NOT_A_NUMBER;
  drives.show();
  controller.receive(pose(3));
  update();
  EXPECT_EQ(said(), static_cast<int>(Outcome::NO_STATE));
  EXPECT_EQ(drives.states[0], known);
}

TEST_F(Controller, BeginsAnewWithEachActivation) {
  begin();
  run(0, 3);
  ASSERT_TRUE(controller.on_deactivate(rclcpp_lifecycle::State()) == ToolController::CallbackReturn::SUCCESS);
  EXPECT_EQ(said(), static_cast<int>(Outcome::INACTIVE));
  controller.receive(pose(3));
  ASSERT_TRUE(controller.on_activate(rclcpp_lifecycle::State()) == ToolController::CallbackReturn::SUCCESS);
  expect_still(Outcome::WAITING);
}

TEST_F(Controller, RefusesMissingInterfaces) {
  ASSERT_TRUE(controller.on_configure(rclcpp_lifecycle::State()) == ToolController::CallbackReturn::SUCCESS);
  drives.lend(controller, false);
  EXPECT_TRUE(controller.on_activate(rclcpp_lifecycle::State()) != ToolController::CallbackReturn::SUCCESS);
}

TEST_F(Controller, RefusesAnotherLeaf) {
  std::copy(OFF_THE_LEAF, OFF_THE_LEAF + N, drives.states.begin());
  drives.show();
  controller.get_node()->set_parameter(rclcpp::Parameter("max_level_error", OFF_BY / 2));
  ASSERT_TRUE(controller.on_configure(rclcpp_lifecycle::State()) == ToolController::CallbackReturn::SUCCESS);
  drives.lend(controller);
  EXPECT_TRUE(controller.on_activate(rclcpp_lifecycle::State()) != ToolController::CallbackReturn::SUCCESS);
}

TEST_F(Controller, RefusesOtherJoints) {
  controller.get_node()->set_parameter(rclcpp::Parameter("joints", std::vector<std::string>{"another joint"}));
  EXPECT_TRUE(controller.on_configure(rclcpp_lifecycle::State()) != ToolController::CallbackReturn::SUCCESS);
}
