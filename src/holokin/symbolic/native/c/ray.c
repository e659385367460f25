/* Radial laws whose leaf has one posture for each pose, motion/ik/branch.py. hk_center: the posture over which the label is 0;
   hk_ray_rows: the task's rows among x, y, z and the turns about them. */
#ifdef HK_RAYS
/* 1 where a piece from q to the answer x, begun at `begun`, is one in which no joint can have made a full turn unseen. */
static int hk_keeps_turns(const hk_t *q, const hk_t *begun, const hk_t *x) {
  int keeps = 1;
  for (int i = 0; i < HK_N; i++)
    keeps &= HK_FABS(x[i] - q[i]) < HK_C(HK_HALF_TURN) && HK_FABS(x[i] - begun[i]) <= HK_C(HK_ASIDE);
  return keeps;
}

/* Go a ray from the center q, on one leaf: 0 at its end, 1 where it could not go on, 2 where it took too many pieces. */
static int hk_go_ray(const hk_way *way, const hk_rules *rules, hk_t *q, hk_t *x) {
  hk_t y[2][HK_N], v[HK_ROWS], left[4][HK_TRANSPORT_K], first, least = HK_INF, margin, rate[HK_N], begun[HK_N];
  hk_t share = HK_C(0), width = HK_C(1);
  for (int i = 0; i < HK_ROWS; i++) v[i] = -hk_pace(way, hk_ray_rows[i]);
  for (int i = 0; i < HK_N; i++) y[0][i] = q[i];
  for (int s = 0; s < HK_TRANSPORT_S; s++) hk_transport_step(y[s % 2], v, y[1 - s % 2], &first, &least, left);
  for (int i = 0; i < HK_N; i++) rate[i] = y[HK_TRANSPORT_S % 2][i] - q[i]; /* to begin with, the given law's own way */
  for (int tried = 0; share < HK_C(1); tried++) {
    if (tried >= rules->tries) return 2;
    const hk_t goal = HK_FMIN(HK_C(1), share + width);
    hk_aim(way, goal, x);
    for (int i = 0; i < HK_N; i++) x[i] = begun[i] = q[i] + (goal - share) * rate[i];
    if (hk_newton(x, rules, &margin) && hk_keeps_turns(q, begun, x)) {
      for (int i = 0; i < HK_N; i++) rate[i] = (x[i] - q[i]) / (goal - share), q[i] = x[i];
      width = HK_C(2) * (goal - share);
      share = goal;
    } else {
      if (width == HK_C(1))
        for (int i = 0; i < HK_N; i++) rate[i] = HK_C(0);
      width = (goal - share) / HK_C(2);
    }
    if (!(width >= HK_C(HK_SHORTEST_RAY))) return 1;
  }
  return 0;
}

/* Leap to the end of a way, where that is near by: 1 and the new q where it was. */
static int hk_leap(const hk_way *way, const hk_rules *rules, hk_t *q, hk_t *x) {
  hk_t margin, most = HK_C(0);
  hk_aim(way, HK_C(1), x);
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  if (!hk_newton(x, rules, &margin)) return 0;
  for (int i = 0; i < HK_N; i++) most = HK_FMAX(HK_FABS(x[i] - q[i]), most);
  if (!(most <= HK_C(HK_LEAP))) return 0;
  for (int i = 0; i < HK_N; i++) q[i] = x[i];
  return 1;
}

/* 1 where a way from q is a ray from the center, on one leaf. */
static int hk_on_ray(const hk_way *way, const hk_t *q) {
  int on = 1;
  for (int i = 0; i < HK_N; i++) on &= q[i] == hk_center[i];
  for (int i = 0; i < HK_R; i++) on &= way->change[i] == HK_C(0);
  return on;
}
#endif
