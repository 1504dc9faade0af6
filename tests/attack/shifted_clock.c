// A wall clock that a test moves while a program runs, without the rights to set the machine's. The program is started with LD_PRELOAD; the file
// that SIGHTLINE_CLOCK_SHIFT names holds the shift in nanoseconds, as 8 bytes in the machine's order.
//
// A wait until a moment of the wall clock ends when the moved clock shows it, also when the clock moves during the wait, as the kernel does it. Such a
// wait is cut into slices. Steady clocks, and waits of theirs, are as always.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/futex.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static const int64_t kSecond = 1000000000, kSlice = 20000000;
// A steady clock counts from the start of the machine, so a moment beyond this many seconds is one of the wall clock.
static const int64_t kLongestUptime_s = 500000000;

static int (*real_clock_gettime)(clockid_t, struct timespec*);
static int (*real_cond_timedwait)(pthread_cond_t*, pthread_mutex_t*, const struct timespec*);
static int (*real_cond_clockwait)(pthread_cond_t*, pthread_mutex_t*, clockid_t, const struct timespec*);
static int (*real_sem_timedwait)(sem_t*, const struct timespec*);
static long (*real_syscall)(long, ...);
static const volatile int64_t* shift;

__attribute__((constructor)) static void begin(void) {
  if (real_clock_gettime) return;
  real_cond_timedwait = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
  real_cond_clockwait = dlsym(RTLD_NEXT, "pthread_cond_clockwait");
  real_sem_timedwait = dlsym(RTLD_NEXT, "sem_timedwait");
  real_syscall = dlsym(RTLD_NEXT, "syscall");
  const char* const path = getenv("SIGHTLINE_CLOCK_SHIFT");
  const int fd = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
  if (fd >= 0) {
    void* const shared = mmap(NULL, sizeof(int64_t), PROT_READ, MAP_SHARED, fd, 0);
    if (shared != MAP_FAILED) shift = shared;
    close(fd);
  }
  real_clock_gettime = dlsym(RTLD_NEXT, "clock_gettime");
}

static int64_t to_ns(const struct timespec* at) {
  const int64_t most_s = INT64_MAX / kSecond - 1;
  return (at->tv_sec > most_s ? most_s : at->tv_sec) * kSecond + at->tv_nsec;
}

static struct timespec to_timespec(int64_t ns) {
  const struct timespec at = {ns / kSecond, ns % kSecond};
  return at;
}

static int64_t true_now(void) {
  struct timespec now;
  begin();
  real_clock_gettime(CLOCK_REALTIME, &now);
  return to_ns(&now);
}

static int64_t shown_now(void) {
  return true_now() + (shift ? *shift : 0);
}

static int is_wall_moment(const struct timespec* at) {
  return at && at->tv_sec > kLongestUptime_s;
}

// The end of the next slice of a wait until `end`, by the machine's clock.
static struct timespec slice_until(int64_t end) {
  const int64_t left = end - shown_now();
  return to_timespec(true_now() + (left < 0 ? 0 : left < kSlice ? left : kSlice));
}

int clock_gettime(clockid_t clock, struct timespec* now) {
  begin();
  const int result = real_clock_gettime(clock, now);
  if (result == 0 && shift && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) *now = to_timespec(to_ns(now) + *shift);
  return result;
}

int gettimeofday(struct timeval* restrict now, void* restrict zone) {
  (void)zone;
  const int64_t ns = shown_now();
  now->tv_sec = ns / kSecond;
  now->tv_usec = ns % kSecond / 1000;
  return 0;
}

time_t time(time_t* now) {
  const time_t seconds = shown_now() / kSecond;
  if (now) *now = seconds;
  return seconds;
}

// A slice that ends before the time looks like a wake-up without a cause, which every caller has to expect.
int pthread_cond_timedwait(pthread_cond_t* restrict condition, pthread_mutex_t* restrict mutex, const struct timespec* restrict until) {
  begin();
  if (!is_wall_moment(until)) return real_cond_timedwait(condition, mutex, until);
  const struct timespec end = slice_until(to_ns(until));
  const int result = real_cond_timedwait(condition, mutex, &end);
  return result == ETIMEDOUT && shown_now() < to_ns(until) ? 0 : result;
}

int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex, clockid_t clock, const struct timespec* until) {
  begin();
  if (clock != CLOCK_REALTIME) return real_cond_clockwait(condition, mutex, clock, until);
  const struct timespec end = slice_until(to_ns(until));
  const int result = real_cond_clockwait(condition, mutex, clock, &end);
  return result == ETIMEDOUT && shown_now() < to_ns(until) ? 0 : result;
}

int sem_timedwait(sem_t* restrict semaphore, const struct timespec* restrict until) {
  begin();
  for (;;) {
    const struct timespec end = slice_until(to_ns(until));
    if (real_sem_timedwait(semaphore, &end) == 0) return 0;
    if (errno != ETIMEDOUT || shown_now() >= to_ns(until)) return -1;
  }
}

// Abseil's locks, and through them gRPC's timers, wait with this call.
static long wait_at_futex(long a, long operation, long c, const struct timespec* until, long e, long f) {
  for (;;) {
    const struct timespec end = slice_until(to_ns(until));
    const long result = real_syscall(SYS_futex, a, operation, c, &end, e, f);
    if (result == 0 || errno != ETIMEDOUT || shown_now() >= to_ns(until)) return result;
  }
}

long syscall(long number, ...) {
  va_list more;
  va_start(more, number);
  const long a = va_arg(more, long), b = va_arg(more, long), c = va_arg(more, long), d = va_arg(more, long), e = va_arg(more, long),
             f = va_arg(more, long);
  va_end(more);
  begin();
  const int absolute = number == SYS_futex && (b & FUTEX_CMD_MASK) == FUTEX_WAIT_BITSET && (b & FUTEX_CLOCK_REALTIME) && d;
  return absolute ? wait_at_futex(a, b, c, (const struct timespec*)d, e, f) : real_syscall(number, a, b, c, d, e, f);
}
