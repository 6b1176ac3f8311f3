/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * rival.cc: the stages `rival` and `tally`, for bench_chain: the time that a frame takes from one
 * to the other, beside cv::Canny's on the same picture (raw, aperture 3, L2 gradient, 50 and 150),
 * in the same thread. In every other frame Canny goes last, so that neither always finds the
 * picture in the cache. `tally` writes a line a frame: ns of Canny, ns of the stages between, pages
 * of memory held.
 */
#include <cstddef>
#include <cstdio>
#include <ctime>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "arris_plugin.h"

namespace {

int64_t canny_time, begun; /* ns: how long Canny took, and when the stages between began */

/* The time that this thread has had, ns: what else the machine does counts little. */
int64_t thread_time() {
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

void run_canny(const arris_frame *f) {
    static cv::Mat edges;
    const arris_image *im = static_cast<const arris_image *>(arris_layer_get(f, ARRIS_IMAGE));
    cv::Mat grey(im->height, im->width, CV_8U, im->data, static_cast<size_t>(im->stride));
    int64_t start = thread_time();
    cv::Canny(grey, edges, 50, 150, 3, true);
    canny_time = thread_time() - start;
}

int rival_setup(arris_stage *s, void *, arris_caps *caps) {
    cv::setNumThreads(1);
    return caps->format == ARRIS_GREY8
               ? 0
               : arris_fail(s, ARRIS_E_INPUT, nullptr, "cv::Canny takes 8-bit pictures only");
}

int rival_process(arris_stage *, void *, arris_frame *f) {
    if (arris_frame_seq(f) % 2 == 0)
        run_canny(f);
    begun = thread_time();
    return 0;
}

struct tally {
    const char *file;
    FILE *out;
};

int tally_setup(arris_stage *s, void *self, arris_caps *) {
    struct tally *t = static_cast<struct tally *>(self);
    t->out = t->file ? std::fopen(t->file, "w") : nullptr;
    return t->out ? 0 : arris_fail(s, ARRIS_E_IO, "give file=", "the tally has no file");
}

long resident_pages() {
    long pages = 0;
    FILE *f = std::fopen("/proc/self/statm", "r");
    if (!f || std::fscanf(f, "%*d %ld", &pages) != 1)
        pages = 0;
    if (f)
        std::fclose(f);
    return pages;
}

int tally_process(arris_stage *, void *self, arris_frame *f) {
    int64_t took = thread_time() - begun;
    if (arris_frame_seq(f) % 2 == 1)
        run_canny(f);
    std::fprintf(static_cast<struct tally *>(self)->out, "%lld %lld %ld\n",
                 static_cast<long long>(canny_time), static_cast<long long>(took),
                 resident_pages());
    return 0;
}

void tally_close(arris_stage *, void *self) {
    struct tally *t = static_cast<struct tally *>(self);
    if (t->out)
        std::fclose(t->out);
}

const arris_prop tally_props[] = {
    ARRIS_P_STRING(struct tally, file, "file", nullptr, "where to write it"),
};

arris_stage_desc rival_stage() {
    arris_stage_desc d = {};
    d.size = sizeof d;
    d.name = "rival";
    d.summary = "times cv::Canny";
    d.layers.needs = ARRIS_BIT(ARRIS_IMAGE);
    d.setup = rival_setup;
    d.process = rival_process;
    return d;
}

arris_stage_desc tally_stage() {
    arris_stage_desc d = {};
    d.size = sizeof d;
    d.name = "tally";
    d.summary = "writes what the stages since `rival` took";
    d.flags = ARRIS_SINK;
    d.layers.needs = ARRIS_BIT(ARRIS_IMAGE);
    d.self_size = sizeof(struct tally);
    d.props = tally_props;
    d.n_props = sizeof tally_props / sizeof *tally_props;
    d.setup = tally_setup;
    d.process = tally_process;
    d.close = tally_close;
    return d;
}

const arris_stage_desc rival = rival_stage(), tally = tally_stage();

} // namespace

ARRIS_PLUGIN("rival", "LGPL-2.1-or-later", &rival, &tally);
