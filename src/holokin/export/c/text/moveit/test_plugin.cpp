/* $title. Written by holokin $version. The plugin on the exported robot, robot.urdf, against the joints of Python. */
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <class_loader/class_loader.hpp>
#include <gtest/gtest.h>
#include <srdfdom/model.h>
#include <urdf/model.h>

#if __has_include(<moveit/kinematics_base/kinematics_base.hpp>)
#include <moveit/kinematics_base/kinematics_base.hpp>
#include <moveit/robot_model/joint_model_group.hpp>
#include <moveit/robot_model/robot_model.hpp>
#else
#include <moveit/kinematics_base/kinematics_base.h>
#include <moveit/robot_model/joint_model_group.h>
#include <moveit/robot_model/robot_model.h>
#endif

#include "python_joints.h"

using Pose = geometry_msgs::msg::Pose;
using Code = moveit_msgs::msg::MoveItErrorCodes;
using Values = std::vector<double>;

namespace {

constexpr double PATIENCE = 10.0; /* [s] */

std::string read(const std::string &file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

class Plugin : public testing::Test {
 protected:
  void SetUp() override {
    const auto urdf = std::make_shared<urdf::Model>();
    ASSERT_TRUE(urdf->initString(read(ROBOT ".urdf")));
    const auto srdf = std::make_shared<srdf::Model>();
    ASSERT_TRUE(srdf->initString(*urdf, read(ROBOT ".srdf")));
    model = std::make_shared<moveit::core::RobotModel>(urdf, srdf);
    plugin = loader.createUniqueInstance<kinematics::KinematicsBase>("$package::KinematicsPlugin");
    ASSERT_TRUE(plugin->initialize(nullptr, *model, "arm", BASE, {TIP}, 0.005));
  }

  Pose pose(std::size_t k) const {
    Pose found;
    found.position.x = POSES[k][0];
    found.position.y = POSES[k][1];
    found.position.z = POSES[k][2];
    found.orientation.x = POSES[k][3];
    found.orientation.y = POSES[k][4];
    found.orientation.z = POSES[k][5];
    found.orientation.w = POSES[k][6];
    return found;
  }

  /* The joints of Python, in the order of the plugin. */
  Values expected(std::size_t k) const {
    Values found;
    for (const std::string &name : plugin->getJointNames())
      found.push_back(JOINTS[k][std::find(NAMES, NAMES + N, name) - NAMES]);
    return found;
  }

  double off(const Values &q, const Values &p) const {
    double most = q.size() == p.size() ? 0.0 : HUGE_VAL;
    for (std::size_t i = 0; i < std::min(q.size(), p.size()); i++) most = std::fmax(most, std::abs(q[i] - p[i]));
    return most;
  }

  class_loader::ClassLoader loader{PLUGIN};
  moveit::core::RobotModelPtr model;
  class_loader::ClassLoader::UniquePtr<kinematics::KinematicsBase> plugin;
  Values solution;
  Code code;
};

}  // namespace

TEST_F(Plugin, HasTheJointsOfTheGroup) {
  const auto *group = model->getJointModelGroup("arm");
  EXPECT_EQ(plugin->getJointNames(), group->getVariableNames());
  EXPECT_TRUE(plugin->supportsGroup(group));
}

TEST_F(Plugin, GivesTheJointsOfPythonWhateverTheSeed) {
  for (std::size_t k = 0; k < COUNT; k++) {
    for (const Values &seed : {expected(k), expected((k + 1) % COUNT), Values(expected(k).size(), 0.0)}) {
      ASSERT_TRUE(plugin->searchPositionIK(pose(k), seed, PATIENCE, solution, code)) << "pose " << k;
      EXPECT_EQ(code.val, Code::SUCCESS);
      EXPECT_LE(off(solution, expected(k)), 1e-9) << "pose " << k;
    }
  }
}

TEST_F(Plugin, PutsTheTipWhereItWasWanted) {
  std::vector<Pose> poses;
  for (std::size_t k = 0; k < COUNT; k++) {
    ASSERT_TRUE(plugin->getPositionFK({TIP}, expected(k), poses));
    const Pose wanted = pose(k);
    EXPECT_NEAR(poses[0].position.x, wanted.position.x, 1e-9);
    EXPECT_NEAR(poses[0].position.y, wanted.position.y, 1e-9);
    EXPECT_NEAR(poses[0].position.z, wanted.position.z, 1e-9);
  }
}

TEST_F(Plugin, RefusesAPoseOutOfReach) {
  Pose far = pose(0);
  far.position.x += 1000.0;
  EXPECT_FALSE(plugin->searchPositionIK(far, expected(0), PATIENCE, solution, code));
  EXPECT_EQ(code.val, Code::NO_IK_SOLUTION);
  EXPECT_TRUE(solution.empty());
}

TEST_F(Plugin, KeepsConsistencyLimits) {
  Values seed = expected(0), limits(seed.size(), 0.1);
  seed[0] += 0.2;
  EXPECT_FALSE(plugin->searchPositionIK(pose(0), seed, PATIENCE, limits, solution, code));
  limits[0] = 0.3;
  EXPECT_TRUE(plugin->searchPositionIK(pose(0), seed, PATIENCE, limits, solution, code));
}

TEST_F(Plugin, AsksTheCallback) {
  const auto refuse = [](const Pose &, const Values &, Code &said) { said.val = Code::PLANNING_FAILED; };
  const auto accept = [](const Pose &, const Values &, Code &said) { said.val = Code::SUCCESS; };
  EXPECT_FALSE(plugin->searchPositionIK(pose(0), expected(0), PATIENCE, solution, refuse, code));
  EXPECT_EQ(code.val, Code::PLANNING_FAILED);
  EXPECT_TRUE(plugin->searchPositionIK(pose(0), expected(0), PATIENCE, solution, accept, code));
}

TEST_F(Plugin, AnswersTheOtherCalls) {
  const kinematics::KinematicsBase::IKCallbackFn none;
  const kinematics::KinematicsBase::IKCostFn cost = [](const Pose &, const moveit::core::RobotState &,
      const moveit::core::JointModelGroup *, const Values &) { return 0.0; };
  std::vector<Values> solutions;
  kinematics::KinematicsResult result;
  const std::vector<Pose> one = {pose(0)}, two = {pose(0), pose(0)};
  EXPECT_TRUE(plugin->getPositionIK(pose(0), expected(0), solution, code));
  EXPECT_LE(off(solution, expected(0)), 1e-9);
  EXPECT_TRUE(plugin->getPositionIK(one, expected(0), solutions, result, kinematics::KinematicsQueryOptions()));
  EXPECT_LE(off(solutions[0], expected(0)), 1e-9);
  EXPECT_TRUE(plugin->searchPositionIK(one, expected(0), PATIENCE, Values(), solution, none, code));
  EXPECT_FALSE(plugin->searchPositionIK(two, expected(0), PATIENCE, Values(), solution, none, code));
  EXPECT_FALSE(plugin->searchPositionIK(one, expected(0), PATIENCE, Values(), solution, none, cost, code));
  EXPECT_FALSE(plugin->searchPositionIK(pose(0), Values(), PATIENCE, solution, code));
  EXPECT_FALSE(plugin->setRedundantJoints(std::vector<unsigned int>{0}));
}

TEST_F(Plugin, AnswersSeveralThreads) {
  std::vector<std::thread> threads;
  std::vector<double> worst(4, 0.0);
  for (std::size_t t = 0; t < worst.size(); t++) {
    threads.emplace_back([this, t, &worst] {
      Values found;
      Code said;
      for (std::size_t k = 0; k < COUNT; k++) {
        const bool solved = plugin->searchPositionIK(pose(k), expected(k), PATIENCE, found, said);
        worst[t] = std::fmax(worst[t], solved ? off(found, expected(k)) : HUGE_VAL);
      }
    });
  }
  for (std::thread &thread : threads) thread.join();
  for (const double most : worst) EXPECT_LE(most, 1e-9);
}
