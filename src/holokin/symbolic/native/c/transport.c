/* The label of where a posture is carried to, its margin and its gradient, in the pieces of symbolic/native/emit.py. What the
   rates leave behind is kept for the sweep back, or, where that is much, found again step by step. */
enum {
  HK_TRANSPORT_ALL = 4 * HK_TRANSPORT_S * HK_TRANSPORT_K <= HK_TRANSPORT_MOST || HK_TRANSPORT_S == 1,
  HK_TRANSPORT_KEPT = HK_TRANSPORT_ALL ? HK_TRANSPORT_S : 1
};

static const double hk_shares[5] = {0.0, 0.5, 0.5, 1.0, 0.0}, hk_weights[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};

/* One Runge-Kutta step from y to after, with rcond of its first rate and the least one. */
static void hk_transport_step(const hk_t *restrict y, const hk_t *restrict v, hk_t *restrict after, hk_t *first,
                              hk_t *least, hk_t (*left)[HK_TRANSPORT_K]) {
  enum { N = HK_TRANSPORT_N };
  const hk_t h = HK_C(HK_TRANSPORT_H);
  hk_t at[N], f[N], total[N], rcond;
  for (int i = 0; i < N; i++) f[i] = total[i] = HK_C(0);
  for (int k = 0; k < 4; k++) {
    for (int i = 0; i < N; i++) at[i] = y[i] + HK_C(hk_shares[k]) * h * f[i];
    hk_transport_rate(at, v, f, &rcond, left[k]);
    for (int i = 0; i < N; i++) total[i] = total[i] + HK_C(hk_weights[k]) * f[i];
    if (k == 0) *first = rcond;
    *least = HK_FMIN(*least, rcond);
  }
  for (int i = 0; i < N; i++) after[i] = y[i] + h * total[i];
}

/* Adds the squares of the differences of two slopes, by y and by v. */
static void hk_transport_gaps(const hk_t *by_f, const hk_t *of_v, const hk_t *other_f, const hk_t *other_v, hk_t *gaps) {
  for (int i = 0; i < HK_TRANSPORT_N; i++) gaps[0] = gaps[0] + (by_f[i] - other_f[i]) * (by_f[i] - other_f[i]);
  for (int i = 0; i < HK_TRANSPORT_M; i++) gaps[1] = gaps[1] + (of_v[i] - other_v[i]) * (of_v[i] - other_v[i]);
}

/* found: the label, if `sloping` its gradient by rows, the margin: of the label alone, if `sloping` of both. */
static void hk_transport(const hk_t *restrict q, hk_t *restrict found, int sloping) {
  enum { N = HK_TRANSPORT_N, M = HK_TRANSPORT_M, R = HK_TRANSPORT_R, S = HK_TRANSPORT_S };
  const hk_t h = HK_C(HK_TRANSPORT_H), sixth = HK_C(hk_weights[0]) * h;
  hk_t y[S + 1][N], left[4 * HK_TRANSPORT_KEPT][HK_TRANSPORT_K], idle[HK_TRANSPORT_K], v[M], missed[M], f[N];
  hk_t first, other, least = HK_INF, slopes[N * R], factor, by_y[N], by_v[M], of_end[N], by_f[N], of_v[M], w[N];
  hk_t ahead_f[N], ahead_v[M], gaps[2], doubt, *margin = found + R + N * R;
  hk_transport_begin(q, v);
  for (int i = 0; i < N; i++) y[0][i] = q[i];
  for (int s = 0; s < S; s++)
    hk_transport_step(y[s], v, y[s + 1], s ? &other : &first, &least, left + (HK_TRANSPORT_ALL ? 4 * s : 0));
  hk_transport_miss(y[S], missed);
  hk_transport_rate(y[S], missed, f, &other, idle);
  hk_transport_end(q, y[S], f, &first, &least, found, margin, slopes, &factor);
  for (int r = 0; sloping && r < R; r++) {
    for (int i = 0; i < N; i++) by_y[i] = slopes[r * N + i];
    for (int i = 0; i < M; i++) by_v[i] = HK_C(0);
    gaps[0] = gaps[1] = HK_C(0);
    for (int s = S - 1; s >= 0; s--) {
      if (!HK_TRANSPORT_ALL) hk_transport_step(y[s], v, w, &other, &least, left);
      for (int i = 0; i < N; i++) of_end[i] = by_y[i], by_f[i] = HK_C(0);
      for (int k = 3; k >= 0; k--) {
        for (int i = 0; i < N; i++) w[i] = h * (HK_C(hk_weights[k]) * of_end[i] + HK_C(hk_shares[k + 1]) * by_f[i]);
        hk_transport_pull(left[(HK_TRANSPORT_ALL ? 4 * s : 0) + k], w, by_f, of_v);
        if (k == 3 && s < S - 1) hk_transport_gaps(ahead_f, ahead_v, by_f, of_v, gaps);
        for (int i = 0; i < N; i++) by_y[i] = by_y[i] + by_f[i];
        for (int i = 0; i < M; i++) by_v[i] = by_v[i] + of_v[i];
      }
      for (int i = 0; i < N; i++) ahead_f[i] = by_f[i];
      for (int i = 0; i < M; i++) ahead_v[i] = of_v[i];
    }
    for (int i = 0; i < N; i++) w[i] = sixth * by_y[i];
    hk_transport_pull(left[0], w, by_f, of_v);
    hk_transport_gaps(ahead_f, ahead_v, by_f, of_v, gaps);
    for (int i = 0; i < M; i++) of_v[i] = of_v[i] / sixth;
    hk_transport_back(q, y[S], v, by_y, by_v, of_v, gaps, &factor, found + R + r * N, &doubt);
    *margin = HK_FMAX(*margin - doubt, HK_C(0)); /* 0 where that is no number */
  }
}
