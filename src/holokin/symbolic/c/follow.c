/* Following a path on a leaf: Newton on [f(q) - x; g(q) - c] at every sample, halving steps so that the branch is
   kept; the same rules as motion/leaf.py. hk_body takes (q, p, R, c) and gives (dq, conditioning, margin, det). */

typedef struct {
  double center[3], x[3], y[3], angle, v[3], turn[3], rotation[9];
} hk_segment;

typedef struct {
  double singular, representation, contraction, almost, smallest, sign;
  int most;
} hk_rules;

static void hk_target(const hk_segment *s, double u, double *p, double *R) {
  const double a = s->angle * u, ca = cos(a), sa = sin(a);
  for (int i = 0; i < 3; i++) p[i] = s->center[i] + ca * s->x[i] + sa * s->y[i] + u * s->v[i];
  const double w[3] = {u * s->turn[0], u * s->turn[1], u * s->turn[2]};
  const double angle = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
  if (angle == 0.0) {
    for (int i = 0; i < 9; i++) R[i] = s->rotation[i];
    return;
  }
  const double k[3] = {w[0] / angle, w[1] / angle, w[2] / angle};
  const double c = cos(angle), t = 1.0 - c, d = sin(angle);
  const double E[9] = {c + t * k[0] * k[0],        t * k[0] * k[1] - d * k[2], t * k[0] * k[2] + d * k[1],
                       t * k[1] * k[0] + d * k[2], c + t * k[1] * k[1],        t * k[1] * k[2] - d * k[0],
                       t * k[2] * k[0] - d * k[1], t * k[2] * k[1] + d * k[0], c + t * k[2] * k[2]};
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      R[3 * i + j] = E[3 * i] * s->rotation[j] + E[3 * i + 1] * s->rotation[3 + j] + E[3 * i + 2] * s->rotation[6 + j];
}

/* 1 and the new q where Newton contracts on the branch, else 0 and q as it was. x holds (q, p, R, c). */
static int hk_newton(double *x, const hk_rules *rules) {
  double y[HK_NY], q[HK_N], before = HUGE_VAL;
  for (int i = 0; i < HK_N; i++) q[i] = x[i];
  for (int k = 0; k < rules->most; k++) {
    double size = 0.0;
    hk_body(x, y);
    for (int i = 0; i < HK_N; i++) {
      const double step = fabs(y[i]);
      if (!(step <= size)) size = step; /* NaN included */
    }
    const int sound = y[HK_N] > rules->singular && y[HK_N + 1] > rules->representation && y[HK_N + 2] * rules->sign > 0.0;
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

/* Steps `first` to `last` of one cycle whose segments have counts[] steps; Q (.., HK_N) gets a row a step.
   Returns the steps done; x keeps the posture (and p, R, c) there. Fewer than asked: the leaf ended, or a limit. */
long long hk_follow(const hk_segment *segments, const long long *counts, const double *home, double *x, long long first,
                    long long last, const double *lower, const double *upper, const hk_rules *rules, double *Q) {
  int s = 0;
  long long before = 0, total = 0;
  for (int i = 0; counts[i] > 0; i++) total += counts[i];
  for (long long k = first; k < last; k++) {
    while (k - before >= counts[s]) before += counts[s++];
    const double start = (double)(k - before) / (double)counts[s], stop = (double)(k - before + 1) / (double)counts[s];
    double share = 0.0, width = 1.0;
    while (share < 1.0) {
      const double goal = share + width < 1.0 ? share + width : 1.0;
      if (goal == 1.0 && home != 0 && k == total - 1)
        for (int i = 0; i < 12; i++) x[HK_N + i] = home[i]; /* a closed path ends where it starts to the last bit */
      else
        hk_target(segments + s, start + goal * (stop - start), x + HK_N, x + HK_N + 3);
      if (hk_newton(x, rules)) {
        share = goal;
        width *= 2.0;
      } else if ((width *= 0.5) < rules->smallest)
        return k - first;
    }
    for (int i = 0; i < HK_N; i++) {
      if (!(x[i] >= lower[i] && x[i] <= upper[i])) return k - first;
      Q[(k - first) * HK_N + i] = x[i];
    }
  }
  return last - first;
}
