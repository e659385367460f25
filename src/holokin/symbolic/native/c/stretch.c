/* A stretch of a way along a leaf, shown to be on one branch: motion/ik/edge.py has the argument. hk_node_body takes
   (q, p, R, c) and gives (dq, rcond, margin, sign of det, A^-1); hk_bend_body takes (q, v) and gives DA[v] v,
   hk_twist_body (q, v, w) and gives what goes with t^2 in A P';
   hk_along_body the Taylor models of A, column by column. hk_rows: the task's rows, six a frame: x, y, z and the turns about them. */
typedef struct {
  hk_t share, half, c[HK_N], v[HK_N], w[HK_N], z[HK_N], radius, reach, balance, axes, turns;
} hk_stretch;

static hk_t hk_most(const hk_t *x) {
  hk_t most = HK_C(0);
  for (int i = 0; i < HK_N; i++) most = HK_FMAX(HK_FABS(x[i]), most);
  return most;
}

/* The posture of a stretch's curve at a share of the way. */
static void hk_curve(const hk_stretch *s, hk_t share, hk_t *q) {
  const hk_t t = (share - s->share) / s->half;
  for (int i = 0; i < HK_N; i++) q[i] = s->c[i] + t * (s->v[i] + t * (s->w[i] + t * s->z[i]));
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
  hk_t width[HK_N], gap[HK_N], load[HK_N], eta[HK_N], bent[HK_N];
  for (int i = 0; i < HK_N; i++) {
    hk_model_constant(s->c[i], x + i);
    x[i].a = s->v[i], x[i].b = s->w[i], x[i].c = s->z[i], x[i].s = x[i].e[i] = s->radius;
  }
  hk_along_body(x, A);
  for (int e = 0; e < SIZE; e++) Y[e] = P[e] = X1[e] = X2[e] = X3[e] = X11[e] = X12[e] = X13[e] = HK_C(0);
  for (int i = 0; i < HK_N; i++) {
    width[i] = gap[i] = bent[i] = HK_C(0);
    for (int j = 0; j < HK_N; j++) {
      const hk_model *one = A + j * HK_N + i;
      Y[i * HK_WIDE + j] = inverse[i * HK_N + j];
      width[i] += one->r;
      gap[i] += one->r0 * (HK_FABS(s->v[j]) + HK_C(2) * HK_FABS(s->w[j]) + HK_C(3) * HK_FABS(s->z[j])) / HK_C(5);
    }
  }
  if (turn >= HK_C(0)) { /* without a curve all these are 0 */
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
  }
  for (int i = 0; i < HK_N; i++) { /* load: the change of A off the middle; eta: what the curve misses */
    hk_t first = HK_C(0), second = HK_C(0), third = HK_C(0), fourth = HK_C(0), fifth = HK_C(0), rest = HK_C(0);
    load[i] = HK_C(0);
    for (int j = 0; j < HK_N; j++) {
      const int e = i * HK_WIDE + j;
      load[i] += HK_FABS(Y[e]) * width[j];
      rest += HK_FABS(Y[e]) * gap[j];
      first += X1[e] * s->v[j];
      second += X2[e] * s->v[j] + HK_C(2) * X1[e] * s->w[j];
      third += X3[e] * s->v[j] + HK_C(2) * X2[e] * s->w[j] + HK_C(3) * X1[e] * s->z[j];
      fourth += HK_C(2) * X3[e] * s->w[j] + HK_C(3) * X2[e] * s->z[j];
      fifth += HK_C(3) * X3[e] * s->z[j];
    }
    first = HK_FABS(first + HK_C(2) * s->w[i]) / HK_C(2);
    second = HK_FABS(second + HK_C(3) * s->z[i]) / HK_C(3);
    eta[i] = HK_FABS(off[i]) + first + second + HK_FABS(third) / HK_C(4) + HK_FABS(fourth) / HK_C(5) +
             HK_FABS(fifth) / HK_C(6) + rest;
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
  s->axes = s->turns = HK_C(0);
  for (int f = 0; f < HK_TURNS; f++) { /* the rotations of the task, one after the other */
    hk_t wide = HK_C(0), missed = HK_C(0), turns[HK_N];
    for (int j = 0; j < HK_N; j++) {
      hk_t axis = HK_C(0);
      turns[j] = HK_C(0);
      for (int l = hk_turns[f]; l < hk_turns[f] + 3; l++) {
        axis += A[j * HK_N + l].m * A[j * HK_N + l].m;
        turns[j] += Y[j * HK_WIDE + l] * Y[j * HK_WIDE + l];
      }
      wide += HK_SQRT(axis) * s->radius;
      missed += HK_SQRT(axis) * eta[j];
    }
    s->axes = HK_FMAX(wide / s->radius, s->axes), s->turns += HK_SQRT(hk_most(turns));
    for (int i = 0; i < HK_N && turn >= HK_C(0); i++) { /* the error's rotation vector turns its own axes, by at most 0.6 of itself */
      load[i] += HK_C(0.6) * HK_SQRT(turns[i]) * wide * wide / s->radius;
      bent[i] += HK_C(1.8) * HK_SQRT(turns[i]) * missed * turn;
    }
  }
  for (int i = 0; i < HK_N; i++) eta[i] += bent[i];
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
  s->reach = HK_FMIN(missing / (HK_C(1) - change), s->radius);
  s->balance = missing / (change * s->radius);
  return most;
}

/* Joint motion for a whole way at the rate of a posture: A^-1 times the way's own. */
static void hk_rate_of(const hk_way *way, const hk_t *inverse, hk_t *rate) {
  hk_t wanted[HK_N];
  for (int i = 0; i < HK_ROWS; i++) wanted[i] = hk_pace(way, hk_rows[i]);
  for (int i = 0; i < HK_R; i++) wanted[HK_ROWS + i] = way->change[i];
  for (int i = 0; i < HK_N; i++) {
    rate[i] = HK_C(0);
    for (int j = 0; j < HK_N; j++) rate[i] += inverse[i * HK_N + j] * wanted[j];
  }
}

/* A^-1 in the middle of a stretch, and the Newton correction there. */
typedef struct {
  hk_t off[HK_N], measures[3], inverse[HK_N * HK_N];
} hk_node;

/* A stretch about a share of the way, near where x has q, its radius `slender` times its joints' motion; 0 where there is
   none. */
static int hk_lay_stretch(const hk_way *way, hk_t share, hk_t half, hk_t slender, const hk_rules *rules, hk_t *x,
                          hk_stretch *s, hk_node *node) {
  hk_t both[3 * HK_N], bend[HK_N], rate[HK_N];
  const hk_t *m = node->measures;
  hk_aim(way, share, x);
  for (int tried = 0;; tried++) {
    hk_node_body(x, node->off);
    if (!(m[0] > rules->singular && m[1] > rules->representation && m[2] * rules->side > HK_C(0))) return 0;
    hk_rate_of(way, node->inverse, rate);
    s->radius = slender * half * hk_most(rate);
    if (!(s->radius < HK_C(1))) return 0;
    if (hk_most(node->off) <= HK_C(HK_CENTRED) * s->radius) break;
    if (tried == 3) return 0;
    for (int i = 0; i < HK_N; i++) x[i] += node->off[i];
  }
  s->share = share, s->half = half;
  for (int i = 0; i < HK_N; i++) s->c[i] = both[i] = x[i], s->v[i] = both[HK_N + i] = half * rate[i];
  hk_bend_body(both, bend);
  for (int i = 0; i < HK_N; i++) {
    s->w[i] = HK_C(0);
    for (int j = 0; j < HK_N; j++) s->w[i] -= node->inverse[i * HK_N + j] * bend[j] / HK_C(2);
    both[2 * HK_N + i] = s->w[i];
  }
  hk_twist_body(both, bend);
  for (int i = 0; i < HK_N; i++) {
    s->z[i] = HK_C(0);
    for (int j = 0; j < HK_N; j++) s->z[i] -= node->inverse[i * HK_N + j] * bend[j] / HK_C(3);
  }
  return 1;
}

/* 1 where the posture that one stretch shows at a share is the one that the next shows there. */
static int hk_meet(const hk_stretch *a, const hk_stretch *b, hk_t share) {
  hk_t p[HK_N], q[HK_N];
  hk_curve(a, share, p);
  hk_curve(b, share, q);
  for (int i = 0; i < HK_N; i++) p[i] -= q[i];
  const hk_t gap = hk_most(p);
  return gap + a->reach <= b->radius || gap + b->reach <= a->radius;
}

/* Go the way in stretches from a share of it, as far as they can be shown, or until a fold is found: q becomes the posture
   there. Returns the share done. */
static hk_t hk_go_stretches(const hk_way *way, const hk_rules *rules, hk_t from, hk_fold *fold, hk_t *q, hk_t *x) {
  hk_stretch last, next;
  hk_node node;
  hk_t share = from, half = (HK_C(1) - from) / HK_C(2), slender = HK_C(HK_SLENDER), margin, seen[HK_N + HK_TARGET + HK_R];
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  if (!hk_lay_stretch(way, from, HK_C(HK_FIRST), slender, rules, x, &last, &node)) return from; /* for its curve alone */
  if (!(last.radius > HK_C(0))) return from;
  half = HK_FMIN(half, HK_C(HK_FIRST) * HK_C(HK_FIRST) * HK_C(HK_SLENDER) / last.radius);
  last.radius = last.reach = HK_C(0);
  for (int laid = 0; share < HK_C(1) && laid < HK_STRETCHES; laid++) {
    half = HK_FMIN(half, (HK_C(1) - share) / HK_C(2));
    const int ends = half >= (HK_C(1) - share) / HK_C(2);
    const hk_t middle = ends ? (share + HK_C(1)) / HK_C(2) : share + half;
    hk_curve(&last, middle, x);
    const int laid_out = hk_lay_stretch(way, middle, half, slender, rules, x, &next, &node);
    const hk_t room = laid_out ? hk_room(&next, node.inverse, node.off, half * way->turn) : HK_INF;
    if (!(room <= HK_C(HK_FULL)) || !hk_meet(&last, &next, share)) {
      half *= room < HK_INF ? HK_FMAX(HK_C(0.4), HK_FMIN(HK_C(0.85), HK_POW(HK_C(0.5) / room, HK_C(0.3)))) : HK_C(0.4);
      if (half * hk_most(last.v) < HK_C(HK_SHORTEST) * last.half) break;
      continue;
    }
    slender *= HK_FMAX(HK_C(0.7), HK_FMIN(HK_C(1.4), HK_SQRT(next.balance)));
    slender = HK_FMIN(HK_C(HK_SLENDER), HK_FMAX(HK_C(HK_SLENDEREST), slender));
    share = ends ? HK_C(1) : share + HK_C(2) * half;
    half *= HK_FMAX(HK_C(0.8), HK_FMIN(HK_C(1.6), HK_POW(HK_C(0.55) / room, HK_C(0.3))));
    last = next;
    for (int i = 0; i < HK_N; i++) x[i] = last.v[i] / last.half, node.off[i] = last.c[i];
    if (!ends && hk_fold_ahead(fold, way, middle, middle, x, rules, node.off, seen)) {
      for (int i = 0; i < HK_N; i++) q[i] = node.off[i];
      return share;
    }
  }
  if (!(share > from)) return from;
  hk_aim(way, share, x);
  hk_curve(&last, share, x);
  for (int i = 0; i < HK_N; i++) next.c[i] = x[i];
  if (!hk_newton(x, rules, &margin)) return from;
  for (int i = 0; i < HK_N; i++) next.c[i] -= x[i];
  if (!(hk_most(next.c) <= last.radius)) return from;
  for (int i = 0; i < HK_N; i++) q[i] = x[i];
  return share;
}

/* Postures within `radius` of c, largest joint: change < 1 is |1 - Y A| there. axes, turns: sizes of the columns of A for
   the tool's rotation, all together, and of the rows of Y for it. next: the radius to try for another region. */
typedef struct {
  hk_t c[HK_N], radius, change, axes, turns, next;
} hk_region;

/* A region about a posture a little farther on than q, where x has (q, p, R, c) and dq leads there; of radius 0 where
   there is none that could hold the way. */
static void hk_explore(const hk_t *x, const hk_t *dq, const hk_rules *rules, hk_region *region) {
  const hk_t nothing[HK_N] = {HK_C(0)}, step = hk_most(dq);
  hk_t at[HK_N + HK_TARGET + HK_R];
  hk_stretch s;
  hk_node node;
  region->radius = HK_C(0);
  if (!(region->next > HK_C(0))) region->next = HK_C(HK_WIDEST);
  for (int tried = 0; tried < 3; tried++) {
    s.radius = region->next;
    if (!(s.radius > step)) { /* too narrow; as far on as this it may not be */
      region->next = HK_C(HK_WIDER) * s.radius;
      return;
    }
    for (int i = 0; i < HK_N + HK_TARGET + HK_R; i++) at[i] = x[i];
    for (int i = 0; i < HK_N; i++) {
      s.c[i] = at[i] = x[i] + (step > HK_C(0) ? dq[i] / step * (HK_C(HK_AHEAD) * s.radius) : HK_C(0));
      s.v[i] = s.w[i] = s.z[i] = HK_C(0);
    }
    hk_node_body(at, node.off);
    if (!(node.measures[0] > rules->singular && node.measures[2] * rules->side > HK_C(0))) return;
    const hk_t most = hk_room(&s, node.inverse, nothing, HK_C(-1)), fits = HK_C(0.9) * HK_C(HK_ALIKE) / most;
    region->next = HK_FMIN(HK_C(HK_WIDEST), s.radius * (most < HK_INF ? HK_FMAX(HK_C(0.1), HK_FMIN(HK_C(HK_WIDER), fits)) : HK_C(0.1)));
    if (most <= HK_C(HK_ALIKE)) {
      for (int i = 0; i < HK_N; i++) region->c[i] = at[i];
      region->radius = s.radius, region->change = most, region->axes = s.axes, region->turns = s.turns;
      return;
    }
  }
}

/* 1 where the way from q to the target in x, which has (q, p, R, c), stays in the region, by the first correction dq of
   Newton, which is the way's rate at q. With Y A(q) = 1 - E and 1 - F elsewhere, that is (1 - F)^-1 (1 - E) dq there,
   2 change / (1 - change) of dq off at most: no point q + t dq is farther off than the farther one of q and q + dq. */
static int hk_within(const hk_region *region, const hk_t *x, const hk_t *dq) {
  hk_t off = HK_C(0), end = HK_C(0);
  if (!(region->radius > HK_C(0))) return 0;
  for (int i = 0; i < HK_N; i++) {
    const hk_t apart = x[i] - region->c[i];
    off = HK_FMAX(HK_FABS(apart), off);
    end = HK_FMAX(HK_FABS(apart + dq[i]), end);
  }
  const hk_t aside = HK_C(2) * region->change / (HK_C(1) - region->change) * hk_most(dq);
  return off <= region->radius && end + aside <= region->radius;
}

/* q at the target in x, which has (q, p, R, c), where a region shows that it is on q's branch; else 0. */
static int hk_go_within(hk_region *region, const hk_rules *rules, hk_t *x, hk_t *q) {
  hk_t y[HK_N + 3], margin;
  hk_leaf_body(x, y);
  if (!(y[HK_N] > rules->singular && y[HK_N + 1] > rules->representation && y[HK_N + 2] * rules->side > HK_C(0))) return 0;
  if (!(hk_most(y) < HK_C(HK_WIDEST))) return 0;
  if (!hk_within(region, x, y)) {
    hk_explore(x, y, rules, region);
    if (!hk_within(region, x, y)) return 0;
  }
  const hk_t step = hk_most(y) / (HK_C(1) - region->change) * (HK_C(1) + region->change);
  for (int i = 0; i < HK_N; i++) x[i] += y[i];
  if (!hk_newton(x, rules, &margin)) return 0;
  hk_t off = HK_C(0), apart = HK_C(0);
  for (int i = 0; i < HK_N; i++) {
    off = HK_FMAX(HK_FABS(x[i] - region->c[i]), off);
    apart = HK_FMAX(HK_FABS(x[i] - q[i]), apart);
  }
  /* Two postures with one pose, |e| = |q - q'| apart at most by `step` and what was found: |e| <= change |e|, and for the
     rotations, which add up to none along q to q' but for their commutators, turns (axes |e|)^3 / 6 besides. */
  const hk_t axes = region->axes * (step + apart);
  if (!(off <= region->radius && region->change + region->turns * region->axes * axes * axes / HK_C(6) < HK_C(0.9))) return 0;
  for (int i = 0; i < HK_N; i++) q[i] = x[i];
  return 1;
}
