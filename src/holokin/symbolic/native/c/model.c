#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("O3") /* short loops unrolled: a quarter of the time */
#endif

/* Taylor models, symbolic/calculus.py: m + a t + b t^2 + c t^3 + sum e[j] u_j, give or take r, for |t| <= 1 and |u_j| <= 1;
   give or take r0 where all u_j are 0. s: the sum of |e[j]|. The result may lie where an argument does. */
enum { HK_WIDE = (HK_N + 3) / 4 * 4 };

typedef struct {
  hk_t m, a, b, c, r0, r, s, e[HK_WIDE];
} hk_model;

static inline void hk_model_constant(hk_t value, hk_model *z) {
  z->m = value;
  z->a = z->b = z->c = z->r0 = z->r = z->s = HK_C(0);
  for (int j = 0; j < HK_WIDE; j++) z->e[j] = HK_C(0);
}

/* k x + l y in the e of z, and their sizes. */
static inline void hk_model_spread(const hk_model *x, hk_t k, const hk_model *y, hk_t l, hk_model *z) {
  hk_t sum[4] = {HK_C(0), HK_C(0), HK_C(0), HK_C(0)}; /* four at once: one after another would take longest */
  for (int j = 0; j < HK_WIDE; j += 4)
    HK_SIMD for (int i = 0; i < 4; i++) {
      const hk_t part = k * x->e[j + i] + l * y->e[j + i];
      z->e[j + i] = part;
      sum[i] += HK_FABS(part);
    }
  z->s = (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

static inline void hk_model_plus(const hk_model *x, const hk_model *y, hk_t sign, hk_model *z) {
  hk_model_spread(x, HK_C(1), y, sign, z);
  z->m = x->m + sign * y->m, z->a = x->a + sign * y->a, z->b = x->b + sign * y->b, z->c = x->c + sign * y->c;
  z->r0 = x->r0 + y->r0, z->r = x->r + y->r;
}

static inline void hk_model_scale(const hk_model *x, hk_t k, hk_model *z) {
  const hk_t size = HK_FABS(k);
  z->m = k * x->m, z->a = k * x->a, z->b = k * x->b, z->c = k * x->c;
  z->r0 = size * x->r0, z->r = size * x->r, z->s = size * x->s;
  HK_SIMD for (int j = 0; j < HK_WIDE; j++) z->e[j] = k * x->e[j];
}

/* How far x can be from its middle on the curve, but for r0. */
static inline hk_t hk_model_swing(const hk_model *x) { return HK_FABS(x->a) + HK_FABS(x->b) + HK_FABS(x->c); }

HK_CALL static void hk_model_times(const hk_model *x, const hk_model *y, hk_model *z) {
  const hk_t p = hk_model_swing(x), q = hk_model_swing(y), s = x->s, t = y->s, k = x->m, l = y->m;
  const hk_t high = HK_FABS(x->a * y->c + x->b * y->b + x->c * y->a) + HK_FABS(x->b * y->c + x->c * y->b) +
                    HK_FABS(x->c * y->c);
  const hk_t r0 = high + x->r0 * (HK_FABS(l) + q + y->r0) + (HK_FABS(k) + p) * y->r0;
  const hk_t r = high + p * t + s * q + s * t + x->r * (HK_FABS(l) + q + t + y->r) + (HK_FABS(k) + p + s) * y->r;
  const hk_t a = k * y->a + x->a * l, b = k * y->b + x->a * y->a + x->b * l;
  const hk_t c = k * y->c + x->a * y->b + x->b * y->a + x->c * l;
  hk_model_spread(x, l, y, k, z);
  z->m = k * l, z->a = a, z->b = b, z->c = c, z->r0 = r0, z->r = r;
}

/* Half the width of x about its middle. */
static inline hk_t hk_model_width(const hk_model *x) { return hk_model_swing(x) + x->r + x->s; }

/* f(x) of the value and three derivatives of f at the middle, and a bound of the fourth over the width. */
static inline void hk_model_apply(const hk_model *x, hk_t f, hk_t f1, hk_t f2, hk_t f3, hk_t f4, hk_model *z) {
  const hk_t p = hk_model_swing(x), g = x->r + x->s, width = p + g, near = p + x->r0, two = HK_FABS(f2) / HK_C(2);
  const hk_t three = HK_FABS(f3) / HK_C(6), four = f4 / HK_C(24), cube = HK_FABS(x->a) * x->a * x->a;
  const hk_t high = HK_C(2) * HK_FABS(x->a * x->c) + x->b * x->b + HK_C(2) * HK_FABS(x->b * x->c) + x->c * x->c;
  const hk_t r0 = HK_FABS(f1) * x->r0 + two * (high + (HK_C(2) * p + x->r0) * x->r0) +
                  three * (near * near * near - cube) + four * (near * near) * (near * near);
  const hk_t r = HK_FABS(f1) * x->r + two * (high + (HK_C(2) * p + g) * g) + three * (width * width * width - cube) +
                 four * (width * width) * (width * width);
  const hk_t a = f1 * x->a, b = f1 * x->b + f2 / HK_C(2) * x->a * x->a;
  const hk_t c = f1 * x->c + f2 * x->a * x->b + f3 / HK_C(6) * x->a * x->a * x->a;
  hk_model_scale(x, f1, z);
  z->m = f, z->a = a, z->b = b, z->c = c, z->r0 = r0, z->r = r;
}

HK_CALL static void hk_model_sin(const hk_model *x, hk_model *z) {
  const hk_t s = HK_SIN(x->m), c = HK_COS(x->m);
  hk_model_apply(x, s, c, -s, -c, HK_C(1), z);
}

HK_CALL static void hk_model_cos(const hk_model *x, hk_model *z) {
  const hk_t s = HK_SIN(x->m), c = HK_COS(x->m);
  hk_model_apply(x, c, -s, -c, s, HK_C(1), z);
}

HK_CALL static void hk_model_inverse(const hk_model *x, hk_model *z) {
  const hk_t one = HK_C(1) / x->m, two = one * one, near = HK_FABS(x->m) - hk_model_width(x), most = HK_C(1) / near;
  const hk_t fourth = near > HK_C(0) ? HK_C(24) * most * (most * most) * (most * most) : HK_INF;
  hk_model_apply(x, one, -two, HK_C(2) * one * two, HK_C(-6) * two * two, fourth, z);
}

HK_CALL static void hk_model_sqrt(const hk_model *x, hk_model *z) {
  const hk_t root = HK_SQRT(x->m), near = x->m - hk_model_width(x), over = HK_C(1) / x->m;
  const hk_t fourth = near > HK_C(0) ? HK_C(0.9375) / (near * near * near * HK_SQRT(near)) : HK_INF;
  const hk_t first = HK_C(0.5) / root, second = HK_C(-0.5) * first * over;
  hk_model_apply(x, root, first, second, HK_C(-1.5) * second * over, fourth, z);
}

HK_CALL static void hk_model_over(const hk_model *x, const hk_model *y, hk_model *z) {
  hk_model one;
  hk_model_inverse(y, &one);
  hk_model_times(x, &one, z);
}
