/* The straight ways of all frames from one pose to another, each turning evenly about one axis, and of the level to that
   of a leaf. turn: the size of all turns together. hk_angular: rows of g that are angles. */
typedef struct {
  hk_line line[HK_FRAMES];
  hk_t end[HK_TARGET], level[HK_R + 1], change[HK_R + 1], turn;
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

/* The way from the poses (p, R) of a posture on the level g to the poses `to` on the leaf c. What a task leaves free of
   them is as it is at the beginning: hk_completed_body takes (p0, R0, p, R), and gives (p, R). */
static void hk_way_to(const hk_t *from, const hk_t *g, const hk_t *to, const hk_t *c, hk_way *way) {
  hk_t square = HK_C(0), E[9];
  for (int i = 0; i < HK_TARGET; i++) way->end[i] = to[i];
#ifdef HK_LEAVES_FREE
  hk_t both[2 * HK_TARGET];
  for (int i = 0; i < HK_TARGET; i++) both[i] = from[i], both[HK_TARGET + i] = to[i];
  hk_completed_body(both, way->end);
  to = way->end;
#endif
  for (int f = 0; f < HK_FRAMES; f++) {
    hk_line *line = way->line + f;
    const hk_t *p = from + 3 * f, *R = from + 3 * HK_FRAMES + 9 * f, *there = to + 3 * HK_FRAMES + 9 * f;
    for (int i = 0; i < 3; i++) {
      line->center[i] = p[i];
      line->v[i] = to[3 * f + i] - p[i];
      for (int j = 0; j < 3; j++) {
        line->rotation[3 * i + j] = R[3 * i + j];
        E[3 * i + j] = HK_C(0);
        for (int k = 0; k < 3; k++) E[3 * i + j] += there[3 * i + k] * R[3 * j + k];
      }
    }
    hk_turning(E, line->turn);
    square += hk_square(line->turn);
  }
  way->turn = HK_SQRT(square);
  for (int i = 0; i < HK_R; i++) {
    const hk_t gap = c[i] - g[i];
    way->level[i] = g[i];
    way->change[i] = hk_angular[i] ? HK_ATAN2(HK_SIN(gap), HK_COS(gap)) : gap;
  }
}

/* (p, R, c) of the way at a share, after q in x. */
static void hk_aim(const hk_way *way, hk_t share, hk_t *x) {
  hk_targets(way->line, share, x + HK_N);
  for (int i = 0; i < HK_TARGET && share == HK_C(1); i++) x[HK_N + i] = way->end[i]; /* to the last bit */
  for (int i = 0; i < HK_R; i++) x[HK_N + HK_TARGET + i] = way->level[i] + share * way->change[i];
}

/* (p, R) of 4x4 matrices by rows, one a frame. */
static void hk_unpack(const hk_t *T, hk_t *to) {
  for (int f = 0; f < HK_FRAMES; f++, T += 16)
    for (int i = 0; i < 3; i++) {
      to[3 * f + i] = T[4 * i + 3];
      for (int j = 0; j < 3; j++) to[3 * HK_FRAMES + 9 * f + 3 * i + j] = T[4 * i + j];
    }
}

/* How fast the row of a task goes along a way, of rows counted six a frame: x, y, z and the turns about them. */
static inline hk_t hk_pace(const hk_way *way, int row) {
  const hk_line *line = way->line + row / 6;
  return row % 6 < 3 ? line->v[row % 6] : line->turn[row % 6 - 3];
}

/* 1 where the rows of R are perpendicular, of length 1 and right-handed. */
static int hk_rotates(const hk_t *R) {
  const hk_t det = R[0] * (R[4] * R[8] - R[5] * R[7]) - R[1] * (R[3] * R[8] - R[5] * R[6]) +
                   R[2] * (R[3] * R[7] - R[4] * R[6]);
  int sound = det > HK_C(0);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j <= i; j++) {
      const hk_t dot = R[3 * i] * R[3 * j] + R[3 * i + 1] * R[3 * j + 1] + R[3 * i + 2] * R[3 * j + 2];
      sound &= HK_FABS(dot - (i == j ? HK_C(1) : HK_C(0))) < HK_C(HK_ROTATION);
    }
  return sound;
}

/* 1 where that is so of the rotations of all frames of a target. */
static int hk_all_rotate(const hk_t *to) {
  int sound = 1;
  for (int f = 0; f < HK_FRAMES; f++) sound &= hk_rotates(to + 3 * HK_FRAMES + 9 * f);
  return sound;
}
