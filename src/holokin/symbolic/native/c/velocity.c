/* Following by velocity: dq = G x' by Runge-Kutta steps of order 4, the same as motion/follow_path.py. hk_rate_body takes
   (q, p, R, v, w) and gives (dq, rcond, margin, largest task error). The segments of each frame lie one after the other,
   those of all frames in turn. */
typedef struct {
  double singular, representation, tracking;
} hk_rules;

/* The rate dq at a share u of a segment; 0 where it is singular. x holds q. */
static int hk_rate(const hk_segment *s, long long apart, double u, const double *closing, const hk_rules *rules, double *x, double *y) {
  double *p = x + HK_N, *v = p + HK_TARGET, *w = v + 3 * HK_FRAMES;
  if (closing != 0)
    for (int i = 0; i < HK_TARGET; i++) p[i] = closing[i]; /* a closed path ends where it starts to the last bit */
  else
    hk_all_on(s, apart, u, p);
  for (int f = 0; f < HK_FRAMES; f++, s += apart, v += 3, w += 3) hk_speed(s, u, v, w);
  hk_rate_body(x, y);
  return y[HK_N] > rules->singular && y[HK_N + 1] > rules->representation;
}

/* Steps `first` to `last` of one cycle whose segments have counts[] steps; Q (.., HK_N) gets a row a step, from the
   posture in q. Returns the steps done. Fewer than asked: a singularity, a limit, or the tool lost the path. */
long long hk_follow(const hk_segment *segments, const long long *counts, const double *closing, double *q, long long first,
                    long long last, const double *lower, const double *upper, const hk_rules *rules, double *Q) {
  double x[HK_N + HK_TARGET + 6 * HK_FRAMES], k1[HK_N + 3], k2[HK_N + 3], k3[HK_N + 3], k4[HK_N + 3];
  int s = 0;
  long long before = 0, total = 0, apart = 0;
  for (; counts[apart] > 0; apart++) total += counts[apart];
  for (long long k = first; k < last; k++) {
    while (k - before >= counts[s]) before += counts[s++];
    const hk_segment *here = segments + s;
    const double n = (double)counts[s], start = (double)(k - before) / n, stop = (double)(k - before + 1) / n;
    const double middle = (start + stop) / 2.0, h = here->duration / n;
    const double *end = k == total - 1 ? closing : 0;
    for (int i = 0; i < HK_N; i++) x[i] = q[i];
    if (!hk_rate(here, apart, start, 0, rules, x, k1)) return k - first;
    for (int i = 0; i < HK_N; i++) x[i] = q[i] + h / 2.0 * k1[i];
    if (!hk_rate(here, apart, middle, 0, rules, x, k2)) return k - first;
    for (int i = 0; i < HK_N; i++) x[i] = q[i] + h / 2.0 * k2[i];
    if (!hk_rate(here, apart, middle, 0, rules, x, k3)) return k - first;
    for (int i = 0; i < HK_N; i++) x[i] = q[i] + h * k3[i];
    if (!hk_rate(here, apart, stop, end, rules, x, k4)) return k - first;
    for (int i = 0; i < HK_N; i++) x[i] = q[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
    hk_rate(here, apart, stop, end, rules, x, k4);
    if (!(k4[HK_N + 2] < rules->tracking)) return k - first; /* NaN included */
    for (int i = 0; i < HK_N; i++)
      if (!(x[i] >= lower[i] && x[i] <= upper[i])) return k - first;
    for (int i = 0; i < HK_N; i++) Q[(k - first) * HK_N + i] = q[i] = x[i];
  }
  return last - first;
}
