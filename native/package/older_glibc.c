// What objects compiled against this machine's C library refer to and glibc 2.28 lacks.
#include <stdint.h>
#include <sys/random.h>

// Since glibc 2.32, whether the process has ever had one thread alone; 0 is the answer that is never wrong.
char __libc_single_threaded = 0;

// Since glibc 2.36: a random number of the system. libstdc++'s random device asks for it.
uint32_t arc4random(void);
uint32_t arc4random(void) {
  uint32_t number = 0;
  // A request of so few bytes is met whole, once the system has gathered its randomness.
  while (getrandom(&number, sizeof(number), 0) != (ssize_t)sizeof(number)) {
  }
  return number;
}
