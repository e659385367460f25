
/* All postures$on_leaf: `count` of them, or a negative status; what the signs are ${name}.h says. */
struct Postures {
  std::array<Joints, 8> q;
  std::array<int, 8> signs;
  int count;
};

inline Postures postures(const Target &target$leaf_given) noexcept {
  Postures found{};
  std::array<real, $n8> q{};
  found.count = ${name}_postures(target.data(), ${leaf_data}q.data(), found.signs.data());
  for (std::size_t i = 0; i < q.size(); i++) found.q[i / ${NAME}_N][i % ${NAME}_N] = q[i];
  return found;
}
