  hk_t x[HK_N + HK_TARGET + HK_R], y[HK_N + 3];
  if (hk_gather(at, target, parameters.leaf, x) && hk_posed(target, HK_POSE) && $turned) {
    hk_signed(target, parameters.leaf, $row, y); /* by the closed form: the posture with the signs of the start */
    if (hk_real(y) && y[HK_N + 2] < HK_C(HK_ROTATION)) {
      for (int i = 0; i < HK_N; i++) x[i] = y[i];
      hk_leaf_body(x, y);
      if (y[HK_N] > HK_C(HK_SINGULAR) && y[HK_N + 1] > HK_C(HK_REPRESENTATION)) {
        for (int i = 0; i < HK_N; i++) q[i] = x[i] + y[i]; /* a last Newton step */
        return hk_rough(y[HK_N], y[HK_N + 1]) ? ${NAME}_IMPRECISE : ${NAME}_OK;
      }
    }
  }
