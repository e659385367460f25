/* Which postures lie on one branch of a leaf: the tubes of motion/ik/branch.py. hk_extended_body takes q and gives A and
   A^-1, (n, n) each by rows; hk_change_body the pairs of dA/dq_k, k slowest, then columns. HK_ROWS: task rows;
   hk_turns: the first of the three angular rows of each rotation among them, HK_TURNS of these; HK_ANGLES: 1 where there
   are angular rows besides. */
typedef struct {
  hk_t center[HK_N], half[HK_N], along[HK_N], radius, change, bend, inverse;
} hk_tube;

typedef struct {
  hk_t share, offset[HK_N];
} hk_place;

typedef struct {
  hk_tube tube;
  hk_place at;
  hk_t length;
  int laid;
} hk_branch;

static hk_t hk_dot(const hk_t *a, const hk_t *b) {
  hk_t sum = HK_C(0);
  for (int i = 0; i < HK_N; i++) sum += a[i] * b[i];
  return sum;
}

static void hk_find(const hk_tube *tube, const hk_t *q, hk_place *at) {
  for (int i = 0; i < HK_N; i++) at->offset[i] = q[i] - tube->center[i];
  at->share = HK_FMIN(HK_C(1), HK_FMAX(HK_C(-1), hk_dot(tube->along, at->offset)));
  for (int i = 0; i < HK_N; i++) at->offset[i] -= at->share * tube->half[i];
}

/* 1 when a posture at b is on the branch of one at a; curve: the second derivative of x on the way, by the share. */
static int hk_links(const hk_tube *tube, const hk_place *a, const hk_place *b, hk_t curve) {
  const hk_t along = HK_FABS(b->share - a->share);
  const hk_t u = hk_dot(a->offset, a->offset), v = hk_dot(b->offset, b->offset), off = HK_FMAX(u, v);
  hk_t away = HK_C(0);
  if (!(tube->change <= HK_C(HK_CHANGE) && off < tube->radius * tube->radius)) return 0;
  for (int i = 0; i < HK_N; i++) away += (b->offset[i] - a->offset[i]) * (b->offset[i] - a->offset[i]);
  away = HK_SQRT(away);
  const hk_t more = (HK_C(2) * along + away / tube->radius) * tube->change * away;
  const hk_t second = along * along * tube->bend + more + tube->inverse * curve;
  return HK_SQRT(off) + second / HK_C(8) / (HK_C(1) - tube->change) <= tube->radius;
}

/* W = Y M of an M (n, n) that lies by columns; with sizes |Y| M. */
static void hk_spread(const hk_t *Y, const hk_t *M, int sizes, hk_t *W) {
  for (int i = 0; i < HK_N; i++)
    for (int j = 0; j < HK_N; j++) {
      hk_t sum = HK_C(0);
      for (int k = 0; k < HK_N; k++) sum += (sizes ? HK_FABS(Y[i * HK_N + k]) : Y[i * HK_N + k]) * M[j * HK_N + k];
      W[i * HK_N + j] = sum;
    }
}

#ifdef HK_ENCLOSED
/* change and bend of a tube, enclosed; 0 where they have no bound. */
static int hk_enclose(hk_tube *tube, const hk_t *Y) {
  enum { SQUARE = HK_N * HK_N };
  hk_t box[2 * HK_N], pairs[2 * HK_N * SQUARE], mid[SQUARE], rad[SQUARE], M[SQUARE], R[SQUARE];
  hk_t along = HK_C(0), across = HK_C(0), bend = HK_C(0);
  for (int i = 0; i < HK_N; i++) {
    box[i] = tube->center[i];
    box[HK_N + i] = HK_FABS(tube->half[i]) + tube->radius;
  }
  hk_change_body(box, pairs);
  for (int e = 0; e < SQUARE; e++) mid[e] = rad[e] = HK_C(0);
  for (int k = 0; k < HK_N; k++) {
    const hk_t *one = pairs + k * SQUARE, *wide = pairs + (HK_N + k) * SQUARE;
    for (int e = 0; e < SQUARE; e++) mid[e] += tube->half[k] * one[e], rad[e] += HK_FABS(tube->half[k]) * wide[e];
    hk_spread(Y, one, 0, M);
    hk_spread(Y, wide, 1, R);
    for (int e = 0; e < SQUARE; e++) across += (HK_FABS(M[e]) + R[e]) * (HK_FABS(M[e]) + R[e]);
  }
  hk_spread(Y, mid, 0, M);
  hk_spread(Y, rad, 1, R);
  for (int i = 0; i < HK_N; i++) {
    hk_t sum = HK_C(0), more = HK_C(0);
    for (int j = 0; j < HK_N; j++) {
      const hk_t size = HK_FABS(M[i * HK_N + j]) + R[i * HK_N + j];
      along += size * size;
      sum += M[i * HK_N + j] * tube->half[j];
      more += R[i * HK_N + j] * HK_FABS(tube->half[j]);
    }
    bend += (HK_FABS(sum) + more) * (HK_FABS(sum) + more);
  }
  tube->change = HK_SQRT(along) + tube->radius * HK_SQRT(across);
  tube->bend = HK_SQRT(bend);
  return tube->change - tube->change == HK_C(0);
}
#endif

/* change and bend of a tube, sampled at its ends and quarters and off its middle in a few perpendicular directions. */
static void hk_sample(hk_tube *tube, const hk_t *A, const hk_t *Y) {
  enum { SQUARE = HK_N * HK_N, COUNT = HK_N < HK_DIRECTIONS ? HK_N : HK_DIRECTIONS };
  const hk_t shares[4] = {HK_C(-1), HK_C(-0.5), HK_C(0.5), HK_C(1)}, step = HK_C(3.14159265358979323846) / HK_C(HK_N);
  hk_t q[HK_N], there[2 * SQUARE + 1], M[SQUARE], D[SQUARE], most = HK_C(0), across = HK_C(0), bend = HK_C(0);
  for (int s = 0; s < 4 + COUNT; s++) {
    hk_t size = HK_C(0), turn = HK_C(0);
    for (int i = 0; i < HK_N; i++) {
      const hk_t wave = HK_COS(step * (HK_C(s - 4) * (HK_C(i) + HK_C(0.5)))) * HK_SQRT(HK_C(s == 4 ? 1 : 2) / HK_C(HK_N));
      q[i] = tube->center[i] + (s < 4 ? shares[s] * tube->half[i] : tube->radius * wave);
    }
    hk_extended_body(q, there);
    for (int i = 0; i < HK_N; i++)
      for (int j = 0; j < HK_N; j++) D[j * HK_N + i] = there[i * HK_N + j] - A[i * HK_N + j];
    hk_spread(Y, D, 0, M);
    for (int i = 0; i < HK_N; i++) {
      hk_t sum = HK_C(0);
      for (int j = 0; j < HK_N; j++) {
        size += M[i * HK_N + j] * M[i * HK_N + j];
        sum += M[i * HK_N + j] * tube->half[j];
      }
      turn += sum * sum;
    }
    if (s >= 4)
      across += size;
    else
      most = HK_FMAX(size, most);
    if (s == 0 || s == 3) bend = HK_FMAX(turn, bend);
    if (!(size - size == HK_C(0))) across = size; /* what is not a number stays */
  }
  tube->change = HK_C(HK_DOUBT) * (HK_SQRT(most) + HK_SQRT(HK_C(HK_N) / HK_C(COUNT) * across));
  tube->bend = HK_C(HK_DOUBT) * HK_SQRT(bend);
}

/* The tube that begins at q and goes on by 2 half. */
static void hk_lay(hk_tube *tube, const hk_t *q, const hk_t *half) {
  hk_t both[2 * HK_N * HK_N + 1];
  const hk_t *A = both, *Y = both + HK_N * HK_N, square = hk_dot(half, half);
  hk_t size = HK_C(0);
  for (int i = 0; i < HK_N; i++) {
    tube->center[i] = q[i] + half[i];
    tube->half[i] = half[i];
    tube->along[i] = half[i] / square;
  }
  tube->radius = HK_C(HK_THICKNESS) * HK_SQRT(square);
  hk_extended_body(tube->center, both);
#ifdef HK_ENCLOSED
  if (!hk_enclose(tube, Y) && tube->radius <= HK_C(HK_THICKNESS) * HK_C(HK_SWITCH))
#endif
    hk_sample(tube, A, Y);
  for (int i = 0; i < HK_N; i++)
    for (int j = 0; j < HK_ROWS; j++) size += Y[i * HK_N + j] * Y[i * HK_N + j];
  tube->inverse = HK_SQRT(size);
  for (int f = 0; f < HK_TURNS; f++) { /* an error's rotation vector turns its own axes, by at most 0.6 of itself */
    hk_t turns = HK_C(0), rates = HK_C(0);
    for (int i = 0; i < HK_N; i++)
      for (int j = hk_turns[f]; j < hk_turns[f] + 3; j++) {
        turns += Y[i * HK_N + j] * Y[i * HK_N + j];
        rates += A[j * HK_N + i] * A[j * HK_N + i];
      }
    tube->change += HK_C(1.2) * tube->radius * HK_SQRT(HK_C(HK_N)) * HK_SQRT(turns) * HK_SQRT(rates);
  }
}

static hk_t hk_shrink(hk_t change) {
  if (!(change - change == HK_C(0))) return HK_C(1) / HK_C(64);
  if (change <= HK_C(HK_CHANGE)) return HK_C(0.5);
  return HK_FMAX(HK_C(1) / HK_C(64), HK_FMIN(HK_C(0.9), HK_C(0.8) * HK_C(HK_CHANGE) / change));
}

/* How long the next step may be, as a share of this one: 1 to 2 when b is on the branch of a, where the last step led;
   below 1 when this one is too long to tell. */
static hk_t hk_branch_step(hk_branch *branch, const hk_t *a, const hk_t *b, hk_t curve) {
  hk_place from, there;
  hk_tube tube;
  hk_t move[HK_N], half[HK_N], change = HK_INF;
  if (branch->laid) {
    hk_find(&branch->tube, b, &there);
    if (hk_links(&branch->tube, &branch->at, &there, curve)) {
      branch->at = there;
      return HK_C(2);
    }
  }
  for (int i = 0; i < HK_N; i++) move[i] = b[i] - a[i];
  const hk_t size = HK_SQRT(hk_dot(move, move));
  if (size == HK_C(0)) return curve <= HK_C(HK_RESTS) ? HK_C(2) : HK_C(0.5); /* rests, or comes back within the step */
  for (int tried = 0; tried < HK_LAID; tried++) {
    const hk_t length = HK_FMAX(branch->length, size / HK_C(2));
    for (int i = 0; i < HK_N; i++) half[i] = move[i] * (length / size);
    hk_lay(&tube, a, half);
    change = tube.change;
    hk_find(&tube, a, &from);
    hk_find(&tube, b, &there);
    if (hk_links(&tube, &from, &there, curve)) {
      branch->tube = tube;
      branch->at = there;
      branch->laid = 1;
      branch->length = length * HK_FMIN(HK_C(1.5), HK_SQRT(HK_C(0.7) * HK_C(HK_CHANGE) / change));
      return HK_FMIN(HK_C(2), HK_FMAX(HK_C(1), HK_C(2) * branch->length / size));
    }
    if (length <= size / HK_C(2)) break;
    branch->length = length * hk_shrink(change);
  }
  branch->laid = 0;
  return hk_shrink(change);
}
