/* Rigid transforms as 12 numbers: three rows of rotation and translation, as in the upper part of a 4 x 4 matrix. */
#ifndef EMULATOR_GEOMETRY_FRAME_H
#define EMULATOR_GEOMETRY_FRAME_H

struct frame {
    double row[3][4];
};

extern const struct frame frame_identity;

struct frame frame_product(const struct frame *a, const struct frame *b);
struct frame frame_inverse(const struct frame *a);
struct frame frame_of_offset(const double translation[3], const double rotation_vector[3]);
void frame_rotation_vector(const struct frame *frame, double rotation_vector[3]);
void frame_point(const struct frame *frame, const double in[3], double out[3]);
void frame_direction(const struct frame *frame, const double in[3], double out[3]);

#endif
