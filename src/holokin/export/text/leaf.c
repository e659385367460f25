
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

$newton
int ${name}_inverse(${name}_real q[$n], const ${name}_real target[$target], const ${name}_real c[$r], int most) {
  hk_t x[HK_N + 12 + HK_R], y[HK_N + 3];
  hk_rules rules;
  if (!hk_gather(q, target, c, x)) return ${NAME}_NOT_FINITE;
  hk_leaf_body(x, y);
  rules.singular = HK_C(HK_SINGULAR);
  rules.representation = HK_C(HK_REPRESENTATION);
  rules.contraction = HK_C(HK_CONTRACTION);
  rules.almost = HK_C(HK_ALMOST);
  rules.smallest = HK_C(1); /* steps are not halved here */
  rules.side = y[HK_N + 2];
  rules.most = most;
  if (!(y[HK_N] > rules.singular && y[HK_N + 1] > rules.representation)) return ${NAME}_SINGULAR;
  if (!hk_newton(x, &rules)) return ${NAME}_NOT_CONVERGED;
  for (int i = 0; i < HK_N; i++) q[i] = x[i];
  if (hk_beyond(q)) return ${NAME}_LIMIT;
  hk_leaf_body(x, y);
  return hk_rough(y[HK_N], y[HK_N + 1]) ? ${NAME}_IMPRECISE : ${NAME}_OK;
}
