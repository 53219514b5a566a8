/* The logger callback of FMI 2.0 is variadic, which Rust cannot define: format here, store in log.rs.
 *
 * Each conversion is formatted alone, so that a format that does not fit its arguments is harmless: texts are copied
 * only from memory that can be read, and %n is left out. */

#define _GNU_SOURCE
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#if defined(__linux__)
#include <sys/uio.h>
#include <unistd.h>
#endif

void airloop_fmu_log(void *environment, const char *instance, int status, const char *category, const char *message);

/* Copies a text as far as it can be read; at most size - 1 bytes. */
static void copy_text(char *to, size_t size, const char *from) {
    if (from == NULL) {
        snprintf(to, size, "(null)");
        return;
    }
#if defined(__linux__)
    size_t done = 0;
    while (done + 1 < size) {
        /* Not across a page at once: the next one may be none. */
        size_t part = 4096 - ((uintptr_t)(from + done) & 4095);
        if (part > size - 1 - done) part = size - 1 - done;
        struct iovec local = {to + done, part}, remote = {(void *)(uintptr_t)(from + done), part};
        if (process_vm_readv(getpid(), &local, 1, &remote, 1, 0) != (ssize_t)part) {
            if (done == 0) {
                snprintf(to, size, "(no text)");
                return;
            }
            break;
        }
        char *end = memchr(to + done, 0, part);
        if (end != NULL) return;
        done += part;
    }
    to[done] = 0;
#else
    snprintf(to, size, "%s", from);
#endif
}

static void format(char *to, size_t size, const char *format, va_list arguments) {
    size_t at = 0;
    const char *f = format;
    while (*f != 0 && at + 1 < size) {
        if (*f != '%') {
            to[at++] = *f++;
            continue;
        }
        char one[64];
        size_t n = 0;
        int longs = 0, size_t_given = 0, long_double = 0, max = 0, diff = 0;
        int digits = 0;
        one[n++] = *f++;
        while (*f != 0 && strchr("-+ #0123456789.*'", *f) != NULL && n < 40) {
            /* Widths and precisions below 1000, as those of '*': others take hours and gigabytes. */
            digits = *f >= '0' && *f <= '9' ? digits + 1 : 0;
            if (digits > 3) {
                f++;
                continue;
            }
            if (*f == '*') {
                n += (size_t)snprintf(one + n, sizeof one - n, "%d", va_arg(arguments, int) % 1000);
                f++;
            } else {
                one[n++] = *f++;
            }
        }
        while (*f != 0 && strchr("hlLqjzt", *f) != NULL && n < 48) {
            longs += *f == 'l';
            longs += 2 * (*f == 'q');
            size_t_given |= *f == 'z';
            long_double |= *f == 'L';
            max |= *f == 'j';
            diff |= *f == 't';
            one[n++] = *f++;
        }
        char kind = *f;
        if (kind != 0) f++;
        one[n++] = kind;
        one[n] = 0;
        char *out = to + at;
        size_t room = size - at;
        int written = 0;
        char text[2048];
        switch (kind) {
            case '%': written = snprintf(out, room, "%%"); break;
            case 'd': case 'i': case 'c':
                if (longs > 1) written = snprintf(out, room, one, va_arg(arguments, long long));
                else if (longs == 1) written = snprintf(out, room, one, va_arg(arguments, long));
                else if (size_t_given) written = snprintf(out, room, one, va_arg(arguments, size_t));
                else if (max) written = snprintf(out, room, one, va_arg(arguments, intmax_t));
                else if (diff) written = snprintf(out, room, one, va_arg(arguments, ptrdiff_t));
                else written = snprintf(out, room, one, va_arg(arguments, int));
                break;
            case 'u': case 'x': case 'X': case 'o':
                if (longs > 1) written = snprintf(out, room, one, va_arg(arguments, unsigned long long));
                else if (longs == 1) written = snprintf(out, room, one, va_arg(arguments, unsigned long));
                else if (size_t_given) written = snprintf(out, room, one, va_arg(arguments, size_t));
                else if (max) written = snprintf(out, room, one, va_arg(arguments, uintmax_t));
                else if (diff) written = snprintf(out, room, one, va_arg(arguments, ptrdiff_t));
                else written = snprintf(out, room, one, va_arg(arguments, unsigned int));
                break;
            case 'e': case 'E': case 'f': case 'F': case 'g': case 'G': case 'a': case 'A':
                if (long_double) written = snprintf(out, room, one, va_arg(arguments, long double));
                else written = snprintf(out, room, one, va_arg(arguments, double));
                break;
            case 'p': written = snprintf(out, room, one, va_arg(arguments, void *)); break;
            case 's':
                if (longs > 0) {
                    (void)va_arg(arguments, void *);
                    written = snprintf(out, room, "(wide text)");
                } else {
                    copy_text(text, sizeof text, va_arg(arguments, const char *));
                    written = snprintf(out, room, one, text);
                }
                break;
            case 'n':
                (void)va_arg(arguments, void *);
                break;
            default:
                /* No conversion at all: shown as it stands. */
                written = snprintf(out, room, "%s", one);
        }
        if (written > 0) at += (size_t)written < room ? (size_t)written : room - 1;
    }
    to[at] = 0;
}

void airloop_fmi2_logger(void *environment, const char *instance, unsigned int status, const char *category,
                         const char *message, ...) {
    char text[4096], own_format[2048], own_instance[256], own_category[256];
    va_list arguments;

    copy_text(own_instance, sizeof own_instance, instance == NULL ? "" : instance);
    copy_text(own_category, sizeof own_category, category == NULL ? "" : category);
    copy_text(own_format, sizeof own_format, message == NULL ? "" : message);
    va_start(arguments, message);
    format(text, sizeof text, own_format, arguments);
    va_end(arguments);
    airloop_fmu_log(environment, own_instance, (int)status, own_category, text);
}
