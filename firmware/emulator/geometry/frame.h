/* Rigid transforms as 12 numbers: three rows of rotation and translation, as in the upper part of a 4 x 4 matrix. */
#ifndef EMULATOR_GEOMETRY_FRAME_H
#define EMULATOR_GEOMETRY_FRAME_H

struct frame {
    double row[3][4];
};

extern const struct frame frame_identity;

/* Compose two transforms: the result applies b first, then a. */
struct frame frame_product(const struct frame *a, const struct frame *b);

/* Return the inverse of a rigid transform. */
struct frame frame_inverse(const struct frame *a);

/* Return the transform that rotates by |rotation_vector| radians about rotation_vector, then translates (metres). */
struct frame frame_of_offset(const double translation[3], const double rotation_vector[3]);

/* Compute the rotation vector of a transform, of length 0 to pi radians. */
void frame_rotation_vector(const struct frame *frame, double rotation_vector[3]);

/* Transform a point (metres) by rotation and translation. */
void frame_point(const struct frame *frame, const double in[3], double out[3]);

/* Rotate a direction, without the translation. */
void frame_direction(const struct frame *frame, const double in[3], double out[3]);

#endif
