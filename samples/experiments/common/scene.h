/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * scene.h: exact scans: pictures of flat plates whose edges are known, from a camera on a path.
 *
 * A pixel is the exact blurred step across each edge: the lens's Gaussian and the box of the pixel
 * (variance 1/12) as one normal distribution; only within some 2 px of a corner, where the four
 * steps are multiplied, is that an approximation.
 */
#ifndef SCENE_H
#define SCENE_H

#include "arris_geometry.h"

enum { SCENE_PLATES = 32 };

/* A convex quadrilateral in one plane, its corners in turn clockwise or not, mm. */
typedef struct plate {
    double corner[4][3];
    double level; /* grey */
} plate;

typedef struct scene {
    arris_camera camera; /* without distortion */
    double ground;       /* the grey level behind all plates */
    double psf, noise;   /* sigma of the lens, px, and of a pixel, grey levels */
    int n;
    plate plate[SCENE_PLATES]; /* a later one covers an earlier one */
} scene;

/* Frame i is taken from C = from + i step, turned by Theta = (i - (frames - 1) / 2) turn. */
typedef struct motion {
    int frames;
    double from[3], step[3]; /* mm */
    double turn;             /* rad */
    double jitter;           /* mm: sigma of the true position along the motion */
} motion;

/* A motion of so many frames along x, its middle at x = 0. */
motion motion_along_x(int frames, double step);

/* The thesis's camera without its lens's distortion, psf 0.8, noise 2, ground 110, no plates. */
scene scene_new(void);

/* A rectangle of half-sides a, b about the middle (x, y, z), turned by `angle` (x to y). */
void scene_add(scene *s, double x, double y, double z, double a, double b, double angle,
               double level);

/* Six plates in two rows, side by side in the picture, at random depths from `near` to `far`,
 * sizes, angles and grey levels. */
void scene_scatter(scene *s, double near, double far, uint64_t seed);

/* Three plates above one another, all at depth z, which a motion along x of up to 0.6 z keeps in
 * the picture. Their steep sides are SCENE_COLUMN_LENGTH z long and have a contrast of 105. */
void scene_column(scene *s, double z, uint64_t seed);
#define SCENE_COLUMN_LENGTH 0.14

/* The Cramér-Rao bounds of VISION.md, as sigmas. Of the offset of an edge in one picture, px, with
 * both grey levels free, fitted over 7 px on both sides and all of its `length` (px) but 2.5 px at
 * either end. And of a line's depth, mm, from frames of a motion along x, the offset across x being
 * known to `offset` px in each. */
double bound_offset(const scene *s, double contrast, double length);
double bound_depth(const scene *s, const motion *m, int frames, double z, double offset);

/* Renders the scan to the folder $B/experiments/NAME: frames.csv with the poses as they are
 * reported, camera.json, PGM pictures. Returns the path of frames.csv, for free. Ends the program
 * when it can't. */
char *scene_render(const scene *s, const motion *m, uint64_t seed, const char *name);

#endif
