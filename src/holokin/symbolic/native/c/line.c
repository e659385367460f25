/* A straight way with an even turn of the tool, and rotations by rotation vectors: the same as ways.py. */
typedef struct {
  hk_t center[3], v[3], turn[3], rotation[9];
} hk_line;

/* Numbers of a target of HK_FRAMES frames: all their positions p, 3 each, then all rotations R, 9 each by rows. */
enum { HK_TARGET = 12 * HK_FRAMES };

static hk_t hk_square(const hk_t *v) { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }

/* R = exp(w) times a rotation, both by rows. */
static void hk_turned(const hk_t *w, const hk_t *rotation, hk_t *R) {
  const hk_t angle = HK_SQRT(hk_square(w));
  if (angle == HK_C(0)) {
    for (int i = 0; i < 9; i++) R[i] = rotation[i];
    return;
  }
  const hk_t k[3] = {w[0] / angle, w[1] / angle, w[2] / angle};
  const hk_t c = HK_COS(angle), t = HK_C(1) - c, d = HK_SIN(angle);
  const hk_t E[9] = {c + t * k[0] * k[0],        t * k[0] * k[1] - d * k[2], t * k[0] * k[2] + d * k[1],
                     t * k[1] * k[0] + d * k[2], c + t * k[1] * k[1],        t * k[1] * k[2] - d * k[0],
                     t * k[2] * k[0] - d * k[1], t * k[2] * k[1] + d * k[0], c + t * k[2] * k[2]};
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      R[3 * i + j] = E[3 * i] * rotation[j] + E[3 * i + 1] * rotation[3 + j] + E[3 * i + 2] * rotation[6 + j];
}

static void hk_target(const hk_line *s, hk_t u, hk_t *p, hk_t *R) {
  for (int i = 0; i < 3; i++) p[i] = s->center[i] + u * s->v[i];
  const hk_t w[3] = {u * s->turn[0], u * s->turn[1], u * s->turn[2]};
  hk_turned(w, s->rotation, R);
}

/* The targets of all frames at a share of their lines. */
static void hk_targets(const hk_line *s, hk_t u, hk_t *to) {
  for (int f = 0; f < HK_FRAMES; f++) hk_target(s + f, u, to + 3 * f, to + 3 * HK_FRAMES + 9 * f);
}
