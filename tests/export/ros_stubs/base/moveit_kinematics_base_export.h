/* For the tests of holokin with MoveIt's own base class: stands in for a header that its build makes. */
#pragma once
#define MOVEIT_KINEMATICS_BASE_EXPORT
