/* 1 where wanted poses of `count` numbers, a point or 4x4 matrices by rows, can be such: the last row of a matrix is 0 0 0 1,
   which is not so where the matrix is transposed, as by a library that keeps matrices by columns. */
static int hk_posed(const hk_t *pose, int count) {
  for (int i = 0; HK_MATRICES && i < count; i++)
    if (i % 16 >= 12 && !(HK_FABS(pose[i] - HK_C(i % 16 == 15)) < HK_C(HK_ROTATION))) return 0;
  return 1;
}
