// What objects compiled against this machine's C library refer to and glibc 2.28 lacks.

// Since glibc 2.32, whether the process has ever had one thread alone; 0 is the answer that is never wrong.
char __libc_single_threaded = 0;
