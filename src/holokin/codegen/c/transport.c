/* The label of where a posture is carried to, its margin and its gradient, in the pieces of codegen/transport.py. What the
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

/* found: the label, if `sloping` its gradient by rows, the margin. */
static void hk_transport(const hk_t *restrict q, hk_t *restrict found, int sloping) {
  enum { N = HK_TRANSPORT_N, M = HK_TRANSPORT_M, R = HK_TRANSPORT_R, S = HK_TRANSPORT_S };
  const hk_t h = HK_C(HK_TRANSPORT_H);
  hk_t y[S + 1][N], left[4 * HK_TRANSPORT_KEPT][HK_TRANSPORT_K], idle[HK_TRANSPORT_K], v[M], missed[M], f[N];
  hk_t first, other, least = HK_INF, slopes[N * R], factor, by_y[N], by_v[M], of_end[N], by_f[N], of_v[M], w[N];
  hk_transport_begin(q, v);
  for (int i = 0; i < N; i++) y[0][i] = q[i];
  for (int s = 0; s < S; s++)
    hk_transport_step(y[s], v, y[s + 1], s ? &other : &first, &least, left + (HK_TRANSPORT_ALL ? 4 * s : 0));
  hk_transport_miss(y[S], missed);
  hk_transport_rate(y[S], missed, f, &other, idle);
  hk_transport_end(q, y[S], f, &first, &least, found, found + R + N * R, slopes, &factor);
  for (int r = 0; sloping && r < R; r++) {
    for (int i = 0; i < N; i++) by_y[i] = slopes[r * N + i];
    for (int i = 0; i < M; i++) by_v[i] = HK_C(0);
    for (int s = S - 1; s >= 0; s--) {
      if (!HK_TRANSPORT_ALL) hk_transport_step(y[s], v, w, &other, &least, left);
      for (int i = 0; i < N; i++) of_end[i] = by_y[i], by_f[i] = HK_C(0);
      for (int k = 3; k >= 0; k--) {
        for (int i = 0; i < N; i++) w[i] = h * (HK_C(hk_weights[k]) * of_end[i] + HK_C(hk_shares[k + 1]) * by_f[i]);
        hk_transport_pull(left[(HK_TRANSPORT_ALL ? 4 * s : 0) + k], w, by_f, of_v);
        for (int i = 0; i < N; i++) by_y[i] = by_y[i] + by_f[i];
        for (int i = 0; i < M; i++) by_v[i] = by_v[i] + of_v[i];
      }
    }
    hk_transport_back(q, by_y, by_v, w);
    for (int i = 0; i < N; i++) found[R + r * N + i] = factor * w[i];
  }
}
