// SPDX-License-Identifier: BSD-3-Clause
// Answer requests, in a thread of its own: a few connections at a time, each bounded in bytes and time.
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/thread_pool.h"
#include "host/control/internal.h"

enum { CLIENTS = 8, MEMBERS = GONIO_CONTROL_ANSWER / 2 - 128, BREATH_MS = 50 };

typedef struct taken_name {
    int socket, folder, lock; // -1 each: there is none
    char name[CONTROL_NAME];
} taken_name;

typedef struct client {
    int fd; // -1: a free place
    int64_t until_ns;
    size_t n;
    char word[CONTROL_WORD];
} client;

struct gonio_control {
    pthread_mutex_t lock; // of the names, the answer and the clients
    pthread_t thread;
    bool running;
    int wake; // makes the thread look again
    atomic_bool stopping, paused, closing;
    taken_name names[GONIO_CONTROL_KINDS];
    client clients[CLIENTS];
    char told[MEMBERS];
    gonio_control_members members;
    void *context;
};

bool gonio_control_stopping(const gonio_control *c) { return c != NULL && atomic_load(&c->stopping); }
bool gonio_control_paused(const gonio_control *c) { return c != NULL && atomic_load(&c->paused); }

// ---- answers ----

static void shut(client *k) {
    close(k->fd);
    k->fd = -1;
}

static void answer(gonio_control *c, int fd) {
    char asked[MEMBERS] = "", text[GONIO_CONTROL_ANSWER];
    if (c->members != NULL) {
        c->members(c->context, asked, sizeof asked);
    }
    const int n = snprintf(text, sizeof text, "{\"pid\":%ld,\"stopping\":%s,\"paused\":%s%s%s%s%s}\n", (long)getpid(),
                           gonio_control_stopping(c) ? "true" : "false", gonio_control_paused(c) ? "true" : "false",
                           c->told[0] != 0 ? "," : "", c->told, asked[0] != 0 ? "," : "", asked);
    // It fits into the socket's buffer; who does not take it does not get it.
    const ssize_t sent = send(fd, text, (size_t)n, MSG_NOSIGNAL | MSG_DONTWAIT);
    (void)sent;
}

static void obey(gonio_control *c, client *k) {
    const char *word = k->word;
    if (strcmp(word, "pause") == 0) {
        atomic_store(&c->paused, true);
    } else if (strcmp(word, "go") == 0) {
        atomic_store(&c->paused, false);
    } else if (strcmp(word, "stop") == 0) {
        atomic_store(&c->stopping, true);
    } else if (strcmp(word, "status") != 0) {
        const char refusal[] = "{\"error\":\"expected status, pause, go or stop\"}\n";
        const ssize_t sent = send(k->fd, refusal, sizeof refusal - 1, MSG_NOSIGNAL | MSG_DONTWAIT);
        (void)sent;
        return;
    }
    answer(c, k->fd);
}

// What has come of a request; a whole line is obeyed, and ends the connection like everything else that ends it.
static void hear(gonio_control *c, client *k) {
    const ssize_t got = recv(k->fd, k->word + k->n, sizeof k->word - 1 - k->n, MSG_DONTWAIT);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) {
        return;
    }
    k->n += got > 0 ? (size_t)got : 0;
    char *end = memchr(k->word, '\n', k->n);
    if (end != NULL) {
        *end = 0;
        obey(c, k);
    }
    if (got <= 0 || end != NULL || k->n == sizeof k->word - 1) {
        shut(k);
    }
}

// The place that is free, or that of whoever has been silent for longest.
static client *place(gonio_control *c) {
    client *oldest = &c->clients[0];
    for (client *k = c->clients; k < c->clients + CLIENTS; k++) {
        if (k->fd < 0) {
            return k;
        }
        oldest = k->until_ns < oldest->until_ns ? k : oldest;
    }
    shut(oldest);
    return oldest;
}

static void greet(gonio_control *c, int listener) {
    const int fd = accept4(listener, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd < 0) {
        if (errno != EAGAIN && errno != EINTR && errno != ECONNABORTED) {
            poll(NULL, 0, BREATH_MS); // no file descriptor left: try again, but not all the time
        }
        return;
    }
    if (!gonio_control_mine(fd)) {
        close(fd);
        return;
    }
    *place(c) = (client){.fd = fd, .until_ns = gonio_clock_ns() + CONTROL_PATIENCE_MS * INT64_C(1000000)};
}

// ---- the thread ----

// What to wait for: the wake, the listeners, the clients; in this order, -1 where there is none. Returns for how long.
static int watch(gonio_control *c, struct pollfd fds[1 + GONIO_CONTROL_KINDS + CLIENTS]) {
    const int64_t now_ns = gonio_clock_ns();
    int64_t wait_ms = -1;
    *fds++ = (struct pollfd){.fd = c->wake, .events = POLLIN};
    for (int k = 0; k < GONIO_CONTROL_KINDS; k++) {
        *fds++ = (struct pollfd){.fd = c->names[k].socket, .events = POLLIN};
    }
    for (client *k = c->clients; k < c->clients + CLIENTS; k++) {
        if (k->fd >= 0 && k->until_ns <= now_ns) {
            shut(k);
        }
        const int64_t left_ms = (k->until_ns - now_ns) / 1000000 + 1;
        wait_ms = k->fd >= 0 && (wait_ms < 0 || left_ms < wait_ms) ? left_ms : wait_ms;
        *fds++ = (struct pollfd){.fd = k->fd, .events = POLLIN};
    }
    return (int)wait_ms;
}

static void serve(gonio_control *c, const struct pollfd *fds) {
    uint64_t woken;
    if (fds[0].revents != 0 && read(c->wake, &woken, sizeof woken) < 0) {
        poll(NULL, 0, BREATH_MS);
    }
    const struct pollfd *clients = fds + 1 + GONIO_CONTROL_KINDS;
    for (int k = 0; k < CLIENTS; k++) {
        if (clients[k].revents != 0) {
            hear(c, &c->clients[k]);
        }
    }
    for (int k = 0; k < GONIO_CONTROL_KINDS; k++) {
        // A name may have been given back meanwhile.
        if (fds[1 + k].revents != 0 && fds[1 + k].fd == c->names[k].socket) {
            greet(c, c->names[k].socket);
        }
    }
}

static void *run(void *context) {
    gonio_control *c = context;
    struct pollfd fds[1 + GONIO_CONTROL_KINDS + CLIENTS];
    while (!atomic_load(&c->closing)) {
        pthread_mutex_lock(&c->lock);
        const int wait_ms = watch(c, fds);
        pthread_mutex_unlock(&c->lock);
        if (poll(fds, sizeof fds / sizeof *fds, wait_ms) > 0) {
            pthread_mutex_lock(&c->lock);
            serve(c, fds);
            pthread_mutex_unlock(&c->lock);
        }
    }
    return NULL;
}

static void wake(const gonio_control *c) {
    const uint64_t one = 1;
    const ssize_t wrote = write(c->wake, &one, sizeof one);
    (void)wrote; // it cannot fail before 2^64 - 2 of them
}

// ---- names ----

// The lock beside a socket tells that its owner lives. GONIO_E_FAILED: somebody has it. Whoever lets go of a lock
// removes its file first, so that one may be held which no longer has a name.
static gonio_status take_lock(taken_name *t, gonio_error *error) {
    char file[CONTROL_NAME + 8];
    snprintf(file, sizeof file, "%s.lock", t->name);
    for (int attempt = 0; attempt < 100; attempt++) {
        struct stat held, named;
        t->lock = openat(t->folder, file, O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600);
        if (t->lock < 0 || fstat(t->lock, &held) != 0) {
            return gonio_fail(error, GONIO_E_IO, "control socket: %s", strerror(errno));
        }
        if (flock(t->lock, LOCK_EX | LOCK_NB) != 0) {
            return gonio_fail(error, GONIO_E_FAILED, "another program is at work on it");
        }
        if (fstatat(t->folder, file, &named, AT_SYMLINK_NOFOLLOW) == 0 && named.st_ino == held.st_ino) {
            return GONIO_OK;
        }
        close(t->lock);
        t->lock = -1;
    }
    return gonio_fail(error, GONIO_E_FAILED, "another program is at work on it");
}

// With the lock held, whatever bears the socket's name is left over from a program that was killed.
static gonio_status take_socket(taken_name *t, gonio_error *error) {
    char file[CONTROL_NAME + 8];
    struct sockaddr_un address;
    gonio_control_address(t->folder, t->name, &address);
    snprintf(file, sizeof file, "%s.socket", t->name);
    unlinkat(t->folder, file, 0);
    t->socket = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (t->socket < 0 || bind(t->socket, (const struct sockaddr *)&address, sizeof address) != 0 ||
        listen(t->socket, 2 * CLIENTS) != 0) {
        return gonio_fail(error, GONIO_E_IO, "control socket: %s", strerror(errno));
    }
    return GONIO_OK;
}

static void let_go(taken_name *t) {
    char file[CONTROL_NAME + 8];
    if (t->socket >= 0) {
        snprintf(file, sizeof file, "%s.socket", t->name);
        unlinkat(t->folder, file, 0);
        close(t->socket);
        snprintf(file, sizeof file, "%s.lock", t->name);
        unlinkat(t->folder, file, 0);
    }
    if (t->lock >= 0) {
        close(t->lock);
    }
    if (t->folder >= 0) {
        close(t->folder);
    }
    *t = (taken_name){.socket = -1, .folder = -1, .lock = -1};
}

static gonio_status take(gonio_control_kind kind, const char *identity, taken_name *t, gonio_error *error) {
    gonio_status status = gonio_control_name(kind, identity, t->name, error);
    // It may have been started where another folder was the first one.
    const int other = status == GONIO_OK ? gonio_control_connect(t->name) : -1;
    if (other >= 0) {
        close(other);
        return gonio_fail(error, GONIO_E_FAILED, "another program is at work on it");
    }
    for (int k = 0; k < CONTROL_FOLDERS && t->folder < 0; k++) {
        t->folder = gonio_control_folder(k, true);
    }
    if (status == GONIO_OK && t->folder < 0) {
        status =
            gonio_fail(error, GONIO_E_IO,
                       "control socket: neither $XDG_RUNTIME_DIR, /run/user/%ld nor /tmp has room for a folder that "
                       "is this user's alone",
                       (long)geteuid());
    }
    status = status == GONIO_OK ? take_lock(t, error) : status;
    return status == GONIO_OK ? take_socket(t, error) : status;
}

gonio_status gonio_control_listen(gonio_control *c, gonio_control_kind kind, const char *identity, gonio_error *error) {
    taken_name t = {.socket = -1, .folder = -1, .lock = -1};
    gonio_control_leave(c, kind);
    gonio_status status = take(kind, identity, &t, error);
    if (status == GONIO_OK && !c->running) {
        c->running = gonio_thread_start(&c->thread, run, c);
        status = c->running ? GONIO_OK : gonio_fail(error, GONIO_E_MEMORY, "control socket: cannot start a thread");
    }
    if (status != GONIO_OK) {
        let_go(&t);
        return status;
    }
    pthread_mutex_lock(&c->lock);
    c->names[kind] = t;
    pthread_mutex_unlock(&c->lock);
    wake(c);
    return GONIO_OK;
}

void gonio_control_leave(gonio_control *c, gonio_control_kind kind) {
    if (c == NULL) {
        return;
    }
    pthread_mutex_lock(&c->lock);
    let_go(&c->names[kind]);
    pthread_mutex_unlock(&c->lock);
    wake(c);
}

// ---- life ----

gonio_status gonio_control_new(gonio_control **out, gonio_error *error) {
    *out = NULL;
    gonio_control *c = calloc(1, sizeof *c);
    const int fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (c == NULL || fd < 0) {
        free(c);
        return gonio_fail(error, GONIO_E_MEMORY, "no memory for a control socket");
    }
    c->wake = fd;
    pthread_mutex_init(&c->lock, NULL);
    for (int k = 0; k < GONIO_CONTROL_KINDS; k++) {
        c->names[k] = (taken_name){.socket = -1, .folder = -1, .lock = -1};
    }
    for (int k = 0; k < CLIENTS; k++) {
        c->clients[k].fd = -1;
    }
    *out = c;
    return GONIO_OK;
}

void gonio_control_free(gonio_control *c) {
    if (c == NULL) {
        return;
    }
    if (c->running) {
        atomic_store(&c->closing, true);
        wake(c);
        pthread_join(c->thread, NULL);
    }
    for (int k = 0; k < GONIO_CONTROL_KINDS; k++) {
        let_go(&c->names[k]);
    }
    for (int k = 0; k < CLIENTS; k++) {
        if (c->clients[k].fd >= 0) {
            shut(&c->clients[k]);
        }
    }
    close(c->wake);
    pthread_mutex_destroy(&c->lock);
    free(c);
}

void gonio_control_tell(gonio_control *c, const char *members) {
    if (c != NULL && strlen(members) < sizeof c->told) {
        pthread_mutex_lock(&c->lock);
        memcpy(c->told, members, strlen(members) + 1);
        pthread_mutex_unlock(&c->lock);
    }
}

void gonio_control_ask(gonio_control *c, gonio_control_members members, void *context) {
    if (c != NULL) {
        pthread_mutex_lock(&c->lock);
        c->members = members;
        c->context = context;
        pthread_mutex_unlock(&c->lock);
    }
}
