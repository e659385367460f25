/* de-luca-oriolo, position of ppr. Written by holokin 0.1.0; see ppr.h. C99; not for -ffast-math, which hides what is not finite. */
#include "ppr.h"

#ifdef PPR_FLOAT
#define HK_FLOAT
#define HK_SINGULAR 0.002
#define HK_REPRESENTATION 0.005
#define HK_ALMOST 0.001
#define HK_PRECISE 0.04
#define HK_CLEAR 0.03
#else
#define HK_SINGULAR 1e-10
#define HK_REPRESENTATION 1e-06
#define HK_ALMOST 1e-07
#endif
#define HK_HELD 1e-06
#define HK_CONTRACTION 0.125
#define HK_N 3
#define HK_M 2
#define HK_R 1
#define HK_POSE 3
#define HK_HOLD (HK_R + 3)
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
  const hk_t v3 = x[2];
  const hk_t v4 = HK_COS(v3);
  const hk_t v7 = HK_C(2.224744871391589) * v4;
  const hk_t v9 = HK_SIN(v3);
  const hk_t v10 = v4 - v9;
  const hk_t v12 = v10 + HK_C(-1.0);
  const hk_t v15 = HK_C(2.414213562373095) * v9;
  const hk_t v16 = v12 - v15;
  const hk_t v17 = HK_C(0.2928932188134525) * v16;
  const hk_t v18 = v12 - v17;
  const hk_t v19 = HK_C(0.7071067811865475) * v18;
  const hk_t v20 = v7 + v19;
  const hk_t v21 = HK_C(0.8164965809277261) * v20;
  const hk_t v22 = v4 - v21;
  const hk_t v25 = HK_C(0.2595130239938435) * v20;
  const hk_t v26 = v18 - v25;
  const hk_t v27 = HK_C(-0.5773502691896257) / v26;
  const hk_t v28 = v22 * v27;
  const hk_t v29 = HK_C(0.40824829046386296) - v28;
  const hk_t v31 = v29 / HK_C(-1.224744871391589);
  const hk_t v32 = HK_C(-0.7071067811865475) * v31;
  const hk_t v33 = HK_C(-0.7071067811865472) - v32;
  const hk_t v34 = HK_C(0.7071067811865475) * v16;
  const hk_t v35 = v9 + v34;
  const hk_t v36 = v35 * v27;
  const hk_t v37 = v33 + v36;
  const hk_t v39 = v37 / HK_C(-1.4142135623730951);
  y[0] = v39;
  y[2] = v31;
  y[4] = v27;
  const hk_t v44 = HK_C(-0.8164965809277263) - v28;
  const hk_t v45 = v44 / HK_C(-1.224744871391589);
  const hk_t v46 = HK_C(-0.7071067811865475) * v45;
  const hk_t v47 = v36 - v46;
  const hk_t v48 = v47 / HK_C(-1.4142135623730951);
  y[1] = v48;
  y[3] = v45;
  y[5] = v27;
  const hk_t v53 = HK_FABS(v26);
  const hk_t v54 = HK_FMIN(HK_C(1.224744871391589), v53);
  const hk_t v56 = HK_FMAX(HK_C(1.4142135623730951), v53);
  const hk_t v57 = v54 / v56;
  y[6] = v57;
  y[7] = HK_C(1.0);
}
static void hk_rate_body(const hk_t *restrict x, hk_t *restrict y) {
  (void)x;
  (void)y;
  const hk_t v0 = x[3];
  const hk_t v2 = HK_C(1.7071067811865472) * v0;
  const hk_t v3 = v0 - v2;
  const hk_t v5 = x[4];
  const hk_t v8 = HK_C(2.224744871391589) * v5;
  const hk_t v10 = HK_C(0.4999999999999999) * v0;
  const hk_t v11 = v8 - v10;
  const hk_t v12 = HK_C(0.8164965809277261) * v11;
  const hk_t v13 = v5 - v12;
  const hk_t v14 = x[2];
  const hk_t v15 = HK_COS(v14);
  const hk_t v16 = HK_C(2.224744871391589) * v15;
  const hk_t v18 = HK_SIN(v14);
  const hk_t v19 = v15 - v18;
  const hk_t v21 = v19 + HK_C(-1.0);
  const hk_t v24 = HK_C(2.414213562373095) * v18;
  const hk_t v25 = v21 - v24;
  const hk_t v26 = HK_C(0.2928932188134525) * v25;
  const hk_t v27 = v21 - v26;
  const hk_t v28 = HK_C(0.7071067811865475) * v27;
  const hk_t v29 = v16 + v28;
  const hk_t v30 = HK_C(0.8164965809277261) * v29;
  const hk_t v31 = v15 - v30;
  const hk_t v32 = HK_C(0.7071067811865475) * v0;
  const hk_t v34 = HK_C(0.2595130239938435) * v11;
  const hk_t v35 = v32 + v34;
  const hk_t v36 = HK_C(0.2595130239938435) * v29;
  const hk_t v37 = v27 - v36;
  const hk_t v38 = v35 / v37;
  const hk_t v39 = v31 * v38;
  const hk_t v40 = v13 + v39;
  const hk_t v42 = v40 / HK_C(-1.224744871391589);
  const hk_t v43 = HK_C(-0.7071067811865475) * v42;
  const hk_t v44 = v3 - v43;
  const hk_t v45 = HK_C(0.7071067811865475) * v25;
  const hk_t v46 = v18 + v45;
  const hk_t v47 = v46 * v38;
  const hk_t v48 = v44 - v47;
  const hk_t v50 = v48 / HK_C(-1.4142135623730951);
  y[0] = v50;
  y[1] = v42;
  const hk_t v53 = -v38;
  y[2] = v53;
  const hk_t v56 = HK_FABS(v37);
  const hk_t v57 = HK_FMIN(HK_C(1.224744871391589), v56);
  const hk_t v59 = HK_FMAX(HK_C(1.4142135623730951), v56);
  const hk_t v60 = v57 / v59;
  y[3] = v60;
  y[4] = HK_C(1.0);
}
static void hk_step_body(const hk_t *restrict x, hk_t *restrict y) {
  (void)x;
  (void)y;
  const hk_t v1 = x[6];
  const hk_t v2 = x[10];
  const hk_t v3 = x[3];
  const hk_t v4 = x[0];
  const hk_t v5 = x[2];
  const hk_t v6 = HK_COS(v5);
  const hk_t v7 = v4 + v6;
  const hk_t v8 = v3 - v7;
  const hk_t v9 = v2 * v8;
  const hk_t v10 = v1 + v9;
  const hk_t v13 = HK_C(2.414213562373095) * v10;
  const hk_t v14 = x[11];
  const hk_t v15 = x[8];
  const hk_t v16 = x[1];
  const hk_t v17 = v4 + v16;
  const hk_t v18 = v17 - v5;
  const hk_t v19 = HK_SIN(v5);
  const hk_t v20 = v18 + v19;
  const hk_t v21 = v20 + v6;
  const hk_t v22 = v15 - v21;
  const hk_t v23 = v14 * v22;
  const hk_t v24 = v13 + v23;
  const hk_t v25 = HK_C(0.7071067811865475) * v24;
  const hk_t v26 = v10 - v25;
  const hk_t v28 = x[7];
  const hk_t v29 = x[4];
  const hk_t v30 = v16 + v19;
  const hk_t v31 = v29 - v30;
  const hk_t v32 = v2 * v31;
  const hk_t v33 = v28 + v32;
  const hk_t v36 = HK_C(2.224744871391589) * v33;
  const hk_t v38 = HK_C(0.2928932188134525) * v24;
  const hk_t v39 = v23 - v38;
  const hk_t v40 = HK_C(0.7071067811865475) * v39;
  const hk_t v41 = v36 + v40;
  const hk_t v42 = HK_C(0.8164965809277261) * v41;
  const hk_t v43 = v33 - v42;
  const hk_t v44 = HK_C(2.224744871391589) * v6;
  const hk_t v45 = v6 - v19;
  const hk_t v47 = v45 + HK_C(-1.0);
  const hk_t v48 = HK_C(2.414213562373095) * v19;
  const hk_t v49 = v47 - v48;
  const hk_t v50 = HK_C(0.2928932188134525) * v49;
  const hk_t v51 = v47 - v50;
  const hk_t v52 = HK_C(0.7071067811865475) * v51;
  const hk_t v53 = v44 + v52;
  const hk_t v54 = HK_C(0.8164965809277261) * v53;
  const hk_t v55 = v6 - v54;
  const hk_t v57 = HK_C(0.2595130239938435) * v41;
  const hk_t v58 = v39 - v57;
  const hk_t v59 = HK_C(0.2595130239938435) * v53;
  const hk_t v60 = v51 - v59;
  const hk_t v61 = v58 / v60;
  const hk_t v62 = v55 * v61;
  const hk_t v63 = v43 - v62;
  const hk_t v65 = v63 / HK_C(-1.224744871391589);
  const hk_t v66 = HK_C(-0.7071067811865475) * v65;
  const hk_t v67 = v26 - v66;
  const hk_t v68 = HK_C(0.7071067811865475) * v49;
  const hk_t v69 = v19 + v68;
  const hk_t v70 = v69 * v61;
  const hk_t v71 = v67 + v70;
  const hk_t v73 = v71 / HK_C(-1.4142135623730951);
  const hk_t v74 = HK_FABS(v73);
  const hk_t v76 = HK_FMAX(v74, HK_C(1e-12));
  const hk_t v77 = HK_C(1) / v76;
  const hk_t v78 = HK_FMIN(HK_C(1.0), v77);
  const hk_t v79 = HK_FABS(v65);
  const hk_t v80 = HK_FMAX(v79, HK_C(1e-12));
  const hk_t v81 = HK_C(1) / v80;
  const hk_t v82 = HK_FMIN(v78, v81);
  const hk_t v84 = HK_FABS(v61);
  const hk_t v85 = HK_FMAX(v84, HK_C(1e-12));
  const hk_t v86 = HK_C(3.141592653589793) / v85;
  const hk_t v87 = HK_FMIN(v82, v86);
  const hk_t v88 = x[9];
  const hk_t v89 = v73 * v88;
  const hk_t v90 = HK_LT(HK_C(1e-12), v89);
  const hk_t v92 = HK_C(5.0) - v4;
  const hk_t v94 = HK_FMAX(v92, HK_C(0.0));
  const hk_t v95 = HK_FMAX(v89, HK_C(1e-12));
  const hk_t v96 = v94 / v95;
  const hk_t v97 = HK_IF(v90, v96);
  const hk_t v98 = HK_NOT(v90);
  const hk_t v99 = HK_IF(v98, HK_C(1.0));
  const hk_t v100 = v97 + v99;
  const hk_t v101 = HK_FMIN(HK_C(1.0), v100);
  const hk_t v102 = -v89;
  const hk_t v103 = HK_LT(HK_C(1e-12), v102);
  const hk_t v105 = HK_C(-5.0) - v4;
  const hk_t v106 = -v105;
  const hk_t v107 = HK_FMAX(v106, HK_C(0.0));
  const hk_t v108 = HK_FMAX(v102, HK_C(1e-12));
  const hk_t v109 = v107 / v108;
  const hk_t v110 = HK_IF(v103, v109);
  const hk_t v111 = HK_NOT(v103);
  const hk_t v112 = HK_IF(v111, HK_C(1.0));
  const hk_t v113 = v110 + v112;
  const hk_t v114 = HK_FMIN(v101, v113);
  const hk_t v115 = v65 * v88;
  const hk_t v116 = HK_LT(HK_C(1e-12), v115);
  const hk_t v117 = HK_C(5.0) - v16;
  const hk_t v118 = HK_FMAX(v117, HK_C(0.0));
  const hk_t v119 = HK_FMAX(v115, HK_C(1e-12));
  const hk_t v120 = v118 / v119;
  const hk_t v121 = HK_IF(v116, v120);
  const hk_t v122 = HK_NOT(v116);
  const hk_t v123 = HK_IF(v122, HK_C(1.0));
  const hk_t v124 = v121 + v123;
  const hk_t v125 = HK_FMIN(v114, v124);
  const hk_t v126 = -v115;
  const hk_t v127 = HK_LT(HK_C(1e-12), v126);
  const hk_t v128 = HK_C(-5.0) - v16;
  const hk_t v129 = -v128;
  const hk_t v130 = HK_FMAX(v129, HK_C(0.0));
  const hk_t v131 = HK_FMAX(v126, HK_C(1e-12));
  const hk_t v132 = v130 / v131;
  const hk_t v133 = HK_IF(v127, v132);
  const hk_t v134 = HK_NOT(v127);
  const hk_t v135 = HK_IF(v134, HK_C(1.0));
  const hk_t v136 = v133 + v135;
  const hk_t v137 = HK_FMIN(v125, v136);
  const hk_t v138 = v61 * v88;
  const hk_t v139 = HK_LT(HK_C(1e-12), v138);
  const hk_t v141 = HK_C(12.566370614359172) - v5;
  const hk_t v142 = HK_FMAX(v141, HK_C(0.0));
  const hk_t v143 = HK_FMAX(v138, HK_C(1e-12));
  const hk_t v144 = v142 / v143;
  const hk_t v145 = HK_IF(v139, v144);
  const hk_t v146 = HK_NOT(v139);
  const hk_t v147 = HK_IF(v146, HK_C(1.0));
  const hk_t v148 = v145 + v147;
  const hk_t v149 = HK_FMIN(v137, v148);
  const hk_t v150 = -v138;
  const hk_t v151 = HK_LT(HK_C(1e-12), v150);
  const hk_t v153 = HK_C(-12.566370614359172) - v5;
  const hk_t v154 = -v153;
  const hk_t v155 = HK_FMAX(v154, HK_C(0.0));
  const hk_t v156 = HK_FMAX(v150, HK_C(1e-12));
  const hk_t v157 = v155 / v156;
  const hk_t v158 = HK_IF(v151, v157);
  const hk_t v159 = HK_NOT(v151);
  const hk_t v160 = HK_IF(v159, HK_C(1.0));
  const hk_t v161 = v158 + v160;
  const hk_t v162 = HK_FMIN(v149, v161);
  const hk_t v163 = HK_FMIN(v87, v162);
  const hk_t v164 = v163 * v73;
  y[0] = v164;
  const hk_t v166 = v163 * v65;
  y[1] = v166;
  const hk_t v168 = v163 * v61;
  y[2] = v168;
  y[3] = v163;
  const hk_t v172 = HK_FABS(v60);
  const hk_t v173 = HK_FMIN(HK_C(1.224744871391589), v172);
  const hk_t v175 = HK_FMAX(HK_C(1.4142135623730951), v172);
  const hk_t v176 = v173 / v175;
  y[4] = v176;
  y[5] = HK_C(1.0);
  y[6] = v162;
  const hk_t v180 = HK_FABS(v4);
  const hk_t v182 = v180 / HK_C(1024.0);
  const hk_t v183 = HK_FABS(v16);
  const hk_t v184 = v183 / HK_C(1024.0);
  const hk_t v185 = v182 + v184;
  const hk_t v186 = HK_FABS(v5);
  const hk_t v187 = v186 / HK_C(1024.0);
  const hk_t v188 = v185 + v187;
  const hk_t v189 = HK_FABS(v3);
  const hk_t v190 = v189 / HK_C(1024.0);
  const hk_t v191 = v188 + v190;
  const hk_t v192 = HK_FABS(v29);
  const hk_t v193 = v192 / HK_C(1024.0);
  const hk_t v194 = v191 + v193;
  const hk_t v195 = x[5];
  const hk_t v196 = HK_FABS(v195);
  const hk_t v197 = v196 / HK_C(1024.0);
  const hk_t v198 = v194 + v197;
  const hk_t v199 = HK_FABS(v1);
  const hk_t v200 = v199 / HK_C(1024.0);
  const hk_t v201 = v198 + v200;
  const hk_t v202 = HK_FABS(v28);
  const hk_t v203 = v202 / HK_C(1024.0);
  const hk_t v204 = v201 + v203;
  const hk_t v205 = HK_FABS(v15);
  const hk_t v206 = v205 / HK_C(1024.0);
  const hk_t v207 = v204 + v206;
  const hk_t v208 = HK_FABS(v88);
  const hk_t v209 = v208 / HK_C(1024.0);
  const hk_t v210 = v207 + v209;
  const hk_t v211 = HK_FABS(v2);
  const hk_t v212 = v211 / HK_C(1024.0);
  const hk_t v213 = v210 + v212;
  const hk_t v214 = HK_FABS(v14);
  const hk_t v215 = v214 / HK_C(1024.0);
  const hk_t v216 = v213 + v215;
  y[7] = v216;
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
  const hk_t v8 = HK_C(2.414213562373095) * v5;
  const hk_t v9 = x[15];
  const hk_t v10 = x[1];
  const hk_t v11 = v1 + v10;
  const hk_t v12 = v11 - v2;
  const hk_t v13 = HK_SIN(v2);
  const hk_t v14 = v12 + v13;
  const hk_t v15 = v14 + v3;
  const hk_t v16 = v9 - v15;
  const hk_t v17 = v8 + v16;
  const hk_t v18 = HK_C(0.7071067811865475) * v17;
  const hk_t v19 = v5 - v18;
  const hk_t v21 = x[4];
  const hk_t v22 = v10 + v13;
  const hk_t v23 = v21 - v22;
  const hk_t v26 = HK_C(2.224744871391589) * v23;
  const hk_t v28 = HK_C(0.2928932188134525) * v17;
  const hk_t v29 = v16 - v28;
  const hk_t v30 = HK_C(0.7071067811865475) * v29;
  const hk_t v31 = v26 + v30;
  const hk_t v32 = HK_C(0.8164965809277261) * v31;
  const hk_t v33 = v23 - v32;
  const hk_t v34 = HK_C(2.224744871391589) * v3;
  const hk_t v35 = v3 - v13;
  const hk_t v37 = v35 + HK_C(-1.0);
  const hk_t v38 = HK_C(2.414213562373095) * v13;
  const hk_t v39 = v37 - v38;
  const hk_t v40 = HK_C(0.2928932188134525) * v39;
  const hk_t v41 = v37 - v40;
  const hk_t v42 = HK_C(0.7071067811865475) * v41;
  const hk_t v43 = v34 + v42;
  const hk_t v44 = HK_C(0.8164965809277261) * v43;
  const hk_t v45 = v3 - v44;
  const hk_t v47 = HK_C(0.2595130239938435) * v31;
  const hk_t v48 = v29 - v47;
  const hk_t v49 = HK_C(0.2595130239938435) * v43;
  const hk_t v50 = v41 - v49;
  const hk_t v51 = v48 / v50;
  const hk_t v52 = v45 * v51;
  const hk_t v53 = v33 - v52;
  const hk_t v55 = v53 / HK_C(-1.224744871391589);
  const hk_t v56 = HK_C(-0.7071067811865475) * v55;
  const hk_t v57 = v19 - v56;
  const hk_t v58 = HK_C(0.7071067811865475) * v39;
  const hk_t v59 = v13 + v58;
  const hk_t v60 = v59 * v51;
  const hk_t v61 = v57 + v60;
  const hk_t v63 = v61 / HK_C(-1.4142135623730951);
  y[0] = v63;
  y[1] = v55;
  y[2] = v51;
  const hk_t v68 = HK_FABS(v50);
  const hk_t v69 = HK_FMIN(HK_C(1.224744871391589), v68);
  const hk_t v71 = HK_FMAX(HK_C(1.4142135623730951), v68);
  const hk_t v72 = v69 / v71;
  y[3] = v72;
  y[4] = HK_C(1.0);
  const hk_t v76 = HK_COPYSIGN(HK_C(1.0), v50);
  y[5] = v76;
}

static int hk_finite(const hk_t *x, int count) {
  for (int i = 0; i < count; i++)
    if (!(x[i] - x[i] == HK_C(0))) return 0;
  return 1;
}

/* Single precision, and too near a singularity for four digits. */
static int hk_rough(hk_t conditioning, hk_t margin) {
#ifdef HK_PRECISE
  return conditioning < HK_C(HK_PRECISE) || margin < HK_C(HK_CLEAR);
#else
  (void)conditioning;
  (void)margin;
  return 0;
#endif
}

/* y: `count` results, then the conditioning and the margin of representations. */
static int hk_deliver(const hk_t *y, int count, hk_t *out) {
  const int sound = y[count] > HK_C(HK_SINGULAR) && y[count + 1] > HK_C(HK_REPRESENTATION) && hk_finite(y, count);
  for (int i = 0; i < count; i++) out[i] = sound ? y[i] : HK_C(0);
  if (!sound) return PPR_SINGULAR;
  return hk_rough(y[count], y[count + 1]) ? PPR_IMPRECISE : PPR_OK;
}

static int hk_refuse(int count, hk_t *out) {
  for (int i = 0; i < count; i++) out[i] = HK_C(0);
  return PPR_NOT_FINITE;
}

/* One control step. hk_step_body takes (q, pose, dx, held) and gives (dq, scale, conditioning,
   margin, room, given): room is the scale that positions allow, given is finite where all arguments are.
   held: the leaf c, dt, the gain and the leaf gain. pose: 16 numbers, a 4x4 matrix by rows, or 3, a position.
   out: dq, then the scale.
   Returns 0 as wanted, 1 slowed for a speed limit, 2 held at a position limit, 3 singular, 4 not finite; from 3 on
   dq is zero. */
HK_API int hk_step(const hk_t *q, const hk_t *pose, const hk_t *dx, hk_t *out, const hk_t *held) {
  enum { size = HK_N + HK_POSE + HK_M + HK_HOLD };
  hk_t x[size], y[HK_N + 5];
  int finite = 1;
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  for (int i = 0; i < HK_POSE; i++) x[HK_N + i] = pose[i];
  for (int i = 0; i < HK_M; i++) x[HK_N + HK_POSE + i] = dx[i];
  for (int i = 0; i < HK_HOLD; i++) x[HK_N + HK_POSE + HK_M + i] = held[i];
  hk_step_body(x, y);
  for (int i = 0; i < HK_N + 1; i++) finite &= y[i] - y[i] == HK_C(0);
  const int sound = y[HK_N + 1] > HK_C(HK_SINGULAR) && y[HK_N + 2] > HK_C(HK_REPRESENTATION);
  const int given = y[HK_N + 4] - y[HK_N + 4] == HK_C(0);
  if (!finite || !sound || !given) {
    for (int i = 0; i < HK_N + 1; i++) out[i] = HK_C(0);
    return given ? 3 : 4;
  }
  for (int i = 0; i < HK_N + 1; i++) out[i] = y[i];
#ifdef HK_IMPRECISE
  if (hk_rough(y[HK_N + 1], y[HK_N + 2])) return HK_IMPRECISE;
#endif
  if (y[HK_N] >= HK_C(1)) return 0;
  return y[HK_N + 3] > HK_C(HK_HELD) ? 1 : 2;
}

void ppr_defaults(ppr_hold *hold) {
  hold->leaf[0] = HK_C(1.2276018366025516);
  hold->dt = HK_C(0.001);
  hold->gain = HK_C(100.0);
  hold->leaf_gain = HK_C(100.0);
}

void ppr_start(ppr_real q[3]) {
  q[0] = HK_C(0.9022932188134525);
  q[1] = HK_C(-0.3035067811865475);
  q[2] = HK_C(0.7853981633974483);
}

int ppr_pose(const ppr_real q[3], ppr_real T[16]) {
  hk_t y[18];
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

int ppr_step(const ppr_real q[3], const ppr_real target[3], const ppr_real dx[2],
    const ppr_hold *hold, ppr_real dq[3], ppr_real *scale) {
  hk_t held[HK_HOLD], out[HK_N + 1];
  for (int i = 0; i < HK_R; i++) held[i] = hold->leaf[i];
  held[HK_R] = hold->dt;
  held[HK_R + 1] = hold->gain;
  held[HK_R + 2] = hold->leaf_gain;
  if (!(hold->dt > HK_C(0) && hold->gain >= HK_C(0) && hold->gain * hold->dt < HK_C(2) &&
        hold->leaf_gain >= HK_C(0) && hold->leaf_gain * hold->dt < HK_C(2))) {
    *scale = HK_C(0);
    hk_refuse(HK_N, dq);
    return PPR_BAD_HOLD;
  }
  const int status = hk_step(q, target, dx, out, held);
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

/* (q, p, R, c) in a row; 0 where something is not finite. */
static int hk_gather(const hk_t *q, const hk_t *target, const hk_t *c, hk_t *x) {
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  for (int i = 0; i < 3; i++) {
    x[HK_N + i] = target[i];
    for (int j = 0; j < 3; j++) x[HK_N + 3 + 3 * i + j] = i == j ? HK_C(1) : HK_C(0);
  }
  for (int i = 0; i < HK_R; i++) x[HK_N + 12 + i] = c[i];
  return hk_finite(x, HK_N + 12 + HK_R) && hk_finite(target, HK_POSE);
}

int ppr_leaf_step(const ppr_real q[3], const ppr_real target[3], const ppr_real c[1],
    ppr_real dq[3]) {
  hk_t x[HK_N + 12 + HK_R], y[HK_N + 3];
  if (!hk_gather(q, target, c, x)) return hk_refuse(HK_N, dq);
  hk_leaf_body(x, y);
  return hk_deliver(y, HK_N, dq);
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

/* Newton on [f(q) - x; g(q) - c], never jumping to another branch: the rules of motion/leaf.py. hk_leaf_body takes
   (q, p, R, c) and gives (dq, conditioning, margin, sign of det). */
typedef struct {
  hk_t singular, representation, contraction, almost, smallest, side;
  int most;
} hk_rules;

/* 1 and the new q where Newton contracts on the branch, else 0 and q as it was. x holds (q, p, R, c). */
static int hk_newton(hk_t *x, const hk_rules *rules) {
  hk_t y[HK_N + 3], q[HK_N], before = HK_INF;
  for (int i = 0; i < HK_N; i++) q[i] = x[i];
  for (int k = 0; k < rules->most; k++) {
    hk_t size = HK_C(0);
    hk_leaf_body(x, y);
    int sound = y[HK_N] > rules->singular && y[HK_N + 1] > rules->representation && y[HK_N + 2] * rules->side > HK_C(0);
    for (int i = 0; i < HK_N; i++) {
      sound &= y[i] - y[i] == HK_C(0);
      size = HK_FMAX(HK_FABS(y[i]), size);
    }
    if (!sound) break;
    if (before <= rules->almost) {
      if (size <= before)
        for (int i = 0; i < HK_N; i++) x[i] += y[i];
      return 1;
    }
    if (!(size <= rules->contraction * before)) break;
    for (int i = 0; i < HK_N; i++) x[i] += y[i];
    before = size;
  }
  for (int i = 0; i < HK_N; i++) x[i] = q[i];
  return 0;
}

int ppr_inverse(ppr_real q[3], const ppr_real target[3], const ppr_real c[1], int most) {
  hk_t x[HK_N + 12 + HK_R], y[HK_N + 3];
  hk_rules rules;
  if (!hk_gather(q, target, c, x)) return PPR_NOT_FINITE;
  hk_leaf_body(x, y);
  rules.singular = HK_C(HK_SINGULAR);
  rules.representation = HK_C(HK_REPRESENTATION);
  rules.contraction = HK_C(HK_CONTRACTION);
  rules.almost = HK_C(HK_ALMOST);
  rules.smallest = HK_C(1); /* steps are not halved here */
  rules.side = y[HK_N + 2];
  rules.most = most;
  if (!(y[HK_N] > rules.singular && y[HK_N + 1] > rules.representation)) return PPR_SINGULAR;
  if (!hk_newton(x, &rules)) return PPR_NOT_CONVERGED;
  for (int i = 0; i < HK_N; i++) q[i] = x[i];
  if (hk_beyond(q)) return PPR_LIMIT;
  hk_leaf_body(x, y);
  return hk_rough(y[HK_N], y[HK_N + 1]) ? PPR_IMPRECISE : PPR_OK;
}

