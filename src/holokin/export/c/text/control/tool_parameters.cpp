/* $title. Written by holokin $version. The parameters of the controller, and the robot description. */
#include <algorithm>
#include <cmath>
#include <exception>
#include <iterator>
#include <utility>

#include <hardware_interface/types/hardware_interface_type_values.hpp>
#include <rclcpp/logging.hpp>

#include "exported_robot.hpp"
#include "interface_access.hpp"
#include "robot_description.hpp"
#include "tool_controller.hpp"

namespace $package {
namespace {

const std::vector<double> LEVEL = {$level};

std::vector<std::string> with_prefix(const std::string &prefix) {
  std::vector<std::string> names;
  for (const char *const joint : JOINTS) names.push_back(prefix + joint);
  return names;
}

}  // namespace

ToolController::CallbackReturn ToolController::on_init() {
  try {
    const auto prefix = auto_declare<std::string>("prefix", "");
    auto_declare<std::vector<std::string>>("joints", with_prefix(prefix));
    auto_declare<std::string>("base", prefix + BASE);
    auto_declare<std::string>("tip", prefix + TIP);
    auto_declare<std::string>("robot_description", "");
    auto_declare<bool>("check_robot", true);
    auto_declare<double>("model_tolerance", 1e-4);
    auto_declare<std::string>("command_interface", hardware_interface::HW_IF_POSITION);
    auto_declare<std::string>("target", "pose");
    auto_declare<double>("period", 0.0);
    auto_declare<double>("timeout", 0.2);
    auto_declare<double>("target_period", 0.0);
    auto_declare<double>("max_linear_velocity", 0.25);
    auto_declare<double>("max_angular_velocity", 1.0);
    auto_declare<double>("max_distance", 0.2);
    auto_declare<double>("max_angle", 0.5);
    auto_declare<double>("max_lag", 0.2);
    auto_declare<double>("tool_correction", 0.1);
    auto_declare<double>("leaf_correction", 0.1);
    auto_declare<std::vector<double>>("level", LEVEL);
    auto_declare<bool>("level_at_activation", false);
    auto_declare<double>("max_level_error", 0.01);
    auto_declare<double>("most_error", 0.1);
    auto_declare<double>("least_rcond", 1e-3);
    auto_declare<double>("status_rate", 20.0);
  } catch (const std::exception &problem) {
    RCLCPP_ERROR(get_node()->get_logger(), "a parameter is not of its type (write 1.0, not 1): %s", problem.what());
    return CallbackReturn::ERROR;
  }
  return CallbackReturn::SUCCESS;
}

/* What is wrong with the parameters; "" where nothing is. */
std::string ToolController::read_settings(Settings &read) const {
  const auto number = [this](const char *name) { return value_of<double>(name); };
  read.prefix = value_of<std::string>("prefix");
  read.joints = value_of<std::vector<std::string>>("joints");
  read.base = value_of<std::string>("base");
  read.tip = value_of<std::string>("tip");

  std::vector<std::string> ours = with_prefix(read.prefix), theirs = read.joints, extra, missing;
  std::sort(ours.begin(), ours.end());
  std::sort(theirs.begin(), theirs.end());
  std::set_difference(theirs.begin(), theirs.end(), ours.begin(), ours.end(), std::back_inserter(extra));
  std::set_difference(ours.begin(), ours.end(), theirs.begin(), theirs.end(), std::back_inserter(missing));
  if (!extra.empty()) return "the export does not move, or not twice, the joints " + listed(extra) + " of `joints`";
  if (!missing.empty()) return "`joints` lacks the joints " + listed(missing) + " of the export";

  const auto command = value_of<std::string>("command_interface"), target = value_of<std::string>("target");
  if (command != hardware_interface::HW_IF_POSITION && command != hardware_interface::HW_IF_VELOCITY)
    return "command_interface is '" + command + "': give position or velocity";
  if (target != "pose" && target != "twist") return "target is '" + target + "': give pose or twist";
  read.positions = command == hardware_interface::HW_IF_POSITION;
  read.twists = target == "twist";

  const std::pair<const char *, double &> lengths[] = {{"max_linear_velocity", read.max_linear_velocity},
      {"max_angular_velocity", read.max_angular_velocity}, {"max_distance", read.max_distance},
      {"max_angle", read.max_angle}, {"max_lag", read.max_lag}, {"max_level_error", read.max_level_error}};
  for (const auto &[name, value] : lengths)
    if (value = number(name); !(value > 0)) return std::string(name) + " is not above 0";
  for (const char *const name : {"most_error", "model_tolerance"})
    if (!(number(name) > 0 && std::isfinite(number(name)))) return std::string(name) + " is not above 0, or infinite";
  if (!(number("status_rate") >= 0.01 && number("status_rate") <= 1000)) return "status_rate is not from 0.01 to 1000";
  const std::pair<const char *, double &> times[] = {{"timeout", read.timeout}, {"target_period", read.target_period},
      {"period", read.period}};
  for (const auto &[name, value] : times)
    if (value = number(name); !(value >= 0 && std::isfinite(value))) return std::string(name) + " is negative or infinite";
  if (read.period <= 0) {
    const unsigned int rate = get_update_rate();
    if (rate == 0) return "the update rate is not known: give `period` [s], that of the controller manager";
    read.period = 1.0 / rate;
  }
  for (const char *const name : {"tool_correction", "leaf_correction", "least_rcond"})
    if (!(number(name) >= 0 && number(name) < 1)) return std::string(name) + " is not from 0 to below 1";

  read.step = strategy::defaults();
  read.step.gain = number("tool_correction") / read.period;
  read.step.constraint_gain = number("leaf_correction") / read.period;
  read.step.most_error = number("most_error");
  read.step.least_rcond = number("least_rcond");
  const auto level = value_of<std::vector<double>>("level");
  if (level.size() != LEVEL.size() || !std::all_of(level.begin(), level.end(), [](double c) { return std::isfinite(c); }))
    return "level is not " + std::to_string(LEVEL.size()) + " finite numbers";
  std::copy(level.begin(), level.end(), read.step.leaf);
  read.level_at_activation = value_of<bool>("level_at_activation");
  return "";
}

/* What the robot description has otherwise than the export; "" where nothing. */
std::string ToolController::check_robot(const Settings &read) const {
  if (!value_of<bool>("check_robot")) return "";
  std::string text = description_of(*this, 0);
  if (text.empty()) text = value_of<std::string>("robot_description");
  if (text.empty())
    return "there is no robot description to compare the export with: give the parameter robot_description, or "
           "check_robot: false";
  return RobotDescription(text, read.prefix)
      .disagreement_with_export(read.base, read.tip, value_of<double>("model_tolerance"));
}

}  // namespace $package
