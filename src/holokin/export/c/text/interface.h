/* $title
   Written by holokin $version from: $origin. Lengths in m, angles in rad, times in s.

   $strategy_words

   Joints: $joints.
   Task rows: $rows.
   Poses are 4x4 matrices by rows (16 numbers): $pose_of.$pose_note
   $pose_checked
   Functions with a status: where it is ${NAME}_SINGULAR or more their results are zero. None allocates, keeps
   anything between calls, or loops without a bound. Define ${NAME}_FLOAT for single precision.$limit_words */
#ifndef ${NAME}_H
#define ${NAME}_H

/* Of this export: its files go together, and others do not compile with them. */
#define ${NAME}_EXPORT 0x0123456789abcdefU

#ifdef __cplusplus
extern "C" {
#endif

#ifdef ${NAME}_FLOAT
typedef float ${name}_real;
#else
typedef double ${name}_real;
#endif

enum {
  ${NAME}_N = $n,      /* joints */
  ${NAME}_M = $m,      /* task rows */
  ${NAME}_R = $r,      /* numbers of a leaf */
  ${NAME}_TARGET = $target, /* numbers of a wanted pose */
  ${NAME}_TWIST = $twist   /* numbers of the twist that leads there */
};

enum {
  ${NAME}_IMPRECISE = -1,   /* single precision only: near a singularity, results have two or three digits */
  ${NAME}_OK = 0,
  ${NAME}_SLOWED = 1,       /* a joint's speed limit: slower along the path, in the same direction */
  ${NAME}_LIMIT = 2,        /* a joint stands at its position limit: the path does not go on */
  ${NAME}_SINGULAR = 3,     /* $singular_words */
  ${NAME}_NOT_FINITE = 4,   /* an argument is infinite or not a number */
  ${NAME}_NOT_CONVERGED = 5, /* inverse kinematics: the leaf ends before the wanted pose, or `most` pieces are too few */
  ${NAME}_BAD_PARAMETERS = 6, /* dt or most_error is not above 0, least_rcond not in [0, 1), a gain negative or not below 2/dt */
  ${NAME}_NOT_A_ROTATION = 7, /* a wanted pose is none: transposed, or, for inverse kinematics, scaled, skewed or left-handed */
  ${NAME}_LOST = 8          /* a control step: the tool is further than most_error from where it is wanted */
};

/* The parameters of a control step. ${name}_defaults gives those of the start posture, with gains of 0.1/dt: another
   dt wants other gains, below 2/dt. */
typedef struct {
$leaf_member  ${name}_real dt;              /* the loop's step [s] */
  ${name}_real gain;            /* K [1/s]: how fast an error of the tool fades */
  ${name}_real constraint_gain; /* K_g [1/s]: how fast the joints are led back to their leaf */
  ${name}_real most_error;      /* of the tool [m, rad]: beyond it a step stands still, LOST */
  ${name}_real least_rcond;     /* of [J; J_g] or J: up to it a step stands still, SINGULAR */
} ${name}_parameters;

void ${name}_defaults(${name}_parameters *parameters);
void ${name}_start(${name}_real q[$n]);

/* $pose_words T at q. */
int ${name}_pose(const ${name}_real q[$n], ${name}_real T[$poses]);

/* G ($n x $m, by rows) and dq = G dx: joint rates for task rates dx ($rates). */
int ${name}_gain(const ${name}_real q[$n], ${name}_real G[$nm]);
int ${name}_rate(const ${name}_real q[$n], const ${name}_real dx[$m], ${name}_real dq[$n]);

/* One control step: joint rates dq that take the tool to `target`, where it is wanted at the end of the step, with
   feedback to the path$and_leaf. `twist` is the constant one that takes the wanted pose of now there: $twist_words.
   dq is slowed by `scale` (0 to 1) where limits ask for it: go on along the path by scale * dt. */
int ${name}_step(const ${name}_real q[$n], const ${name}_real target[$target], const ${name}_real twist[$twist],
    const ${name}_parameters *parameters, ${name}_real dq[$n], ${name}_real *scale);
$leaf_interface
#ifdef __cplusplus
}
#endif

#endif
