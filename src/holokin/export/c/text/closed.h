
/* All postures with the wanted pose$on_leaf, by a closed form: how many, 0 to 8, lie in q, one after another, each of $n
   joints. Or -${NAME}_NOT_FINITE, -${NAME}_NOT_A_ROTATION, and q stays.
   signs[i], 0 to 7, says by its bits 4, 2, 1 at which of the three steps posture i has the root with a negative slope;
   the postures come in the order of these numbers. While the arm moves on the leaf and meets no singular posture its
   number stays: so it tells the branches apart. Where two postures meet, at a singular one, neither is counted.
   Limits: $postures_within. A joint that has several turns
   within its range is at the one nearest to the middle of it, or to 0 where it has no range. */
int ${name}_postures(const ${name}_real target[$target], $c_given${name}_real q[$n8], int signs[8]);
