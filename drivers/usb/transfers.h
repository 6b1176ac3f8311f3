/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * transfers.h: the stream's transfers: always some on their way, their payloads to the assembler.
 */
#ifndef USB_TRANSFERS_H
#define USB_TRANSFERS_H

#include "camera.h"

/* Submits them to c->alternate. Returns 0, or ARRIS_E_IO, ARRIS_E_MEMORY. */
int transfers_start(camera *c, fault *f);

/* Handles what comes within `ms`, clears a stall. Returns 0 or ARRIS_E_IO. */
int transfers_step(camera *c, int ms, fault *f);

/* Cancels them and waits for that. */
void transfers_stop(camera *c);

#endif
