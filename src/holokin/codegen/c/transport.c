/* The label of where a posture q is carried to, its margin and, if asked, its gradient: codegen/transport.py, which names
   the pieces. found: the label, the gradient by rows, the margin. */
static void hk_transport(const hk_t *restrict q, hk_t *restrict found, int gradient) {
  enum { N = HK_TRANSPORT_N, M = HK_TRANSPORT_M, R = HK_TRANSPORT_R, S = HK_TRANSPORT_S, K = HK_TRANSPORT_K };
  const hk_t h = HK_C(HK_TRANSPORT_H), third = HK_C(1) / HK_C(3), sixth = HK_C(1) / HK_C(6);
  const hk_t shares[5] = {HK_C(0), HK_C(0.5), HK_C(0.5), HK_C(1), HK_C(0)}, weights[4] = {sixth, third, third, sixth};
  hk_t v[M], y[N], at[N], f[N], total[N], rcond, first = HK_C(0), least = HK_INF, left[4 * S][K], idle[K];
  hk_t slopes[N * R], factor, by_v[M], of_end[N], by_f[N], of_v[M];
  hk_transport_begin(q, v);
  for (int i = 0; i < N; i++) y[i] = q[i];
  for (int s = 0; s < S; s++) {
    for (int i = 0; i < N; i++) f[i] = total[i] = HK_C(0);
    for (int k = 0; k < 4; k++) {
      for (int i = 0; i < N; i++) at[i] = y[i] + shares[k] * h * f[i];
      hk_transport_rate(at, v, f, &rcond, left[4 * s + k]);
      for (int i = 0; i < N; i++) total[i] = total[i] + weights[k] * f[i];
      if (s == 0 && k == 0) first = rcond;
      least = HK_FMIN(least, rcond);
    }
    for (int i = 0; i < N; i++) y[i] = y[i] + h * total[i];
  }
  hk_transport_miss(y, by_v);
  hk_transport_rate(y, by_v, f, &rcond, idle);
  hk_transport_end(q, y, f, &first, &least, found, found + R + N * R, slopes, &factor);
  for (int r = 0; gradient && r < R; r++) {
    for (int i = 0; i < N; i++) y[i] = slopes[r * N + i];
    for (int i = 0; i < M; i++) by_v[i] = HK_C(0);
    for (int s = S - 1; s >= 0; s--) {
      for (int i = 0; i < N; i++) of_end[i] = y[i], by_f[i] = HK_C(0);
      for (int k = 3; k >= 0; k--) {
        for (int i = 0; i < N; i++) at[i] = h * (weights[k] * of_end[i] + shares[k + 1] * by_f[i]);
        hk_transport_pull(left[4 * s + k], at, by_f, of_v);
        for (int i = 0; i < N; i++) y[i] = y[i] + by_f[i];
        for (int i = 0; i < M; i++) by_v[i] = by_v[i] + of_v[i];
      }
    }
    hk_transport_back(q, y, by_v, at);
    for (int i = 0; i < N; i++) found[R + r * N + i] = factor * at[i];
  }
}
