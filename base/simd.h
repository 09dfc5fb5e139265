// simd.h - loops over arrays of numbers that are compiled for several processors at once.
// Floor 0.
#ifndef HG_BASE_SIMD_H
#define HG_BASE_SIMD_H

// Of a function: eight at a time where the processor can; without fused operations the results are
// the same. Not with sanitizers, which are not ready yet when the choice is made.
#if defined(__x86_64__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) &&                \
    !defined(__SANITIZE_THREAD__)
#define HG_SIMD_LOOP __attribute__((target_clones("avx2", "default")))
#else
#define HG_SIMD_LOOP
#endif

// Before a loop: what it writes is apart from what it reads. Without it loops over many arrays are
// not compiled so, as restrict is only seen of parameters.
#ifdef __clang__
#define HG_SIMD_APART _Pragma("clang loop vectorize(assume_safety)")
#else
#define HG_SIMD_APART _Pragma("GCC ivdep")
#endif

#endif
