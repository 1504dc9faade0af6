// A loop that gains from wider vectors than the baseline's is compiled once more for each width, and the widest that the machine
// has is taken at load time: `SIGHTLINE_VECTOR_CLONES void f(...)`. All clones give the same bits: no contraction into fused
// multiply-adds (-ffp-contract=off) and no reordering of sums. For free functions in a source file.
#pragma once

// Sanitizers instrument what chooses the clone, which runs before they are set up.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SIGHTLINE_VECTOR_CLONES __attribute__((target_clones("arch=skylake-avx512", "avx2", "default")))
#else
#define SIGHTLINE_VECTOR_CLONES
#endif
