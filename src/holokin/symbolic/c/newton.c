/* Newton on [f(q) - x; g(q) - c], never jumping to another branch: the rules of motion/leaf.py. hk_leaf_body takes
   (q, p, R, c) and gives (dq, conditioning, margin, sign of det). */
typedef struct {
  hk_t singular, representation, contraction, almost, smallest, side;
  int most;
} hk_rules;

/* 1 and the new q where Newton contracts on the branch, else 0 and q as it was. x holds (q, p, R, c). */
static int hk_newton(hk_t *x, const hk_rules *rules) {
  hk_t y[HK_N + 3], q[HK_N], before = HK_INF;
  for (int i = 0; i < HK_N; i++) q[i] = x[i];
  for (int k = 0; k < rules->most; k++) {
    hk_t size = HK_C(0);
    hk_leaf_body(x, y);
    int sound = y[HK_N] > rules->singular && y[HK_N + 1] > rules->representation && y[HK_N + 2] * rules->side > HK_C(0);
    for (int i = 0; i < HK_N; i++) {
      sound &= y[i] - y[i] == HK_C(0);
      size = HK_FMAX(HK_FABS(y[i]), size);
    }
    if (!sound) break;
    if (before <= rules->almost) {
      if (size <= before)
        for (int i = 0; i < HK_N; i++) x[i] += y[i];
      return 1;
    }
    if (!(size <= rules->contraction * before)) break;
    for (int i = 0; i < HK_N; i++) x[i] += y[i];
    before = size;
  }
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  return 0;
}
