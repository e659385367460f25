/* Newton on [f(q) - x; g(q) - c] in steps that keep to one branch: the rules of motion/ik/leaf.py. hk_leaf_body takes
   (q, p, R, c) and gives (dq, rcond, margin, sign of det). */
typedef struct {
  hk_t singular, representation, contraction, almost, done, smallest, creep, side;
  int most, tries;
} hk_rules;

/* 1 and the new q where Newton contracts, else 0. x holds (q, p, R, c). */
static int hk_newton(hk_t *x, const hk_rules *rules, hk_t *margin) {
  hk_t y[HK_N + 3], before = HK_INF;
  for (int k = 0; k < rules->most; k++) {
    hk_t size = HK_C(0);
    hk_leaf_body(x, y);
    int sound = y[HK_N] > rules->singular && y[HK_N + 1] > rules->representation && y[HK_N + 2] * rules->side > HK_C(0);
    for (int i = 0; i < HK_N; i++) {
      sound &= y[i] - y[i] == HK_C(0);
      size = HK_FMAX(HK_FABS(y[i]), size);
    }
    *margin = y[HK_N + 1];
    if (!sound) return 0;
    const int last = before <= rules->almost;
    if (last && !(size <= before)) return 1;
    if (!last && !(size <= HK_FMAX(rules->contraction * before, rules->done))) return 0;
    for (int i = 0; i < HK_N; i++) x[i] += y[i];
    if (last || size <= rules->done) return 1;
    before = size;
  }
  return 0;
}

/* One piece of a way: from the posture q to the target in x, which has (q, p, R, c), begun at q + width * rate. Gives
   the length of the piece to try next, as a share of this one: at least 1, with the new q and rate, where it keeps to
   the branch, else below; -1 where the joints hardly move. */
static hk_t hk_piece(hk_t *x, hk_t *q, hk_t *rate, hk_t width, hk_t arc, hk_t turn, hk_branch *branch,
                     const hk_rules *rules) {
  hk_t margin, most = HK_C(0);
  for (int i = 0; i < HK_N; i++) x[i] = q[i] + width * rate[i];
  if (!hk_newton(x, rules, &margin)) return HK_C(0.5);
  const hk_t steep = HK_ANGLES ? turn / HK_FMIN(HK_C(1), margin) : HK_TURNS ? turn : HK_C(0);
  const hk_t fits = hk_branch_step(branch, q, x, width * width * (arc + HK_C(2) * (steep * steep)));
  if (!(fits >= HK_C(1))) return fits;
  for (int i = 0; i < HK_N; i++) {
    const hk_t move = x[i] - q[i];
    most = HK_FMAX(HK_FABS(move), most);
    rate[i] = move / width;
    q[i] = x[i];
  }
  return most > rules->creep ? fits : HK_C(-1);
}
