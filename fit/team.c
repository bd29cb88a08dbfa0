#include "fit/team.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <unistd.h>

#define THREADS_MAX 256

struct gonio_team {
    pthread_mutex_t mutex;
    pthread_cond_t begin, end;
    pthread_t threads[THREADS_MAX];
    int count;           // helpers beside the caller
    int busy;            // helpers that have not finished the round
    unsigned long round; // grows by one a run
    bool stop;
    atomic_size_t next;
    size_t items;
    void (*work)(void *context, size_t item);
    void *context;
};

static void take_items(gonio_team *team) {
    for (;;) {
        const size_t item = atomic_fetch_add(&team->next, 1);
        if (item >= team->items) {
            return;
        }
        team->work(team->context, item);
    }
}

static void *helper(void *argument) {
    gonio_team *team = argument;
    unsigned long seen = 0;
    pthread_mutex_lock(&team->mutex);
    for (;;) {
        while (team->round == seen && !team->stop) {
            pthread_cond_wait(&team->begin, &team->mutex);
        }
        if (team->stop) {
            break;
        }
        seen = team->round;
        pthread_mutex_unlock(&team->mutex);
        take_items(team);
        pthread_mutex_lock(&team->mutex);
        if (--team->busy == 0) {
            pthread_cond_signal(&team->end);
        }
    }
    pthread_mutex_unlock(&team->mutex);
    return NULL;
}

size_t gonio_team_threads(int threads) {
    const long online = threads > 0 ? threads : sysconf(_SC_NPROCESSORS_ONLN);
    return online < 1 ? 1 : online > THREADS_MAX ? THREADS_MAX : (size_t)online;
}

size_t gonio_team_size(const gonio_team *team) { return team != NULL ? (size_t)team->count + 1 : 1; }

gonio_team *gonio_team_new(int threads) {
    const int wanted = (int)gonio_team_threads(threads);
    gonio_team *team = wanted > 1 ? calloc(1, sizeof *team) : NULL;
    if (team == NULL) {
        return NULL;
    }
    pthread_mutex_init(&team->mutex, NULL);
    pthread_cond_init(&team->begin, NULL);
    pthread_cond_init(&team->end, NULL);
    while (team->count < wanted - 1 && pthread_create(&team->threads[team->count], NULL, helper, team) == 0) {
        team->count++;
    }
    return team;
}

void gonio_team_free(gonio_team *team) {
    if (team == NULL) {
        return;
    }
    pthread_mutex_lock(&team->mutex);
    team->stop = true;
    pthread_cond_broadcast(&team->begin);
    pthread_mutex_unlock(&team->mutex);
    for (int i = 0; i < team->count; i++) {
        pthread_join(team->threads[i], NULL);
    }
    pthread_cond_destroy(&team->begin);
    pthread_cond_destroy(&team->end);
    pthread_mutex_destroy(&team->mutex);
    free(team);
}

void gonio_team_run(gonio_team *team, size_t items, void (*work)(void *context, size_t item), void *context) {
    if (team == NULL || team->count == 0 || items <= 1) {
        for (size_t item = 0; item < items; item++) {
            work(context, item);
        }
        return;
    }
    pthread_mutex_lock(&team->mutex);
    team->items = items;
    team->work = work;
    team->context = context;
    atomic_store(&team->next, 0);
    team->busy = team->count;
    team->round++;
    pthread_cond_broadcast(&team->begin);
    pthread_mutex_unlock(&team->mutex);
    take_items(team);
    pthread_mutex_lock(&team->mutex);
    while (team->busy > 0) {
        pthread_cond_wait(&team->end, &team->mutex);
    }
    pthread_mutex_unlock(&team->mutex);
}
