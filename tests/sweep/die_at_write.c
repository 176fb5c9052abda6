/* Kills the process at a system call that writes; preloaded, so that Python and SQLite call these functions.
   `arm(n, fault)` lets n more calls through. At the next one it dies, before it (0) or after half of what it writes (1);
   or the disk is full from then on (2), so that no call succeeds which takes room. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <sys/stat.h>
#include <unistd.h>

enum { TORN = 1, FULL = 2 };

static long left = -1;
static int fault;

void arm(long calls, int chosen) { left = calls; fault = chosen; }

long calls_left(void) { return left; }

/* Counts the call, and returns whether it is to fail; dies where it is to die. */
static int fails(int takes_room) {
    if (left > 0) left--;
    else if (left == 0 && fault != FULL) kill(getpid(), SIGKILL);
    else if (left == 0 && takes_room) { errno = ENOSPC; return 1; }
    return 0;
}

#define REAL(name) static __typeof__(name) *real; if (!real) real = (__typeof__(name) *)dlsym(RTLD_NEXT, #name)

#define PLAIN(name, takes_room, parameters, ...) \
    int name parameters { REAL(name); return fails(takes_room) ? -1 : real(__VA_ARGS__); }

#define WRITING(name, parameters, first, size, ...) \
    ssize_t name parameters { \
        REAL(name); \
        if (left == 0 && fault == TORN) real(first, (size) / 2 __VA_ARGS__); \
        return fails(fd > STDERR_FILENO) ? -1 : real(first, size __VA_ARGS__); \
    }

#define FIRST fd, data
#define COMMA ,
WRITING(write, (int fd, const void *data, size_t size), FIRST, size, )
WRITING(pwrite, (int fd, const void *data, size_t size, off_t place), FIRST, size, COMMA place)
WRITING(pwrite64, (int fd, const void *data, size_t size, off64_t place), FIRST, size, COMMA place)
PLAIN(fsync, 1, (int fd), fd)
PLAIN(fdatasync, 1, (int fd), fd)
PLAIN(ftruncate, 0, (int fd, off_t size), fd, size)
PLAIN(ftruncate64, 0, (int fd, off64_t size), fd, size)
PLAIN(rename, 1, (const char *from, const char *to), from, to)
PLAIN(unlink, 0, (const char *path), path)
PLAIN(mkdir, 1, (const char *path, mode_t mode), path, mode)

#define OPENING(name) \
    int name(const char *path, int flags, ...) { \
        REAL(name); va_list more; va_start(more, flags); \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0; \
        va_end(more); \
        return (flags & O_CREAT) && fails(access(path, F_OK)) ? -1 : real(path, flags, mode); \
    }
OPENING(open)
OPENING(open64)
