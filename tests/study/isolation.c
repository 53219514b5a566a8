/* Bare round trip from one process to others over shared memory: a number, a futex where the other sleeps, and LOOKS looks
   before sleeping (0: a futex each time). The others are asked in turn. Prints the median in microseconds.
   Run: round_trip LOOKS PROCESSES */
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

enum { TURNS = 2000, BATCHES = 51 };

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
    if (count != 3) return 2;
    int looks = atoi(words[1]), processes = atoi(words[2]);
    enum { LINE = 16, WORDS = 4 * LINE }; /* four words per process, each in a cache line of its own */
    _Atomic uint32_t *shared =
        mmap(0, processes * WORDS * sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    for (int p = 0; p < processes; ++p) {
        if (fork()) continue;
        _Atomic uint32_t *ask = shared + p * WORDS, *answer = ask + LINE, *worker = ask + 2 * LINE, *owner = ask + 3 * LINE;
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
        for (int k = 0; k < TURNS / processes; ++k, ++number)
            for (int p = 0; p < processes; ++p) {
                _Atomic uint32_t *ask = shared + p * WORDS, *answer = ask + LINE, *worker = ask + 2 * LINE, *owner = ask + 3 * LINE;
                tell(ask, worker, number + 1);
                await(answer, owner, number, looks);
            }
        took[batch] = (now() - began) / (TURNS / processes * processes);
    }
    for (int p = 0; p < processes; ++p) tell(shared + p * WORDS, shared + p * WORDS + 2 * LINE, UINT32_MAX);
    while (wait(0) > 0) {}
    qsort(took, BATCHES, sizeof *took, order);
    printf("%g\n", took[BATCHES / 2]);
    return 0;
}
