/* A dense system amid straight-line code: A = Q R by Householder reflections, as symbolic/linear.py writes them out.
   M = [A | B] (n, n + k) by rows; B becomes A^-1 B. measures: min |R_ii| / max |R_ii|, sign of det A. w: n + k numbers. */
static void hk_solve(int n, int k, hk_t *restrict M, hk_t *restrict w, hk_t *restrict measures) {
  const int width = n + k;
  hk_t least = HK_INF, most = HK_C(0), side = HK_C(1);
  for (int c = 0; c < n - 1; c++) {
    hk_t sum = HK_C(0);
    for (int i = c; i < n; i++) sum = sum + M[i * width + c] * M[i * width + c];
    const hk_t first = M[c * width + c], norm = HK_SQRT(sum), s = HK_COPYSIGN(HK_C(1), first);
    const hk_t beta = HK_C(1) / (norm * (norm + s * first));
    M[c * width + c] = first + s * norm;
    for (int j = c + 1; j < width; j++) w[j] = HK_C(0);
    for (int i = c; i < n; i++) {
      const hk_t v = M[i * width + c], *restrict row = M + i * width;
      HK_SIMD for (int j = c + 1; j < width; j++) w[j] = w[j] + v * row[j];
    }
    for (int i = c; i < n; i++) {
      const hk_t v = beta * M[i * width + c];
      hk_t *restrict row = M + i * width;
      HK_SIMD for (int j = c + 1; j < width; j++) row[j] = row[j] - v * w[j];
    }
    M[c * width + c] = -s * norm;
    side = -side; /* a reflection turns the sign */
  }
  for (int i = n - 1; i >= 0; i--) {
    const hk_t r = M[i * width + i], size = HK_FABS(r);
    least = HK_FMIN(size, least);
    most = HK_FMAX(size, most);
    side = HK_COPYSIGN(HK_C(1), side * HK_COPYSIGN(HK_C(1), r));
    for (int j = n; j < width; j++) {
      const hk_t found = M[i * width + j] / r;
      M[i * width + j] = found;
      for (int l = 0; l < i; l++) M[l * width + j] = M[l * width + j] - M[l * width + i] * found;
    }
  }
  measures[0] = least / most;
  measures[1] = side;
}
