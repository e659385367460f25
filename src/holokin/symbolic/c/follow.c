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
