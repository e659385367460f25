
/* The constraint's value g(q); leaves are g(q) = c. */
int ${name}_constraint(const ${name}_real q[$n], ${name}_real g[$r]);

/* The correction dq of one Newton step from q towards the wanted pose on the leaf c. */
int ${name}_leaf_step(const ${name}_real q[$n], const ${name}_real target[$target], const ${name}_real c[$r],
    ${name}_real dq[$n]);

/* Inverse kinematics: q becomes the posture with the wanted pose on the leaf c that q moves to when the tool goes there
   straight; or, from ${NAME}_SINGULAR on, q stays. The way is gone in pieces, `most` at most (each has at most $newtons Newton
   steps): 4 are plenty for targets close by, as along a path, some 20 for 0.5 rad of joint motion. A piece is accepted
   only where it cannot lead to another branch. ${NAME}_LIMIT: q is that posture, but beyond a joint's limits. */
int ${name}_inverse(${name}_real q[$n], const ${name}_real target[$target], const ${name}_real c[$r], int most);

/* Inverse kinematics as a function of the pose alone, whatever came before: the same from the start posture, on its
   leaf. The whole way is gone at each call: 100 pieces are plenty for most of it, ${name}_inverse from the last
   answer is faster. */
int ${name}_solve(${name}_real q[$n], const ${name}_real target[$target], int most);
