/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * main.c: the program `arris-robot`: with --driver the daemon between LCM and a robot's controller,
 * else one that gives it a command.
 */
#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "arris_plugin.h"
#include "bytes.h"
#include "client.h"
#include "csv.h"
#include "lcmtypes/arris_robot_command_t.h"
#include "rigid.h"
#include "robot.h"

static const char usage[] =
    "usage: arris-robot --driver NAME [OPTION...]   be the robot's daemon\n"
    "       arris-robot [OPTION...] home | move X Y Z [QW QX QY QZ] | path FILE | stop\n"
    "                                               give it a command, wait until it is done\n"
    "       arris-robot [OPTION...] hold            feed-hold, until Ctrl-C\n"
    "\n"
    "  --url URL               the LCM network; LCM_DEFAULT_URL, or multicast on this machine\n"
    "of a command:\n"
    "  --speed MM/S            0: the robot's own\n"
    "  --time-limit S          the robot stops when it is not done then; 0: none\n"
    "of the daemon:\n"
    "  --rate HZ               states a second (200)\n"
    "  --home X,Y,Z            mm (0,0,0)\n"
    "  --space X0,X1,Y0,Y1,Z0,Z1   mm, the work space (1000 mm to each side)\n"
    "  --speed, --max-speed MM/S   where a command says none (100); at most (500)\n"
    "  --acceleration MM/S2    (500)\n"
    "  --link-timeout MS       a commander not heard for so long is lost (500)\n"
    "of the driver sim:\n"
    "  --offset X,Y,Z          mm, by which it is always wrong\n"
    "  --repeatability MM      sigma of what each target is missed by\n"
    "  --jitter MM, --rot-jitter RAD   sigma of the axes' stick-slip\n"
    "  --seed N                of chance (1)\n"
    "\n"
    "FILE is a CSV with the columns x,y,z,qw,qx,qy,qz: flange in base, mm and unit quaternion.\n"
    "Exit codes: 0 done, 1 refused, stopped or timed out, 2 wrong usage, 4 no robot or no "
    "network.\n";

typedef struct arguments {
    const char *url, *driver;
    double rate, speed, time_limit;
    robot_options options;
    robot_limits limits;
} arguments;

static const robot_driver *const drivers[] = {&driver_sim};

static volatile int stopped;

static void on_signal(int number) {
    (void)number;
    stopped = 1;
}

static int say(const fault *f, int code) {
    fprintf(stderr, "arris-robot: %s\n", f->text);
    if (f->hint)
        fprintf(stderr, "  %s\n", f->hint);
    return code;
}

/* ---- words ----------------------------------------------------------------------------------- */

/* n numbers with commas between, from `min` to `max`. */
static bool numbers(const char *text, int n, double min, double max, double *out) {
    for (int i = 0; i < n; i++) {
        char *end;
        out[i] = strtod(text, &end);
        if (end == text || !(out[i] >= min && out[i] <= max) || *end != (i + 1 < n ? ',' : '\0'))
            return false;
        text = end + 1;
    }
    return true;
}

typedef struct number_option {
    const char *name;
    size_t offset;
    int n;
    double min, max;
} number_option;

#define AT(field) offsetof(arguments, field)
static const number_option number_options[] = {
    {"speed", AT(speed), 1, 0, 1e5},
    {"time-limit", AT(time_limit), 1, 0, 1e6},
    {"rate", AT(rate), 1, 1, 1000},
    {"home", AT(options.home.pos), 3, -1e6, 1e6},
    {"space", AT(limits.space), 6, -1e6, 1e6},
    {"max-speed", AT(limits.max_speed), 1, 1e-3, 1e5},
    {"acceleration", AT(options.acceleration), 1, 1, 1e6},
    {"link-timeout", AT(limits.link_timeout), 1, 50, 1e5},
    {"offset", AT(options.offset), 3, -100, 100},
    {"repeatability", AT(options.repeatability), 1, 0, 10},
    {"jitter", AT(options.jitter), 1, 0, 10},
    {"rot-jitter", AT(options.rot_jitter), 1, 0, 0.1},
};
enum {
    NUMBERS = sizeof number_options / sizeof *number_options,
    URL = NUMBERS,
    DRIVER,
    SEED,
    HELP
};

static int parse(int argc, char **argv, arguments *a) {
    struct option table[HELP + 2] = {[URL] = {"url", 1, NULL, URL},
                                     [DRIVER] = {"driver", 1, NULL, DRIVER},
                                     [SEED] = {"seed", 1, NULL, SEED},
                                     [HELP] = {"help", 0, NULL, HELP}};
    for (int i = 0; i < NUMBERS; i++)
        table[i] = (struct option){number_options[i].name, 1, NULL, i};
    for (int c; (c = getopt_long(argc, argv, "+", table, NULL)) != -1;) {
        if (c == URL)
            a->url = optarg;
        else if (c == DRIVER)
            a->driver = optarg;
        else if (c == SEED)
            a->options.seed = atoi(optarg);
        else if (c == HELP) {
            fputs(usage, stdout);
            exit(0);
        } else if (c == '?')
            return 2;
        else if (!numbers(optarg, number_options[c].n, number_options[c].min, number_options[c].max,
                          (double *)(void *)((char *)a + number_options[c].offset))) {
            fprintf(stderr, "arris-robot: --%s %s: %d number%s from %g to %g\n", table[c].name,
                    optarg, number_options[c].n, number_options[c].n > 1 ? "s" : "",
                    number_options[c].min, number_options[c].max);
            return 2;
        }
    }
    return 0;
}

/* ---- the daemon ------------------------------------------------------------------------------ */

static void sleep_until(int64_t ns) {
    struct timespec t = {.tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
}

/* One step each period; what a late wake-up has left out is made up for where that can be done. */
static void run(robot *r, const robot_driver *d, double rate) {
    int64_t period = (int64_t)(1e9 / rate), next = arris_now();
    while (!stopped) {
        sleep_until(next);
        int64_t now = arris_now(), utime = link_utime();
        if (!d->any_time || now - next > 1000000000)
            next = now;
        robot_step(r, next, utime - (now - next) / 1000);
        next += period;
    }
}

static int be_daemon(const arguments *a, lcm_link *link) {
    const robot_driver *d = NULL;
    robot_limits limits = a->limits;
    fault f;
    for (size_t i = 0; i < sizeof drivers / sizeof *drivers; i++)
        if (strcmp(drivers[i]->name, a->driver) == 0)
            d = drivers[i];
    if (!d) {
        fprintf(stderr, "arris-robot: there is no driver '%s'; there is:\n", a->driver);
        for (size_t i = 0; i < sizeof drivers / sizeof *drivers; i++)
            fprintf(stderr, "  %s: %s\n", drivers[i]->name, drivers[i]->summary);
        return 2;
    }
    limits.link_timeout /= 1000;
    limits.speed = a->speed > 0 ? a->speed : 100;
    robot *r = robot_new(d, &a->options, &limits, link, arris_now(), &f);
    if (!r)
        return say(&f, 4);
    run(r, d, a->rate);
    robot_free(r);
    return 0;
}

/* ---- commands -------------------------------------------------------------------------------- */

static int read_row(const csv *c, const int *column, robot_pose *p, fault *f) {
    int r = 0;
    for (int k = 0; k < 7 && r == 0; k++)
        r = csv_number(c, column[k], k < 3 ? &p->pos[k] : &p->quat[k - 3], f);
    if (r == 0 && !rigid_normalise(p->quat))
        r = fault_set(f, ARRIS_E_INPUT, NULL, "%s:%d: the quaternion is not of unit length",
                      c->path, c->line);
    return r;
}

static int read_path(const char *path, client_command *what, fault *f) {
    static const char *const names[] = {"x", "y", "z", "qw", "qx", "qy", "qz"};
    int column[7];
    bytes b = {0};
    csv c;
    int r = bytes_read(&b, path, 1 << 20, f);
    if (r == 0)
        r = csv_open(&c, path, (char *)b.data, b.n, f);
    if (r == 0)
        r = csv_columns(&c, names, 7, column, f);
    while (r == 0 && (r = csv_next(&c, f)) == 1)
        r = what->n < ROBOT_POSES
                ? read_row(&c, column, &what->pose[what->n++], f)
                : fault_set(f, ARRIS_E_INPUT, NULL, "%s has more than %d poses", path, ROBOT_POSES);
    free(b.data);
    return r;
}

static int read_pose(int argc, char **argv, client_command *what, fault *f) {
    double v[7] = {0, 0, 0, 1, 0, 0, 0};
    bool good = argc == 3 || argc == 7;
    for (int i = 0; i < argc && good; i++)
        good = numbers(argv[i], 1, -1e6, 1e6, &v[i]);
    memcpy(what->pose[0].pos, v, sizeof what->pose[0].pos);
    memcpy(what->pose[0].quat, v + 3, sizeof what->pose[0].quat);
    what->n = 1;
    if (good && rigid_normalise(what->pose[0].quat))
        return 0;
    return fault_set(f, ARRIS_E_USAGE, NULL,
                     "move takes x, y, z in mm, and perhaps a unit quaternion w, x, y, z");
}

static int read_command(int argc, char **argv, client_command *what, fault *f) {
    static const char *const names[] = {[ARRIS_ROBOT_COMMAND_T_HOME] = "home",
                                        [ARRIS_ROBOT_COMMAND_T_MOVE] = "move",
                                        [ARRIS_ROBOT_COMMAND_T_PATH] = "path",
                                        [ARRIS_ROBOT_COMMAND_T_STOP] = "stop",
                                        [ARRIS_ROBOT_COMMAND_T_HOLD] = "hold"};
    for (int8_t i = ARRIS_ROBOT_COMMAND_T_HOME; i <= ARRIS_ROBOT_COMMAND_T_HOLD; i++)
        if (argc > 0 && strcmp(argv[0], names[i]) == 0)
            what->command = i;
    if (what->command == ARRIS_ROBOT_COMMAND_T_MOVE)
        return read_pose(argc - 1, argv + 1, what, f);
    if (what->command == ARRIS_ROBOT_COMMAND_T_PATH && argc == 2)
        return read_path(argv[1], what, f);
    if (what->command && what->command != ARRIS_ROBOT_COMMAND_T_PATH && argc == 1)
        return 0;
    return fault_set(f, ARRIS_E_USAGE, "arris-robot --help tells more",
                     "expected --driver NAME, or a command: home, move, path, stop, hold");
}

static int give_command(const arguments *a, client_command *what, lcm_link *link) {
    fault f;
    what->speed = a->speed;
    what->time_limit = a->time_limit;
    int r = client_run(link, what, &stopped, &f);
    return r ? say(&f, r == ARRIS_E_INPUT ? 1 : 4) : 0;
}

int main(int argc, char **argv) {
    static client_command what;
    arguments a = {.rate = 200,
                   .options = {.home.quat = {1, 0, 0, 0}, .acceleration = 500, .seed = 1},
                   .limits = {.space = {{-1000, 1000}, {-1000, 1000}, {-1000, 1000}},
                              .max_speed = 500,
                              .link_timeout = 500}};
    struct sigaction action = {.sa_handler = on_signal};
    fault f;
    int rc = parse(argc, argv, &a);
    if (rc)
        return rc;
    if (!a.driver && read_command(argc - optind, argv + optind, &what, &f))
        return say(&f, 2);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    lcm_link *link = link_open(a.url, &f);
    if (!link)
        return say(&f, 4);
    rc = a.driver ? be_daemon(&a, link) : give_command(&a, &what, link);
    link_close(link);
    return rc;
}
