// Names that oneTBB looks for, in case another library of the process has them, are settled here,
// as nothing, when a library is linked: those of an allocator, and of what binds threads to NUMA's
// nodes. Debian's linker has a word for that, which zig's does not know.
#define NOBODY_HAS(name) __asm__(".globl " #name "\n.hidden " #name "\n.set " #name ", 0")

NOBODY_HAS(__RML_close_factory);
NOBODY_HAS(__RML_open_factory);
NOBODY_HAS(__TBB_call_with_my_server_info);
NOBODY_HAS(__TBB_internal_allocate_binding_handler);
NOBODY_HAS(__TBB_internal_apply_affinity);
NOBODY_HAS(__TBB_internal_deallocate_binding_handler);
NOBODY_HAS(__TBB_internal_destroy_system_topology);
NOBODY_HAS(__TBB_internal_get_default_concurrency);
NOBODY_HAS(__TBB_internal_initialize_system_topology);
NOBODY_HAS(__TBB_internal_restore_affinity);
NOBODY_HAS(__TBB_make_rml_server);
NOBODY_HAS(scalable_aligned_free);
NOBODY_HAS(scalable_aligned_malloc);
NOBODY_HAS(scalable_free);
NOBODY_HAS(scalable_malloc);

// Every library calls this first where it is there, which it is in programs that count calls.
__attribute__((visibility("hidden"))) void __gmon_start__(void);
void __gmon_start__(void) {}
