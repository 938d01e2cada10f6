// Read by the thread sanitizer where it is linked in. Libraries of the system are not built with it,
// so that what happens inside them, and what their locks order, cannot be seen. OpenVDB's loops are
// templates: they call oneTBB by themselves from the media library.
extern "C" const char* __tsan_default_suppressions();
extern "C" const char* __tsan_default_suppressions() {
  return "called_from_lib:libtbb.so\n"
         "called_from_lib:libopenvdb.so\n"
         "called_from_lib:libOpenImageIO.so\n"
         "race:openvdb::\n"
         "mutex:initialiseOnce\n";
}
