
/* The constraint's value g(q); leaves are g(q) = c. */
int ${name}_constraint(const ${name}_real q[$n], ${name}_real g[$r]);

/* The correction dq of one Newton step from q towards the wanted pose on the leaf c. */
int ${name}_leaf_step(const ${name}_real q[$n], const ${name}_real target[$target], const ${name}_real c[$r],
    ${name}_real dq[$n]);

/* Inverse kinematics: q becomes the posture on the leaf c with the wanted pose, or, from ${NAME}_SINGULAR on, stays.
   Newton from q, at most `most` steps (12 is plenty), refused where it might land on another branch: keep targets close,
   as along a path. ${NAME}_LIMIT: q is that posture, but beyond a joint's limits. */
int ${name}_inverse(${name}_real q[$n], const ${name}_real target[$target], const ${name}_real c[$r], int most);
