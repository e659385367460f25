
int ${name}_constraint(const ${name}_real q[$n], ${name}_real g[$r]) {
  hk_t y[HK_R + 2];
  if (!hk_finite(q, HK_N)) return hk_refuse(HK_R, g);
  hk_constraint_body(q, y);
  return hk_deliver(y, HK_R, g);
}

/* 1 where a joint is beyond its limits. */
static int hk_beyond(const hk_t *q) {
$beyond  return 0;
}

static const int hk_angular[] = {$angular}; /* rows of g that are angles */
$branch
$newton
$line
$way
$fold
$ray
$inverse
/* (q, p, R, c) in a row; 0 where something is not finite. */
static int hk_gather(const hk_t *q, const hk_t *target, const hk_t *c, hk_t *x) {
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
$gather  for (int i = 0; i < HK_R; i++) x[HK_N + HK_TARGET + i] = c[i];
  return hk_finite(x, HK_N + HK_TARGET + HK_R) && hk_finite(target, HK_POSE);
}

int ${name}_leaf_step(const ${name}_real q[$n], const ${name}_real target[$target], const ${name}_real c[$r],
    ${name}_real dq[$n]) {
  hk_t x[HK_N + HK_TARGET + HK_R], y[HK_N + 3];
  if (!hk_gather(q, target, c, x)) return hk_refuse(HK_N, dq);
  if (!hk_posed(target, HK_POSE)) {
    hk_refuse(HK_N, dq);
    return ${NAME}_NOT_A_ROTATION;
  }
  hk_leaf_body(x, y);
  return hk_deliver(y, HK_N, dq);
}

int ${name}_inverse(${name}_real q[$n], const ${name}_real target[$target], const ${name}_real c[$r], int most) {
  hk_t x[HK_N + HK_TARGET + HK_R], y[HK_N + 3], g[HK_R + 2], T[16 * HK_FRAMES + 2], from[HK_TARGET], at[HK_N];
  hk_rules rules;
  hk_way way;
  if (!hk_gather(q, target, c, x)) return ${NAME}_NOT_FINITE;
  if (!hk_posed(target, HK_POSE) || !hk_all_rotate(x + HK_N)) return ${NAME}_NOT_A_ROTATION;
  hk_leaf_body(x, y);
  rules.singular = HK_C(HK_SINGULAR);
  rules.representation = HK_C(HK_REPRESENTATION);
  rules.contraction = HK_C(HK_CONTRACTION);
  rules.almost = HK_C(HK_ALMOST);
  rules.done = HK_C(HK_DONE);
  rules.smallest = HK_C(0);
  rules.creep = HK_C(-1);
  rules.side = y[HK_N + 2];
  rules.most = $newtons;
  rules.tries = most;
  if (!(y[HK_N] > rules.singular && y[HK_N + 1] > rules.representation)) return ${NAME}_SINGULAR;
  hk_pose_body(q, T);
  hk_unpack(T, from);
  for (int i = 0; !HK_MATRICES && i < 9 * HK_FRAMES; i++) from[3 * HK_FRAMES + i] = HK_C(i % 9 % 4 == 0);
  hk_constraint_body(q, g);
  hk_way_to(from, g, x + HK_N, c, &way);
  for (int i = 0; i < HK_N; i++) at[i] = q[i];
  if (hk_go(&way, &rules, HK_C(0), at, x)) return ${NAME}_NOT_CONVERGED;
  for (int i = 0; i < HK_N; i++) x[i] = q[i] = at[i];
  if (hk_beyond(q)) return ${NAME}_LIMIT;
  hk_leaf_body(x, y);
  return hk_rough(y[HK_N], y[HK_N + 1]) ? ${NAME}_IMPRECISE : ${NAME}_OK;
}

int ${name}_solve(${name}_real q[$n], const ${name}_real target[$target], int most) {
  ${name}_parameters parameters;
  hk_t at[HK_N];
  ${name}_defaults(&parameters);
  ${name}_start(at);
$at_once  const int status = ${name}_inverse(at, target, parameters.leaf, most);
  for (int i = 0; i < HK_N && status < ${NAME}_SINGULAR; i++) q[i] = at[i];
  return status;
}
