/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * parts.c: stages for the tests of the runtime: a source of numbers, what changes, drops, fails or
 * holds up frames, and a sink that notes all that happens to it in a file. Numbers travel in user0.
 */
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "arris_plugin.h"

#define USER1 ((enum arris_layer)(ARRIS_USER0 + 1))

typedef struct number {
    uint64_t value;
} number;

static void hold_ms(double ms) {
    struct timespec t = {(time_t)(ms / 1e3), (long)(ms * 1e6) % 1000000000};
    nanosleep(&t, NULL);
}

static int reserve_number(arris_stage *s, void *self, arris_caps *caps) {
    (void)self, (void)caps;
    return arris_reserve(s, ARRIS_USER0, sizeof(number), 0);
}

/* ---- testsrc: the frame of number i has index 100 + i and the value i² + 7 --------------------
 */

struct testsrc {
    int32_t frames, late_every, made;
    bool live;
    double late;
};

static int testsrc_setup(arris_stage *s, void *self, arris_caps *caps) {
    arris_set_live(s, ((struct testsrc *)self)->live);
    return reserve_number(s, self, caps);
}

static int testsrc_process(arris_stage *s, void *self, arris_frame *f) {
    struct testsrc *t = self;
    if (t->made == t->frames)
        return ARRIS_END;
    uint64_t i = (uint64_t)t->made++;
    arris_frame_set(f, (int64_t)i + 100, (int64_t)i * 1000);
    ((number *)arris_layer_give(s, f, ARRIS_USER0))->value = i * i + 7;
    if (t->late_every && t->made % t->late_every == 0)
        hold_ms(t->late);
    return 0;
}

static const arris_prop testsrc_table[] = {
    ARRIS_P_INT_OR(struct testsrc, frames, "frames", "end", "end", 0, 1e9, NULL, "how many"),
    ARRIS_P_BOOL(struct testsrc, live, "live", "false", "whether it is a live source"),
    ARRIS_P_INT(struct testsrc, late_every, "late-every", "0", 0, 1e9, NULL,
                "every so many frames one comes late; 0: none"),
    ARRIS_P_DOUBLE(struct testsrc, late, "late", "0", 0, 1e4, "ms", "how late it comes"),
};
static const arris_stage_desc testsrc = {
    .size = sizeof(arris_stage_desc),
    .name = "testsrc",
    .summary = "numbers",
    .flags = ARRIS_SOURCE,
    .layers = {.gives = ARRIS_BIT(ARRIS_USER0)},
    .self_size = sizeof(struct testsrc),
    .props = testsrc_table,
    .n_props = sizeof testsrc_table / sizeof *testsrc_table,
    .setup = testsrc_setup,
    .process = testsrc_process,
};

/* the same, working ahead */
static const arris_stage_desc testahead = {
    .size = sizeof(arris_stage_desc),
    .name = "testahead",
    .summary = "numbers, worked out ahead",
    .flags = ARRIS_SOURCE | ARRIS_AHEAD,
    .layers = {.gives = ARRIS_BIT(ARRIS_USER0)},
    .self_size = sizeof(struct testsrc),
    .props = testsrc_table,
    .n_props = sizeof testsrc_table / sizeof *testsrc_table,
    .setup = testsrc_setup,
    .process = testsrc_process,
};

/* ---- testmap: replaces the value v by 3 v + 1 -------------------------------------------------
 */

static int testmap_process(arris_stage *s, void *self, arris_frame *f) {
    (void)self;
    const number *in = arris_layer_get(f, ARRIS_USER0);
    uint64_t before = in->value;
    number *out = arris_layer_give(s, f, ARRIS_USER0);
    out->value = 3 * in->value + 1;
    arris_count(s, "odd", out->value & 1);
    if (out == in || in->value != before || arris_layer_get(f, ARRIS_USER0) != out)
        return arris_fail(s, ARRIS_E_INTERNAL, NULL, "the old layer is not what it was");
    return 0;
}

/* Larger than the host's own: as built with a header to come. */
static const struct {
    arris_stage_desc desc;
    void *more;
} testmap = {
    .desc =
        {
            .size = sizeof testmap,
            .name = "testmap",
            .summary = "changes numbers",
            .layers = {.needs = ARRIS_BIT(ARRIS_USER0), .gives = ARRIS_BIT(ARRIS_USER0)},
            .setup = reserve_number,
            .process = testmap_process,
        },
    .more = NULL,
};

/* ---- testdrop: drops every frame whose number is a multiple of `every` ------------------------
 */

struct testdrop {
    int32_t every;
};

static int testdrop_process(arris_stage *s, void *self, arris_frame *f) {
    (void)s;
    return arris_frame_seq(f) % (uint64_t)((struct testdrop *)self)->every == 0 ? ARRIS_DROP : 0;
}

static const arris_prop testdrop_table[] = {
    ARRIS_P_INT(struct testdrop, every, "every", "2", 1, 1000, "frames", "which are dropped"),
};
static const arris_stage_desc testdrop = {
    .size = sizeof(arris_stage_desc),
    .name = "testdrop",
    .summary = "drops frames",
    .self_size = sizeof(struct testdrop),
    .props = testdrop_table,
    .n_props = 1,
    .process = testdrop_process,
};

/* ---- testhold: holds every frame up, deaf to the end of the stream ----------------------------
 */

struct testhold {
    double ms;
    const char *until;
};

static int testhold_process(arris_stage *s, void *self, arris_frame *f) {
    (void)f;
    const struct testhold *h = self;
    hold_ms(h->ms);
    while (h->until && access(h->until, F_OK) && arris_running(s))
        hold_ms(1);
    return 0;
}

static const arris_prop testhold_table[] = {
    ARRIS_P_DOUBLE(struct testhold, ms, "ms", "0", 0, 1e4, "ms", "how long"),
    ARRIS_P_INFILE(struct testhold, until, "until", NULL, "and until this file is there"),
};
static const arris_stage_desc testhold = {
    .size = sizeof(arris_stage_desc),
    .name = "testhold",
    .summary = "holds frames up",
    .self_size = sizeof(struct testhold),
    .props = testhold_table,
    .n_props = 2,
    .process = testhold_process,
};

/* ---- testfail: fails at a frame, in setup or in finish, after some warnings -------------------
 */

struct testfail {
    int32_t at, when, warnings;
};
enum { IN_SETTLE, IN_SETUP, IN_PROCESS, IN_FINISH };

static int fail(arris_stage *s, const struct testfail *t, int32_t when) {
    for (int i = 0; t->when == when && i < t->warnings; i++)
        arris_warn(s, "warning %d", i);
    return t->when == when ? arris_fail(s, ARRIS_E_INPUT, "as it was told", "it fails") : 0;
}

static int testfail_settle(arris_stage *s, void *self, arris_layers *l) {
    (void)l;
    return fail(s, self, IN_SETTLE);
}

static int testfail_setup(arris_stage *s, void *self, arris_caps *caps) {
    (void)caps;
    return fail(s, self, IN_SETUP);
}

static int testfail_process(arris_stage *s, void *self, arris_frame *f) {
    return (int64_t)arris_frame_seq(f) == ((struct testfail *)self)->at ? fail(s, self, IN_PROCESS)
                                                                        : 0;
}

static int testfail_finish(arris_stage *s, void *self, arris_frame *f) {
    (void)f;
    return fail(s, self, IN_FINISH);
}

static const arris_prop testfail_table[] = {
    ARRIS_P_INT(struct testfail, at, "at", "0", 0, 1e9, NULL, "the frame"),
    ARRIS_P_ENUM(struct testfail, when, "when", "process", "settle|setup|process|finish", "where"),
    ARRIS_P_INT(struct testfail, warnings, "warnings", "0", 0, 1e9, NULL, "how many before"),
};
static const arris_stage_desc testfail = {
    .size = sizeof(arris_stage_desc),
    .name = "testfail",
    .summary = "fails",
    .self_size = sizeof(struct testfail),
    .props = testfail_table,
    .n_props = 3,
    .settle = testfail_settle,
    .setup = testfail_setup,
    .process = testfail_process,
    .finish = testfail_finish,
};

/* ---- testtrouble: is in trouble from a frame to another, and looks how the stream goes then ---
 */

struct testtrouble {
    int32_t from, to;
};

static void find_odd(void *user, const char *stage, const char *name, uint64_t n) {
    if (strcmp(stage, "testmap") == 0 && strcmp(name, "odd") == 0)
        *(uint64_t *)user = n;
}

static int testtrouble_process(arris_stage *s, void *self, arris_frame *f) {
    const struct testtrouble *t = self;
    int64_t i = (int64_t)arris_frame_seq(f);
    bool troubled = i >= t->from && i < t->to;
    uint64_t odd = 0;
    arris_trouble(s, troubled ? "all is lost" : NULL);
    arris_progress p = arris_stage_progress(s);
    arris_each_counter(s, find_odd, &odd);
    bool told = p.trouble && strcmp(p.troubled, arris_stage_name(s)) == 0;
    if (told != troubled || odd != (uint64_t)(i + 1) / 2 || p.frames != (uint64_t)i + 1 ||
        p.seconds <= 0 || arris_frame_arrival(f) > arris_now())
        return arris_fail(s, ARRIS_E_INTERNAL, NULL, "it does not see how the stream goes");
    return 0;
}

static const arris_prop testtrouble_table[] = {
    ARRIS_P_INT(struct testtrouble, from, "from", "0", 0, 1e9, NULL, "the first frame"),
    ARRIS_P_INT(struct testtrouble, to, "to", "0", 0, 1e9, NULL, "the frame after the last"),
};
static const arris_stage_desc testtrouble = {
    .size = sizeof(arris_stage_desc),
    .name = "testtrouble",
    .summary = "is in trouble for a while",
    .self_size = sizeof(struct testtrouble),
    .props = testtrouble_table,
    .n_props = 2,
    .process = testtrouble_process,
};

/* ---- testgive: gives user1, the frame's number from 1; may forget to reserve it ----------------
 */

struct testgive {
    bool forget;
};

static int testgive_setup(arris_stage *s, void *self, arris_caps *caps) {
    (void)caps;
    return ((struct testgive *)self)->forget ? 0 : arris_reserve(s, USER1, sizeof(number), 0);
}

static int testgive_process(arris_stage *s, void *self, arris_frame *f) {
    (void)self;
    ((number *)arris_layer_give(s, f, USER1))->value = arris_frame_seq(f) + 1;
    return 0;
}

static const arris_prop testgive_table[] = {
    ARRIS_P_BOOL(struct testgive, forget, "forget", "false", "to reserve the layer"),
};
static const arris_stage_desc testgive = {
    .size = sizeof(arris_stage_desc),
    .name = "testgive",
    .summary = "gives user1",
    .layers = {.gives = ARRIS_BIT(USER1)},
    .self_size = sizeof(struct testgive),
    .props = testgive_table,
    .n_props = 1,
    .setup = testgive_setup,
    .process = testgive_process,
};

/* ---- testask: puts what came of an earlier frame, its user1, into this one's user0 -------------
 */

struct testask {
    int32_t delay, every;
};

static int testask_setup(arris_stage *s, void *self, arris_caps *caps) {
    arris_set_delay(s, ((struct testask *)self)->delay);
    return reserve_number(s, self, caps);
}

static int testask_process(arris_stage *s, void *self, arris_frame *f) {
    bool ask = arris_frame_seq(f) % (uint64_t)((struct testask *)self)->every == 0;
    const number *earlier = ask ? arris_feedback(s, USER1) : NULL;
    ((number *)arris_layer_give(s, f, ARRIS_USER0))->value = earlier ? earlier->value : 0;
    return 0;
}

static const arris_prop testask_table[] = {
    ARRIS_P_INT(struct testask, delay, "delay", "1", 1, 16, "frames", "how much earlier"),
    ARRIS_P_INT(struct testask, every, "every", "1", 1, 1000, "frames", "it asks in one of these"),
};
static const arris_stage_desc testask = {
    .size = sizeof(arris_stage_desc),
    .name = "testask",
    .summary = "asks for user1",
    .layers = {.gives = ARRIS_BIT(ARRIS_USER0), .asks = ARRIS_BIT(USER1)},
    .self_size = sizeof(struct testask),
    .props = testask_table,
    .n_props = 2,
    .setup = testask_setup,
    .process = testask_process,
};

/* ---- testnote: a line in a file for all that happens ------------------------------------------
 */

struct testnote {
    const char *log, *label;
    int32_t need;
    bool address;
    int fd;
};

static void note(const struct testnote *n, const char *format, ...) {
    char line[200];
    int at = snprintf(line, sizeof line, "%s ", n->label);
    va_list ap;
    va_start(ap, format);
    at += vsnprintf(line + at, sizeof line - (size_t)at, format, ap);
    va_end(ap);
    line[at++] = '\n';
    if (n->fd > 0 && write(n->fd, line, (size_t)at) != at)
        _exit(99);
}

static int testnote_settle(arris_stage *s, void *self, arris_layers *l) {
    (void)s;
    int32_t need = ((struct testnote *)self)->need;
    l->needs = need ? ARRIS_BIT(ARRIS_USER0 + need - 1) : 0;
    return 0;
}

static int testnote_setup(arris_stage *s, void *self, arris_caps *caps) {
    (void)caps;
    struct testnote *n = self;
    n->fd = n->log ? open(n->log, O_WRONLY | O_APPEND | O_CREAT, 0600) : 0;
    if (n->fd < 0)
        return arris_fail(s, ARRIS_E_IO, NULL, "cannot write '%s'", n->log);
    note(n, "setup");
    return 0;
}

static int testnote_process(arris_stage *s, void *self, arris_frame *f) {
    (void)s;
    const struct testnote *n = self;
    const number *v = arris_layer_get(f, ARRIS_USER0);
    note(n, "frame %llu %lld %lld value %llu at %p", (unsigned long long)arris_frame_seq(f),
         (long long)arris_frame_index(f), (long long)arris_frame_utime(f),
         v ? (unsigned long long)v->value : 0, n->address ? (const void *)v : NULL);
    return 0;
}

static int testnote_finish(arris_stage *s, void *self, arris_frame *f) {
    (void)s;
    note(self, "finish %llu", (unsigned long long)arris_frame_seq(f));
    return 0;
}

static void testnote_close(arris_stage *s, void *self) {
    (void)s;
    struct testnote *n = self;
    note(n, "close");
    if (n->fd > 0)
        close(n->fd);
}

static const arris_prop testnote_table[] = {
    ARRIS_P_STRING(struct testnote, log, "log", NULL, "the file"),
    ARRIS_P_STRING(struct testnote, label, "label", "note", "the first word of its lines"),
    ARRIS_P_ENUM(struct testnote, need, "need", "nothing", "nothing|user0|user1", "what it needs"),
    ARRIS_P_BOOL(struct testnote, address, "address", "false", "whether to say where the layer is"),
};
static const arris_stage_desc testnote = {
    .size = sizeof(arris_stage_desc),
    .name = "testnote",
    .summary = "takes notes",
    .flags = ARRIS_SINK,
    .layers = {.wants = ARRIS_BIT(ARRIS_USER0)},
    .self_size = sizeof(struct testnote),
    .props = testnote_table,
    .n_props = sizeof testnote_table / sizeof *testnote_table,
    .settle = testnote_settle,
    .setup = testnote_setup,
    .process = testnote_process,
    .finish = testnote_finish,
    .close = testnote_close,
};

/* A subcommand: prints its words and returns their number. */
static int print_words(int argc, char **argv) {
    for (int i = 0; i < argc; i++)
        puts(argv[i]);
    return argc;
}

static const arris_command_desc testwords = {sizeof(arris_command_desc), "testwords",
                                             "prints its words", print_words};
static const arris_command_desc *const commands[] = {&testwords, NULL};

ARRIS_PLUGIN_COMMANDS("parts", "LGPL-2.1-or-later", commands, &testsrc, &testahead, &testmap.desc,
                      &testdrop, &testhold, &testfail, &testtrouble, &testgive, &testask,
                      &testnote);
