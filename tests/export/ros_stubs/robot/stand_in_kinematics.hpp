/* For the tests of holokin: kinematics::KinematicsBase with the virtual functions of MoveIt 2 (2.5 to 2.15), in their
   order, written from its public interface. */
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <stand_in_node.hpp>

#include "stand_in_robot.hpp"

namespace kinematics {

namespace DiscretizationMethods {
enum DiscretizationMethod { NO_DISCRETIZATION = 1, ALL_DISCRETIZED };
}
namespace KinematicErrors {
enum KinematicError { OK = 1, MULTIPLE_TIPS_NOT_SUPPORTED = 4, NO_SOLUTION = 8 };
}

struct KinematicsQueryOptions {
  bool lock_redundant_joints = false, return_approximate_solution = false;
  DiscretizationMethods::DiscretizationMethod discretization_method = DiscretizationMethods::NO_DISCRETIZATION;
};

struct KinematicsResult {
  KinematicErrors::KinematicError kinematic_error;
  double solution_percentage;
};

class KinematicsBase {
 public:
  using P = geometry_msgs::msg::Pose;
  using V = std::vector<double>;
  using E = moveit_msgs::msg::MoveItErrorCodes;
  using O = KinematicsQueryOptions;
  using S = std::string;
  using IKCallbackFn = std::function<void(const P &, const V &, E &)>;
  using IKCostFn = std::function<double(const P &, const moveit::core::RobotState &, const moveit::core::JointModelGroup *, const V &)>;

  virtual bool getPositionIK(const P &, const V &, V &, E &, const O & = O()) const = 0;
  virtual bool getPositionIK(const std::vector<P> &poses, const V &seed, std::vector<V> &solutions, KinematicsResult &result,
      const O &options) const {
    E error;
    V solution;
    result = {KinematicErrors::MULTIPLE_TIPS_NOT_SUPPORTED, 0.0};
    if (poses.size() != 1) return false;
    const bool found = getPositionIK(poses[0], seed, solution, error, options);
    result.kinematic_error = found ? KinematicErrors::OK : KinematicErrors::NO_SOLUTION;
    if (found) solutions = {solution};
    return found;
  }
  virtual bool searchPositionIK(const P &, const V &, double, V &, E &, const O & = O()) const = 0;
  virtual bool searchPositionIK(const P &, const V &, double, const V &, V &, E &, const O & = O()) const = 0;
  virtual bool searchPositionIK(const P &, const V &, double, V &, const IKCallbackFn &, E &, const O & = O()) const = 0;
  virtual bool searchPositionIK(const P &, const V &, double, const V &, V &, const IKCallbackFn &, E &,
      const O & = O()) const = 0;
  virtual bool searchPositionIK(const std::vector<P> &, const V &, double, const V &, V &, const IKCallbackFn &, E &,
      const O & = O(), const moveit::core::RobotState * = nullptr) const { return false; }
  virtual bool searchPositionIK(const std::vector<P> &, const V &, double, const V &, V &, const IKCallbackFn &,
      const IKCostFn &, E &, const O & = O(), const moveit::core::RobotState * = nullptr) const { return false; }
  virtual bool getPositionFK(const std::vector<S> &, const V &, std::vector<P> &) const = 0;
  virtual void setValues(const S &, const S &, const S &, const std::vector<S> &, double) {}
  virtual bool initialize(const rclcpp::Node::SharedPtr &, const moveit::core::RobotModel &, const S &, const S &,
      const std::vector<S> &, double) { return false; }
  virtual const S &getGroupName() const { return group_name_; }
  virtual const S &getBaseFrame() const { return base_frame_; }
  virtual const S &getTipFrame() const { return tip_frames_[0]; }
  virtual const std::vector<S> &getTipFrames() const { return tip_frames_; }
  virtual bool setRedundantJoints(const std::vector<unsigned int> &joints) {
    redundant_joint_indices_ = joints;
    return true;
  }
  bool setRedundantJoints(const std::vector<S> &names) {
    return setRedundantJoints(std::vector<unsigned int>(names.size(), 0));
  }
  virtual void getRedundantJoints(std::vector<unsigned int> &joints) const { joints = redundant_joint_indices_; }
  virtual const std::vector<S> &getJointNames() const = 0;
  virtual const std::vector<S> &getLinkNames() const = 0;
  virtual bool supportsGroup(const moveit::core::JointModelGroup *group, S *why = nullptr) const = 0;
  void setDefaultTimeout(double timeout) { default_timeout_ = timeout; }
  virtual ~KinematicsBase() = default;

 protected:
  rclcpp::Node::SharedPtr node_;
  moveit::core::RobotModelConstPtr robot_model_;
  S robot_description_, group_name_, base_frame_;
  std::vector<S> tip_frames_;
  double default_timeout_ = 1.0;
  std::vector<unsigned int> redundant_joint_indices_;
  std::map<int, double> redundant_joint_discretization_;

  /* The model is borrowed: it lives longer than its solvers. A slash in front of a frame is removed. */
  void storeValues(const moveit::core::RobotModel &model, const S &group, const S &base, const std::vector<S> &tips, double) {
    const auto bare = [](const S &frame) { return frame.substr(std::min(frame.find_first_not_of('/'), frame.size())); };
    robot_model_ = moveit::core::RobotModelConstPtr(&model, [](const moveit::core::RobotModel *) {});
    group_name_ = group;
    base_frame_ = bare(base);
    tip_frames_.clear();
    for (const S &tip : tips) tip_frames_.push_back(bare(tip));
  }
};

}  // namespace kinematics
