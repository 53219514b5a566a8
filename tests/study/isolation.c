/* Round trip between two processes over shared memory, as a worker makes it: a number, a futex where the other sleeps,
   and some looks before sleeping. Prints the median of the turns in microseconds. */
#define _GNU_SOURCE
#include <linux/futex.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { TURNS = 2000, BATCHES = 101 };

static void await(_Atomic uint32_t *word, _Atomic uint32_t *sleeps, uint32_t old, int looks) {
    for (int k = 0; k < looks; ++k)
        if (atomic_load(word) != old) return;
    atomic_store(sleeps, 1);
    while (atomic_load(word) == old) syscall(SYS_futex, word, FUTEX_WAIT, old, 0, 0, 0);
    atomic_store(sleeps, 0);
}

static void tell(_Atomic uint32_t *word, _Atomic uint32_t *sleeps, uint32_t value) {
    atomic_store(word, value);
    if (atomic_load(sleeps)) syscall(SYS_futex, word, FUTEX_WAKE, 1, 0, 0, 0);
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e6 * t.tv_sec + 1e-3 * t.tv_nsec;
}

static int order(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int count, char **words) {
    int looks = count > 1 ? atoi(words[1]) : 4000;
    _Atomic uint32_t *shared = mmap(0, 4096, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    _Atomic uint32_t *ask = shared, *answer = shared + 16, *worker = shared + 32, *owner = shared + 48;
    pid_t child = fork();
    if (child == 0) {
        for (uint32_t k = 0;; ++k) {
            await(ask, worker, k, looks);
            if (atomic_load(ask) == UINT32_MAX) return 0;
            tell(answer, owner, k + 1);
        }
    }
    double took[BATCHES];
    uint32_t number = 0;
    for (int batch = 0; batch < BATCHES; ++batch) {
        double began = now();
        for (int k = 0; k < TURNS; ++k, ++number) {
            tell(ask, worker, number + 1);
            await(answer, owner, number, looks);
        }
        took[batch] = (now() - began) / TURNS;
    }
    tell(ask, worker, UINT32_MAX);
    waitpid(child, 0, 0);
    qsort(took, BATCHES, sizeof *took, order);
    printf("%g\n", took[BATCHES / 2]);
    return 0;
}
