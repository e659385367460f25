
using Leaf = std::array<real, ${NAME}_R>; /* c = g(q) */

inline Result<Leaf> constraint(const Joints &q) noexcept {
  Result<Leaf> found{};
  found.status = static_cast<Status>(${name}_constraint(q.data(), found.value.data()));
  return found;
}

inline Result<Joints> leaf_step(const Joints &q, const Target &target, const Leaf &c) noexcept {
  Result<Joints> found{};
  found.status = static_cast<Status>(${name}_leaf_step(q.data(), target.data(), c.data(), found.value.data()));
  return found;
}

/* From the posture `from`, in `most` pieces at most; without a solution the value is `from`. */
inline Result<Joints> inverse(const Joints &from, const Target &target, const Leaf &c, int most) noexcept {
  Result<Joints> found{from, Status::ok};
  found.status = static_cast<Status>(${name}_inverse(found.value.data(), target.data(), c.data(), most));
  return found;
}

/* From the start, whatever came before, on its leaf. */
inline Result<Joints> solve(const Target &target, int most) noexcept {
  Result<Joints> found{start(), Status::ok};
  found.status = static_cast<Status>(${name}_solve(found.value.data(), target.data(), most));
  return found;
}
