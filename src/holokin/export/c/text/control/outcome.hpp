/* $title. Written by holokin $version. What becomes of an update of the controller. */
#pragma once

#include <cstdint>

#include "$name.hpp"

namespace $package {

/* What became of an update. Up to SLOWED the joints move; those up to LOST have the numbers of the exported C. */
enum class Outcome : std::uint8_t {
  OK = 0,
  SLOWED = 1,
  LIMIT = 2,
  SINGULAR = 3,
  NOT_FINITE = 4,
  LOST = 8,
  WAITING = 20,
  STALE = 21,
  BAD_TARGET = 22,
  FAR = 23,
  BAD_PERIOD = 24,
  NO_STATE = 25,
  NOT_FOLLOWING = 26,
  INACTIVE = 27,
  BAD_PARAMETERS = 28
};

inline const char *words_of(Outcome outcome) {
  switch (outcome) {
    case Outcome::OK: return "follows the target";
    case Outcome::SLOWED: return "slowed: a joint is at its speed limit";
    case Outcome::LIMIT: return "stands still: a joint is at its position limit";
    case Outcome::SINGULAR: return "stands still: the next posture is singular, as at the end of the reach";
    case Outcome::NOT_FINITE: return "stands still: a number is not finite";
    case Outcome::LOST: return "stands still until it is activated again: the tool is too far from where it is wanted";
    case Outcome::WAITING: return "stands still: no target since the activation";
    case Outcome::STALE: return "stands still: the target is older than the timeout";
    case Outcome::BAD_TARGET: return "stands still: the last target is none";
    case Outcome::FAR: return "stands still: the target is farther than max_distance or max_angle";
    case Outcome::BAD_PERIOD: return "stands still: the period is not above 0";
    case Outcome::NO_STATE: return "stands still: the position of a joint is not known";
    case Outcome::NOT_FOLLOWING: return "stands still until it is activated again: the joints do not follow the commands";
    case Outcome::INACTIVE: return "is not active";
    case Outcome::BAD_PARAMETERS: return "stands still: the exported step refuses its parameters";
  }
  return "";
}

inline bool moves(Outcome outcome) { return outcome == Outcome::OK || outcome == Outcome::SLOWED; }

inline Outcome outcome_of(::$name::Status status) {
  switch (status) {
    case ::$name::Status::imprecise:
    case ::$name::Status::ok: return Outcome::OK;
    case ::$name::Status::slowed: return Outcome::SLOWED;
    case ::$name::Status::limit: return Outcome::LIMIT;
    case ::$name::Status::singular: return Outcome::SINGULAR;
    case ::$name::Status::not_finite: return Outcome::NOT_FINITE;
    case ::$name::Status::lost: return Outcome::LOST;
    case ::$name::Status::not_a_rotation: return Outcome::BAD_TARGET;
    default: return Outcome::BAD_PARAMETERS;
  }
}

}  // namespace $package
