/* Lets system calls fail that write; preloaded, so that Python, SQLite and compiled libraries call these functions.
   `arm(calls, fault, below)` lets calls through that touch files whose names contain `below`; "" is in every name.
   At the next one the process dies, before it (DIE) or after half of what it writes (TORN); or from then on none
   succeeds that takes room (error ENOSPC), or none at all (any other error). `lock(error)` lets locks fail. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

enum { DIE = -1, TORN = -2 };

static long left = -1;
static int fault, lock_error;
static char below[256];

void arm(long calls, int chosen, const char *name) { fault = chosen; strncpy(below, name, 255); left = calls; }

void lock(int error) { lock_error = error; }

long calls_left(void) { return left; }

static const char *name_of(int fd, char *name) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t size = readlink(link, name, 4095);
    name[size < 0 ? 0 : size] = 0;
    return name;
}

/* Counts the call, and returns whether it is to fail; dies where it is to die. */
static int fails(const char *path, int takes_room) {
    if (left < 0 || !strstr(path, below)) return 0;
    if (left > 0) left--;
    else if (fault < 0) kill(getpid(), SIGKILL);
    else if (takes_room || fault != ENOSPC) { errno = fault; return 1; }
    return 0;
}

static int is_file(const char *path) { return path[0] == '/' && strncmp(path, "/dev/", 5) && strncmp(path, "/proc/", 6); }

#define REAL(name) static __typeof__(name) *real; if (!real) real = (__typeof__(name) *)dlsym(RTLD_NEXT, #name)

#define OF_PATH(name, takes_room, parameters, ...) \
    int name parameters { REAL(name); return fails(path, takes_room) ? -1 : real(__VA_ARGS__); }

#define OF_FILE(name, takes_room, parameters, ...) \
    int name parameters { \
        REAL(name); char path[4096]; \
        return left >= 0 && is_file(name_of(fd, path)) && fails(path, takes_room) ? -1 : real(__VA_ARGS__); \
    }

#define WRITING(name, parameters, half, ...) \
    ssize_t name parameters { \
        REAL(name); char path[4096]; \
        if (left < 0 || !is_file(name_of(fd, path))) return real(__VA_ARGS__); \
        if (left == 0 && fault == TORN && strstr(path, below)) real half; \
        return fails(path, 1) ? -1 : real(__VA_ARGS__); \
    }

WRITING(write, (int fd, const void *data, size_t size), (fd, data, size / 2), fd, data, size)
WRITING(pwrite, (int fd, const void *data, size_t size, off_t at), (fd, data, size / 2, at), fd, data, size, at)
WRITING(pwrite64, (int fd, const void *data, size_t size, off64_t at), (fd, data, size / 2, at), fd, data, size, at)
WRITING(writev, (int fd, const struct iovec *data, int count), (fd, data, count / 2), fd, data, count)
OF_FILE(fsync, 1, (int fd), fd)
OF_FILE(fdatasync, 1, (int fd), fd)
OF_FILE(ftruncate, 0, (int fd, off_t size), fd, size)
OF_FILE(ftruncate64, 0, (int fd, off64_t size), fd, size)
OF_PATH(rename, 1, (const char *path, const char *to), path, to)
OF_PATH(unlink, 0, (const char *path), path)
OF_PATH(mkdir, 1, (const char *path, mode_t mode), path, mode)

#define OPENING(name) \
    int name(const char *path, int flags, ...) { \
        REAL(name); va_list more; va_start(more, flags); \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0; \
        va_end(more); \
        return (flags & O_CREAT) && fails(path, access(path, F_OK)) ? -1 : real(path, flags, mode); \
    }
OPENING(open)
OPENING(open64)

int flock(int fd, int operation) {
    REAL(flock);
    if (lock_error) { errno = lock_error; return -1; }
    return real(fd, operation);
}

#define LOCKING(name) \
    int name(int fd, int command, ...) { \
        REAL(name); va_list more; va_start(more, command); \
        void *given = va_arg(more, void *); \
        va_end(more); \
        if (lock_error && (command == F_SETLK || command == F_SETLKW)) { errno = lock_error; return -1; } \
        return real(fd, command, given); \
    }
LOCKING(fcntl)
LOCKING(fcntl64)
