/* $title
   Written by holokin $version from: $origin. The exported inverse kinematics as a kinematics plugin of MoveIt 2.

   $strategy_words

   The plugin begins at the start posture, on its leaf, so the same pose gives the same joints. The seed is not used,
   but with the parameter `from_seed`. The leaf decides on the redundant joints, so none of them can be chosen here. */
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#if __has_include(<moveit/kinematics_base/kinematics_base.hpp>)
#include <moveit/kinematics_base/kinematics_base.hpp>
#include <moveit/robot_model/robot_model.hpp>
#else /* MoveIt 2.5, of ROS 2 Humble */
#include <moveit/kinematics_base/kinematics_base.h>
#include <moveit/robot_model/robot_model.h>
#endif

#include "${name}.hpp"

namespace $package {

class KinematicsPlugin : public kinematics::KinematicsBase {
 public:
  using ErrorCode = moveit_msgs::msg::MoveItErrorCodes;
  using Options = kinematics::KinematicsQueryOptions;
  using Pose = geometry_msgs::msg::Pose;
  using Values = std::vector<double>;
  using kinematics::KinematicsBase::getPositionIK;
  using kinematics::KinematicsBase::setRedundantJoints;

  bool initialize(const rclcpp::Node::SharedPtr &node, const moveit::core::RobotModel &model, const std::string &group,
      const std::string &base, const std::vector<std::string> &tips, double discretization) override;

  bool supportsGroup(const moveit::core::JointModelGroup *group, std::string *why = nullptr) const override;

  bool getPositionIK(const Pose &pose, const Values &seed, Values &solution, ErrorCode &error,
      const Options &options = Options()) const override;

  bool searchPositionIK(const Pose &pose, const Values &seed, double timeout, Values &solution, ErrorCode &error,
      const Options &options = Options()) const override;
  bool searchPositionIK(const Pose &pose, const Values &seed, double timeout, const Values &consistency_limits,
      Values &solution, ErrorCode &error, const Options &options = Options()) const override;
  bool searchPositionIK(const Pose &pose, const Values &seed, double timeout, Values &solution,
      const IKCallbackFn &callback, ErrorCode &error, const Options &options = Options()) const override;
  bool searchPositionIK(const Pose &pose, const Values &seed, double timeout, const Values &consistency_limits,
      Values &solution, const IKCallbackFn &callback, ErrorCode &error,
      const Options &options = Options()) const override;
  bool searchPositionIK(const std::vector<Pose> &poses, const Values &seed, double timeout,
      const Values &consistency_limits, Values &solution, const IKCallbackFn &callback, ErrorCode &error,
      const Options &options = Options(), const moveit::core::RobotState *state = nullptr) const override;
  bool searchPositionIK(const std::vector<Pose> &poses, const Values &seed, double timeout,
      const Values &consistency_limits, Values &solution, const IKCallbackFn &callback, const IKCostFn &cost,
      ErrorCode &error, const Options &options = Options(),
      const moveit::core::RobotState *state = nullptr) const override;

  bool getPositionFK(const std::vector<std::string> &links, const Values &joints,
      std::vector<Pose> &poses) const override;

  const std::vector<std::string> &getJointNames() const override { return joint_names_; }
  const std::vector<std::string> &getLinkNames() const override { return link_names_; }

  /* False for every joint: the leaf leaves none to choose. True for no joint. */
  bool setRedundantJoints(const std::vector<unsigned int> &joints) override { return joints.empty(); }

 private:
  /* A joint of the group, in the group's order: a joint of the export, or one that follows it. */
  struct Seat {
    std::size_t ours;
    bool follows;
    double factor, offset, lower, upper;
  };
  struct Seats {
    std::vector<Seat> seats;
    std::vector<std::string> names;
  };

  bool read_parameters(std::string &why);
  bool agrees(std::string &why) const;
  std::string refused(const Values &seed, const Values &consistency_limits, const Pose &pose, $name::Target &target) const;
  $name::Result<$name::Joints> solved(const $name::Target &target, const Values &seed, double timeout, bool &late) const;
  $name::Joints ours(const Values &group) const;
  Values theirs(const $name::Joints &q) const;
  bool within_bounds(const Values &group) const;

  static bool seated(const moveit::core::JointModelGroup &group, Seats &found, std::string &why);

  std::vector<Seat> seats_;
  std::vector<std::string> joint_names_, link_names_;
  $name::Leaf leaf_{};
  int max_pieces_ = $most;
  bool from_seed_ = false;
  double model_tolerance_ = 1e-4;
  bool ready_ = false;
};

}  // namespace $package
