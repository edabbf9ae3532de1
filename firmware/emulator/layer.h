/* The dielectric: how a normal force on one taxel changes what its fringe field passes through.
 *
 * Silicone pillars stand in air. Pressure shortens them (neo-Hookean in compression), the air between them goes, and the
 * layer's permittivity rises from that of the mixture to that of solid silicone: steep at first, then saturating. */
#ifndef EMULATOR_LAYER_H
#define EMULATOR_LAYER_H

/* Prepare the curve; must be called once before layer_permittivity_rise(). */
void layer_init(void);

/* Relative rise of the layer's permittivity, 0 at no force, for a force in newtons on one taxel's 5 mm x 5 mm cell. */
double layer_permittivity_rise(double force_n);

#endif
