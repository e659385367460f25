/* The segments of each frame lie one after the other, those of all frames in turn.
   Steps `first` to `last` of one cycle whose segments have counts[] steps; Q (.., HK_N) gets a row a step.
   Returns the steps done; x keeps (q, p, R, c) there and the rate of the last step. Fewer than asked: the last number
   of x says why, of hk_ends, and its q is where; HK_FEW pieces say nothing, since Python soon tries them again. */
enum hk_ends { HK_STOPPED = 1, HK_TRIED, HK_LIMIT };
enum { HK_FEW = 1000 };

long long hk_follow(const hk_segment *segments, const long long *counts, const double *closing, double *x, long long first,
                    long long last, const double *lower, const double *upper, const hk_rules *rules, double *Q) {
  int s = 0;
  long long before = 0, total = 0, apart = 0;
  double q[HK_N], *rate = x + HK_STATE, *why = rate + HK_N;
  hk_branch branch;
  branch.laid = 0;
  branch.length = HK_LONGEST;
  for (int i = 0; i < HK_N; i++) q[i] = x[i];
  for (; counts[apart] > 0; apart++) total += counts[apart];
  for (long long k = first; k < last; k++) {
    while (k - before >= counts[s]) before += counts[s++];
    const hk_segment *here = segments + s;
    const double start = (double)(k - before) / (double)counts[s], stop = (double)(k - before + 1) / (double)counts[s];
    const double n = (double)counts[s];
    double arcs = 0.0, turns = 0.0, share = 0.0, width = 1.0;
    for (int f = 0; f < HK_FRAMES; f++) {
      const hk_segment *one = here + f * apart;
      arcs += one->bend * one->bend, turns += one->sway * one->sway;
    }
    const double arc = sqrt(arcs) / (n * n), turn = sqrt(turns) / n;
    for (int tried = 0; share < 1.0; tried++) {
      const double goal = share + width < 1.0 ? share + width : 1.0;
      if (goal == 1.0 && closing != 0 && k == total - 1)
        for (int i = 0; i < HK_TARGET; i++) x[HK_N + i] = closing[i]; /* a closed path ends where it starts to the last bit */
      else
        hk_all_on(here, apart, start + goal * (stop - start), x + HK_N);
      const double fits = hk_piece(x, q, rate, goal - share, arc, turn, &branch, rules);
      width = fits * (goal - share);
      if (fits >= 1.0 || (fits < 0.0 && goal == 1.0)) {
        share = goal;
        continue;
      }
      if (!(width >= rules->smallest) || tried >= rules->tries) {
        for (int i = 0; i < HK_N; i++) x[i] = q[i];
        *why = width >= rules->smallest ? HK_TRIED : tried > HK_FEW ? HK_STOPPED : 0;
        return k - first;
      }
    }
    for (int i = 0; i < HK_N; i++) {
      if (!(q[i] >= lower[i] && q[i] <= upper[i])) {
        *why = HK_LIMIT;
        return k - first;
      }
      Q[(k - first) * HK_N + i] = q[i];
    }
  }
  return last - first;
}
