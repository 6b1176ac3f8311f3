/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * format.c: settles with a device what pictures it sends. Drivers adjust wishes silently, so
 * everything is read back.
 */
#include "format.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { MAX_SIDE = 16384 /* px */ };

/* ---- what there is --------------------------------------------------------------------------- */

static size_t append(char *text, size_t size, size_t at, const char *item) {
    int n = at < size ? snprintf(text + at, size - at, "%s%s", at ? ", " : "", item) : 0;
    return at + (size_t)n;
}

void format_sizes(const device *d, uint32_t fourcc, char *text, size_t size) {
    struct v4l2_frmsizeenum e = {.pixel_format = fourcc};
    char item[64];
    *text = '\0';
    for (size_t at = 0; device_ioctl(d->fd, VIDIOC_ENUM_FRAMESIZES, &e) == 0; e.index++) {
        if (e.type == V4L2_FRMSIZE_TYPE_DISCRETE)
            snprintf(item, sizeof item, "%ux%u", e.discrete.width, e.discrete.height);
        else
            snprintf(item, sizeof item, "%ux%u to %ux%u", e.stepwise.min_width,
                     e.stepwise.min_height, e.stepwise.max_width, e.stepwise.max_height);
        at = append(text, size, at, item);
        if (e.type != V4L2_FRMSIZE_TYPE_DISCRETE)
            break;
    }
}

static double rate(struct v4l2_fract period) {
    return period.numerator ? (double)period.denominator / period.numerator : 0;
}

void format_rates(const device *d, uint32_t fourcc, uint32_t width, uint32_t height, char *text,
                  size_t size) {
    struct v4l2_frmivalenum e = {.pixel_format = fourcc, .width = width, .height = height};
    char item[64];
    *text = '\0';
    for (size_t at = 0; device_ioctl(d->fd, VIDIOC_ENUM_FRAMEINTERVALS, &e) == 0; e.index++) {
        if (e.type == V4L2_FRMIVAL_TYPE_DISCRETE)
            snprintf(item, sizeof item, "%.4g", rate(e.discrete));
        else
            snprintf(item, sizeof item, "%.4g to %.4g", rate(e.stepwise.max), rate(e.stepwise.min));
        at = append(text, size, at, item);
        if (e.type != V4L2_FRMIVAL_TYPE_DISCRETE)
            break;
    }
}

static bool offers(const device *d, uint32_t fourcc) {
    struct v4l2_fmtdesc e = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
    for (; device_ioctl(d->fd, VIDIOC_ENUM_FMT, &e) == 0; e.index++)
        if (e.pixelformat == fourcc)
            return true;
    return false;
}

/* ---- pixels and size ------------------------------------------------------------------------- */

static uint32_t field_of(int32_t fields) {
    return fields == FIELDS_TOP      ? V4L2_FIELD_TOP
           : fields == FIELDS_BOTTOM ? V4L2_FIELD_BOTTOM
           : fields == FIELDS_WEAVE  ? V4L2_FIELD_INTERLACED
                                     : V4L2_FIELD_NONE;
}

/* A driver may know single fields only within whole frames, and gives those instead. The height
 * that is wished is the whole frame's. */
static int set_format(const device *d, const wish *w, const pixels *p, struct v4l2_format *v,
                      unsigned long request, fault *f) {
    *v = (struct v4l2_format){.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
    if (device_ioctl(d->fd, VIDIOC_G_FMT, v))
        return fault_set(f, ARRIS_E_IO, NULL, "%s has no format: %s", d->path, strerror(errno));
    bool was_field = V4L2_FIELD_HAS_T_OR_B(v->fmt.pix.field);
    uint32_t whole = w->height ? (uint32_t)w->height : v->fmt.pix.height * (1 + was_field);
    if (w->width)
        v->fmt.pix.width = (uint32_t)w->width;
    v->fmt.pix.field = field_of(w->fields);
    v->fmt.pix.height = V4L2_FIELD_HAS_T_OR_B(v->fmt.pix.field) ? whole / 2 : whole;
    v->fmt.pix.pixelformat = p->fourcc;
    v->fmt.pix.bytesperline = v->fmt.pix.sizeimage = 0;
    struct v4l2_format tried = *v;
    if (device_ioctl(d->fd, VIDIOC_TRY_FMT, &tried) == 0 &&
        V4L2_FIELD_HAS_BOTH(tried.fmt.pix.field) != V4L2_FIELD_HAS_BOTH(v->fmt.pix.field))
        v->fmt.pix.height = V4L2_FIELD_HAS_T_OR_B(tried.fmt.pix.field) ? whole / 2 : whole;
    if (device_ioctl(d->fd, request, v))
        return fault_set(f, ARRIS_E_IO, NULL, "cannot set %s on %s: %s", p->name, d->path,
                         errno == EBUSY ? "another program uses it" : strerror(errno));
    return 0;
}

static bool as_wished(const wish *w, const pixels *p, const struct v4l2_pix_format *got) {
    uint32_t whole = got->height * (V4L2_FIELD_HAS_T_OR_B(got->field) ? 2 : 1);
    return got->pixelformat == p->fourcc && (!w->width || got->width == (uint32_t)w->width) &&
           (!w->height || whole == (uint32_t)w->height);
}

static int choose(const device *d, const wish *w, const pixels **p, fault *f) {
    struct v4l2_format v;
    if (w->pixels) {
        *p = &pixels_table[w->pixels - 1];
        return offers(d, (*p)->fourcc)
                   ? 0
                   : fault_set(f, ARRIS_E_USAGE,
                               "`arris stages v4l2src --devices` lists the formats",
                               "%s does not send %s", d->card, (*p)->name);
    }
    const pixels *any = NULL;
    for (*p = pixels_table; (*p)->name; (*p)++) {
        if (!offers(d, (*p)->fourcc))
            continue;
        any = any ? any : *p;
        if (set_format(d, w, *p, &v, VIDIOC_TRY_FMT, f) == 0 && as_wished(w, *p, &v.fmt.pix))
            return 0;
    }
    *p = any; /* which then says what is wrong with it */
    return any ? 0
               : fault_set(f, ARRIS_E_INPUT, NULL, "%s sends none of the formats %s", d->card,
                           strchr(PIXELS_WORDS, '|') + 1);
}

static int lay_out(const device *d, const wish *w, const struct v4l2_pix_format *v, format *out,
                   fault *f) {
    bool second = w->fields == FIELDS_BOTTOM, single = w->fields != FIELDS_WEAVE;
    out->width = (int32_t)v->width;
    out->height = (int32_t)v->height;
    out->stride = v->bytesperline;
    out->bytes = pixels_size(out->pixels, out->height, out->stride);
    switch (v->field) {
    case V4L2_FIELD_ANY:
    case V4L2_FIELD_NONE:
        if (w->fields == FIELDS_AUTO || !single)
            return 0;
        return fault_set(f, ARRIS_E_USAGE, "leave fields= out", "%s sends no fields, whole frames",
                         d->card);
    case V4L2_FIELD_TOP:
    case V4L2_FIELD_BOTTOM:
        if (single && second == (v->field == V4L2_FIELD_BOTTOM))
            return 0;
        break;
    case V4L2_FIELD_ALTERNATE:
        out->only = second ? V4L2_FIELD_BOTTOM : V4L2_FIELD_TOP;
        return 0;
    case V4L2_FIELD_INTERLACED:
    case V4L2_FIELD_INTERLACED_TB:
    case V4L2_FIELD_INTERLACED_BT:
        out->woven = !single;
        if (single && out->pixels->bytes) {
            out->first = second ? out->stride : 0;
            out->stride *= 2;
            out->height /= 2;
        }
        if (!single || out->pixels->bytes)
            return 0;
        break;
    default:
        break;
    }
    return fault_set(f, ARRIS_E_USAGE, "try another format= or fields=",
                     "%s interlaces in a way that is not known here (%u)", d->card, v->field);
}

/* ---- rate ------------------------------------------------------------------------------------ */

static int set_rate(const device *d, double fps, format *out, fault *f) {
    struct v4l2_streamparm p = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
    bool can = device_ioctl(d->fd, VIDIOC_G_PARM, &p) == 0 &&
               p.parm.capture.capability & V4L2_CAP_TIMEPERFRAME;
    if (fps > 0 && can) {
        p.parm.capture.timeperframe = (struct v4l2_fract){1000, (uint32_t)lround(fps * 1000)};
        can = device_ioctl(d->fd, VIDIOC_S_PARM, &p) == 0;
    }
    out->fps = p.parm.capture.timeperframe.numerator ? rate(p.parm.capture.timeperframe) : 0;
    if (fps > 0 && (!can || fabs(out->fps - fps) > 0.01 * fps))
        return fault_set(f, ARRIS_E_USAGE, "`arris stages v4l2src --devices` lists the rates",
                         "%s sends %.4g frames/s at this size, not %.4g", d->card, out->fps, fps);
    return 0;
}

int format_settle(const device *d, const wish *w, format *out, fault *f) {
    struct v4l2_format v;
    *out = (format){.pixels = NULL};
    int r = choose(d, w, &out->pixels, f);
    if (r == 0)
        r = set_format(d, w, out->pixels, &v, VIDIOC_S_FMT, f);
    if (r < 0)
        return r;
    if (!as_wished(w, out->pixels, &v.fmt.pix)) {
        char sizes[200];
        format_sizes(d, out->pixels->fourcc, sizes, sizeof sizes);
        return fault_set(f, ARRIS_E_USAGE, "`arris stages v4l2src --devices` lists the sizes",
                         "%s does not send %s of that size, but %ux%u; it has %s", d->card,
                         out->pixels->name, v.fmt.pix.width, v.fmt.pix.height, sizes);
    }
    if (v.fmt.pix.width - 1 >= MAX_SIDE || v.fmt.pix.height - 1 >= MAX_SIDE ||
        v.fmt.pix.bytesperline < v.fmt.pix.width * (uint32_t)out->pixels->bytes)
        return fault_set(f, ARRIS_E_INPUT, NULL, "%s says it sends %ux%u with %u bytes a row",
                         d->path, v.fmt.pix.width, v.fmt.pix.height, v.fmt.pix.bytesperline);
    r = lay_out(d, w, &v.fmt.pix, out, f);
    return r == 0 ? set_rate(d, w->fps, out, f) : r;
}
