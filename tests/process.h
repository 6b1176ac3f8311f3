/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * process.h: runs the `arris` program that was built, as its users do, and keeps what it says.
 */
#ifndef PROCESS_H
#define PROCESS_H

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { MAX_WORDS = 64, LIMIT_S = 120 /* after which a program is taken to hang */ };

typedef struct process {
    pid_t pid;
    int fd[2];       /* where its standard output and standard error go */
    int code;        /* of its exit; 128 + the signal's number when that ended it */
    char *text[2];   /* what it wrote; for process_free */
    char *out, *err; /* the same two by name */
} process;

static inline const char *arris_path(void) {
    static char path[4096];
    const char *b = getenv("B");
    snprintf(path, sizeof path, "%s/arris", b ? b : "build");
    return path;
}

/* Starts a program in the working directory `in` (NULL: this one). fd[1] may be given; when it is
 * -1 it is a file in memory, as fd[0] always is. */
static inline process process_start(const char *in, int terminal, char *const *words) {
    process p = {.fd = {memfd_create("out", MFD_CLOEXEC),
                        terminal >= 0 ? terminal : memfd_create("err", MFD_CLOEXEC)}};
    char path[4096];
    if (!realpath(words[0], path) || p.fd[0] < 0 || p.fd[1] < 0 || (p.pid = fork()) < 0)
        abort();
    if (p.pid == 0) {
        int none = open("/dev/null", O_RDONLY);
        if (none < 0 || dup2(none, 0) < 0 || dup2(p.fd[0], 1) < 0 || dup2(p.fd[1], 2) < 0 ||
            (in && chdir(in)))
            _exit(126);
        execv(path, words);
        _exit(127);
    }
    return p;
}

static inline char *fd_text(int fd) {
    off_t n = lseek(fd, 0, SEEK_END);
    char *text = calloc(1, (size_t)(n > 0 ? n : 0) + 1);
    if (!text || (n > 0 && pread(fd, text, (size_t)n, 0) != n))
        abort();
    close(fd);
    return text;
}

/* Waits for its end. One that takes too long is killed, and its code is 128 + SIGKILL. */
static inline void process_wait(process *p) {
    int status = 0;
    for (long ms = 0; waitpid(p->pid, &status, WNOHANG) == 0; ms += 2) {
        if (ms > LIMIT_S * 1000)
            kill(p->pid, SIGKILL);
        nanosleep(&(struct timespec){0, 2000000}, NULL);
    }
    p->code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    for (int i = 0; i < 2; i++)
        p->text[i] = fd_text(p->fd[i]);
    p->out = p->text[0];
    p->err = p->text[1];
}

static inline void process_free(process *p) {
    free(p->text[0]);
    free(p->text[1]);
}

/* The command line's words as they are separated by blanks; quotes mean nothing. */
static inline void split(char *line, char **words) {
    int n = 0;
    for (char *w = strtok(line, " "); w && n < MAX_WORDS - 1; w = strtok(NULL, " "))
        words[n++] = w;
    words[n] = NULL;
}

/* Starts `arris` with these words. */
static inline process arris_begin(const char *in, int terminal, const char *line) {
    char copy[8192], *words[MAX_WORDS] = {(char *)arris_path()};
    snprintf(copy, sizeof copy, "%s", line);
    split(copy, words + 1);
    return process_start(in, terminal, words);
}

/* Runs `arris` with these words to its end. */
static inline process arris_run(const char *line) {
    process p = arris_begin(NULL, -1, line);
    process_wait(&p);
    return p;
}

/* Runs `arris launch LINE`, the line as one word, in the folder `in`. */
static inline process arris_launch(const char *in, const char *line) {
    char *words[] = {(char *)arris_path(), (char *)"launch", (char *)line, NULL};
    process p = process_start(in, -1, words);
    process_wait(&p);
    return p;
}

#endif
