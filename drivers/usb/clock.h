/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * clock.h: a camera's clock in terms of this machine's.
 *
 * Payloads carry the camera's clock at the moment they were sent. They arrive late by a time that
 * varies but is never negative: the least difference of both clocks within the last seconds is the
 * offset, and follows their drift.
 */
#ifndef USB_CLOCK_H
#define USB_CLOCK_H

#include <stdbool.h>
#include <stdint.h>

typedef struct source_clock {
    double tick; /* ns; 0: the camera has no clock that we know */
    bool known;
    uint32_t last;             /* its value at the last note */
    int64_t ticks;             /* the same without wrapping round */
    int64_t before, now, turn; /* ns: the least offset of the last window and of this one, and when
                                  this one ends */
} source_clock;

/* `hertz` 0: unknown. */
void clock_init(source_clock *c, uint32_t hertz);

/* A payload that was sent at `ticks` has arrived at `now`, CLOCK_MONOTONIC ns. */
void clock_note(source_clock *c, uint32_t ticks, int64_t now);

/* When the camera's clock showed `ticks`, CLOCK_MONOTONIC ns. False when that is not known, or not
 * within half a second before `arrived`: some cameras' clocks are not what they say. */
bool clock_date(const source_clock *c, uint32_t ticks, int64_t arrived, int64_t *when);

#endif
