/* de-luca-oriolo, position of ppr
   Written by holokin 0.2.0 from: a test. Lengths in m, angles in rad, times in s.

   The strategy's leaves are g(q) = c, custom.

   Joints: q1, q2, q3.
   Task rows: x, y.
   Poses are 4x4 matrices by rows (16 numbers): the tool in the base frame. A wanted pose is a position, 3 numbers.
   Of a wanted position it is checked that it is finite.
   Functions with a status: where it is PPR_SINGULAR or more their results are zero. None allocates, keeps
   anything between calls, or loops without a bound. Define PPR_FLOAT for single precision. */
#ifndef PPR_H
#define PPR_H

/* Of this export: its files go together, and others do not compile with them. */
#define PPR_EXPORT 0x9a9dcc78cb4de268U

#ifdef __cplusplus
extern "C" {
#endif

#ifdef PPR_FLOAT
typedef float ppr_real;
#else
typedef double ppr_real;
#endif

enum {
  PPR_N = 3,      /* joints */
  PPR_M = 2,      /* task rows */
  PPR_R = 1,      /* numbers of a leaf */
  PPR_TARGET = 3, /* numbers of a wanted pose */
  PPR_TWIST = 3   /* numbers of the twist that leads there */
};

enum {
  PPR_IMPRECISE = -1,   /* single precision only: near a singularity, results have two or three digits */
  PPR_OK = 0,
  PPR_SLOWED = 1,       /* a joint's speed limit: slower along the path, in the same direction */
  PPR_LIMIT = 2,        /* a joint stands at its position limit: the path does not go on */
  PPR_SINGULAR = 3,     /* J, [J; J_g] or H loses rank, the representation does, or a result overflows */
  PPR_NOT_FINITE = 4,   /* an argument is infinite or not a number */
  PPR_NOT_CONVERGED = 5, /* inverse kinematics: the leaf ends before the wanted pose, or `most` pieces are too few */
  PPR_BAD_PARAMETERS = 6, /* dt or most_error is not above 0, least_rcond not in [0, 1), a gain negative or not below 2/dt */
  PPR_NOT_A_ROTATION = 7, /* a wanted pose is none: transposed, or, for inverse kinematics, scaled, skewed or left-handed */
  PPR_LOST = 8          /* a control step: the tool is further than most_error from where it is wanted */
};

/* The parameters of a control step. ppr_defaults gives those of the start posture, with gains of 0.1/dt: another
   dt wants other gains, below 2/dt. */
typedef struct {
  ppr_real leaf[1];         /* c = g(q) that is wanted at the end of the step */
  ppr_real leaf_rate[1];    /* c' [per s]: takes it there in dt; 0 for a leaf that stays */
  ppr_real dt;              /* the loop's step [s] */
  ppr_real gain;            /* K [1/s]: how fast an error of the tool fades */
  ppr_real constraint_gain; /* K_g [1/s]: how fast the joints are led back to their leaf */
  ppr_real most_error;      /* of the tool [m, rad]: beyond it a step stands still, LOST */
  ppr_real least_rcond;     /* of [J; J_g] or J: up to it a step stands still, SINGULAR */
} ppr_parameters;

void ppr_defaults(ppr_parameters *parameters);
void ppr_start(ppr_real q[3]);

/* The tool's pose T at q. */
int ppr_pose(const ppr_real q[3], ppr_real T[16]);

/* G (3 x 2, by rows) and dq = G dx: joint rates for task rates dx (m/s, m/s). */
int ppr_gain(const ppr_real q[3], ppr_real G[6]);
int ppr_rate(const ppr_real q[3], const ppr_real dx[2], ppr_real dq[3]);

/* One control step: joint rates dq that take the tool to `target`, where it is wanted at the end of the step, with
   feedback to the path and to the leaf. `twist` is the constant one that takes the wanted pose of now there: a velocity in the base frame, 3 numbers [m/s].
   dq is slowed by `scale` (0 to 1) where limits ask for it: go on along the path by scale * dt. */
int ppr_step(const ppr_real q[3], const ppr_real target[3], const ppr_real twist[3],
    const ppr_parameters *parameters, ppr_real dq[3], ppr_real *scale);

/* The constraint's value g(q); leaves are g(q) = c. */
int ppr_constraint(const ppr_real q[3], ppr_real g[1]);

/* The correction dq of one Newton step from q towards the wanted pose on the leaf c. */
int ppr_leaf_step(const ppr_real q[3], const ppr_real target[3], const ppr_real c[1],
    ppr_real dq[3]);

/* Inverse kinematics: q becomes the posture with the wanted pose on the leaf c that q moves to when the tool goes there
   straight; or, from PPR_SINGULAR on, q stays. The way is gone in pieces, `most` at most (each has at most 12 Newton
   steps): 4 are plenty for targets close by, as along a path, some 20 for 0.5 rad of joint motion. A piece is accepted
   only where it cannot lead to another branch. PPR_LIMIT: q is that posture, but beyond a joint's limits. */
int ppr_inverse(ppr_real q[3], const ppr_real target[3], const ppr_real c[1], int most);

/* Inverse kinematics as a function of the pose alone, whatever came before: the same from the start posture, on its
   leaf. The whole way is gone at each call: 100 pieces are plenty for most of it, ppr_inverse from the last
   answer is faster. */
int ppr_solve(ppr_real q[3], const ppr_real target[3], int most);

#ifdef __cplusplus
}
#endif

#endif
