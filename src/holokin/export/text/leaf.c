
int ${name}_constraint(const ${name}_real q[$n], ${name}_real g[$r]) {
  hk_t y[HK_R + 2];
  if (!hk_finite(q, HK_N)) return hk_refuse(HK_R, g);
  hk_constraint_body(q, y);
  return hk_deliver(y, HK_R, g);
}

/* (q, p, R, c) in a row; 0 where something is not finite. */
static int hk_gather(const hk_t *q, const hk_t *target, const hk_t *c, hk_t *x) {
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
$gather  for (int i = 0; i < HK_R; i++) x[HK_N + 12 + i] = c[i];
  return hk_finite(x, HK_N + 12 + HK_R) && hk_finite(target, HK_POSE);
}

int ${name}_leaf_step(const ${name}_real q[$n], const ${name}_real target[$target], const ${name}_real c[$r],
    ${name}_real dq[$n]) {
  hk_t x[HK_N + 12 + HK_R], y[HK_N + 3];
  if (!hk_gather(q, target, c, x)) return hk_refuse(HK_N, dq);
  hk_leaf_body(x, y);
  return hk_deliver(y, HK_N, dq);
}

/* 1 where a joint is beyond its limits. */
static int hk_beyond(const hk_t *q) {
$beyond  return 0;
}

static const int hk_angular[] = {$angular}; /* rows of g that are angles */
$branch
$newton
$path
/* The straight way from the tool's pose at q to the target in x, turning evenly; 0 where it turns by over 3 rad. */
static int hk_way(const hk_t *q, const hk_t *x, hk_segment *way) {
  hk_t T[18], E[9];
  hk_pose_body(q, T);
  for (int i = 0; i < 3; i++) {
    way->center[i] = T[4 * i + 3];
    way->v[i] = x[HK_N + i] - way->center[i];
    way->x[i] = way->y[i] = way->turn[i] = HK_C(0);
    for (int j = 0; j < 3; j++) way->rotation[3 * i + j] = T[4 * i + j];
  }
  way->angle = way->duration = HK_C(0);
  if (HK_POSE == 3) return 1;
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) {
      E[3 * i + j] = HK_C(0);
      for (int k = 0; k < 3; k++) E[3 * i + j] += x[HK_N + 3 + 3 * i + k] * T[4 * j + k];
    }
  const hk_t w[3] = {(E[7] - E[5]) / HK_C(2), (E[2] - E[6]) / HK_C(2), (E[3] - E[1]) / HK_C(2)};
  const hk_t s = HK_SQRT(hk_square(w)), angle = HK_ATAN2(s, (E[0] + E[4] + E[8] - HK_C(1)) / HK_C(2));
  if (!(angle <= HK_C(3))) return 0;
  for (int i = 0; i < 3; i++) way->turn[i] = s > HK_C(0) ? w[i] * (angle / s) : HK_C(0);
  return 1;
}

int ${name}_inverse(${name}_real q[$n], const ${name}_real target[$target], const ${name}_real c[$r], int most) {
  hk_t x[HK_N + 12 + HK_R], y[HK_N + 3], g[HK_R + 2], end[12], at[HK_N], rate[HK_N];
  hk_t share = HK_C(0), width = HK_C(1);
  hk_rules rules;
  hk_branch branch;
  hk_segment way;
  if (!hk_gather(q, target, c, x)) return ${NAME}_NOT_FINITE;
  hk_leaf_body(x, y);
  rules.singular = HK_C(HK_SINGULAR);
  rules.representation = HK_C(HK_REPRESENTATION);
  rules.contraction = HK_C(HK_CONTRACTION);
  rules.almost = HK_C(HK_ALMOST);
  rules.done = HK_C(HK_DONE);
  rules.creep = HK_C(-1);
  rules.side = y[HK_N + 2];
  rules.most = $newtons;
  if (!(y[HK_N] > rules.singular && y[HK_N + 1] > rules.representation)) return ${NAME}_SINGULAR;
  if (!hk_way(q, x, &way)) return ${NAME}_NOT_CONVERGED;
  hk_constraint_body(q, g);
  branch.laid = 0;
  branch.length = HK_C(HK_LONGEST);
  for (int i = 0; i < 12; i++) end[i] = x[HK_N + i];
  for (int i = 0; i < HK_N; i++) at[i] = q[i], rate[i] = HK_C(0);
  const hk_t turn = HK_SQRT(hk_square(way.turn));
  for (int tried = 0; share < HK_C(1); tried++) {
    const hk_t goal = HK_FMIN(HK_C(1), share + width);
    if (tried >= most) return ${NAME}_NOT_CONVERGED;
    hk_target(&way, goal, x + HK_N, x + HK_N + 3);
    for (int i = 0; i < 12 && goal == HK_C(1); i++) x[HK_N + i] = end[i];
    for (int i = 0; i < HK_R; i++) {
      const hk_t gap = c[i] - g[i], near = hk_angular[i] ? HK_ATAN2(HK_SIN(gap), HK_COS(gap)) : gap;
      x[HK_N + 12 + i] = g[i] + goal * near;
    }
    const hk_t fits = hk_piece(x, at, rate, goal - share, HK_C(0), turn, &branch, &rules);
    width = fits * (goal - share);
    if (fits < HK_C(0)) return ${NAME}_NOT_CONVERGED;
    if (fits >= HK_C(1)) share = goal;
  }
  for (int i = 0; i < HK_N; i++) x[i] = q[i] = at[i];
  if (hk_beyond(q)) return ${NAME}_LIMIT;
  hk_leaf_body(x, y);
  return hk_rough(y[HK_N], y[HK_N + 1]) ? ${NAME}_IMPRECISE : ${NAME}_OK;
}
