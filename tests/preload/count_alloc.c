/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * count_alloc.c: stands before malloc and the like and counts their calls by who makes them
 * (count_alloc.h). The real functions are glibc's own, by the names it keeps for such uses.
 */
#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "count_alloc.h"

#define PUBLIC __attribute__((visibility("default")))

PUBLIC void count_alloc(bool on);
PUBLIC int count_alloc_report(const char *path);

extern void *__libc_malloc(size_t n);
extern void *__libc_calloc(size_t n, size_t size);
extern void *__libc_realloc(void *p, size_t n);
extern void *__libc_memalign(size_t align, size_t n);

enum { MAX_SITES = 1000, DEPTH = 40 };

static struct {
    void *at;
    unsigned long n;
} site[MAX_SITES];
static atomic_bool counting;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static __thread bool inside; /* an allocation that the counting makes itself */

/* Libraries that allocate for whoever calls them. */
static bool is_language(const char *file) {
    static const char *const names[] = {"/libc.so",  "/libstdc++",  "/libgcc_s",
                                        "/ld-linux", "/libpthread", "count_alloc.so"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strstr(file, names[i]))
            return true;
    return false;
}

static void *asker(void) {
    void *stack[DEPTH];
    int n = backtrace(stack, DEPTH);
    Dl_info d;
    for (int i = 0; i < n; i++)
        if (dladdr(stack[i], &d) && d.dli_fname && !is_language(d.dli_fname))
            return stack[i];
    return NULL;
}

static void count(void) {
    if (!atomic_load_explicit(&counting, memory_order_relaxed) || inside)
        return;
    inside = true;
    void *at = asker();
    pthread_mutex_lock(&lock);
    for (size_t i = 0; i < MAX_SITES; i++)
        if (!site[i].n || site[i].at == at) {
            site[i].at = at;
            site[i].n++;
            break;
        }
    pthread_mutex_unlock(&lock);
    inside = false;
}

void count_alloc(bool on) {
    void *stack[DEPTH];
    inside = true;
    backtrace(stack, DEPTH); /* loads what it needs the first time */
    inside = false;
    atomic_store(&counting, on);
}

int count_alloc_report(const char *path) {
    FILE *f = fopen(path, "w");
    Dl_info d;
    for (size_t i = 0; f && i < MAX_SITES && site[i].n; i++) {
        bool known = site[i].at && dladdr(site[i].at, &d) && d.dli_fname;
        fprintf(f, "%lu %s %s+%td\n", site[i].n, known ? d.dli_fname : "?",
                known && d.dli_sname ? d.dli_sname : "?",
                known ? (char *)site[i].at - (char *)(d.dli_sname ? d.dli_saddr : d.dli_fbase) : 0);
    }
    return f ? fclose(f) : -1;
}

/* ---- the functions that are stood before ----------------------------------------------------- */

PUBLIC void *malloc(size_t n) {
    count();
    return __libc_malloc(n);
}

PUBLIC void *calloc(size_t n, size_t size) {
    count();
    return __libc_calloc(n, size);
}

PUBLIC void *realloc(void *p, size_t n) {
    count();
    return __libc_realloc(p, n);
}

PUBLIC void *memalign(size_t align, size_t n) {
    count();
    return __libc_memalign(align, n);
}

PUBLIC void *aligned_alloc(size_t align, size_t n) {
    return memalign(align, n);
}

PUBLIC int posix_memalign(void **p, size_t align, size_t n) {
    *p = memalign(align, n);
    return *p ? 0 : ENOMEM;
}
