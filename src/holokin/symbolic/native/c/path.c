/* A path of segments, each a piece of an arc plus a cubic, on which the tool turns by a cubic rotation vector: the same
   as path/path.py. bend, sway: bounds of its second derivative and of its turn. */
typedef struct {
  double center[3], x[3], y[3], angle, along[9], turning[12], rotation[9], duration, bend, sway;
} hk_segment;

static void hk_on(const hk_segment *s, double u, double *p, double *R) {
  const double a = s->angle * u, ca = cos(a), sa = sin(a), *b = s->along, *t = s->turning;
  double w[3];
  for (int i = 0; i < 3; i++) {
    p[i] = s->center[i] + ca * s->x[i] + sa * s->y[i] + (u * b[i] + u * u * (b[3 + i] + u * b[6 + i]));
    w[i] = t[i] + u * (t[3 + i] + u * (t[6 + i] + u * t[9 + i]));
  }
  hk_turned(w, s->rotation, R);
}

/* The targets of all frames, whose segments lie `apart` from one another. */
static void hk_all_on(const hk_segment *s, long long apart, double u, double *to) {
  for (int f = 0; f < HK_FRAMES; f++) hk_on(s + f * apart, u, to + 3 * f, to + 3 * HK_FRAMES + 9 * f);
}

static void hk_cross(const double *a, const double *b, double *c) {
  for (int i = 0; i < 3; i++) c[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

/* The velocity v and the angular velocity w at u. */
static void hk_speed(const hk_segment *s, double u, double *v, double *w) {
  const double a = s->angle * u, ca = cos(a), sa = sin(a), *b = s->along, *t = s->turning;
  double phi[3], rate[3], once[3], more[3], f = 0.5, g = 1.0 / 6.0;
  int even = 1;
  for (int i = 0; i < 3; i++) {
    const double arc = s->angle * (ca * s->y[i] - sa * s->x[i]);
    v[i] = (arc + (b[i] + u * (2.0 * b[3 + i] + 3.0 * u * b[6 + i]))) / s->duration;
    phi[i] = t[i] + u * (t[3 + i] + u * (t[6 + i] + u * t[9 + i]));
    rate[i] = t[3 + i] + u * (2.0 * t[6 + i] + 3.0 * u * t[9 + i]);
    even &= t[6 + i] == 0.0 && t[9 + i] == 0.0;
  }
  for (int i = 0; i < 3; i++) w[i] = (even ? t[3 + i] : rate[i]) / s->duration;
  if (even) return;
  const double q = hk_square(phi), angle = sqrt(q);
  if (angle < 0.3) { /* (1 - cos) / angle^2 and (angle - sin) / angle^3 by their series */
    f -= q * (1.0 / 24 - q * (1.0 / 720 - q * (1.0 / 40320 - q / 3628800)));
    g -= q * (1.0 / 120 - q * (1.0 / 5040 - q * (1.0 / 362880 - q / 39916800)));
  } else {
    const double h = sin(angle / 2.0) / angle;
    f = 2.0 * h * h;
    g = (angle - sin(angle)) / (angle * q);
  }
  hk_cross(phi, rate, once);
  hk_cross(phi, once, more);
  for (int i = 0; i < 3; i++) w[i] += (f * once[i] + g * more[i]) / s->duration;
}
