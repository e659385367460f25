/* $title
   Written by holokin $version from: $origin. C++17 round ${name}.h, which says what the functions do: arrays with
   their sizes, results with their status. No allocation, no exception, no dependency. Compile ${name}.c as C and link it.

   if (const auto dq = ${name}::rate(q, dx)) command(dq.value); else stop(dq.status); */
#ifndef ${NAME}_HPP
#define ${NAME}_HPP

#include <array>

#include "${name}.h"

static_assert(${NAME}_EXPORT == 0x0123456789abcdefU, "${name}.h is of another export");

namespace ${name} {

using real = ${name}_real;
using Joints = std::array<real, ${NAME}_N>;                 /* q or dq */
using Rows = std::array<real, ${NAME}_M>;                   /* of the task: dx */
using Pose = std::array<real, $poses>;                          /* $pose_kind, by rows */
using Target = std::array<real, ${NAME}_TARGET>;            /* $target_words */
using Twist = std::array<real, ${NAME}_TWIST>;              /* $twist_words */
using Gain = std::array<real, ${NAME}_N * ${NAME}_M>; /* G, by rows */
using Parameters = ${name}_parameters;

enum class Status {
  imprecise = ${NAME}_IMPRECISE,
  ok = ${NAME}_OK,
  slowed = ${NAME}_SLOWED,
  limit = ${NAME}_LIMIT,
  singular = ${NAME}_SINGULAR,
  not_finite = ${NAME}_NOT_FINITE,
  not_converged = ${NAME}_NOT_CONVERGED,
  bad_parameters = ${NAME}_BAD_PARAMETERS,
  not_a_rotation = ${NAME}_NOT_A_ROTATION,
  lost = ${NAME}_LOST
};

/* A value and its status; true where there is a value: where the status is below ${NAME}_SINGULAR. */
template <class T>
struct Result {
  T value;
  Status status;
  explicit operator bool() const noexcept { return static_cast<int>(status) < ${NAME}_SINGULAR; }
};

/* A control step: joint rates, and the share of the step by which to go on along the path. */
struct Step {
  Joints rates;
  real scale;
};

inline Parameters defaults() noexcept {
  Parameters parameters;
  ${name}_defaults(&parameters);
  return parameters;
}

inline Joints start() noexcept {
  Joints q{};
  ${name}_start(q.data());
  return q;
}

inline Result<Pose> pose(const Joints &q) noexcept {
  Result<Pose> found{};
  found.status = static_cast<Status>(${name}_pose(q.data(), found.value.data()));
  return found;
}

inline Result<Gain> gain(const Joints &q) noexcept {
  Result<Gain> found{};
  found.status = static_cast<Status>(${name}_gain(q.data(), found.value.data()));
  return found;
}

inline Result<Joints> rate(const Joints &q, const Rows &dx) noexcept {
  Result<Joints> found{};
  found.status = static_cast<Status>(${name}_rate(q.data(), dx.data(), found.value.data()));
  return found;
}

inline Result<Step> step(const Joints &q, const Target &target, const Twist &twist,
    const Parameters &parameters) noexcept {
  Result<Step> found{};
  const int status = ${name}_step(q.data(), target.data(), twist.data(), &parameters, found.value.rates.data(),
      &found.value.scale);
  found.status = static_cast<Status>(status);
  return found;
}
$leaf_interface
}  // namespace ${name}

#endif
