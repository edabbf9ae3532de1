/* Contact of the elastic layer with one solid: every piece of the sheet is a column, which the solid indents and
   shears. The code is independent of the emulated skin. */
#ifndef TAXEL_SIM_LAYER_CONTACT_H
#define TAXEL_SIM_LAYER_CONTACT_H

#include <stddef.h>
#include <stdint.h>

#include "division.h"

#define SIM_POSE 16 /* numbers of a pose: 4 x 4, by rows */
#define SIM_NO_TAXEL UINT32_MAX

/* Force law of the layer on an area of 25 mm2: taxel.sim.soft_contact.LayerLaw. */
struct sim_law {
    double stiffness_n_per_m;
    double stiffening_m;
    double closing_m;
    double solid_m;
    double straight_m;
};

/* Adhesion and sliding of the layer's surface on the solid: a column sticks to the point that it first touched, its
   shear acts as a spring, and it slides where the spring would exceed `coefficient` times the normal force. */
struct sim_friction {
    double coefficient;       /* 0: no friction */
    double stiffness_n_per_m; /* shear stiffness of 25 mm2 of the layer */
};

/* The caller owns all memory. Pieces are sorted by board, and within a board by square of the sheet. */
struct sim_layer {
    size_t boards;
    size_t square_pieces;     /* pieces of one square; each board has whole squares */
    const size_t *first;      /* [boards + 1], first piece of each board */
    const double *position;   /* [pieces][3], on the electrode's level, bracket frame, metres */
    const double *normal;     /* [pieces][3] */
    const double *half_sides; /* [pieces][2][3], half of each side of the piece, bracket frame, metres */
    const double *area_share; /* [pieces], area of the piece divided by the area of the force law, 25 mm2 */
    const uint32_t *taxel;    /* [pieces], taxel of the piece; SIM_NO_TAXEL: a piece of the margin */
    const double *board_size; /* [boards], largest distance of a point of a piece from the bracket's origin, metres */
    double square_size_m;     /* largest distance of a piece from the middle piece of its square, metres */
    double piece_size_m;      /* largest distance of a point of a piece from the middle of the piece, metres */
    double thickness_m;
    double near_m;      /* search distance: farther pieces are ignored until the board has moved by this distance */
    double max_depth_m; /* largest indentation for which the near faces are complete */
    double min_slope;   /* see struct sim_face */
    struct sim_law law;
    struct sim_friction friction;
    struct sim_solid solid;
    /* State between the calls. */
    uint32_t *near;       /* [pieces], near pieces of board b beginning at first[b] */
    size_t *near_count;   /* [boards] */
    double *near_normals; /* [boards][faces][3], faces of a polytope that the near pieces can touch */
    double *near_offsets; /* [boards][faces] */
    size_t *near_faces;   /* [boards], number of these faces */
    double *search_pose;  /* [boards][SIM_POSE], pose of the board at the last search, solid's frame */
    double *slack_m;      /* [boards], motion from there that requires a new search; below 0: search now */
    double *clearance_m;  /* [boards], lower bound of the distance of the layer from the solid at the last load */
    double *anchor;       /* [pieces][3], point of the solid to which a piece sticks, solid's frame */
    double *touched;      /* [pieces], share of the area that touched the solid at the last advance; 0: no anchor */
};

/* Return sizeof (struct sim_layer), for a check by a caller in another language. */
size_t sim_layer_struct_size(void);

/* Compute the contact of boards with the solid. poses: [boards][SIM_POSE], brackets in the world. solid_pose:
   [SIM_POSE], world.
   wrench: [boards][6], force and moment on each board about its bracket's origin, world.
   stiffness: [boards][6][6], negative derivative of the wrench with respect to a small motion of the board
   (translation, rotation), world.
   taxel_force: [taxels] or NULL, newtons along the normals; set to zero by the caller.
   advance: not 0: store where the pieces now stick to the solid; 0: the stored points are unchanged. */
void sim_layer_load(struct sim_layer *layer, const double *poses, const double *solid_pose, double *wrench,
                    double *stiffness, double *taxel_force, int advance);

#endif
