/* A stretch of a way along a leaf, shown to be on one branch: motion/stretch.py has the argument. hk_node_body takes
   (q, p, R, c) and gives (dq, rcond, margin, sign of det, A^-1); hk_bend_body takes (q, v) and gives DA[v] v;
   hk_along_body the Taylor models of A, column by column. */
typedef struct {
  hk_t share, half, c[HK_N], v[HK_N], w[HK_N], radius, reach, axes, turns;
} hk_stretch;

static hk_t hk_most(const hk_t *x) {
  hk_t most = HK_C(0);
  for (int i = 0; i < HK_N; i++) most = HK_FMAX(HK_FABS(x[i]), most);
  return most;
}

/* The posture of a stretch's curve at a share of the way. */
static void hk_curve(const hk_stretch *s, hk_t share, hk_t *q) {
  const hk_t t = (share - s->share) / s->half;
  for (int i = 0; i < HK_N; i++) q[i] = s->c[i] + t * (s->v[i] + t * s->w[i]);
}

/* Z = Y X, all (n, n) by rows, X padded. */
static inline void hk_product(const hk_t *Y, const hk_t *X, hk_t *Z) {
  for (int i = 0; i < HK_N; i++) {
    hk_t sum[HK_WIDE];
    for (int j = 0; j < HK_WIDE; j++) sum[j] = HK_C(0);
    for (int k = 0; k < HK_N; k++) HK_SIMD for (int j = 0; j < HK_WIDE; j++) sum[j] += Y[i * HK_WIDE + k] * X[k * HK_WIDE + j];
    for (int j = 0; j < HK_WIDE; j++) Z[i * HK_WIDE + j] = sum[j];
  }
}

/* How much of its room a stretch takes: up to 1 each tool pose of the way has one posture within `radius` of the curve,
   and that within `reach`. Y: A^-1 at its middle; off: the Newton correction there; turn: of the tool over half of it, or
   below 0 for the first of these alone, of the change of A. */
static hk_t hk_room(hk_stretch *s, const hk_t *inverse, const hk_t *off, hk_t turn) {
  enum { SIZE = HK_N * HK_WIDE };
  hk_model x[HK_N], A[HK_N * HK_N];
  hk_t Y[SIZE], P[SIZE], X1[SIZE], X2[SIZE], X3[SIZE], X11[SIZE], X12[SIZE], X13[SIZE];
  hk_t width[HK_N], gap[HK_N], load[HK_N], eta[HK_N];
  for (int i = 0; i < HK_N; i++) {
    hk_model_constant(s->c[i], x + i);
    x[i].a = s->v[i], x[i].b = s->w[i], x[i].s = x[i].e[i] = s->radius;
  }
  hk_along_body(x, A);
  for (int e = 0; e < SIZE; e++) Y[e] = P[e] = HK_C(0);
  for (int i = 0; i < HK_N; i++) {
    width[i] = gap[i] = HK_C(0);
    for (int j = 0; j < HK_N; j++) {
      const hk_model *one = A + j * HK_N + i;
      Y[i * HK_WIDE + j] = inverse[i * HK_N + j];
      width[i] += one->r;
      gap[i] += one->r0 * (HK_FABS(s->v[j]) + HK_C(2) * HK_FABS(s->w[j])) / HK_C(5);
    }
  }
  for (int i = 0; i < HK_N; i++)
    for (int j = 0; j < HK_N; j++) P[i * HK_WIDE + j] = A[j * HK_N + i].a;
  hk_product(Y, P, X1);
  for (int i = 0; i < HK_N; i++)
    for (int j = 0; j < HK_N; j++) P[i * HK_WIDE + j] = A[j * HK_N + i].b;
  hk_product(Y, P, X2);
  for (int i = 0; i < HK_N; i++)
    for (int j = 0; j < HK_N; j++) P[i * HK_WIDE + j] = A[j * HK_N + i].c;
  hk_product(Y, P, X3);
  hk_product(X1, X1, X11);
  hk_product(X1, X2, X12);
  hk_product(X1, X3, X13);
  for (int i = 0; i < HK_N; i++) { /* load: the change of A off the middle; eta: what the curve misses */
    hk_t first = HK_C(0), second = HK_C(0), third = HK_C(0), fourth = HK_C(0), rest = HK_C(0);
    load[i] = HK_C(0);
    for (int j = 0; j < HK_N; j++) {
      const int e = i * HK_WIDE + j;
      load[i] += HK_FABS(Y[e]) * width[j];
      rest += HK_FABS(Y[e]) * gap[j];
      first += X1[e] * s->v[j];
      second += X2[e] * s->v[j] + HK_C(2) * X1[e] * s->w[j];
      third += X3[e] * s->v[j] + HK_C(2) * X2[e] * s->w[j];
      fourth += HK_C(2) * X3[e] * s->w[j];
    }
    first = HK_FABS(first + HK_C(2) * s->w[i]) / HK_C(2);
    eta[i] = HK_FABS(off[i]) + first + HK_FABS(second) / HK_C(3) + HK_FABS(third) / HK_C(4) + HK_FABS(fourth) / HK_C(5) + rest;
  }
  for (int j = 0; j < HK_N; j++) { /* the columns of A, by the joint that they depend on */
    for (int l = 0; l < HK_N; l++)
      for (int k = 0; k < HK_WIDE; k++) P[l * HK_WIDE + k] = A[j * HK_N + l].e[k];
    for (int i = 0; i < HK_N; i++) {
      hk_t sum[HK_WIDE];
      for (int k = 0; k < HK_WIDE; k++) sum[k] = HK_C(0);
      for (int l = 0; l < HK_N; l++)
        HK_SIMD for (int k = 0; k < HK_WIDE; k++) sum[k] += Y[i * HK_WIDE + l] * P[l * HK_WIDE + k];
      for (int k = 0; k < HK_WIDE; k++) load[i] += HK_FABS(sum[k]);
    }
  }
#if HK_TURN >= 0
  hk_t wide = HK_C(0), missed = HK_C(0), turns[HK_N];
  for (int j = 0; j < HK_N; j++) {
    hk_t axis = HK_C(0);
    turns[j] = HK_C(0);
    for (int l = HK_TURN; l < HK_TURN + 3; l++) {
      axis += A[j * HK_N + l].m * A[j * HK_N + l].m;
      turns[j] += Y[j * HK_WIDE + l] * Y[j * HK_WIDE + l];
    }
    wide += HK_SQRT(axis) * s->radius;
    missed += HK_SQRT(axis) * eta[j];
  }
  s->axes = wide / s->radius, s->turns = HK_SQRT(hk_most(turns));
  for (int i = 0; i < HK_N && turn >= HK_C(0); i++) { /* the error's rotation vector turns its own axes, by at most 0.6 of itself */
    load[i] += HK_C(0.6) * HK_SQRT(turns[i]) * wide * wide / s->radius;
    eta[i] += HK_C(1.8) * HK_SQRT(turns[i]) * missed * turn;
  }
#else
  (void)turn;
  s->axes = s->turns = HK_C(0);
#endif
  hk_t most = HK_C(0), change = HK_C(0), missing = HK_C(0);
  for (int i = 0; i < HK_N; i++) { /* by (1 - t X1) Y instead of Y, which takes the change along t away */
    hk_t all = load[i], miss = eta[i];
    for (int j = 0; j < HK_N; j++) {
      const int e = i * HK_WIDE + j;
      all += HK_FABS(X1[e]) * load[j] + HK_FABS(X2[e] - X11[e]) + HK_FABS(X3[e] - X12[e]) + HK_FABS(X13[e]);
      miss += HK_FABS(X1[e]) * eta[j];
    }
    most = HK_FMAX(all + miss / s->radius, most);
    change = HK_FMAX(all, change);
    missing = HK_FMAX(miss, missing);
    if (!(all + miss < HK_INF)) return HK_INF; /* not a number included */
  }
  s->reach = missing / (HK_C(1) - change);
  return most;
}
