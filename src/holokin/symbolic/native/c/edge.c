/* The pose of a leaf that is nearest to a wanted one: the rules of motion/ik/edge.py and motion/ik/inverse_function.py.
   hk_edge_body takes (q, p, R, length) and gives (e, S, rcond^2, its slope, twist, p, R). HK_ROWS: m. */
enum { HK_M = HK_ROWS, HK_MOST_HELD = 2 * HK_N + 1, HK_STATE = HK_N + 12 + HK_R };

/* A leaf and how far it may be gone: a start, the tool there (p, R), the level, limits, lengths. */
typedef struct {
  const hk_t *start, *tool, *level, *lower, *upper;
  hk_t length, margin;
  hk_rules rules;
} hk_edge;

/* What the edge function says of a posture q, with count constraints c [m], their slopes A by z, and their sizes. */
typedef struct {
  hk_t q[HK_N], e[HK_M], S[HK_N * HK_M], rcond, slope[HK_N], twist[6 * HK_M], tool[12];
  hk_t c[HK_MOST_HELD], A[HK_MOST_HELD * HK_M], sizes[HK_MOST_HELD];
  int count, which[HK_MOST_HELD];
} hk_look;

static hk_t hk_times(const hk_t *a, const hk_t *b, int count) {
  hk_t sum = HK_C(0);
  for (int i = 0; i < count; i++) sum += a[i] * b[i];
  return sum;
}

static hk_t hk_excess(const hk_look *at) {
  hk_t most = HK_C(0);
  for (int i = 0; i < at->count; i++) most = HK_FMAX(-at->c[i], most);
  return most;
}

static hk_t hk_distance(const hk_look *at) { return HK_SQRT(hk_times(at->e, at->e, HK_M)); }

static hk_t hk_merit(const hk_look *at, hk_t weight) {
  return hk_times(at->e, at->e, HK_M) / HK_C(2) + weight * hk_excess(at);
}

/* scaled: a look whose constraints and sizes are kept, or 0. */
static HK_CALL void hk_look_at(const hk_edge *edge, const hk_t *q, const hk_t *goal, const hk_look *scaled, hk_look *at) {
  hk_t x[HK_N + 13], y[HK_M + HK_N * HK_M + 1 + HK_N + 6 * HK_M + 12], most = HK_C(0);
  int count = 0;
  for (int i = 0; i < HK_N; i++) x[i] = at->q[i] = q[i];
  for (int i = 0; i < 12; i++) x[HK_N + i] = goal[i];
  x[HK_N + 12] = edge->length;
  hk_edge_body(x, y);
  const hk_t *from = y;
  for (int i = 0; i < HK_M; i++) at->e[i] = *from++;
  for (int i = 0; i < HK_N * HK_M; i++) at->S[i] = *from++;
  const hk_t square = *from++ / (edge->margin * edge->margin);
  at->rcond = HK_SQRT(square) * edge->margin;
  for (int i = 0; i < HK_N; i++) at->slope[i] = *from++;
  for (int i = 0; i < 6 * HK_M; i++) at->twist[i] = *from++;
  for (int i = 0; i < 12; i++) at->tool[i] = *from++;
  hk_t c[HK_MOST_HELD], A[HK_MOST_HELD * HK_M], sizes[HK_MOST_HELD];
  for (int k = 0; k < HK_MOST_HELD; k++) {
    const int joint = k == 0 ? 0 : (k - 1) % HK_N, high = k > HK_N;
    hk_t *row = A + k * HK_M;
    c[k] = k == 0 ? square - HK_C(1) : high ? edge->upper[joint] - q[joint] : q[joint] - edge->lower[joint];
    for (int j = 0; j < HK_M; j++) {
      row[j] = HK_C(0);
      if (k == 0)
        for (int i = 0; i < HK_N; i++) row[j] += square * at->slope[i] * at->S[i * HK_M + j];
      else
        row[j] = high ? -at->S[joint * HK_M + j] : at->S[joint * HK_M + j];
    }
    sizes[k] = c[k] < HK_INF ? HK_SQRT(hk_times(row, row, HK_M)) : HK_C(0);
    most = HK_FMAX(sizes[k], most);
  }
  for (int k = 0; k < (scaled ? scaled->count : HK_MOST_HELD); k++) {
    const int one = scaled ? scaled->which[k] : k;
    const hk_t size = scaled ? scaled->sizes[k] : sizes[k];
    if (!scaled && !(size > HK_C(HK_EDGE_UNMOVED) * most)) continue; /* the tool does not move it */
    at->which[count] = one;
    at->sizes[count] = size;
    at->c[count] = c[one] / size;
    for (int j = 0; j < HK_M; j++) at->A[count * HK_M + j] = A[one * HK_M + j] / size;
    count++;
  }
  at->count = count;
}

/* x = H^-1 b of a small symmetric positive definite H (n, n) that lies in rows of length `stride`. */
static void hk_cholesky_solve(const hk_t *H, int n, int stride, const int *held, const hk_t *b, hk_t *x) {
  hk_t L[HK_MOST_HELD * HK_MOST_HELD];
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) {
      hk_t sum = H[held[i] * stride + held[j]];
      for (int k = 0; k < j; k++) sum -= L[i * n + k] * L[j * n + k];
      if (i == j)
        L[i * n + i] = HK_SQRT(HK_FMAX(sum, HK_C(1e-300)));
      else
        L[i * n + j] = sum / L[j * n + j];
    }
  for (int i = 0; i < n; i++) {
    x[i] = b[i];
    for (int k = 0; k < i; k++) x[i] -= L[i * n + k] * x[k];
    x[i] /= L[i * n + i];
  }
  for (int i = n - 1; i >= 0; i--) {
    for (int k = i + 1; k < n; k++) x[i] -= L[k * n + i] * x[k];
    x[i] /= L[i * n + i];
  }
}

/* The z with the least z^T M^-1 z / 2 - e^T z and A z >= -c, by Lawson and Hanson's active sets; its multipliers. */
static HK_CALL void hk_project(const hk_look *at, const hk_t *e, const hk_t *M, hk_t *z, hk_t *force) {
  enum { K = HK_MOST_HELD };
  const int count = at->count;
  hk_t free[HK_M], MA[K * HK_M], H[K * K], b[K], right[K], wanted[K];
  int held[K], holds = 0, is[K];
  for (int i = 0; i < HK_M; i++) free[i] = M ? hk_times(M + i * HK_M, e, HK_M) : e[i];
  for (int k = 0; k < count; k++) {
    for (int i = 0; i < HK_M; i++) MA[k * HK_M + i] = M ? hk_times(M + i * HK_M, at->A + k * HK_M, HK_M) : at->A[k * HK_M + i];
    b[k] = hk_times(at->A + k * HK_M, free, HK_M) + at->c[k];
    force[k] = HK_C(0);
    is[k] = 0;
  }
  for (int tried = 0; tried < 3 * count + 3; tried++) {
    int worst = -1;
    hk_t least = HK_C(0);
    for (int k = 0; k < count; k++) {
      hk_t slack = b[k];
      for (int i = 0; i < holds; i++) slack += H[k * K + held[i]] * force[held[i]];
      if (!is[k] && (worst < 0 || slack < least)) worst = k, least = slack;
    }
    if (worst < 0 || !(least < HK_C(-1e-14) * (HK_C(1) + HK_FABS(b[worst])))) break;
    for (int k = 0; k < count; k++) /* the rows of H that are wanted */
      H[k * K + worst] = H[worst * K + k] = hk_times(at->A + k * HK_M, MA + worst * HK_M, HK_M);
    H[worst * K + worst] *= HK_C(1) + HK_C(HK_EDGE_DEPENDENT);
    held[holds++] = worst;
    is[worst] = 1;
    while (holds > 0) {
      int first = -1;
      hk_t share = HK_C(1);
      for (int i = 0; i < holds; i++) right[i] = -b[held[i]];
      hk_cholesky_solve(H, holds, K, held, right, wanted);
      for (int i = 0; i < holds; i++)
        if (!(wanted[i] > HK_C(0))) {
          const hk_t now = force[held[i]], part = now / (now - wanted[i]);
          if (first < 0 || part < share) first = i, share = part;
        }
      for (int i = 0; i < holds; i++) force[held[i]] += (first < 0 ? HK_C(1) : share) * (wanted[i] - force[held[i]]);
      if (first < 0) break;
      force[held[first]] = HK_C(0);
      is[held[first]] = 0;
      holds--;
      for (int i = first; i < holds; i++) held[i] = held[i + 1];
    }
  }
  for (int i = 0; i < HK_M; i++) {
    z[i] = free[i];
    for (int k = 0; k < count; k++) z[i] += MA[k * HK_M + i] * force[k];
  }
}

/* The straight way of the tool from one pose (p, R) to another, on the leaf. */
static void hk_straight(const hk_edge *edge, const hk_t *from, const hk_t *to, hk_way *way) {
  hk_way_to(from, edge->level, to, edge->level, way);
}

/* From q along a way, in stretches shown to keep to the branch, and in so many pieces at most: 1 where it is gone to its
   end; q is how far it got. */
static int hk_walked(const hk_edge *edge, hk_t *q, const hk_way *way, int tries) {
  hk_t x[HK_STATE];
  hk_rules rules = edge->rules;
  rules.tries = tries;
  return hk_go(way, &rules, HK_C(0), q, x) == 0;
}

/* The same by Newton steps alone: quick, and not shown to keep to the branch; nothing less than its end counts. */
static HK_CALL int hk_glance(const hk_edge *edge, hk_t *q, const hk_way *way) {
  hk_t x[HK_STATE], y[HK_N + 3], at[HK_N], begun[HK_N], rate[HK_N], margin, share = HK_C(0), width = HK_C(1);
  hk_aim(way, HK_C(HK_EDGE_BEGUN), x);
  for (int i = 0; i < HK_N; i++) x[i] = at[i] = q[i];
  hk_leaf_body(x, y);
  for (int i = 0; i < HK_N; i++) rate[i] = y[i] / HK_C(HK_EDGE_BEGUN);
  while (width >= HK_C(HK_EDGE_NARROW)) {
    const hk_t end = share + width < HK_C(1) ? share + width : HK_C(1), gone = end - share;
    hk_t off = HK_C(0);
    hk_aim(way, end, x);
    for (int i = 0; i < HK_N; i++) x[i] = begun[i] = at[i] + gone * rate[i];
    const int found = hk_newton(x, &edge->rules, &margin);
    width = gone / HK_C(2);
    if (!found) continue;
    for (int i = 0; i < HK_N; i++) off = HK_FMAX(HK_FABS(x[i] - begun[i]), off);
    width *= HK_FMIN(HK_C(8), HK_FMAX(HK_C(0.5), HK_SQRT(HK_C(2) * HK_C(HK_EDGE_LEAP) / HK_FMAX(off, HK_C(1e-300)))));
    if (off > HK_C(HK_EDGE_LEAP)) continue;
    for (int i = 0; i < HK_N; i++) rate[i] = (x[i] - at[i]) / gone, at[i] = x[i];
    for (int i = 0; i < HK_N && (gone >= HK_C(HK_EDGE_COARSE) || end == HK_C(1)); i++) q[i] = x[i];
    if (end == HK_C(1)) return 1;
    share = end;
  }
  return 0;
}

/* The posture of the leaf at a tool pose to which Newton's method contracts from q, in x; 0 where there is none. */
static int hk_solved(const hk_edge *edge, const hk_t *q, const hk_t *pose, hk_t *x) {
  hk_t margin;
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  for (int i = 0; i < 12; i++) x[HK_N + i] = pose[i];
  for (int i = 0; i < HK_R; i++) x[HK_N + 12 + i] = edge->level[i];
  return hk_newton(x, &edge->rules, &margin);
}

/* The look at the posture of the leaf nearby that has the tool pose of q; 0 where there is none. */
static int hk_onto(const hk_edge *edge, const hk_t *q, const hk_t *goal, hk_look *at) {
  hk_t x[HK_STATE];
  hk_look_at(edge, q, goal, 0, at);
  if (!hk_solved(edge, q, at->tool, x)) return 0;
  hk_look_at(edge, x, goal, 0, at);
  return 1;
}

/* The look after a share of a motion z of the tool, or, without z, of the straight way to the goal; 0 where that leads
   nowhere. careful: only where it is shown to keep to the branch. */
static int hk_moved(const hk_edge *edge, const hk_look *at, const hk_t *z, hk_t share, const hk_t *goal, int careful,
                    hk_look *there) {
  hk_t x[HK_STATE], margin;
  hk_way way;
  hk_straight(edge, at->tool, goal, &way);
  for (int i = 0; z && i < 3; i++) {
    way.line[0].v[i] = hk_times(at->twist + i * HK_M, z, HK_M);
    way.line[0].turn[i] = hk_times(at->twist + (3 + i) * HK_M, z, HK_M);
  }
  if (z)
    hk_target(way.line, share, x + HK_N, x + HK_N + 3);
  else
    hk_aim(&way, share, x);
  for (int i = 0; i < HK_R; i++) x[HK_N + 12 + i] = edge->level[i];
  for (int i = 0; i < HK_N; i++) x[i] = at->q[i];
  if (careful) {
    hk_straight(edge, at->tool, x + HK_N, &way);
    if (!hk_walked(edge, x, &way, HK_EDGE_FEW)) return 0;
  } else {
    for (int i = 0; i < HK_N; i++) x[i] += share * hk_times(at->S + i * HK_M, z ? z : at->e, HK_M);
    if (!hk_newton(x, &edge->rules, &margin)) return 0;
  }
  hk_look_at(edge, x, goal, 0, there);
  return 1;
}

/* Leads a look to the nearest posture within the constraints, if a few steps do. */
static int hk_inside(const hk_edge *edge, hk_look *at, const hk_t *goal, int careful) {
  const hk_t none[HK_M] = {HK_C(0)};
  hk_t z[HK_M], force[HK_MOST_HELD], longest = HK_C(HK_EDGE_TRUST);
  hk_look there;
  for (int tried = 0; tried < HK_EDGE_RETURNS; tried++) {
    if (hk_excess(at) <= HK_C(HK_EDGE_WITHIN)) return 1;
    hk_project(at, none, 0, z, force);
    const hk_t size = HK_SQRT(hk_times(z, z, HK_M));
    if (hk_moved(edge, at, z, HK_FMIN(HK_C(1), longest / HK_FMAX(size, HK_C(1e-300))), goal, careful, &there)) {
      *at = there;
      longest *= HK_C(2);
    } else
      longest = HK_FMIN(size, longest) / HK_C(4);
  }
  return hk_excess(at) <= HK_C(HK_EDGE_WITHIN);
}
