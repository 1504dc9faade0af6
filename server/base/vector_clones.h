// Compiles a function once for each vector width; at load time the widest that the machine has is chosen:
// `SIGHTLINE_VECTOR_CLONES void f(...)`. All clones give the same bits: no contraction into fused
// multiply-adds (-ffp-contract=off) and no reordering of sums. For free functions in a source file.
//
// A loop that the compiler vectorises badly can be written by hand for the widest vectors, in addition to a plain one:
//
//   #ifdef SIGHTLINE_X86_V4
//   SIGHTLINE_X86_V4 void f_v4(...);    // with AVX-512 intrinsics; called only where runs_x86_v4()
//   #endif
//
// Both must give the same answers.
#pragma once

// The clone is chosen before the sanitizers are set up, and they would instrument the choice. Clang 14, which fuzzes,
// lacks both.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define SIGHTLINE_VECTOR_CLONES __attribute__((target_clones("arch=x86-64-v4", "avx2", "default")))
#else
#define SIGHTLINE_VECTOR_CLONES
#endif

// Before a loop whose arrays do not overlap. For more than ten pairs of them GCC gives up, __restrict or not.
#if defined(__GNUC__) && !defined(__clang__)
#define SIGHTLINE_NO_OVERLAP _Pragma("GCC ivdep")
#else
#define SIGHTLINE_NO_OVERLAP
#endif

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define SIGHTLINE_X86_V4 __attribute__((target("arch=x86-64-v4")))
namespace sightline {
inline bool runs_x86_v4() {
  return __builtin_cpu_supports("x86-64-v4");
}
}  // namespace sightline
#endif
