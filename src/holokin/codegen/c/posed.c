/* 1 where a wanted pose of `count` numbers, a position or a matrix by rows, can be one: the last row of a matrix is 0 0 0 1,
   which is not so where the matrix is transposed, as by a library that keeps matrices by columns. */
static int hk_posed(const hk_t *pose, int count) {
  for (int i = 12; i < count; i++)
    if (!(HK_FABS(pose[i] - HK_C(i == 15)) < HK_C(HK_ROTATION))) return 0;
  return 1;
}
