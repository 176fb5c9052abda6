/* Kills the process at a system call that writes; preloaded, so that Python and SQLite call these functions.
   `arm(n, torn)` lets n more calls through and dies at the next one, before it or after half of what it writes. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <sys/stat.h>
#include <unistd.h>

static long left = -1;
static int is_torn;

void arm(long calls, int torn) { left = calls; is_torn = torn; }

long calls_left(void) { return left; }

static int is_due(void) { return left >= 0 && left-- == 0; }

static void die(void) { kill(getpid(), SIGKILL); }

#define REAL(name) static __typeof__(name) *real; if (!real) real = (__typeof__(name) *)dlsym(RTLD_NEXT, #name)

#define PLAIN(name, parameters, ...) \
    int name parameters { REAL(name); if (is_due()) die(); return real(__VA_ARGS__); }

#define WRITING(name, parameters, first, size, ...) \
    ssize_t name parameters { \
        REAL(name); \
        if (is_due()) { if (is_torn) real(first, (size) / 2 __VA_ARGS__); die(); } \
        return real(first, size __VA_ARGS__); \
    }

#define FIRST fd, data
#define COMMA ,
WRITING(write, (int fd, const void *data, size_t size), FIRST, size, )
WRITING(pwrite, (int fd, const void *data, size_t size, off_t place), FIRST, size, COMMA place)
WRITING(pwrite64, (int fd, const void *data, size_t size, off64_t place), FIRST, size, COMMA place)
PLAIN(fsync, (int fd), fd)
PLAIN(fdatasync, (int fd), fd)
PLAIN(ftruncate, (int fd, off_t size), fd, size)
PLAIN(ftruncate64, (int fd, off64_t size), fd, size)
PLAIN(rename, (const char *from, const char *to), from, to)
PLAIN(unlink, (const char *path), path)
PLAIN(mkdir, (const char *path, mode_t mode), path, mode)

#define OPENING(name) \
    int name(const char *path, int flags, ...) { \
        REAL(name); va_list more; va_start(more, flags); \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0; \
        va_end(more); \
        if ((flags & O_CREAT) && is_due()) die(); \
        return real(path, flags, mode); \
    }
OPENING(open)
OPENING(open64)
