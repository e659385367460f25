/* de-luca-oriolo, position of ppr
   Written by holokin 0.2.0 from: a test. C++17 round ppr.h, which says what the functions do: arrays with
   their sizes, results with their status. No allocation, no exception, no dependency. Compile ppr.c as C and link it.

   if (const auto dq = ppr::rate(q, dx)) command(dq.value); else stop(dq.status); */
#ifndef PPR_HPP
#define PPR_HPP

#include <array>

#include "ppr.h"

static_assert(PPR_EXPORT == 0x9a9dcc78cb4de268U, "ppr.h is of another export");

namespace ppr {

using real = ppr_real;
using Joints = std::array<real, PPR_N>;                 /* q or dq */
using Rows = std::array<real, PPR_M>;                   /* of the task: dx */
using Pose = std::array<real, 16>;                          /* 4x4, by rows */
using Target = std::array<real, PPR_TARGET>;            /* a position in the base frame, 3 numbers */
using Twist = std::array<real, PPR_TWIST>;              /* a velocity in the base frame, 3 numbers [m/s] */
using Gain = std::array<real, PPR_N * PPR_M>; /* G, by rows */
using Parameters = ppr_parameters;

enum class Status {
  imprecise = PPR_IMPRECISE,
  ok = PPR_OK,
  slowed = PPR_SLOWED,
  limit = PPR_LIMIT,
  singular = PPR_SINGULAR,
  not_finite = PPR_NOT_FINITE,
  not_converged = PPR_NOT_CONVERGED,
  bad_parameters = PPR_BAD_PARAMETERS,
  not_a_rotation = PPR_NOT_A_ROTATION,
  lost = PPR_LOST
};

/* A value and its status; true where there is a value: where the status is below PPR_SINGULAR. */
template <class T>
struct Result {
  T value;
  Status status;
  explicit operator bool() const noexcept { return static_cast<int>(status) < PPR_SINGULAR; }
};

/* A control step: joint rates, and the share of the step by which to go on along the path. */
struct Step {
  Joints rates;
  real scale;
};

inline Parameters defaults() noexcept {
  Parameters parameters;
  ppr_defaults(&parameters);
  return parameters;
}

inline Joints start() noexcept {
  Joints q{};
  ppr_start(q.data());
  return q;
}

inline Result<Pose> pose(const Joints &q) noexcept {
  Result<Pose> found{};
  found.status = static_cast<Status>(ppr_pose(q.data(), found.value.data()));
  return found;
}

inline Result<Gain> gain(const Joints &q) noexcept {
  Result<Gain> found{};
  found.status = static_cast<Status>(ppr_gain(q.data(), found.value.data()));
  return found;
}

inline Result<Joints> rate(const Joints &q, const Rows &dx) noexcept {
  Result<Joints> found{};
  found.status = static_cast<Status>(ppr_rate(q.data(), dx.data(), found.value.data()));
  return found;
}

inline Result<Step> step(const Joints &q, const Target &target, const Twist &twist,
    const Parameters &parameters) noexcept {
  Result<Step> found{};
  const int status = ppr_step(q.data(), target.data(), twist.data(), &parameters, found.value.rates.data(),
      &found.value.scale);
  found.status = static_cast<Status>(status);
  return found;
}

using Leaf = std::array<real, PPR_R>; /* c = g(q) */

inline Result<Leaf> constraint(const Joints &q) noexcept {
  Result<Leaf> found{};
  found.status = static_cast<Status>(ppr_constraint(q.data(), found.value.data()));
  return found;
}

inline Result<Joints> leaf_step(const Joints &q, const Target &target, const Leaf &c) noexcept {
  Result<Joints> found{};
  found.status = static_cast<Status>(ppr_leaf_step(q.data(), target.data(), c.data(), found.value.data()));
  return found;
}

/* From the posture `from`, in `most` pieces at most; without a solution the value is `from`. */
inline Result<Joints> inverse(const Joints &from, const Target &target, const Leaf &c, int most) noexcept {
  Result<Joints> found{from, Status::ok};
  found.status = static_cast<Status>(ppr_inverse(found.value.data(), target.data(), c.data(), most));
  return found;
}

/* From the start, whatever came before, on its leaf. */
inline Result<Joints> solve(const Target &target, int most) noexcept {
  Result<Joints> found{start(), Status::ok};
  found.status = static_cast<Status>(ppr_solve(found.value.data(), target.data(), most));
  return found;
}

}  // namespace ppr

#endif
