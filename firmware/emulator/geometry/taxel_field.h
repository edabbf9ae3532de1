/* The field of one taxel: the quantities by which the layer and an object above the taxel change its fringe capacitance
 * (the part of the capacitance between TX and RX electrode whose field passes through the layer). */
#ifndef EMULATOR_GEOMETRY_TAXEL_FIELD_H
#define EMULATOR_GEOMETRY_TAXEL_FIELD_H

struct taxel_field {
    double rise; /* relative rise of the fringe capacitance through the layer, mean over the taxel */
    /* distance to the object before contact, metres, mean over the cells; CONTACT_FAR_M if no effect uses it */
    double gap;
    double force; /* newtons */
};

#endif
