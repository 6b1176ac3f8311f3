/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * find.h: the inner corners of a chessboard in a picture.
 */
#ifndef CALIBRATE_FIND_H
#define CALIBRATE_FIND_H

#include "model.h"

#ifdef __cplusplus
extern "C" {
#endif

enum find_result {
    FIND_OK,
    FIND_NONE,    /* no board of that size is in the picture, or not the whole of it */
    FIND_BIGGER,  /* the pattern goes on beyond the corners that were asked for */
    FIND_UNSURE,  /* too few corners lie where their neighbours say they should */
    FIND_INTERNAL /* OpenCV failed, or no memory */
};

/* Finds all inner corners of `b` in the picture, which may be of any size and format, and refines
 * them at the saddle points. corner[2i], corner[2i + 1] get the pixel of corner i; NAN, NAN when it
 * is not to be relied on. The order is that of cal_board, the board seen from its printed side; of
 * the turns that map the board to itself the one is taken that makes the square between corners 0,
 * 1, cols and cols + 1 a dark one. When that leaves two or four, any.
 *
 * `quick` makes one attempt only, as a live picture needs. Any thread; keeps nothing. */
enum find_result find_board(const arris_image *image, const cal_board *b, bool quick,
                            double *corner);

/* What to tell the user of a result; NULL for FIND_OK. */
const char *find_reason(enum find_result r);

/* The corners of the same board turned by 180 degrees, in place; by 90 degrees, when cols = rows.
 */
void find_turn_half(const cal_board *b, double *corner);
void find_turn_quarter(const cal_board *b, double *corner);

/* How many turns the colours of its squares leave open: 1, 2 or 4. */
int find_turns(const cal_board *b);

#ifdef __cplusplus
}
#endif
#endif
