/* de-luca-oriolo, position of ppr. Written by holokin 0.2.0; see ppr.h. C99; not for -ffast-math, which hides what is not finite. */
#include "ppr.h"
#if PPR_EXPORT != 0x9a9dcc78cb4de268U
#error "these files are of different exports: export again"
#endif

#ifdef PPR_FLOAT
#define HK_FLOAT
#define HK_SINGULAR 0.002
#define HK_REPRESENTATION 0.005
#define HK_ALMOST 0.001
#define HK_DONE 0.0001
#define HK_PRECISE 0.04
#define HK_CLEAR 0.03
#define HK_BOTH 0.01
#define HK_SOUND(c, m) ((c) > HK_C(HK_SINGULAR) && (m) > HK_C(HK_REPRESENTATION) && (c) * (m) > HK_C(5e-05))
#else
#define HK_SINGULAR 1e-10
#define HK_REPRESENTATION 1e-06
#define HK_ALMOST 1e-07
#define HK_DONE 1e-09
#endif
#define HK_AT_LIMIT 1e-06
#define HK_CONTRACTION 0.125
#define HK_N 3
#define HK_M 2
#define HK_R 1
#define HK_FRAMES 1
#define HK_MATRICES 0
#define HK_POSE 3
#define HK_TWIST 3
#define HK_PARAMETERS (2 * HK_R + 5)
#define HK_IMPRECISE PPR_IMPRECISE
#define HK_API static
#define HK_SIMD
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

static void hk_pose_body(const hk_t *restrict x, hk_t *restrict y) {
  (void)x;
  (void)y;
  const hk_t v0 = x[2];
  const hk_t v1 = HK_COS(v0);
  y[0] = v1;
  const hk_t v3 = HK_SIN(v0);
  y[4] = v3;
  y[8] = HK_C(0.0);
  y[12] = HK_C(0.0);
  const hk_t v8 = -v3;
  y[1] = v8;
  y[5] = v1;
  y[9] = HK_C(0.0);
  y[13] = HK_C(0.0);
  y[2] = HK_C(0.0);
  y[6] = HK_C(0.0);
  y[10] = HK_C(1.0);
  y[14] = HK_C(0.0);
  const hk_t v18 = x[0];
  const hk_t v19 = v18 + v1;
  y[3] = v19;
  const hk_t v21 = x[1];
  const hk_t v22 = v21 + v3;
  y[7] = v22;
  y[11] = HK_C(0.0);
  y[15] = HK_C(1.0);
  y[16] = HK_C(1.0);
  y[17] = HK_C(1.0);
}
static void hk_gain_body(const hk_t *restrict x, hk_t *restrict y) {
  (void)x;
  (void)y;
  const hk_t v2 = x[2];
  const hk_t v3 = HK_COS(v2);
  const hk_t v4 = HK_SIN(v2);
  const hk_t v5 = v3 - v4;
  const hk_t v7 = v5 + HK_C(-1.0);
  const hk_t v8 = v7 * v7;
  const hk_t v9 = HK_C(2.0) + v8;
  const hk_t v10 = HK_SQRT(v9);
  const hk_t v11 = HK_C(1) / v10;
  const hk_t v12 = v11 * v11;
  const hk_t v13 = HK_C(1.0) + v12;
  const hk_t v14 = HK_SQRT(v13);
  const hk_t v15 = HK_C(1.0) + v14;
  const hk_t v16 = v15 / v14;
  const hk_t v17 = HK_C(1.0) - v16;
  const hk_t v18 = v12 / v14;
  const hk_t v19 = v14 + HK_C(1.0);
  const hk_t v20 = v14 * v19;
  const hk_t v21 = HK_C(1) / v20;
  const hk_t v22 = v21 / v10;
  const hk_t v23 = v22 * v12;
  const hk_t v24 = v11 - v23;
  const hk_t v25 = v22 * v15;
  const hk_t v26 = v24 * v25;
  const hk_t v27 = v24 * v24;
  const hk_t v28 = HK_C(1.0) + v27;
  const hk_t v29 = HK_SQRT(v28);
  const hk_t v30 = v26 / v29;
  const hk_t v31 = HK_C(1.0) + v29;
  const hk_t v32 = v31 * v3;
  const hk_t v33 = v7 / v10;
  const hk_t v34 = v33 / v10;
  const hk_t v35 = v15 * v4;
  const hk_t v36 = v34 - v35;
  const hk_t v37 = v22 * v36;
  const hk_t v38 = v33 - v37;
  const hk_t v39 = v24 * v38;
  const hk_t v40 = v32 + v39;
  const hk_t v41 = v40 / v29;
  const hk_t v42 = v3 - v41;
  const hk_t v43 = v29 + HK_C(1.0);
  const hk_t v44 = v29 * v43;
  const hk_t v45 = v24 / v44;
  const hk_t v46 = v45 * v26;
  const hk_t v47 = v46 - v25;
  const hk_t v48 = v45 * v40;
  const hk_t v49 = v38 - v48;
  const hk_t v50 = v47 / v49;
  const hk_t v51 = v42 * v50;
  const hk_t v52 = v30 - v51;
  const hk_t v53 = v52 / v29;
  const hk_t v54 = v18 * v53;
  const hk_t v55 = v17 - v54;
  const hk_t v56 = v36 / v14;
  const hk_t v57 = v4 + v56;
  const hk_t v58 = v57 * v50;
  const hk_t v59 = v55 + v58;
  const hk_t v60 = v59 / v14;
  const hk_t v61 = -v60;
  y[0] = v61;
  const hk_t v63 = -v53;
  y[2] = v63;
  y[4] = v50;
  const hk_t v66 = v31 / v29;
  const hk_t v67 = HK_C(1.0) - v66;
  const hk_t v68 = v45 * v31;
  const hk_t v69 = v68 / v49;
  const hk_t v70 = v42 * v69;
  const hk_t v71 = v67 + v70;
  const hk_t v72 = v71 / v29;
  const hk_t v73 = v18 * v72;
  const hk_t v74 = v57 * v69;
  const hk_t v75 = v73 + v74;
  const hk_t v76 = v75 / v14;
  y[1] = v76;
  const hk_t v78 = -v72;
  y[3] = v78;
  const hk_t v80 = -v69;
  y[5] = v80;
  const hk_t v82 = HK_FMIN(v14, v29);
  const hk_t v83 = HK_FABS(v49);
  const hk_t v84 = HK_FMIN(v82, v83);
  const hk_t v85 = HK_FMAX(v14, v29);
  const hk_t v86 = HK_FMAX(v85, v83);
  const hk_t v87 = v84 / v86;
  y[6] = v87;
  y[7] = HK_C(1.0);
}
static void hk_rate_body(const hk_t *restrict x, hk_t *restrict y) {
  (void)x;
  (void)y;
  const hk_t v0 = x[3];
  const hk_t v3 = x[2];
  const hk_t v4 = HK_COS(v3);
  const hk_t v5 = HK_SIN(v3);
  const hk_t v6 = v4 - v5;
  const hk_t v8 = v6 + HK_C(-1.0);
  const hk_t v9 = v8 * v8;
  const hk_t v10 = HK_C(2.0) + v9;
  const hk_t v11 = HK_SQRT(v10);
  const hk_t v12 = HK_C(1) / v11;
  const hk_t v13 = v12 * v12;
  const hk_t v14 = HK_C(1.0) + v13;
  const hk_t v15 = HK_SQRT(v14);
  const hk_t v16 = HK_C(1.0) + v15;
  const hk_t v17 = v16 * v0;
  const hk_t v18 = v17 / v15;
  const hk_t v19 = v0 - v18;
  const hk_t v20 = v13 / v15;
  const hk_t v21 = x[4];
  const hk_t v22 = v15 + HK_C(1.0);
  const hk_t v23 = v15 * v22;
  const hk_t v24 = HK_C(1) / v23;
  const hk_t v25 = v24 / v11;
  const hk_t v26 = v25 * v13;
  const hk_t v27 = v12 - v26;
  const hk_t v28 = v27 * v27;
  const hk_t v29 = HK_C(1.0) + v28;
  const hk_t v30 = HK_SQRT(v29);
  const hk_t v31 = HK_C(1.0) + v30;
  const hk_t v32 = v31 * v21;
  const hk_t v33 = v25 * v17;
  const hk_t v34 = v27 * v33;
  const hk_t v35 = v32 - v34;
  const hk_t v36 = v35 / v30;
  const hk_t v37 = v21 - v36;
  const hk_t v38 = v31 * v4;
  const hk_t v39 = v8 / v11;
  const hk_t v40 = v39 / v11;
  const hk_t v41 = v16 * v5;
  const hk_t v42 = v40 - v41;
  const hk_t v43 = v25 * v42;
  const hk_t v44 = v39 - v43;
  const hk_t v45 = v27 * v44;
  const hk_t v46 = v38 + v45;
  const hk_t v47 = v46 / v30;
  const hk_t v48 = v4 - v47;
  const hk_t v49 = v30 + HK_C(1.0);
  const hk_t v50 = v30 * v49;
  const hk_t v51 = v27 / v50;
  const hk_t v52 = v51 * v35;
  const hk_t v53 = v33 + v52;
  const hk_t v54 = v51 * v46;
  const hk_t v55 = v44 - v54;
  const hk_t v56 = v53 / v55;
  const hk_t v57 = v48 * v56;
  const hk_t v58 = v37 + v57;
  const hk_t v59 = v58 / v30;
  const hk_t v60 = v20 * v59;
  const hk_t v61 = v19 - v60;
  const hk_t v62 = v42 / v15;
  const hk_t v63 = v5 + v62;
  const hk_t v64 = v63 * v56;
  const hk_t v65 = v61 - v64;
  const hk_t v66 = v65 / v15;
  const hk_t v67 = -v66;
  y[0] = v67;
  const hk_t v69 = -v59;
  y[1] = v69;
  const hk_t v71 = -v56;
  y[2] = v71;
  const hk_t v73 = HK_FMIN(v15, v30);
  const hk_t v74 = HK_FABS(v55);
  const hk_t v75 = HK_FMIN(v73, v74);
  const hk_t v76 = HK_FMAX(v15, v30);
  const hk_t v77 = HK_FMAX(v76, v74);
  const hk_t v78 = v75 / v77;
  y[3] = v78;
  y[4] = HK_C(1.0);
}
static void hk_step_body(const hk_t *restrict x, hk_t *restrict y) {
  (void)x;
  (void)y;
  const hk_t v1 = x[6];
  const hk_t v2 = x[12];
  const hk_t v3 = x[3];
  const hk_t v4 = x[0];
  const hk_t v5 = x[2];
  const hk_t v6 = HK_COS(v5);
  const hk_t v7 = v4 + v6;
  const hk_t v8 = v3 - v7;
  const hk_t v9 = x[11];
  const hk_t v10 = v9 * v1;
  const hk_t v11 = v8 - v10;
  const hk_t v12 = v2 * v11;
  const hk_t v13 = v1 + v12;
  const hk_t v15 = HK_SIN(v5);
  const hk_t v16 = v6 - v15;
  const hk_t v18 = v16 + HK_C(-1.0);
  const hk_t v19 = v18 * v18;
  const hk_t v20 = HK_C(2.0) + v19;
  const hk_t v21 = HK_SQRT(v20);
  const hk_t v22 = HK_C(1) / v21;
  const hk_t v23 = v22 * v22;
  const hk_t v24 = HK_C(1.0) + v23;
  const hk_t v25 = HK_SQRT(v24);
  const hk_t v26 = HK_C(1.0) + v25;
  const hk_t v27 = v26 * v13;
  const hk_t v28 = x[10];
  const hk_t v29 = x[13];
  const hk_t v30 = x[9];
  const hk_t v31 = v9 * v28;
  const hk_t v32 = v30 - v31;
  const hk_t v33 = x[1];
  const hk_t v34 = v4 + v33;
  const hk_t v35 = v34 - v5;
  const hk_t v36 = v35 + v15;
  const hk_t v37 = v36 + v6;
  const hk_t v38 = v32 - v37;
  const hk_t v39 = v29 * v38;
  const hk_t v40 = v28 + v39;
  const hk_t v41 = v40 / v21;
  const hk_t v42 = v41 / v21;
  const hk_t v43 = v27 + v42;
  const hk_t v44 = v43 / v25;
  const hk_t v45 = v13 - v44;
  const hk_t v46 = v23 / v25;
  const hk_t v47 = x[7];
  const hk_t v48 = x[4];
  const hk_t v49 = v33 + v15;
  const hk_t v50 = v48 - v49;
  const hk_t v51 = v9 * v47;
  const hk_t v52 = v50 - v51;
  const hk_t v53 = v2 * v52;
  const hk_t v54 = v47 + v53;
  const hk_t v55 = v25 + HK_C(1.0);
  const hk_t v56 = v25 * v55;
  const hk_t v57 = HK_C(1) / v56;
  const hk_t v58 = v57 / v21;
  const hk_t v59 = v58 * v23;
  const hk_t v60 = v22 - v59;
  const hk_t v61 = v60 * v60;
  const hk_t v62 = HK_C(1.0) + v61;
  const hk_t v63 = HK_SQRT(v62);
  const hk_t v64 = HK_C(1.0) + v63;
  const hk_t v65 = v64 * v54;
  const hk_t v66 = v58 * v43;
  const hk_t v67 = v41 - v66;
  const hk_t v68 = v60 * v67;
  const hk_t v69 = v65 + v68;
  const hk_t v70 = v69 / v63;
  const hk_t v71 = v54 - v70;
  const hk_t v72 = v64 * v6;
  const hk_t v73 = v18 / v21;
  const hk_t v74 = v73 / v21;
  const hk_t v75 = v26 * v15;
  const hk_t v76 = v74 - v75;
  const hk_t v77 = v58 * v76;
  const hk_t v78 = v73 - v77;
  const hk_t v79 = v60 * v78;
  const hk_t v80 = v72 + v79;
  const hk_t v81 = v80 / v63;
  const hk_t v82 = v6 - v81;
  const hk_t v83 = v63 + HK_C(1.0);
  const hk_t v84 = v63 * v83;
  const hk_t v85 = v60 / v84;
  const hk_t v86 = v85 * v69;
  const hk_t v87 = v67 - v86;
  const hk_t v88 = v85 * v80;
  const hk_t v89 = v78 - v88;
  const hk_t v90 = v87 / v89;
  const hk_t v91 = v82 * v90;
  const hk_t v92 = v71 - v91;
  const hk_t v93 = v92 / v63;
  const hk_t v94 = v46 * v93;
  const hk_t v95 = v45 - v94;
  const hk_t v96 = v76 / v25;
  const hk_t v97 = v15 + v96;
  const hk_t v98 = v97 * v90;
  const hk_t v99 = v95 + v98;
  const hk_t v100 = v99 / v25;
  const hk_t v101 = HK_FABS(v100);
  const hk_t v103 = HK_FMAX(v101, HK_C(1e-12));
  const hk_t v104 = HK_C(1) / v103;
  const hk_t v105 = HK_FMIN(HK_C(1.0), v104);
  const hk_t v107 = HK_FMIN(v25, v63);
  const hk_t v108 = HK_FABS(v89);
  const hk_t v109 = HK_FMIN(v107, v108);
  const hk_t v110 = HK_FMAX(v25, v63);
  const hk_t v111 = HK_FMAX(v110, v108);
  const hk_t v112 = v109 / v111;
  const hk_t v113 = HK_C(0.5) * v112;
  const hk_t v114 = v101 * v9;
  const hk_t v115 = HK_FMAX(v114, HK_C(1e-12));
  const hk_t v116 = v113 / v115;
  const hk_t v117 = HK_FMIN(v105, v116);
  const hk_t v118 = HK_FABS(v93);
  const hk_t v119 = HK_FMAX(v118, HK_C(1e-12));
  const hk_t v120 = HK_C(1) / v119;
  const hk_t v121 = HK_FMIN(v117, v120);
  const hk_t v122 = v118 * v9;
  const hk_t v123 = HK_FMAX(v122, HK_C(1e-12));
  const hk_t v124 = v113 / v123;
  const hk_t v125 = HK_FMIN(v121, v124);
  const hk_t v127 = HK_FABS(v90);
  const hk_t v128 = HK_FMAX(v127, HK_C(1e-12));
  const hk_t v129 = HK_C(3.141592653589793) / v128;
  const hk_t v130 = HK_FMIN(v125, v129);
  const hk_t v131 = v127 * v9;
  const hk_t v132 = HK_FMAX(v131, HK_C(1e-12));
  const hk_t v133 = v113 / v132;
  const hk_t v134 = HK_FMIN(v130, v133);
  const hk_t v135 = v100 * v9;
  const hk_t v136 = HK_FABS(v135);
  const hk_t v137 = HK_LT(HK_C(1e-12), v136);
  const hk_t v139 = -v135;
  const hk_t v140 = HK_LT(HK_C(0.0), v139);
  const hk_t v142 = HK_C(5.0) - v4;
  const hk_t v143 = HK_IF(v140, v142);
  const hk_t v144 = HK_NOT(v140);
  const hk_t v146 = HK_C(-5.0) - v4;
  const hk_t v147 = -v146;
  const hk_t v148 = HK_IF(v144, v147);
  const hk_t v149 = v143 + v148;
  const hk_t v150 = HK_FMAX(v149, HK_C(0.0));
  const hk_t v151 = HK_FMAX(v136, HK_C(1e-12));
  const hk_t v152 = v150 / v151;
  const hk_t v153 = HK_IF(v137, v152);
  const hk_t v154 = HK_NOT(v137);
  const hk_t v155 = HK_IF(v154, HK_C(1.0));
  const hk_t v156 = v153 + v155;
  const hk_t v157 = HK_FMIN(HK_C(1.0), v156);
  const hk_t v158 = v93 * v9;
  const hk_t v159 = HK_FABS(v158);
  const hk_t v160 = HK_LT(HK_C(1e-12), v159);
  const hk_t v161 = -v158;
  const hk_t v162 = HK_LT(HK_C(0.0), v161);
  const hk_t v163 = HK_C(5.0) - v33;
  const hk_t v164 = HK_IF(v162, v163);
  const hk_t v165 = HK_NOT(v162);
  const hk_t v166 = HK_C(-5.0) - v33;
  const hk_t v167 = -v166;
  const hk_t v168 = HK_IF(v165, v167);
  const hk_t v169 = v164 + v168;
  const hk_t v170 = HK_FMAX(v169, HK_C(0.0));
  const hk_t v171 = HK_FMAX(v159, HK_C(1e-12));
  const hk_t v172 = v170 / v171;
  const hk_t v173 = HK_IF(v160, v172);
  const hk_t v174 = HK_NOT(v160);
  const hk_t v175 = HK_IF(v174, HK_C(1.0));
  const hk_t v176 = v173 + v175;
  const hk_t v177 = HK_FMIN(v157, v176);
  const hk_t v178 = v90 * v9;
  const hk_t v179 = HK_FABS(v178);
  const hk_t v180 = HK_LT(HK_C(1e-12), v179);
  const hk_t v181 = HK_LT(HK_C(0.0), v178);
  const hk_t v183 = HK_C(12.566370614359172) - v5;
  const hk_t v184 = HK_IF(v181, v183);
  const hk_t v185 = HK_NOT(v181);
  const hk_t v187 = HK_C(-12.566370614359172) - v5;
  const hk_t v188 = -v187;
  const hk_t v189 = HK_IF(v185, v188);
  const hk_t v190 = v184 + v189;
  const hk_t v191 = HK_FMAX(v190, HK_C(0.0));
  const hk_t v192 = HK_FMAX(v179, HK_C(1e-12));
  const hk_t v193 = v191 / v192;
  const hk_t v194 = HK_IF(v180, v193);
  const hk_t v195 = HK_NOT(v180);
  const hk_t v196 = HK_IF(v195, HK_C(1.0));
  const hk_t v197 = v194 + v196;
  const hk_t v198 = HK_FMIN(v177, v197);
  const hk_t v199 = HK_FMIN(v134, v198);
  const hk_t v200 = v199 * v100;
  const hk_t v201 = -v200;
  y[0] = v201;
  const hk_t v203 = v199 * v93;
  const hk_t v204 = -v203;
  y[1] = v204;
  const hk_t v206 = v199 * v90;
  y[2] = v206;
  y[3] = v199;
  y[4] = v112;
  y[5] = HK_C(1.0);
  y[6] = v198;
  const hk_t v212 = HK_FABS(v11);
  const hk_t v213 = HK_FMAX(HK_C(0.0), v212);
  const hk_t v214 = HK_FABS(v52);
  const hk_t v215 = HK_FMAX(v213, v214);
  y[7] = v215;
  const hk_t v218 = v4 / HK_C(1024.0);
  const hk_t v219 = x[8];
  const hk_t v220 = v219 / HK_C(1024.0);
  const hk_t v221 = v218 + v220;
  const hk_t v222 = v48 / HK_C(1024.0);
  const hk_t v223 = v2 / HK_C(1024.0);
  const hk_t v224 = v222 + v223;
  const hk_t v225 = v221 + v224;
  const hk_t v226 = v5 / HK_C(1024.0);
  const hk_t v227 = v28 / HK_C(1024.0);
  const hk_t v228 = v226 + v227;
  const hk_t v229 = v1 / HK_C(1024.0);
  const hk_t v230 = x[14];
  const hk_t v231 = v230 / HK_C(1024.0);
  const hk_t v232 = v229 + v231;
  const hk_t v233 = v228 + v232;
  const hk_t v234 = v225 + v233;
  const hk_t v235 = v33 / HK_C(1024.0);
  const hk_t v236 = v30 / HK_C(1024.0);
  const hk_t v237 = v235 + v236;
  const hk_t v238 = x[5];
  const hk_t v239 = v238 / HK_C(1024.0);
  const hk_t v240 = v29 / HK_C(1024.0);
  const hk_t v241 = v239 + v240;
  const hk_t v242 = v237 + v241;
  const hk_t v243 = v3 / HK_C(1024.0);
  const hk_t v244 = v9 / HK_C(1024.0);
  const hk_t v245 = v243 + v244;
  const hk_t v246 = v47 / HK_C(1024.0);
  const hk_t v247 = x[15];
  const hk_t v248 = v247 / HK_C(1024.0);
  const hk_t v249 = v246 + v248;
  const hk_t v250 = v245 + v249;
  const hk_t v251 = v242 + v250;
  const hk_t v252 = v234 + v251;
  y[8] = v252;
  const hk_t v255 = HK_LE(v156, HK_C(1e-06));
  const hk_t v256 = HK_IF(v255, HK_C(1.0));
  const hk_t v257 = HK_LE(v176, HK_C(1e-06));
  const hk_t v258 = HK_IF(v257, HK_C(2.0));
  const hk_t v259 = v256 + v258;
  const hk_t v260 = HK_LE(v197, HK_C(1e-06));
  const hk_t v262 = HK_IF(v260, HK_C(4.0));
  const hk_t v263 = v259 + v262;
  y[9] = v263;
}
static void hk_constraint_body(const hk_t *restrict x, hk_t *restrict y) {
  (void)x;
  (void)y;
  const hk_t v0 = x[0];
  const hk_t v1 = x[1];
  const hk_t v2 = v0 + v1;
  const hk_t v3 = x[2];
  const hk_t v4 = v2 - v3;
  const hk_t v5 = HK_SIN(v3);
  const hk_t v6 = v4 + v5;
  const hk_t v7 = HK_COS(v3);
  const hk_t v8 = v6 + v7;
  y[0] = v8;
  y[1] = HK_C(1.0);
  y[2] = HK_C(1.0);
}
static void hk_leaf_body(const hk_t *restrict x, hk_t *restrict y) {
  (void)x;
  (void)y;
  const hk_t v0 = x[3];
  const hk_t v1 = x[0];
  const hk_t v2 = x[2];
  const hk_t v3 = HK_COS(v2);
  const hk_t v4 = v1 + v3;
  const hk_t v5 = v0 - v4;
  const hk_t v8 = HK_SIN(v2);
  const hk_t v9 = v3 - v8;
  const hk_t v11 = v9 + HK_C(-1.0);
  const hk_t v12 = v11 * v11;
  const hk_t v13 = HK_C(2.0) + v12;
  const hk_t v14 = HK_SQRT(v13);
  const hk_t v15 = HK_C(1) / v14;
  const hk_t v16 = v15 * v15;
  const hk_t v17 = HK_C(1.0) + v16;
  const hk_t v18 = HK_SQRT(v17);
  const hk_t v19 = HK_C(1.0) + v18;
  const hk_t v20 = v19 * v5;
  const hk_t v21 = x[15];
  const hk_t v22 = x[1];
  const hk_t v23 = v1 + v22;
  const hk_t v24 = v23 - v2;
  const hk_t v25 = v24 + v8;
  const hk_t v26 = v25 + v3;
  const hk_t v27 = v21 - v26;
  const hk_t v28 = v27 / v14;
  const hk_t v29 = v28 / v14;
  const hk_t v30 = v20 + v29;
  const hk_t v31 = v30 / v18;
  const hk_t v32 = v5 - v31;
  const hk_t v33 = v16 / v18;
  const hk_t v34 = x[4];
  const hk_t v35 = v22 + v8;
  const hk_t v36 = v34 - v35;
  const hk_t v37 = v18 + HK_C(1.0);
  const hk_t v38 = v18 * v37;
  const hk_t v39 = HK_C(1) / v38;
  const hk_t v40 = v39 / v14;
  const hk_t v41 = v40 * v16;
  const hk_t v42 = v15 - v41;
  const hk_t v43 = v42 * v42;
  const hk_t v44 = HK_C(1.0) + v43;
  const hk_t v45 = HK_SQRT(v44);
  const hk_t v46 = HK_C(1.0) + v45;
  const hk_t v47 = v46 * v36;
  const hk_t v48 = v40 * v30;
  const hk_t v49 = v28 - v48;
  const hk_t v50 = v42 * v49;
  const hk_t v51 = v47 + v50;
  const hk_t v52 = v51 / v45;
  const hk_t v53 = v36 - v52;
  const hk_t v54 = v46 * v3;
  const hk_t v55 = v11 / v14;
  const hk_t v56 = v55 / v14;
  const hk_t v57 = v19 * v8;
  const hk_t v58 = v56 - v57;
  const hk_t v59 = v40 * v58;
  const hk_t v60 = v55 - v59;
  const hk_t v61 = v42 * v60;
  const hk_t v62 = v54 + v61;
  const hk_t v63 = v62 / v45;
  const hk_t v64 = v3 - v63;
  const hk_t v65 = v45 + HK_C(1.0);
  const hk_t v66 = v45 * v65;
  const hk_t v67 = v42 / v66;
  const hk_t v68 = v67 * v51;
  const hk_t v69 = v49 - v68;
  const hk_t v70 = v67 * v62;
  const hk_t v71 = v60 - v70;
  const hk_t v72 = v69 / v71;
  const hk_t v73 = v64 * v72;
  const hk_t v74 = v53 - v73;
  const hk_t v75 = v74 / v45;
  const hk_t v76 = v33 * v75;
  const hk_t v77 = v32 - v76;
  const hk_t v78 = v58 / v18;
  const hk_t v79 = v8 + v78;
  const hk_t v80 = v79 * v72;
  const hk_t v81 = v77 + v80;
  const hk_t v82 = v81 / v18;
  const hk_t v83 = -v82;
  y[0] = v83;
  const hk_t v85 = -v75;
  y[1] = v85;
  y[2] = v72;
  const hk_t v88 = HK_FMIN(v18, v45);
  const hk_t v89 = HK_FABS(v71);
  const hk_t v90 = HK_FMIN(v88, v89);
  const hk_t v91 = HK_FMAX(v18, v45);
  const hk_t v92 = HK_FMAX(v91, v89);
  const hk_t v93 = v90 / v92;
  y[3] = v93;
  y[4] = HK_C(1.0);
  const hk_t v96 = -v18;
  const hk_t v97 = HK_COPYSIGN(HK_C(1.0), v96);
  const hk_t v98 = -v45;
  const hk_t v99 = HK_COPYSIGN(HK_C(1.0), v98);
  const hk_t v100 = v97 * v99;
  const hk_t v101 = HK_COPYSIGN(HK_C(1.0), v71);
  const hk_t v102 = v100 * v101;
  y[5] = v102;
}

static int hk_finite(const hk_t *x, int count) {
  for (int i = 0; i < count; i++)
    if (!(x[i] - x[i] == HK_C(0))) return 0;
  return 1;
}

/* Single precision, and too near a singularity for four digits. */
static int hk_rough(hk_t rcond, hk_t margin) {
#ifdef HK_PRECISE
  return rcond < HK_C(HK_PRECISE) || margin < HK_C(HK_CLEAR) || rcond * margin < HK_C(HK_BOTH);
#else
  (void)rcond;
  (void)margin;
  return 0;
#endif
}

/* y: `count` results, then rcond and the margin of representations. */
static int hk_deliver(const hk_t *y, int count, hk_t *out) {
  const int sound = HK_SOUND(y[count], y[count + 1]) && hk_finite(y, count);
  for (int i = 0; i < count; i++) out[i] = sound ? y[i] : HK_C(0);
  if (!sound) return PPR_SINGULAR;
  return hk_rough(y[count], y[count + 1]) ? PPR_IMPRECISE : PPR_OK;
}

static int hk_refuse(int count, hk_t *out) {
  for (int i = 0; i < count; i++) out[i] = HK_C(0);
  return PPR_NOT_FINITE;
}

#define HK_ROTATION 1e-05
/* 1 where wanted poses of `count` numbers, a point or 4x4 matrices by rows, can be such: the last row of a matrix is 0 0 0 1,
   which is not so where the matrix is transposed, as by a library that keeps matrices by columns. */
static int hk_posed(const hk_t *pose, int count) {
  for (int i = 0; HK_MATRICES && i < count; i++)
    if (i % 16 >= 12 && !(HK_FABS(pose[i] - HK_C(i % 16 == 15)) < HK_C(HK_ROTATION))) return 0;
  return 1;
}

/* One control step. hk_step_body takes (q, pose, twist, parameters) and gives (dq, scale, rcond, margin, room, off,
   given, holding): room is the scale that positions allow, off the tool's largest error, given is finite where all
   arguments are, holding the sum of 2^i over the joints i at a position limit, which would go beyond it.
   pose and twist: where the tool is wanted at the end of the step, 16 numbers, a 4x4 matrix by rows, or 3, a position;
   and the twist that leads there, 6 numbers, or 3, a velocity. parameters: the leaf c, its rate, dt, the gain, the constraint
   gain, the most error and the least rcond. out: dq, the scale, holding.
   Returns 0 as wanted, 1 slowed for a speed limit, 2 held at a position limit, 3 singular, 4 not finite, 8 lost: the
   tool's error is larger than the most; from 3 on dq is zero. */
HK_API int hk_step(const hk_t *q, const hk_t *pose, const hk_t *twist, hk_t *out, const hk_t *parameters) {
  enum { size = HK_N + HK_POSE + HK_TWIST + HK_PARAMETERS };
  hk_t x[size], y[HK_N + 7];
  int finite = 1;
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  for (int i = 0; i < HK_POSE; i++) x[HK_N + i] = pose[i];
  for (int i = 0; i < HK_TWIST; i++) x[HK_N + HK_POSE + i] = twist[i];
  for (int i = 0; i < HK_PARAMETERS; i++) x[HK_N + HK_POSE + HK_TWIST + i] = parameters[i];
  hk_step_body(x, y);
  for (int i = 0; i < HK_N + 1; i++) finite &= y[i] - y[i] == HK_C(0);
  const hk_t *const bounds = parameters + HK_PARAMETERS - 2;
  const int sound = HK_SOUND(y[HK_N + 1], y[HK_N + 2]) && y[HK_N + 1] > bounds[1];
  const int given = y[HK_N + 5] - y[HK_N + 5] == HK_C(0), near = y[HK_N + 4] <= bounds[0];
  if (!finite || !sound || !given || !near) {
    for (int i = 0; i < HK_N + 2; i++) out[i] = HK_C(0);
    return !given ? 4 : finite && sound ? 8 : 3;
  }
  for (int i = 0; i < HK_N + 1; i++) out[i] = y[i];
  out[HK_N + 1] = y[HK_N + 6];
#ifdef HK_IMPRECISE
  if (hk_rough(y[HK_N + 1], y[HK_N + 2])) return HK_IMPRECISE;
#endif
  if (y[HK_N] >= HK_C(1)) return 0;
  return y[HK_N + 3] > HK_C(HK_AT_LIMIT) ? 1 : 2;
}

void ppr_defaults(ppr_parameters *parameters) {
  parameters->leaf[0] = HK_C(1.2276018366025516);
  parameters->leaf_rate[0] = HK_C(0);
  parameters->dt = HK_C(0.001);
  parameters->gain = HK_C(100.0);
  parameters->constraint_gain = HK_C(100.0);
  parameters->most_error = HK_C(0.1);
  parameters->least_rcond = HK_C(0.001);
}

void ppr_start(ppr_real q[3]) {
  q[0] = HK_C(0.9022932188134525);
  q[1] = HK_C(-0.3035067811865475);
  q[2] = HK_C(0.7853981633974483);
}

int ppr_pose(const ppr_real q[3], ppr_real T[16]) {
  hk_t y[16 + 2];
  if (!hk_finite(q, HK_N)) return hk_refuse(16, T);
  hk_pose_body(q, y);
  return hk_deliver(y, 16, T);
}

int ppr_gain(const ppr_real q[3], ppr_real G[6]) {
  hk_t y[HK_N * HK_M + 2];
  if (!hk_finite(q, HK_N)) return hk_refuse(HK_N * HK_M, G);
  hk_gain_body(q, y);
  return hk_deliver(y, HK_N * HK_M, G);
}

int ppr_rate(const ppr_real q[3], const ppr_real dx[2], ppr_real dq[3]) {
  hk_t x[HK_N + HK_M], y[HK_N + 2];
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  for (int i = 0; i < HK_M; i++) x[HK_N + i] = dx[i];
  if (!hk_finite(x, HK_N + HK_M)) return hk_refuse(HK_N, dq);
  hk_rate_body(x, y);
  return hk_deliver(y, HK_N, dq);
}

int ppr_step(const ppr_real q[3], const ppr_real target[3], const ppr_real twist[3],
    const ppr_parameters *parameters, ppr_real dq[3], ppr_real *scale) {
  hk_t values[HK_PARAMETERS], out[HK_N + 2];
  const hk_t dt = parameters->dt, gain = parameters->gain, constraint_gain = parameters->constraint_gain;
  for (int i = 0; i < HK_R; i++) {
    values[i] = parameters->leaf[i];
    values[HK_R + i] = parameters->leaf_rate[i];
  }
  values[2 * HK_R] = dt;
  values[2 * HK_R + 1] = gain;
  values[2 * HK_R + 2] = constraint_gain;
  values[2 * HK_R + 3] = parameters->most_error;
  values[2 * HK_R + 4] = parameters->least_rcond;
  if (!(dt > HK_C(0) && gain >= HK_C(0) && gain * dt < HK_C(2) && constraint_gain >= HK_C(0) &&
        constraint_gain * dt < HK_C(2) && parameters->most_error > HK_C(0) && parameters->least_rcond >= HK_C(0) &&
        parameters->least_rcond < HK_C(1))) {
    *scale = HK_C(0);
    hk_refuse(HK_N, dq);
    return PPR_BAD_PARAMETERS;
  }
  if (hk_finite(target, HK_POSE) && !hk_posed(target, HK_POSE)) {
    *scale = HK_C(0);
    hk_refuse(HK_N, dq);
    return PPR_NOT_A_ROTATION;
  }
  const int status = hk_step(q, target, twist, out, values);
  for (int i = 0; i < HK_N; i++) dq[i] = out[i];
  *scale = out[HK_N];
  return status;
}

int ppr_constraint(const ppr_real q[3], ppr_real g[1]) {
  hk_t y[HK_R + 2];
  if (!hk_finite(q, HK_N)) return hk_refuse(HK_R, g);
  hk_constraint_body(q, y);
  return hk_deliver(y, HK_R, g);
}

/* 1 where a joint is beyond its limits. */
static int hk_beyond(const hk_t *q) {
  if (q[0] > HK_C(5.000000001)) return 1;
  if (q[0] < HK_C(-5.000000001)) return 1;
  if (q[1] > HK_C(5.000000001)) return 1;
  if (q[1] < HK_C(-5.000000001)) return 1;
  if (q[2] > HK_C(12.566370615359173)) return 1;
  if (q[2] < HK_C(-12.566370615359173)) return 1;
  return 0;
}

static const int hk_angular[] = {0}; /* rows of g that are angles */
#define HK_CHANGE 0.5
#define HK_THICKNESS 0.125
#define HK_DOUBT 1.5
#define HK_LAID 8
#define HK_RESTS 1e-12
#define HK_LONGEST 0.1
#define HK_DIRECTIONS 8
#define HK_SWITCH 0.001
#define HK_TURNS 0
#define HK_ANGLES 0
#define HK_ROWS 2
static const int hk_turns[] = {0};
static void hk_extended_body(const hk_t *restrict x, hk_t *restrict y) {
  (void)x;
  (void)y;
  y[0] = HK_C(1.0);
  y[3] = HK_C(0.0);
  y[6] = HK_C(1.0);
  y[1] = HK_C(0.0);
  y[4] = HK_C(1.0);
  y[7] = HK_C(1.0);
  const hk_t v8 = x[2];
  const hk_t v9 = HK_SIN(v8);
  const hk_t v10 = -v9;
  y[2] = v10;
  const hk_t v12 = HK_COS(v8);
  y[5] = v12;
  const hk_t v14 = v12 - v9;
  const hk_t v16 = v14 + HK_C(-1.0);
  y[8] = v16;
  const hk_t v19 = v16 * v16;
  const hk_t v20 = HK_C(2.0) + v19;
  const hk_t v21 = HK_SQRT(v20);
  const hk_t v22 = HK_C(1) / v21;
  const hk_t v23 = v22 * v22;
  const hk_t v24 = HK_C(1.0) + v23;
  const hk_t v25 = HK_SQRT(v24);
  const hk_t v26 = HK_C(1.0) + v25;
  const hk_t v27 = v26 / v25;
  const hk_t v28 = HK_C(1.0) - v27;
  const hk_t v29 = v23 / v25;
  const hk_t v30 = v25 + HK_C(1.0);
  const hk_t v31 = v25 * v30;
  const hk_t v32 = HK_C(1) / v31;
  const hk_t v33 = v32 / v21;
  const hk_t v34 = v33 * v23;
  const hk_t v35 = v22 - v34;
  const hk_t v36 = v33 * v26;
  const hk_t v37 = v35 * v36;
  const hk_t v38 = v35 * v35;
  const hk_t v39 = HK_C(1.0) + v38;
  const hk_t v40 = HK_SQRT(v39);
  const hk_t v41 = v37 / v40;
  const hk_t v42 = HK_C(1.0) + v40;
  const hk_t v43 = v42 * v12;
  const hk_t v44 = v16 / v21;
  const hk_t v45 = v44 / v21;
  const hk_t v46 = v26 * v9;
  const hk_t v47 = v45 - v46;
  const hk_t v48 = v33 * v47;
  const hk_t v49 = v44 - v48;
  const hk_t v50 = v35 * v49;
  const hk_t v51 = v43 + v50;
  const hk_t v52 = v51 / v40;
  const hk_t v53 = v12 - v52;
  const hk_t v54 = v40 + HK_C(1.0);
  const hk_t v55 = v40 * v54;
  const hk_t v56 = v35 / v55;
  const hk_t v57 = v56 * v37;
  const hk_t v58 = v57 - v36;
  const hk_t v59 = v56 * v51;
  const hk_t v60 = v49 - v59;
  const hk_t v61 = v58 / v60;
  const hk_t v62 = v53 * v61;
  const hk_t v63 = v41 - v62;
  const hk_t v64 = v63 / v40;
  const hk_t v65 = v29 * v64;
  const hk_t v66 = v28 - v65;
  const hk_t v67 = v47 / v25;
  const hk_t v68 = v9 + v67;
  const hk_t v69 = v68 * v61;
  const hk_t v70 = v66 + v69;
  const hk_t v71 = v70 / v25;
  const hk_t v72 = -v71;
  y[9] = v72;
  const hk_t v74 = -v64;
  y[12] = v74;
  y[15] = v61;
  const hk_t v77 = v42 / v40;
  const hk_t v78 = HK_C(1.0) - v77;
  const hk_t v79 = v56 * v42;
  const hk_t v80 = v79 / v60;
  const hk_t v81 = v53 * v80;
  const hk_t v82 = v78 + v81;
  const hk_t v83 = v82 / v40;
  const hk_t v84 = v29 * v83;
  const hk_t v85 = v68 * v80;
  const hk_t v86 = v84 + v85;
  const hk_t v87 = v86 / v25;
  y[10] = v87;
  const hk_t v89 = -v83;
  y[13] = v89;
  const hk_t v91 = -v80;
  y[16] = v91;
  const hk_t v93 = v38 / v40;
  const hk_t v94 = v56 * v38;
  const hk_t v95 = v35 - v94;
  const hk_t v96 = v95 / v60;
  const hk_t v97 = v53 * v96;
  const hk_t v98 = v93 + v97;
  const hk_t v99 = v98 / v40;
  const hk_t v100 = v29 * v99;
  const hk_t v101 = v100 - v29;
  const hk_t v102 = v68 * v96;
  const hk_t v103 = v101 + v102;
  const hk_t v104 = v103 / v25;
  const hk_t v105 = -v104;
  y[11] = v105;
  y[14] = v99;
  y[17] = v96;
}
#define HK_ENCLOSED
HK_CALL static void hk_pair_1(const hk_t *a, const hk_t *b, hk_t *y) {
  const hk_t a0 = a[0], a1 = a[1];
  const hk_t b0 = b[0], b1 = b[1];
  (void)a1;
  (void)b1;
  hk_t z0, z1;
  const hk_t v0 = a0;
  const hk_t v1 = b0;
  const hk_t v2 = v0 + v1;
  z0 = v2;
  const hk_t v4 = a1;
  const hk_t v5 = b1;
  const hk_t v6 = v4 + v5;
  z1 = v6;
  y[0] = z0, y[1] = z1;
}
HK_CALL static void hk_pair_5(const hk_t *a, hk_t *y) {
  const hk_t a0 = a[0], a1 = a[1];
  (void)a1;
  hk_t z0, z1;
  const hk_t v0 = a0;
  const hk_t v1 = -v0;
  z0 = v1;
  const hk_t v3 = a1;
  z1 = v3;
  y[0] = z0, y[1] = z1;
}
HK_CALL static void hk_pair_13(const hk_t *a, hk_t *y) {
  const hk_t a0 = a[0], a1 = a[1];
  (void)a1;
  hk_t z0, z1;
  const hk_t v0 = a0;
  const hk_t v1 = HK_SIN(v0);
  z0 = v1;
  const hk_t v3 = HK_COS(v0);
  const hk_t v4 = HK_FABS(v3);
  const hk_t v5 = a1;
  const hk_t v6 = v4 * v5;
  const hk_t v7 = v5 * v5;
  const hk_t v9 = v7 / HK_C(2.0);
  const hk_t v10 = v6 + v9;
  const hk_t v11 = HK_FMIN(v10, HK_C(2.0));
  z1 = v11;
  y[0] = z0, y[1] = z1;
}
HK_CALL static void hk_pair_14(const hk_t *a, hk_t *y) {
  const hk_t a0 = a[0], a1 = a[1];
  (void)a1;
  hk_t z0, z1;
  const hk_t v0 = a0;
  const hk_t v1 = HK_COS(v0);
  z0 = v1;
  const hk_t v3 = HK_SIN(v0);
  const hk_t v4 = HK_FABS(v3);
  const hk_t v5 = a1;
  const hk_t v6 = v4 * v5;
  const hk_t v7 = v5 * v5;
  const hk_t v9 = v7 / HK_C(2.0);
  const hk_t v10 = v6 + v9;
  const hk_t v11 = HK_FMIN(v10, HK_C(2.0));
  z1 = v11;
  y[0] = z0, y[1] = z1;
}
static void hk_change_body(const hk_t *x, hk_t *y) {
  hk_t w[6];
  for (int i = 0; i < 54; i++) y[i] = HK_C(0);
  w[0] = HK_C(0.0), w[1] = HK_C(0);
  w[0] = x[2], w[1] = x[5];
  hk_pair_14(w + 0, w + 2);
  hk_pair_5(w + 2, w + 4);
  y[24] = w[4], y[51] = w[5];
  hk_pair_13(w + 0, w + 0);
  hk_pair_5(w + 0, w + 4);
  y[25] = w[4], y[52] = w[5];
  hk_pair_1(w + 0, w + 2, w + 0);
  hk_pair_5(w + 0, w + 0);
  y[26] = w[0], y[53] = w[1];
}
#define HK_LEAVES_FREE
static void hk_completed_body(const hk_t *restrict x, hk_t *restrict y) {
  (void)x;
  (void)y;
  const hk_t v0 = x[12];
  y[0] = v0;
  const hk_t v2 = x[13];
  y[1] = v2;
  const hk_t v4 = x[2];
  y[2] = v4;
  const hk_t v6 = x[3];
  y[3] = v6;
  const hk_t v8 = x[6];
  y[6] = v8;
  const hk_t v10 = x[9];
  y[9] = v10;
  const hk_t v12 = x[4];
  y[4] = v12;
  const hk_t v14 = x[7];
  y[7] = v14;
  const hk_t v16 = x[10];
  y[10] = v16;
  const hk_t v18 = x[5];
  y[5] = v18;
  const hk_t v20 = x[8];
  y[8] = v20;
  const hk_t v22 = x[11];
  y[11] = v22;
}
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

/* Newton on [f(q) - x; g(q) - c] in steps that keep to one branch: the rules of motion/ik/leaf.py. hk_leaf_body takes
   (q, p, R, c) and gives (dq, rcond, margin, sign of det). */
typedef struct {
  hk_t singular, representation, contraction, almost, done, smallest, creep, side;
  int most, tries;
} hk_rules;

/* 1 and the new q where Newton contracts, else 0. x holds (q, p, R, c). */
static int hk_newton(hk_t *x, const hk_rules *rules, hk_t *margin) {
  hk_t y[HK_N + 3], before = HK_INF;
  for (int k = 0; k < rules->most; k++) {
    hk_t size = HK_C(0);
    hk_leaf_body(x, y);
    int sound = y[HK_N] > rules->singular && y[HK_N + 1] > rules->representation && y[HK_N + 2] * rules->side > HK_C(0);
    for (int i = 0; i < HK_N; i++) {
      sound &= y[i] - y[i] == HK_C(0);
      size = HK_FMAX(HK_FABS(y[i]), size);
    }
    *margin = y[HK_N + 1];
    if (!sound) return 0;
    const int last = before <= rules->almost;
    if (last && !(size <= before)) return 1;
    if (!last && !(size <= HK_FMAX(rules->contraction * before, rules->done))) return 0;
    for (int i = 0; i < HK_N; i++) x[i] += y[i];
    if (last || size <= rules->done) return 1;
    before = size;
  }
  return 0;
}

/* One piece of a way: from the posture q to the target in x, which has (q, p, R, c), begun at q + width * rate. Gives
   the length of the piece to try next, as a share of this one: at least 1, with the new q and rate, where it keeps to
   the branch, else below; -1 where the joints hardly move. */
static hk_t hk_piece(hk_t *x, hk_t *q, hk_t *rate, hk_t width, hk_t arc, hk_t turn, hk_branch *branch,
                     const hk_rules *rules) {
  hk_t margin, most = HK_C(0);
  for (int i = 0; i < HK_N; i++) x[i] = q[i] + width * rate[i];
  if (!hk_newton(x, rules, &margin)) return HK_C(0.5);
  const hk_t steep = HK_ANGLES ? turn / HK_FMIN(HK_C(1), margin) : HK_TURNS ? turn : HK_C(0);
  const hk_t fits = hk_branch_step(branch, q, x, width * width * (arc + HK_C(2) * (steep * steep)));
  if (!(fits >= HK_C(1))) return fits;
  for (int i = 0; i < HK_N; i++) {
    const hk_t move = x[i] - q[i];
    most = HK_FMAX(HK_FABS(move), most);
    rate[i] = move / width;
    q[i] = x[i];
  }
  return most > rules->creep ? fits : HK_C(-1);
}

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

/* Folds: where a leaf ends, and the way with it. Ahead of one the joints go like the square root of the share of the way
   that is left, so that 1 / |q'|^2 falls evenly, and is 0 there: two rates tell where. Of a way that passes close by one,
   the place moves on by a quarter of what has been gone (or by half, past a posture about which joints spin).
   A way is given up where the place stands still until 4^-SURE of the share is left; the posture is then led on while
   Newton's method converges, to 4^-CLOSER at least. It is a judgement, no proof: it refuses poses, and answers none. */
enum { HK_SURE = 4, HK_CLOSER = 7 };

typedef struct {
  hk_t share, slack, at, first;
  int found, agreed;
} hk_fold;

/* Take in the joints' rate at a share: 1 where the fold that it shows has moved by at most so much of what was gone. */
static int hk_fold_agrees(hk_fold *fold, hk_t share, const hk_t *rate, hk_t most) {
  const hk_t slack = HK_C(1) / hk_dot(rate, rate), gone = share - fold->share, fall = fold->slack - slack;
  const hk_t at = share + gone * (slack / fall);
  const int agrees = fall > HK_C(0) && at > share && HK_FABS(at - fold->at) <= most * gone;
  fold->share = share, fold->slack = slack, fold->at = at;
  return agrees;
}

/* Look for a fold ahead of q, which is at a share of the way, by the joints' rate there, or in the middle of what led
   there. 1 where there is one before the way's end: q then lies close to it. x is for (q, p, R, c). */
static int hk_fold_ahead(hk_fold *fold, const hk_way *way, hk_t middle, hk_t share, const hk_t *rate, const hk_rules *rules,
                         hk_t *q, hk_t *x) {
  hk_t at[HK_N], y[HK_N + 3], margin;
  const int agrees = hk_fold_agrees(fold, middle, rate, HK_C(0.25));
  fold->agreed = agrees ? fold->agreed + 1 : 0;
  if (!agrees) fold->first = fold->slack;
  if (fold->agreed < 2 || fold->slack > HK_C(0.5) * fold->first) return 0;
  if (!(fold->at > share && HK_C(2) * fold->at - share < HK_C(1))) return 0;
  hk_fold near = *fold;
  fold->first = fold->slack; /* the next look, if any, where this has halved again */
  for (int i = 0; i < HK_N; i++) at[i] = q[i];
  for (int k = 0; k <= HK_CLOSER; k++) { /* to q at first, then to a quarter of the share left, by half of the motion */
    const hk_t left = k ? near.at - share : HK_C(0);
    share += HK_C(0.75) * left;
    for (int i = 0; i < HK_N; i++) x[i] = at[i] + (k ? left * y[i] : HK_C(0));
    hk_aim(way, share, x);
    if (!hk_newton(x, rules, &margin)) {
      if (k > HK_SURE) break;
      return 0;
    }
    for (int i = 0; i < HK_N; i++) at[i] = x[i];
    const hk_t ahead = HK_C(0.001) * (near.at - share);
    hk_aim(way, share + ahead, x);
    hk_leaf_body(x, y); /* the joints' rate */
    for (int i = 0; i < HK_N; i++) y[i] /= ahead;
    if (k && !hk_fold_agrees(&near, share, y, HK_C(k > 1 ? 0.1 : 0.25))) return 0;
    near.share = share, near.slack = HK_C(1) / hk_dot(y, y);
  }
  for (int i = 0; i < HK_N; i++) q[i] = at[i];
  fold->found = 1;
  return 1;
}


/* Inverse kinematics on a leaf: a way gone in stretches that are shown to keep to one branch, and in the pieces of newton.c
   where they cannot be.
   hk_go: from the posture q, at a share of the way; 0 at its end, 1 where it could not go on, 2 where it took too many pieces, 3 where it comes to
   a fold. q becomes the posture there; x is for (q, p, R, c). */
static int hk_go(const hk_way *way, const hk_rules *rules, hk_t share, hk_t *q, hk_t *x) {
  hk_t width, rate[HK_N];
  hk_fold fold = {HK_C(0), HK_C(0), HK_C(0), HK_C(0), 0, 0};
  hk_branch branch;
#ifdef HK_RAYS
  if (hk_on_ray(way, q)) return hk_go_ray(way, rules, q, x);
  if (hk_leap(way, rules, q, x)) return 0;
#endif
#ifdef HK_STRETCHES
  share = hk_go_stretches(way, rules, share, &fold, q, x);
  if (fold.found) return 3;
#endif
  branch.laid = 0;
  branch.length = HK_C(HK_LONGEST);
  width = HK_C(1) - share;
  for (int i = 0; i < HK_N; i++) rate[i] = HK_C(0);
  for (int tried = 0; share < HK_C(1); tried++) {
    const hk_t goal = HK_FMIN(HK_C(1), share + width), from = share;
    if (tried >= rules->tries) return 2;
    hk_aim(way, goal, x);
    const hk_t fits = hk_piece(x, q, rate, goal - share, HK_C(0), way->turn, &branch, rules);
    width = fits * (goal - share);
    if (fits >= HK_C(1) || (fits < HK_C(0) && goal == HK_C(1)))
      share = goal;
    else if (!(width >= rules->smallest))
      return 1;
    if (share > from && share < HK_C(1) && hk_fold_ahead(&fold, way, (from + share) / HK_C(2), share, rate, rules, q, x)) return 3;
  }
  return 0;
}

/* (q, p, R, c) in a row; 0 where something is not finite. */
static int hk_gather(const hk_t *q, const hk_t *target, const hk_t *c, hk_t *x) {
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  for (int i = 0; i < 3 * HK_FRAMES; i++) x[HK_N + i] = i < HK_POSE ? target[i] : HK_C(0);
  for (int i = 0; i < 9 * HK_FRAMES; i++) x[HK_N + 3 * HK_FRAMES + i] = HK_C(i % 9 % 4 == 0);
  for (int i = 0; i < HK_R; i++) x[HK_N + HK_TARGET + i] = c[i];
  return hk_finite(x, HK_N + HK_TARGET + HK_R) && hk_finite(target, HK_POSE);
}

int ppr_leaf_step(const ppr_real q[3], const ppr_real target[3], const ppr_real c[1],
    ppr_real dq[3]) {
  hk_t x[HK_N + HK_TARGET + HK_R], y[HK_N + 3];
  if (!hk_gather(q, target, c, x)) return hk_refuse(HK_N, dq);
  if (!hk_posed(target, HK_POSE)) {
    hk_refuse(HK_N, dq);
    return PPR_NOT_A_ROTATION;
  }
  hk_leaf_body(x, y);
  return hk_deliver(y, HK_N, dq);
}

int ppr_inverse(ppr_real q[3], const ppr_real target[3], const ppr_real c[1], int most) {
  hk_t x[HK_N + HK_TARGET + HK_R], y[HK_N + 3], g[HK_R + 2], T[16 * HK_FRAMES + 2], from[HK_TARGET], at[HK_N];
  hk_rules rules;
  hk_way way;
  if (!hk_gather(q, target, c, x)) return PPR_NOT_FINITE;
  if (!hk_posed(target, HK_POSE) || !hk_all_rotate(x + HK_N)) return PPR_NOT_A_ROTATION;
  hk_leaf_body(x, y);
  rules.singular = HK_C(HK_SINGULAR);
  rules.representation = HK_C(HK_REPRESENTATION);
  rules.contraction = HK_C(HK_CONTRACTION);
  rules.almost = HK_C(HK_ALMOST);
  rules.done = HK_C(HK_DONE);
  rules.smallest = HK_C(0);
  rules.creep = HK_C(-1);
  rules.side = y[HK_N + 2];
  rules.most = 12;
  rules.tries = most;
  if (!(y[HK_N] > rules.singular && y[HK_N + 1] > rules.representation)) return PPR_SINGULAR;
  hk_pose_body(q, T);
  hk_unpack(T, from);
  for (int i = 0; !HK_MATRICES && i < 9 * HK_FRAMES; i++) from[3 * HK_FRAMES + i] = HK_C(i % 9 % 4 == 0);
  hk_constraint_body(q, g);
  hk_way_to(from, g, x + HK_N, c, &way);
  for (int i = 0; i < HK_N; i++) at[i] = q[i];
  if (hk_go(&way, &rules, HK_C(0), at, x)) return PPR_NOT_CONVERGED;
  for (int i = 0; i < HK_N; i++) x[i] = q[i] = at[i];
  if (hk_beyond(q)) return PPR_LIMIT;
  hk_leaf_body(x, y);
  return hk_rough(y[HK_N], y[HK_N + 1]) ? PPR_IMPRECISE : PPR_OK;
}

int ppr_solve(ppr_real q[3], const ppr_real target[3], int most) {
  ppr_parameters parameters;
  hk_t at[HK_N];
  ppr_defaults(&parameters);
  ppr_start(at);
  const int status = ppr_inverse(at, target, parameters.leaf, most);
  for (int i = 0; i < HK_N && status < PPR_SINGULAR; i++) q[i] = at[i];
  return status;
}

