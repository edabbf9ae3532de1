/* The dielectric layer above the electrodes: compression and relative rise of the permittivity under a normal force or
 * pressure.
 *
 * Silicone pillars stand in air on a solid silicone sheet. Pressure compresses the pillars (neo-Hookean) and displaces
 * the air, so that the permittivity of the layer rises from that of the mixture to that of solid silicone: steeply at
 * first, then it saturates. The sheet bears load, but the field of the electrodes does not pass through it. Equations:
 * docs/effects-physics.md. */
#ifndef EMULATOR_PHYSICS_LAYER_H
#define EMULATOR_PHYSICS_LAYER_H

#include <stddef.h>

#define LAYER_PILLAR_HEIGHT_M 0.0008 /* thesis, section 3.2 */
/* sheet below the pillars; the whole layer is near 1 mm under 50 N (thesis, 4.2.1) */
#define LAYER_SHEET_HEIGHT_M 0.0012

/* Compute the tables. Must be called once before any other function of this header. */
void layer_init(void);

/* Return the relative rise of the permittivity (0 without force) under a force in newtons on the 5 mm x 5 mm area of
 * one taxel. */
double layer_rise_at_force(double force_n);

/* Return the pressure (Pa) at a compression of the pillars (m), or its derivative (Pa/m). Beyond the compression that
 * leaves almost no air, the curve continues as a steep line, so that a solver always gets a finite value. */
double layer_pressure(double compression_m);
double layer_stiffness(double compression_m);

/* Return the compression of the pillars (m) under a pressure (Pa) of up to 16 MPa: the inverse of layer_pressure(). */
double layer_compression(double pressure_pa);

/* Return the work per area (J/m^2) of a compression: the integral of layer_pressure(). */
double layer_work(double compression_m);

/* Return the relative rise of the permittivity at a compression or under a pressure. The result agrees with
 * layer_rise_at_force() within a relative error of 3e-5 plus 1e-7. */
double layer_rise_at_compression(double compression_m);
double layer_rise_at_pressure(double pressure_pa);

/* Return the volume fraction of air in the layer at a relative rise of the permittivity. */
double layer_air_fraction(double rise);

/* Return the relative permittivity of the uncompressed layer. */
double layer_rest_permittivity(void);

/* Return the pressure (Pa) of the whole layer, pillars and sheet, at an indentation (m), or its derivative (Pa/m). */
double layer_contact_pressure(double compression_m);
double layer_contact_stiffness(double compression_m);

/* Return the pressure (Pa) of the whole layer at an indentation (m), and write its derivative *rate (Pa/m); both are 0
 * without compression. */
double layer_contact_curve(double compression_m, double *rate);

/* Compute pressure and derivative as layer_contact_curve() at `count` compressions. */
void layer_contact_curves(const double *compression_m, size_t count, double *pressure, double *rate);

/* Return the indentation (m) of the whole layer at a pressure (Pa): the inverse of layer_contact_pressure(). */
double layer_contact_compression(double pressure_pa);

/* Return the shear stiffness of the layer in a grasp: force per area and per displacement along the surface, pascal per
 * metre. */
double layer_shear_stiffness(void);

#endif
