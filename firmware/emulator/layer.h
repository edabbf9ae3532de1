/* The dielectric: how a normal force on one taxel changes what its fringe field passes through.
 *
 * Silicone pillars stand in air. Pressure shortens them (neo-Hookean in compression), the air between them goes, and the
 * layer's permittivity rises from that of the mixture to that of solid silicone: steep at first, then saturating. */
#ifndef EMULATOR_LAYER_H
#define EMULATOR_LAYER_H

#define LAYER_PILLAR_HEIGHT_M 0.0008 /* thesis, section 3.2 */
#define LAYER_SHEET_HEIGHT_M 0.0012  /* the silicone that they stand on; with it the layer is near 1 mm under 50 N (4.2.1) */

/* Prepare the curve; must be called once before what follows. */
void layer_init(void);

/* Relative rise of the layer's permittivity, 0 at no force, for a force in newtons on one taxel's 5 mm x 5 mm cell. */
double layer_permittivity_rise(double force_n);

/* Pressure (pascal) that compresses the pillars by so many metres, and its rise with compression (pascal a metre). Beyond
 * the last of the air the curve goes on as a steep line, so that a solver always gets an answer. */
double layer_pressure(double compression_m);
double layer_stiffness(double compression_m);

/* The way back, up to 16 MPa: compression (metres) under a pressure (pascal). */
double layer_compression(double pressure_pa);

/* Work that it took to compress an area so far: the integral of layer_pressure(), joule a square metre. */
double layer_work(double compression_m);

/* Relative rise of the permittivity at a compression or under a pressure: layer_permittivity_rise() of the force that makes
 * them, to 3e-5 of it and 1e-7. */
double layer_compression_rise(double compression_m);
double layer_pressure_rise(double pressure_pa);

/* Share of the layer's volume that is air at such a rise, and the layer's relative permittivity at rest. */
double layer_pores(double rise);
double layer_permittivity(void);

/* What the whole layer, pillars and the sheet under them, presses back with when an object sinks in by so many metres
 * (pascal), and its rise (pascal a metre). The sheet is solid: it bears, but the electrodes' field does not notice it. */
double layer_contact_pressure(double compression_m);
double layer_contact_stiffness(double compression_m);

#endif
