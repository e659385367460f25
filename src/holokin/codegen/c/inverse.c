/* Inverse kinematics on a leaf: the straight way from the tool pose of a posture to another, gone in stretches that are
   shown to keep to one branch, or in the pieces of newton.c where they cannot be. hk_rows: the task's rows among x, y, z
   and the turns about them; hk_angular: rows of g that are angles. */
typedef struct {
  hk_segment line;
  hk_t end[12], level[HK_R + 1], change[HK_R + 1], turn;
} hk_way;

/* The rotation vector of a rotation matrix by rows, by the quaternion's largest part. */
static void hk_turning(const hk_t *E, hk_t *w) {
  const hk_t trace = E[0] + E[4] + E[8];
  hk_t s = HK_C(1) + trace, v[3] = {E[7] - E[5], E[2] - E[6], E[3] - E[1]};
  int k = -1;
  for (int i = 0; i < 3; i++)
    if (HK_C(1) + HK_C(2) * E[4 * i] - trace > s) s = HK_C(1) + HK_C(2) * E[4 * i] - trace, k = i;
  if (k >= 0) {
    const hk_t real = v[k];
    for (int i = 0; i < 3; i++) v[i] = i == k ? s : E[3 * i + k] + E[3 * k + i];
    for (int i = 0; i < 3; i++) v[i] = real < HK_C(0) ? -v[i] : v[i];
    s = HK_FABS(real);
  }
  const hk_t size = HK_SQRT(hk_square(v)), angle = HK_C(2) * HK_ATAN2(size, s);
  for (int i = 0; i < 3; i++) w[i] = size > HK_C(0) ? angle * (v[i] / size) : HK_C(0);
}

/* The way from the pose (p, R) of a posture on the level g to the pose `to` on the leaf c. */
static void hk_way_to(const hk_t *from, const hk_t *g, const hk_t *to, const hk_t *c, hk_way *way) {
  hk_segment *line = &way->line;
  hk_t E[9];
  for (int i = 0; i < 12; i++) way->end[i] = to[i];
  for (int i = 0; i < 3; i++) {
    line->center[i] = from[i];
    line->v[i] = to[i] - from[i];
    line->x[i] = line->y[i] = HK_C(0);
    for (int j = 0; j < 3; j++) {
      line->rotation[3 * i + j] = from[3 + 3 * i + j];
      E[3 * i + j] = HK_C(0);
      for (int k = 0; k < 3; k++) E[3 * i + j] += to[3 + 3 * i + k] * from[3 + 3 * j + k];
    }
  }
  line->angle = line->duration = HK_C(0);
  hk_turning(E, line->turn);
  way->turn = HK_SQRT(hk_square(line->turn));
  for (int i = 0; i < HK_R; i++) {
    const hk_t gap = c[i] - g[i];
    way->level[i] = g[i];
    way->change[i] = hk_angular[i] ? HK_ATAN2(HK_SIN(gap), HK_COS(gap)) : gap;
  }
}

/* (p, R, c) of the way at a share, after q in x. */
static void hk_aim(const hk_way *way, hk_t share, hk_t *x) {
  hk_target(&way->line, share, x + HK_N, x + HK_N + 3);
  for (int i = 0; i < 12 && share == HK_C(1); i++) x[HK_N + i] = way->end[i]; /* to the last bit */
  for (int i = 0; i < HK_R; i++) x[HK_N + 12 + i] = way->level[i] + share * way->change[i];
}

#ifdef HK_STRETCHES
/* Joint motion for a whole way at the rate of a posture: A^-1 times the way's own. */
static void hk_rate_of(const hk_way *way, const hk_t *inverse, hk_t *rate) {
  hk_t wanted[HK_N];
  for (int i = 0; i < HK_ROWS; i++) wanted[i] = hk_rows[i] < 3 ? way->line.v[hk_rows[i]] : way->line.turn[hk_rows[i] - 3];
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

/* A stretch about a share of the way, near where x has q; 0 where there is none. */
static int hk_lay_stretch(const hk_way *way, hk_t share, hk_t half, const hk_rules *rules, hk_t *x, hk_stretch *s,
                          hk_node *node) {
  hk_t both[2 * HK_N], bend[HK_N], rate[HK_N];
  const hk_t *m = node->measures;
  hk_aim(way, share, x);
  for (int tried = 0;; tried++) {
    hk_node_body(x, node->off);
    if (!(m[0] > rules->singular && m[1] > rules->representation && m[2] * rules->side > HK_C(0))) return 0;
    hk_rate_of(way, node->inverse, rate);
    s->radius = HK_C(HK_SLENDER) * half * hk_most(rate);
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

/* Go the way in stretches as far as they can be shown: q becomes the posture there. Returns the share done. */
static hk_t hk_go_stretches(const hk_way *way, const hk_rules *rules, hk_t *q, hk_t *x) {
  hk_stretch last, next;
  hk_node node;
  hk_t share = HK_C(0), half = HK_C(0.5), margin;
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  if (!hk_lay_stretch(way, HK_C(0), HK_C(HK_FIRST), rules, x, &last, &node)) return HK_C(0); /* for its curve alone */
  if (!(last.radius > HK_C(0))) return HK_C(0);
  half = HK_FMIN(half, HK_C(HK_FIRST) * HK_C(HK_FIRST) * HK_C(HK_SLENDER) / last.radius);
  last.radius = last.reach = HK_C(0);
  for (int laid = 0; share < HK_C(1) && laid < HK_STRETCHES; laid++) {
    half = HK_FMIN(half, (HK_C(1) - share) / HK_C(2));
    const int ends = half >= (HK_C(1) - share) / HK_C(2);
    const hk_t middle = ends ? (share + HK_C(1)) / HK_C(2) : share + half;
    hk_curve(&last, middle, x);
    const int laid_out = hk_lay_stretch(way, middle, half, rules, x, &next, &node);
    const hk_t room = laid_out ? hk_room(&next, node.inverse, node.off, half * way->turn) : HK_INF;
    if (!(room <= HK_C(HK_FULL)) || !hk_meet(&last, &next, share)) {
      half *= room < HK_INF ? HK_FMAX(HK_C(0.3), HK_FMIN(HK_C(0.75), HK_SQRT(HK_C(0.6) / room))) : HK_C(0.4);
      if (half * hk_most(last.v) < HK_C(HK_SHORTEST) * last.half) break;
      continue;
    }
    share = ends ? HK_C(1) : share + HK_C(2) * half;
    half *= HK_FMAX(HK_C(0.8), HK_FMIN(HK_C(1.6), HK_SQRT(HK_C(0.65) / room)));
    last = next;
  }
  if (!(share > HK_C(0))) return HK_C(0);
  hk_aim(way, share, x);
  hk_curve(&last, share, x);
  for (int i = 0; i < HK_N; i++) next.c[i] = x[i];
  if (!hk_newton(x, rules, &margin)) return HK_C(0);
  for (int i = 0; i < HK_N; i++) next.c[i] -= x[i];
  if (!(hk_most(next.c) <= last.radius)) return HK_C(0);
  for (int i = 0; i < HK_N; i++) q[i] = x[i];
  return share;
}

/* Postures within `radius` of c, largest joint: change < 1 is |1 - Y A| there. axes, turns: sizes of the columns of A for
   the tool's rotation, all together, and of the rows of Y for it. */
typedef struct {
  hk_t c[HK_N], radius, change, axes, turns;
} hk_region;

/* A region about a posture a little farther on than q, where x has (q, p, R, c) and dq leads there; of radius 0 where
   there is none. */
static void hk_explore(const hk_t *x, const hk_t *dq, const hk_rules *rules, hk_region *region) {
  const hk_t nothing[HK_N] = {HK_C(0)}, step = hk_most(dq);
  hk_t at[HK_N + 12 + HK_R], most = HK_C(0);
  hk_stretch s;
  hk_node node;
  s.radius = region->radius > HK_C(0) ? HK_FMIN(HK_C(1.3) * region->radius, HK_C(HK_WIDEST)) : HK_C(HK_WIDEST);
  region->radius = HK_C(0);
  for (int tried = 0; tried < 3; tried++) {
    for (int i = 0; i < HK_N + 12 + HK_R; i++) at[i] = x[i];
    for (int i = 0; i < HK_N; i++) {
      s.c[i] = at[i] = x[i] + (step > HK_C(0) ? dq[i] / step * (HK_C(HK_AHEAD) * s.radius) : HK_C(0));
      s.v[i] = s.w[i] = HK_C(0);
    }
    hk_node_body(at, node.off);
    if (!(node.measures[0] > rules->singular && node.measures[2] * rules->side > HK_C(0))) return;
    most = hk_room(&s, node.inverse, nothing, HK_C(-1));
    if (most <= HK_C(HK_ALIKE)) {
      for (int i = 0; i < HK_N; i++) region->c[i] = at[i];
      region->radius = s.radius, region->change = most, region->axes = s.axes, region->turns = s.turns;
      return;
    }
    s.radius *= most < HK_INF ? HK_FMAX(HK_C(0.1), HK_C(0.9) * HK_C(HK_ALIKE) / most) : HK_C(0.1);
  }
}

/* 1 where the way from q to the target in x, which has (q, p, R, c), stays in the region, by the first correction dq of
   Newton: its rate is at most (1 + change) / (1 - change) of dq. */
static int hk_within(const hk_region *region, const hk_t *x, const hk_t *dq) {
  hk_t off = HK_C(0);
  if (!(region->radius > HK_C(0))) return 0;
  for (int i = 0; i < HK_N; i++) off = HK_FMAX(HK_FABS(x[i] - region->c[i]), off);
  return off + (HK_C(1) + region->change) / (HK_C(1) - region->change) * hk_most(dq) <= region->radius;
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
#endif

/* Go the way from the posture q: 0 at its end, 1 where it could not go on, 2 where it took too many pieces. q becomes
   the posture there; x is for (q, p, R, c). */
static int hk_go(const hk_way *way, const hk_rules *rules, hk_t *q, hk_t *x) {
  hk_t share = HK_C(0), width, rate[HK_N];
  hk_branch branch;
#ifdef HK_STRETCHES
  share = hk_go_stretches(way, rules, q, x);
#endif
  branch.laid = 0;
  branch.length = HK_C(HK_LONGEST);
  width = HK_C(1) - share;
  for (int i = 0; i < HK_N; i++) rate[i] = HK_C(0);
  for (int tried = 0; share < HK_C(1); tried++) {
    const hk_t goal = HK_FMIN(HK_C(1), share + width);
    if (tried >= rules->tries) return 2;
    hk_aim(way, goal, x);
    const hk_t fits = hk_piece(x, q, rate, goal - share, HK_C(0), way->turn, &branch, rules);
    width = fits * (goal - share);
    if (fits >= HK_C(1) || (fits < HK_C(0) && goal == HK_C(1)))
      share = goal;
    else if (!(width >= rules->smallest))
      return 1;
  }
  return 0;
}
