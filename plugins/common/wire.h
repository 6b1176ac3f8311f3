/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * wire.h: reads LCM's encoding (big-endian, counts before arrays) out of bytes that nobody vouches
 * for, without allocating. lcm-gen's own decoders trust the counts that they find. After the first
 * field that is not there all is 0 and `bad` is set; a reader looks at that once, at the end.
 */
#ifndef WIRE_H
#define WIRE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

typedef struct wire {
    const uint8_t *at, *end;
    bool bad;
} wire;

/* n bytes of the message, which stay where they are; NULL when there are fewer. */
static inline const uint8_t *wire_bytes(wire *w, size_t n) {
    const uint8_t *p = w->at;
    if (w->bad || n > (size_t)(w->end - w->at)) {
        w->bad = true;
        return NULL;
    }
    w->at += n;
    return p;
}

/* An integer of `size` bytes. */
static inline uint64_t wire_integer(wire *w, size_t size) {
    const uint8_t *p = wire_bytes(w, size);
    uint64_t v = 0;
    for (size_t i = 0; p && i < size; i++)
        v = v << 8 | p[i];
    return v;
}

static inline int64_t wire_int64(wire *w) {
    return (int64_t)wire_integer(w, 8);
}

static inline int32_t wire_int32(wire *w) {
    return (int32_t)(uint32_t)wire_integer(w, 4);
}

static inline int8_t wire_int8(wire *w) {
    return (int8_t)(uint8_t)wire_integer(w, 1);
}

static inline double wire_double(wire *w) {
    uint64_t v = wire_integer(w, 8);
    double d;
    memcpy(&d, &v, sizeof d);
    return d;
}

static inline void wire_doubles(wire *w, double *v, size_t n) {
    for (size_t i = 0; i < n; i++)
        v[i] = wire_double(w);
}

/* A count, which must be from 0 to `max`. */
static inline int32_t wire_count(wire *w, int32_t max) {
    int32_t n = wire_int32(w);
    if (n < 0 || n > max)
        w->bad = true;
    return w->bad ? 0 : n;
}

/* A string of at most `max` characters, where it stands in the message; "" when it is bad. */
static inline const char *wire_string(wire *w, int32_t max) {
    int32_t n = wire_count(w, max + 1);
    const char *s = (const char *)wire_bytes(w, (size_t)n);
    if (!s || n < 1 || s[n - 1] || strlen(s) + 1 != (size_t)n)
        w->bad = true;
    return w->bad ? "" : s;
}

/* Begins a message, whose fingerprint must be `hash`. */
static inline wire wire_begin(const void *data, size_t n, int64_t hash) {
    wire w = {data, (const uint8_t *)data + n, false};
    if (wire_int64(&w) != hash)
        w.bad = true;
    return w;
}

/* Whether all was there and nothing is left. */
static inline bool wire_ended(const wire *w) {
    return !w->bad && w->at == w->end;
}

#endif
