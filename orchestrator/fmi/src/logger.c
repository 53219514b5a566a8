/* The logger callback of FMI 2.0 is variadic, which Rust cannot define: format here, store in log.rs. */

#include <stdarg.h>
#include <stdio.h>

void airloop_fmu_log(void *environment, const char *instance, int status, const char *category, const char *message);

void airloop_fmi2_logger(void *environment, const char *instance, unsigned int status, const char *category,
                         const char *message, ...) {
    char text[4096];
    va_list arguments;

    if (message == NULL) {
        airloop_fmu_log(environment, instance, (int)status, category, "");
        return;
    }
    va_start(arguments, message);
    if (vsnprintf(text, sizeof text, message, arguments) < 0) {
        /* The format is broken; the bare message is still better than nothing. */
        snprintf(text, sizeof text, "%s", message);
    }
    va_end(arguments);
    airloop_fmu_log(environment, instance, (int)status, category, text);
}
