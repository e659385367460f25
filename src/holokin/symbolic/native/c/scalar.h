/* hk_t is one number: a double, or with HK_FLOAT a float. HK_API goes before what others may call. */
#include <math.h>

#ifndef HK_API
#define HK_API
#endif

#ifndef HK_FLOAT
typedef double hk_t;
#define HK_F(name) name
#else
typedef float hk_t;
#define HK_F(name) name##f
#endif

#ifndef HK_SIMD
#define HK_SIMD _Pragma("omp simd")
#endif
#ifndef HK_SOUND
#define HK_SOUND(c, m) ((c) > HK_C(HK_SINGULAR) && (m) > HK_C(HK_REPRESENTATION))
#endif
#ifdef __GNUC__
#define HK_CALL __attribute__((noinline)) /* small code, and quick to compile */
#else
#define HK_CALL
#endif
#define HK_C(x) ((hk_t)(x))
#define HK_INF ((hk_t)HUGE_VAL)
#define HK_NAN (HK_INF - HK_INF)
#define HK_SQRT(x) HK_F(sqrt)(x)
#define HK_SIN(x) HK_F(sin)(x)
#define HK_COS(x) HK_F(cos)(x)
#define HK_TAN(x) HK_F(tan)(x)
#define HK_ASIN(x) HK_F(asin)(x)
#define HK_ACOS(x) HK_F(acos)(x)
#define HK_ATAN(x) HK_F(atan)(x)
#define HK_ATAN2(y, x) HK_F(atan2)(y, x)
#define HK_EXP(x) HK_F(exp)(x)
#define HK_LOG(x) HK_F(log)(x)
#define HK_SINH(x) HK_F(sinh)(x)
#define HK_COSH(x) HK_F(cosh)(x)
#define HK_TANH(x) HK_F(tanh)(x)
#define HK_ASINH(x) HK_F(asinh)(x)
#define HK_ACOSH(x) HK_F(acosh)(x)
#define HK_ATANH(x) HK_F(atanh)(x)
#define HK_ERF(x) HK_F(erf)(x)
#define HK_LOG1P(x) HK_F(log1p)(x)
#define HK_EXPM1(x) HK_F(expm1)(x)
#define HK_FLOOR(x) HK_F(floor)(x)
#define HK_CEIL(x) HK_F(ceil)(x)
#define HK_FABS(x) HK_F(fabs)(x)
#define HK_POW(x, y) HK_F(pow)(x, y)
#define HK_FMOD(x, y) HK_F(fmod)(x, y)
#define HK_HYPOT(x, y) HK_F(hypot)(x, y)
#define HK_COPYSIGN(x, y) HK_F(copysign)(x, y)
#define HK_FMIN(a, b) ((a) < (b) ? (a) : (b))
#define HK_FMAX(a, b) ((a) > (b) ? (a) : (b))
#define HK_LT(a, b) ((a) < (b) ? HK_C(1) : HK_C(0))
#define HK_LE(a, b) ((a) <= (b) ? HK_C(1) : HK_C(0))
#define HK_EQ(a, b) ((a) == (b) ? HK_C(1) : HK_C(0))
#define HK_NE(a, b) ((a) != (b) ? HK_C(1) : HK_C(0))
#define HK_TRUE(a) ((a) != HK_C(0))
#define HK_NOT(a) (HK_TRUE(a) ? HK_C(0) : HK_C(1))
#define HK_AND(a, b) (HK_TRUE(a) && HK_TRUE(b) ? HK_C(1) : HK_C(0))
#define HK_OR(a, b) (HK_TRUE(a) || HK_TRUE(b) ? HK_C(1) : HK_C(0))
#define HK_IF(c, a) (HK_TRUE(c) ? (a) : HK_C(0))
#define HK_SIGN(a) ((a) > HK_C(0) ? HK_C(1) : (a) < HK_C(0) ? HK_C(-1) : (a))
