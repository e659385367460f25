/* hk_t is a vector of HK_LANES doubles, one lane a sample; GCC's and Clang's vector types. */
#include <math.h>

#if defined(__AVX512F__)
#define HK_LANES 8
#elif defined(__AVX__)
#define HK_LANES 4
#else
#define HK_LANES 2
#endif

typedef double hk_t __attribute__((vector_size(8 * HK_LANES)));
typedef long long hk_bits __attribute__((vector_size(8 * HK_LANES)));

static inline hk_t hk_all(double x) {
  hk_t r;
  for (int l = 0; l < HK_LANES; l++) r[l] = x;
  return r;
}

static inline hk_t hk_choose(hk_bits mask, hk_t a, hk_t b) {
  return (hk_t)((mask & (hk_bits)a) | (~mask & (hk_bits)b));
}

#define HK_SIGN_BIT ((hk_bits)hk_all(-0.0))
#define HK_SIMD
#define HK_C(x) hk_all(x)
#define HK_INF hk_all(HUGE_VAL)
#define HK_NAN hk_all(NAN)
#define HK_FABS(x) ((hk_t)((hk_bits)(x) & ~HK_SIGN_BIT))
#define HK_COPYSIGN(x, y) ((hk_t)(((hk_bits)(x) & ~HK_SIGN_BIT) | ((hk_bits)(y) & HK_SIGN_BIT)))
#define HK_FMIN(a, b) hk_choose((a) < (b), a, b)
#define HK_FMAX(a, b) hk_choose((a) > (b), a, b)
#define HK_BOOL(mask) ((hk_t)((hk_bits)(mask) & (hk_bits)hk_all(1.0)))
#define HK_LT(a, b) HK_BOOL((a) < (b))
#define HK_LE(a, b) HK_BOOL((a) <= (b))
#define HK_EQ(a, b) HK_BOOL((a) == (b))
#define HK_NE(a, b) HK_BOOL((a) != (b))
#define HK_TRUE(a) ((a) != hk_all(0.0))
#define HK_NOT(a) HK_BOOL(~HK_TRUE(a))
#define HK_AND(a, b) HK_BOOL(HK_TRUE(a) & HK_TRUE(b))
#define HK_OR(a, b) HK_BOOL(HK_TRUE(a) | HK_TRUE(b))
#define HK_IF(c, a) ((hk_t)(HK_TRUE(c) & (hk_bits)(a)))
#define HK_SIGN(a) (HK_LT(hk_all(0.0), a) - HK_LT(a, hk_all(0.0)))

static inline hk_t hk_sqrt(hk_t x) {
#if defined(__AVX512F__) && defined(__GNUC__) && !defined(__clang__)
  for (int l = 0; l < HK_LANES; l++) x[l] = __builtin_sqrt(x[l]);
  return x;
#elif defined(__AVX__) && defined(__GNUC__) && !defined(__clang__)
  return __builtin_ia32_sqrtpd256(x);
#else
  for (int l = 0; l < HK_LANES; l++) x[l] = __builtin_sqrt(x[l]);
  return x;
#endif
}

#define HK_EACH(name, call)                            \
  static inline hk_t name(hk_t x) {                    \
    for (int l = 0; l < HK_LANES; l++) x[l] = call(x[l]); \
    return x;                                          \
  }
#define HK_EACH2(name, call)                                 \
  static inline hk_t name(hk_t x, hk_t y) {                  \
    for (int l = 0; l < HK_LANES; l++) x[l] = call(x[l], y[l]); \
    return x;                                                \
  }
HK_EACH(hk_tan, tan)
HK_EACH(hk_asin, asin)
HK_EACH(hk_acos, acos)
HK_EACH(hk_atan, atan)
HK_EACH(hk_exp, exp)
HK_EACH(hk_log, log)
HK_EACH(hk_sinh, sinh)
HK_EACH(hk_cosh, cosh)
HK_EACH(hk_tanh, tanh)
HK_EACH(hk_asinh, asinh)
HK_EACH(hk_acosh, acosh)
HK_EACH(hk_atanh, atanh)
HK_EACH(hk_erf, erf)
HK_EACH(hk_log1p, log1p)
HK_EACH(hk_expm1, expm1)
HK_EACH(hk_floor, floor)
HK_EACH(hk_ceil, ceil)
HK_EACH(hk_far_sin, sin)
HK_EACH(hk_far_cos, cos)
HK_EACH2(hk_far_atan2, atan2)
HK_EACH2(hk_pow, pow)
HK_EACH2(hk_fmod, fmod)
HK_EACH2(hk_hypot, hypot)

/* Sine and cosine of all lanes at once: reduction by multiples of pi/2 in three parts (Cody and Waite), then the
   minimax polynomials of FDLIBM's k_sin.c and k_cos.c (Sun Microsystems, 1993). Below 1e5 rad the error is under
   2e-16; farther out, and for what is not finite, the library's own. */
#define HK_NEAR 1.0e5
#define HK_TURN 6755399441055744.0 /* 1.5 * 2^52: adding it rounds to an integer */

static inline int hk_near(hk_t x) {
  int near = 1;
  for (int l = 0; l < HK_LANES; l++) near &= (x[l] < HK_NEAR) & (x[l] > -HK_NEAR);
  return near;
}

static inline hk_t hk_sin_part(hk_t x, long long quarter) {
  const hk_t shifted = x * hk_all(6.36619772367581382433e-01) + hk_all(HK_TURN);
  const hk_t k = shifted - hk_all(HK_TURN);
  const hk_bits quadrant = (hk_bits)shifted + quarter;
  const hk_t r = ((x - k * hk_all(1.57079632673412561417e+00)) - k * hk_all(6.07710050630396597660e-11)) -
                 k * hk_all(2.02226624879595063154e-21);
  const hk_t z = r * r;
  const hk_t s = r + r * z * (hk_all(-1.66666666666666324348e-01) + z * (hk_all(8.33333333332248946124e-03) +
                 z * (hk_all(-1.98412698298579493134e-04) + z * (hk_all(2.75573137070700676789e-06) +
                 z * (hk_all(-2.50507602534068634195e-08) + z * hk_all(1.58969099521155010221e-10))))));
  const hk_t c = hk_all(1.0) - (hk_all(0.5) * z - z * z * (hk_all(4.16666666666666019037e-02) +
                 z * (hk_all(-1.38888888888741095749e-03) + z * (hk_all(2.48015872894767294178e-05) +
                 z * (hk_all(-2.75573143513906633035e-07) + z * (hk_all(2.08757232129817482790e-09) +
                 z * hk_all(-1.13596475577881948265e-11)))))));
  const hk_t value = hk_choose((quadrant & 1) != 0, c, s);
  return (hk_t)((hk_bits)value ^ ((quadrant & 2) << 62));
}

static inline hk_t hk_sin(hk_t x) { return hk_near(x) ? hk_sin_part(x, 0) : hk_far_sin(x); }
static inline hk_t hk_cos(hk_t x) { return hk_near(x) ? hk_sin_part(x, 1) : hk_far_cos(x); }

/* atan2(y, x) of all lanes at once: r = lesser / greater of |x|, |y|, or (r - 1) / (r + 1) of one above tan(pi/8), by the
   minimax polynomial of FDLIBM's s_atan.c (Sun Microsystems, 1993); of what is not finite, or huge, the library's own. */
#define HK_HUGE 1.0e150

static inline hk_t hk_atan2(hk_t y, hk_t x) {
  int near = 1;
  for (int l = 0; l < HK_LANES; l++) near &= (x[l] < HK_HUGE) & (x[l] > -HK_HUGE) & (y[l] < HK_HUGE) & (y[l] > -HK_HUGE);
  if (!near) return hk_far_atan2(y, x);
  const hk_t across = HK_FABS(y), along = HK_FABS(x);
  const hk_bits steep = across > along;
  const hk_t low = hk_choose(steep, along, across), high = hk_choose(steep, across, along);
  const hk_bits wide = low > hk_all(4.14213562373095034349e-01) * high;
  const hk_t bottom = hk_choose(wide, low + high, high);
  const hk_t r = hk_choose(wide, low - high, low) / hk_choose(bottom == 0.0, hk_all(1.0), bottom);
  const hk_t z = r * r, w = z * z;
  const hk_t odd = z * (hk_all(3.33333333333329318027e-01) + w * (hk_all(1.42857142725034663711e-01) +
                   w * (hk_all(9.09088713343650656196e-02) + w * (hk_all(6.66107313738753120669e-02) +
                   w * (hk_all(4.97687799461593236017e-02) + w * hk_all(1.62858201153657823623e-02))))));
  const hk_t even = w * (hk_all(-1.99999999998764832476e-01) + w * (hk_all(-1.11111104054623557880e-01) +
                    w * (hk_all(-7.69187620504482999495e-02) + w * (hk_all(-5.83357013379057348645e-02) +
                    w * hk_all(-3.65315727442169155270e-02)))));
  const hk_t part = r * (odd + even);
  const hk_t small = hk_choose(wide, hk_all(7.85398163397448278999e-01) - ((part - hk_all(3.06161699786838301793e-17)) - r), r - part);
  const hk_t first = hk_choose(steep, hk_all(1.57079632679489655800e+00) - (small - hk_all(6.12323399573676603587e-17)), small);
  const hk_bits back = (hk_bits)x < 0;
  const hk_t angle = hk_choose(back, hk_all(3.14159265358979311600e+00) - (first - hk_all(1.22464679914735317723e-16)), first);
  return HK_COPYSIGN(angle, y);
}

#define HK_SQRT hk_sqrt
#define HK_SIN hk_sin
#define HK_COS hk_cos
#define HK_TAN hk_tan
#define HK_ASIN hk_asin
#define HK_ACOS hk_acos
#define HK_ATAN hk_atan
#define HK_ATAN2 hk_atan2
#define HK_EXP hk_exp
#define HK_LOG hk_log
#define HK_SINH hk_sinh
#define HK_COSH hk_cosh
#define HK_TANH hk_tanh
#define HK_ASINH hk_asinh
#define HK_ACOSH hk_acosh
#define HK_ATANH hk_atanh
#define HK_ERF hk_erf
#define HK_LOG1P hk_log1p
#define HK_EXPM1 hk_expm1
#define HK_FLOOR hk_floor
#define HK_CEIL hk_ceil
#define HK_POW hk_pow
#define HK_FMOD hk_fmod
#define HK_HYPOT hk_hypot
