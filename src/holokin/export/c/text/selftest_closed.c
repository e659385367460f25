    /* All postures at the pose of the vector: each has pose and leaf, signs of its own, and one is the vector's. */
    copy(v->pose, target, $target);
$copy_level    const double exact = sizeof(real) < sizeof(double) ? 1e-2 : 1e-9 * v->loss;
    const int count = ${name}_postures(target, ${c_call}found, signs);
    double nearest = HUGE_VAL;
    for (int i = 0; i < count; i++) {
      double apart = 0.0;
      for (int j = 0; j < $n; j++) apart = fmax(apart, fabs(remainder((double)found[$n * i + j] - v->q[j], 2.0 * acos(-1.0))));
      nearest = fmin(nearest, apart);
      if (i && signs[i] <= signs[i - 1]) nearest = HUGE_VAL;
      if (accept("pose of postures", k, ${name}_pose(found + $n * i, T), 1)) compare("pose of postures", k, T, v->pose, $poses, exact, 0.0);
$leaf_of_postures    }
    if (!(nearest <= exact) && !rough) {
      printf("postures: vector %d is %g from the nearest of %d\n", k, nearest, count);
      failures++;
    }
