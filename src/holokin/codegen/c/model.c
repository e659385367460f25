/* Taylor models, symbolic/taylor.py: m + a t + b t^2 + sum e[j] u_j, give or take r, for |t| <= 1 and |u_j| <= 1.
   s: the sum of |e[j]|. The result may lie where an argument does. */
enum { HK_WIDE = (HK_N + 3) / 4 * 4 };

typedef struct {
  hk_t m, a, b, r, s, e[HK_WIDE];
} hk_model;

static inline void hk_model_constant(hk_t value, hk_model *z) {
  z->m = value;
  z->a = z->b = z->r = z->s = HK_C(0);
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
  const hk_t m = x->m + sign * y->m, a = x->a + sign * y->a, b = x->b + sign * y->b, r = x->r + y->r;
  hk_model_spread(x, HK_C(1), y, sign, z);
  z->m = m, z->a = a, z->b = b, z->r = r;
}

static inline void hk_model_scale(const hk_model *x, hk_t k, hk_model *z) {
  z->m = k * x->m, z->a = k * x->a, z->b = k * x->b;
  z->r = HK_FABS(k) * x->r, z->s = HK_FABS(k) * x->s;
  HK_SIMD for (int j = 0; j < HK_WIDE; j++) z->e[j] = k * x->e[j];
}

HK_CALL static void hk_model_times(const hk_model *x, const hk_model *y, hk_model *z) {
  const hk_t p = HK_FABS(x->a) + HK_FABS(x->b), q = HK_FABS(y->a) + HK_FABS(y->b), s = x->s, t = y->s;
  const hk_t third = HK_FABS(x->a * y->b + x->b * y->a) + HK_FABS(x->b * y->b) + p * t + s * q + s * t;
  const hk_t r = third + x->r * (HK_FABS(y->m) + q + t + y->r) + (HK_FABS(x->m) + p + s) * y->r;
  const hk_t m = x->m * y->m, a = x->m * y->a + x->a * y->m, b = x->m * y->b + x->a * y->a + x->b * y->m;
  hk_model_spread(x, y->m, y, x->m, z);
  z->m = m, z->a = a, z->b = b, z->r = r;
}

/* Half the width of x about its middle. */
static inline hk_t hk_model_width(const hk_model *x) { return HK_FABS(x->a) + HK_FABS(x->b) + x->r + x->s; }

/* f(x) of the value and two derivatives of f at the middle, and a bound of the third over the width. */
static inline void hk_model_apply(const hk_model *x, hk_t f, hk_t f1, hk_t f2, hk_t f3, hk_model *z) {
  const hk_t p = HK_FABS(x->a) + HK_FABS(x->b), g = x->r + x->s, width = p + g;
  const hk_t square = HK_C(2) * HK_FABS(x->a * x->b) + x->b * x->b + HK_C(2) * p * g + g * g;
  const hk_t r = HK_FABS(f1) * x->r + HK_FABS(f2) * square / HK_C(2) + f3 / HK_C(6) * width * width * width;
  const hk_t a = f1 * x->a, b = f1 * x->b + f2 / HK_C(2) * x->a * x->a;
  hk_model_scale(x, f1, z);
  z->m = f, z->a = a, z->b = b, z->r = r;
}

HK_CALL static void hk_model_sin(const hk_model *x, hk_model *z) {
  const hk_t s = HK_SIN(x->m), c = HK_COS(x->m);
  hk_model_apply(x, s, c, -s, HK_C(1), z);
}

HK_CALL static void hk_model_cos(const hk_model *x, hk_model *z) {
  const hk_t s = HK_SIN(x->m), c = HK_COS(x->m);
  hk_model_apply(x, c, -s, -c, HK_C(1), z);
}

HK_CALL static void hk_model_inverse(const hk_model *x, hk_model *z) {
  const hk_t one = HK_C(1) / x->m, near = HK_FABS(x->m) - hk_model_width(x), most = HK_C(1) / near;
  const hk_t third = near > HK_C(0) ? HK_C(6) * most * most * most * most : HK_INF;
  hk_model_apply(x, one, -one * one, HK_C(2) * one * one * one, third, z);
}

HK_CALL static void hk_model_sqrt(const hk_model *x, hk_model *z) {
  const hk_t root = HK_SQRT(x->m), near = x->m - hk_model_width(x);
  const hk_t third = near > HK_C(0) ? HK_C(0.375) / (near * near * HK_SQRT(near)) : HK_INF;
  hk_model_apply(x, root, HK_C(0.5) / root, HK_C(-0.25) / (x->m * root), third, z);
}

HK_CALL static void hk_model_over(const hk_model *x, const hk_model *y, hk_model *z) {
  hk_model one;
  hk_model_inverse(y, &one);
  hk_model_times(x, &one, z);
}
