/* The elastic layer against one solid: every piece of the sheet is a spring along its normal. The simulator's own; it
   shares nothing with the emulated skin. */
#ifndef TAXEL_SIM_LAYER_CONTACT_H
#define TAXEL_SIM_LAYER_CONTACT_H

#include <stddef.h>
#include <stdint.h>

#include "ray.h"

#define SIM_POSE 16 /* numbers of a pose: 4 x 4, by rows */
#define SIM_NOBODYS UINT32_MAX

/* Force over compression of the whole layer under one taxel: taxel.sim.soft_contact.LayerLaw. */
struct sim_law {
    double stiffness_n_per_m;
    double stiffening_m;
    double closing_m;
    double straight_m;
};

/* All memory is the caller's. Pieces of one board follow each other, and those of one square of sheet within them. */
struct sim_layer {
    size_t boards;
    size_t square_pieces;     /* pieces of one square; each board has whole squares */
    const size_t *first;      /* [boards + 1], first piece of each board */
    const double *position;   /* [pieces][3], on the electrode's level, bracket frame, metres */
    const double *normal;     /* [pieces][3] */
    const uint32_t *taxel;    /* [pieces], whose it is; SIM_NOBODYS: the bare margin's */
    const double *board_size; /* [boards], farthest piece from the bracket's origin, metres */
    double square_size_m;     /* farthest piece from its square's middle one */
    double thickness_m;
    double near_m;    /* pieces whose layer is farther are left out until the board has moved by as much */
    double deepest_m; /* a line that enters farther below the electrode comes in through another side */
    struct sim_law law;
    struct sim_solid solid;
    /* What the library keeps from call to call. */
    uint32_t *near;       /* [pieces], from first[b] on those of board b */
    size_t *near_count;   /* [boards] */
    double *near_normals; /* [boards][faces][3], the faces of a polytope that these pieces may meet */
    double *near_offsets; /* [boards][faces] */
    size_t *near_faces;   /* [boards], how many */
    double *looked;       /* [boards][SIM_POSE], where the board was when its near pieces were found */
    double *slack_m;      /* [boards], how far it may move from there; below 0: look in any case */
};

/* sizeof (struct sim_layer), for a caller that mirrors it. */
size_t sim_layer_struct_size(void);

/* Contact of brackets at poses [boards][SIM_POSE] with the solid at solid_pose [SIM_POSE], both in the world.
   wrench: [boards][6], force and moment on each board about its bracket's origin, world.
   stiffness: [boards][6][6], how the wrench falls with a small motion of the board (translation, rotation), world.
   taxel_force: [taxels] or NULL, newtons; set to zero by the caller. */
void sim_layer_load(struct sim_layer *layer, const double *poses, const double *solid_pose, double *wrench,
                    double *stiffness, double *taxel_force);

#endif
