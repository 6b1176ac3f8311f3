/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * grey.h: a component of the flow as a picture.
 */
#ifndef GREY_H
#define GREY_H

#include <stddef.h>
#include <stdint.h>

enum { GREY_NONE = 128 };

/* The grey levels of n displacements in px (thesis, section 2.3): mid grey, 128, is none, darker
 * negative, lighter positive; from -range px on black, from +range on white. What is not a number
 * is none. */
void grey_of(const float *px, size_t n, double range, uint8_t *grey);

#endif
