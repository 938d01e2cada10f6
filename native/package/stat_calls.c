// zig's static part of glibc, for versions before 2.33, has functions here that leave errno alone
// where they fail, so that what is missing seems to be there. The ones of the C library itself,
// which those versions have under these names, set it. On 64-bit ARM files of any size are meant.
struct stat;
int __xstat(int version, const char* path, struct stat* out);
int __lxstat(int version, const char* path, struct stat* out);
int __fxstat(int version, int descriptor, struct stat* out);
int __fxstatat(int version, int folder, const char* path, struct stat* out, int flags);
// The kernel's own form of the structure.
enum { kVersion = 0 };

#define HIDDEN __attribute__((visibility("hidden")))
#define BOTH(name, parameters, call) \
  HIDDEN int name parameters;        \
  int name parameters {              \
    return call;                     \
  }                                  \
  HIDDEN int name##64 parameters;    \
  int name##64 parameters {          \
    return call;                     \
  }

BOTH(stat, (const char* path, struct stat* out), __xstat(kVersion, path, out))
BOTH(lstat, (const char* path, struct stat* out), __lxstat(kVersion, path, out))
BOTH(fstat, (int descriptor, struct stat* out), __fxstat(kVersion, descriptor, out))
BOTH(fstatat, (int folder, const char* path, struct stat* out, int flags),
     __fxstatat(kVersion, folder, path, out, flags))
