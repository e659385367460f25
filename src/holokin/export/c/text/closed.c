
#ifdef HK_FLOAT
#define HK_MEETING $doubt_float
#else
#define HK_MEETING $doubt
#endif

/* y: the posture of some signs, as bits, then how real it is, how far within the limits, the fault of the pose. */
static void hk_signed(const hk_t *target, const hk_t *c, int signs, hk_t *y) {
  hk_t x[16 + HK_R + 3];
  for (int i = 0; i < 16; i++) x[i] = target[i];
  for (int i = 0; i < HK_R; i++) x[16 + i] = c[i];
  for (int i = 0; i < 3; i++) x[16 + HK_R + i] = (signs >> (2 - i)) & 1 ? HK_C(-1) : HK_C(1);
  hk_posture_body(x, y);
}

/* 1 where that is a posture, within the limits. */
static int hk_real(const hk_t *y) {
  return y[HK_N] > HK_C(HK_MEETING) && y[HK_N + 1] >= HK_C(0) && hk_finite(y, HK_N);
}

int ${name}_postures(const ${name}_real target[$target], $c_given${name}_real q[$n8], int signs[8]) {
  hk_t y[HK_N + 3];
  int count = 0;
  if (!hk_finite(target, 16) || !hk_finite($c_taken, HK_R)) return -${NAME}_NOT_FINITE;
  for (int s = 0; s < 8; s++) {
    hk_signed(target, $c_taken, s, y);
    if (!(y[HK_N + 2] < HK_C(HK_ROTATION))) return -${NAME}_NOT_A_ROTATION;
    if (!hk_real(y)) continue;
    for (int i = 0; i < HK_N; i++) q[count * HK_N + i] = y[i];
    signs[count++] = s;
  }
  return count;
}
