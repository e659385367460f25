/* $title. Written by holokin $version; see kinematics_plugin.hpp. */
#include "kinematics_plugin.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <exception>
#include <tuple>

#include <pluginlib/class_list_macros.hpp>
#include <rcl_interfaces/msg/parameter_descriptor.hpp>
#include <rclcpp/logging.hpp>
#include <rclcpp/node.hpp>

#if __has_include(<moveit/robot_state/robot_state.hpp>)
#include <moveit/robot_model/joint_model_group.hpp>
#include <moveit/robot_state/robot_state.hpp>
#else
#include <moveit/robot_model/joint_model_group.h>
#include <moveit/robot_state/robot_state.h>
#endif

#include "exported_robot.hpp"

namespace $package {
namespace {

using Clock = std::chrono::steady_clock;

/* The first try takes this many pieces at most, each other one twice as many as the one before. */
constexpr int FIRST_PIECES = 256;

rclcpp::Logger logger() { return rclcpp::get_logger("$package"); }

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/* The value of a parameter, declared here where nobody has done it before. */
template <class T>
T parameter(rclcpp::Node &node, const std::string &name, const T &by_default, const std::string &about) {
  if (node.has_parameter(name)) return node.get_parameter(name).get_value<T>();
  rcl_interfaces::msg::ParameterDescriptor descriptor;
  descriptor.description = about;
  descriptor.read_only = true;
  return node.declare_parameter<T>(name, by_default, descriptor);
}

/* The pose of a link in the frame of another. */
Matrix relative(moveit::core::RobotState &state, const std::string &base, const std::string &link) {
  const auto B = state.getGlobalLinkTransform(base);
  const auto T = state.getGlobalLinkTransform(link);
  Matrix found = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 4; j++)
      for (int k = 0; k < 3; k++)
        found[static_cast<std::size_t>(4 * i + j)] += B(k, i) * (T(k, j) - (j == 3 ? B(k, 3) : 0.0));
  return found;
}

}  // namespace

bool KinematicsPlugin::initialize(const rclcpp::Node::SharedPtr &node, const moveit::core::RobotModel &model,
    const std::string &group, const std::string &base, const std::vector<std::string> &tips, double discretization) {
  ready_ = false;
  node_ = node;
  storeValues(model, group, base, tips, discretization);
  const moveit::core::JointModelGroup *joints = model.getJointModelGroup(group);
  std::string why;
  Seats found;
  if (joints == nullptr) {
    why = "the robot model has no such group";
  } else if (tip_frames_.size() != 1) {
    why = "the group has " + std::to_string(tip_frames_.size()) + " tips, the export has one";
  } else if (!model.hasLinkModel(base_frame_) || !model.hasLinkModel(tip_frames_[0])) {
    why = "the robot model has no link '" + base_frame_ + "' or no link '" + tip_frames_[0] + "'";
  } else if (seated(*joints, found, why)) {
    seats_ = found.seats;
    joint_names_ = found.names;
    link_names_ = joints->getLinkModelNames();
    const strategy::Parameters parameters = strategy::defaults();
    std::copy(std::begin(parameters.leaf), std::end(parameters.leaf), leaf_.begin());
    ready_ = read_parameters(why) && agrees(why);
  }
  if (!ready_) RCLCPP_ERROR(logger(), "Group '%s': %s", group.c_str(), why.c_str());
  return ready_;
}

bool KinematicsPlugin::read_parameters(std::string &why) {
  if (!node_) return true;
  const std::string prefix = "robot_description_kinematics." + group_name_ + ".";
  try {
    const auto pieces = parameter<std::int64_t>(*node_, prefix + "max_pieces", $most,
        "Pieces of the way to a pose at most, 1 to 20000");
    from_seed_ = parameter<bool>(*node_, prefix + "from_seed", false,
        "Begin at the seed; where the leaf has several postures of a pose, the joints then depend on the seed");
    model_tolerance_ = parameter<double>(*node_, prefix + "model_tolerance", 1e-4,
        "How far the tip may be from that of the exported model [m, rad]");
    if (pieces < 1 || pieces > 20000) why = "max_pieces is " + std::to_string(pieces) + ": give 1 to 20000";
    if (!(model_tolerance_ > 0)) why = "model_tolerance is not above 0";
    max_pieces_ = static_cast<int>(std::clamp<std::int64_t>(pieces, 1, 20000));
  } catch (const std::exception &problem) {
    why = std::string("a parameter below ") + prefix + " is not of its type: " + problem.what();
  }
  return why.empty();
}

/* Whether MoveIt's model puts the tip where the export puts it. */
bool KinematicsPlugin::agrees(std::string &why) const {
  moveit::core::RobotState state(robot_model_);
  state.setToDefaultValues();
  const auto pose_of = [this, &state](const strategy::Joints &q) {
    for (std::size_t i = 0; i < q.size(); i++) state.setVariablePosition(JOINTS[i], q[i]);
    return relative(state, base_frame_, tip_frames_[0]);
  };
  why = disagreement(pose_of, base_frame_, tip_frames_[0], model_tolerance_);
  return why.empty();
}

/* Puts the joints of a group to those of the export, by their names. */
bool KinematicsPlugin::seated(const moveit::core::JointModelGroup &group, Seats &found, std::string &why) {
  std::vector<std::string> extra, missing(JOINTS.begin(), JOINTS.end());
  for (const moveit::core::JointModel *joint : group.getJointModels()) {
    if (joint->getVariableCount() == 0) continue;
    const moveit::core::JointModel *leader = joint->getMimic() != nullptr ? joint->getMimic() : joint;
    const auto place = std::find(JOINTS.begin(), JOINTS.end(), leader->getName());
    if (joint->getVariableCount() != 1 || place == JOINTS.end()) {
      extra.push_back(joint->getName());
      continue;
    }
    Seat seat = {static_cast<std::size_t>(place - JOINTS.begin()), leader != joint, 1.0, 0.0, -HUGE_VAL, HUGE_VAL};
    if (seat.follows) std::tie(seat.factor, seat.offset) = std::make_tuple(joint->getMimicFactor(), joint->getMimicOffset());
    const auto &bounds = joint->getVariableBounds()[0];
    if (bounds.position_bounded_) std::tie(seat.lower, seat.upper) = std::tie(bounds.min_position_, bounds.max_position_);
    if (!seat.follows) missing.erase(std::find(missing.begin(), missing.end(), *place));
    found.seats.push_back(seat);
    found.names.push_back(joint->getName());
  }
  if (!extra.empty()) why = "the export does not move the joints " + listed(extra) + " of the group";
  if (!missing.empty()) why += (why.empty() ? "" : "; ") + ("the group lacks the joints " + listed(missing) + " of the export");
  return why.empty();
}

bool KinematicsPlugin::supportsGroup(const moveit::core::JointModelGroup *group, std::string *why) const {
  Seats found;
  std::string said;
  const bool fits = group != nullptr && seated(*group, found, said);
  if (!fits && why != nullptr) *why = group != nullptr ? said : "there is no group";
  return fits;
}

strategy::Joints KinematicsPlugin::ours(const Values &group) const {
  strategy::Joints q{};
  for (std::size_t i = 0; i < seats_.size(); i++)
    if (!seats_[i].follows) q[seats_[i].ours] = group[i];
  return q;
}

KinematicsPlugin::Values KinematicsPlugin::theirs(const strategy::Joints &q) const {
  Values group;
  for (const Seat &seat : seats_) group.push_back(seat.factor * q[seat.ours] + seat.offset);
  return group;
}

bool KinematicsPlugin::within_bounds(const Values &group) const {
  for (std::size_t i = 0; i < seats_.size(); i++)
    if (!(group[i] >= seats_[i].lower && group[i] <= seats_[i].upper)) return false;
  return true;
}

/* What is wrong with a call; "" where nothing is, and then the target. */
std::string KinematicsPlugin::refused(const Values &seed, const Values &consistency_limits, const Pose &pose,
    strategy::Target &target) const {
  const std::string count = std::to_string(seats_.size());
  if (!ready_) return "the plugin is not initialized";
  if (seed.size() != seats_.size()) return "the seed has " + std::to_string(seed.size()) + " values, not " + count;
  if (!consistency_limits.empty() && consistency_limits.size() != seats_.size())
    return "there are " + std::to_string(consistency_limits.size()) + " consistency limits, not " + count;
  Matrix T;
  if (!to_matrix(pose, T)) return "the pose is not finite, or its quaternion is not of length 1";
$set_target
  return "";
}

/* Tries with more and more pieces, and looks at the clock between them. */
strategy::Result<strategy::Joints> KinematicsPlugin::solved(const strategy::Target &target, const Values &seed, double timeout,
    bool &late) const {
  const auto began = Clock::now();
  for (int most = std::min(FIRST_PIECES, max_pieces_);; most = std::min(2 * most, max_pieces_)) {
    const auto found = from_seed_ ? strategy::inverse(ours(seed), target, leaf_, most) : strategy::solve(target, most);
    if (found.status != strategy::Status::not_converged || most == max_pieces_) return found;
    late = seconds_since(began) >= timeout;
    if (late) return found;
  }
}

bool KinematicsPlugin::searchPositionIK(const Pose &pose, const Values &seed, double timeout,
    const Values &consistency_limits, Values &solution, const IKCallbackFn &callback, ErrorCode &error,
    const Options & /* nothing of a leaf is to be chosen */) const {
  strategy::Target target{};
  const std::string why = refused(seed, consistency_limits, pose, target);
  error.val = ErrorCode::NO_IK_SOLUTION;
  if (!why.empty()) {
    RCLCPP_ERROR(logger(), "Group '%s': %s", group_name_.c_str(), why.c_str());
    return false;
  }
  bool late = false;
  const auto found = solved(target, seed, timeout > 0 ? timeout : default_timeout_, late);
  if (late) error.val = ErrorCode::TIMED_OUT;
  if (!found || found.status == strategy::Status::limit) return false;
  const Values joints = theirs(found.value);
  if (!within_bounds(joints)) return false;
  for (std::size_t i = 0; i < consistency_limits.size(); i++)
    if (!(std::abs(joints[i] - seed[i]) <= consistency_limits[i])) return false;
  if (callback) {
    callback(pose, joints, error);
    if (error.val != ErrorCode::SUCCESS) return false;
  }
  solution = joints;
  error.val = ErrorCode::SUCCESS;
  return true;
}

bool KinematicsPlugin::getPositionIK(const Pose &pose, const Values &seed, Values &solution, ErrorCode &error,
    const Options &options) const {
  return searchPositionIK(pose, seed, 0.0, Values(), solution, IKCallbackFn(), error, options);
}

bool KinematicsPlugin::searchPositionIK(const Pose &pose, const Values &seed, double timeout, Values &solution,
    ErrorCode &error, const Options &options) const {
  return searchPositionIK(pose, seed, timeout, Values(), solution, IKCallbackFn(), error, options);
}

bool KinematicsPlugin::searchPositionIK(const Pose &pose, const Values &seed, double timeout,
    const Values &consistency_limits, Values &solution, ErrorCode &error, const Options &options) const {
  return searchPositionIK(pose, seed, timeout, consistency_limits, solution, IKCallbackFn(), error, options);
}

bool KinematicsPlugin::searchPositionIK(const Pose &pose, const Values &seed, double timeout, Values &solution,
    const IKCallbackFn &callback, ErrorCode &error, const Options &options) const {
  return searchPositionIK(pose, seed, timeout, Values(), solution, callback, error, options);
}

bool KinematicsPlugin::searchPositionIK(const std::vector<Pose> &poses, const Values &seed, double timeout,
    const Values &consistency_limits, Values &solution, const IKCallbackFn &callback, ErrorCode &error,
    const Options &options, const moveit::core::RobotState *) const {
  if (poses.size() == 1)
    return searchPositionIK(poses[0], seed, timeout, consistency_limits, solution, callback, error, options);
  RCLCPP_ERROR(logger(), "Group '%s': %zu poses for one tip", group_name_.c_str(), poses.size());
  error.val = ErrorCode::NO_IK_SOLUTION;
  return false;
}

bool KinematicsPlugin::searchPositionIK(const std::vector<Pose> &poses, const Values &seed, double timeout,
    const Values &consistency_limits, Values &solution, const IKCallbackFn &callback, const IKCostFn &cost,
    ErrorCode &error, const Options &options, const moveit::core::RobotState *state) const {
  if (!cost) return searchPositionIK(poses, seed, timeout, consistency_limits, solution, callback, error, options, state);
  RCLCPP_ERROR(logger(), "Group '%s': there is one answer for a pose, so no cost can choose", group_name_.c_str());
  error.val = ErrorCode::NO_IK_SOLUTION;
  return false;
}

bool KinematicsPlugin::getPositionFK(const std::vector<std::string> &links, const Values &joints,
    std::vector<Pose> &poses) const {
  if (!ready_ || joints.size() != seats_.size()) return false;
  const strategy::Joints q = ours(joints);
  const auto T = strategy::pose(q);
  if (!T) return false;
  moveit::core::RobotState state(robot_model_);
  state.setToDefaultValues();
  for (std::size_t i = 0; i < q.size(); i++) state.setVariablePosition(JOINTS[i], q[i]);
  std::vector<Pose> found;
  for (const std::string &link : links) {
    if (link != tip_frames_[0] && !robot_model_->hasLinkModel(link)) return false;
    found.push_back(to_pose(link == tip_frames_[0] ? T.value : relative(state, base_frame_, link)));
  }
  poses = found;
  return true;
}

}  // namespace $package

PLUGINLIB_EXPORT_CLASS($package::KinematicsPlugin, kinematics::KinematicsBase)
