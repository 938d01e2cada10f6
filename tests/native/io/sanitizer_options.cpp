// Read by the leak sanitizer where it is linked in. OpenImageIO 2.4 keeps the text of a failed
// reader's last error per thread and never frees it.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() {
  return "leak:OpenImageIO";
}
