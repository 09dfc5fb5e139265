// slice.h - how long the scheduler lets a thread run at a time. Floor 0 (base). Thread: any, its
// own.
//
// The broker's loop does little at a time and others wait for it; workers and encoders compute. The
// kernel (EEVDF, since Linux 6.12) runs the thread with the earliest deadline, which is a slice
// from when it may run: one that asks for short slices interrupts others when it wakes, instead of
// waiting for the end of theirs (0.7 to 2.8 ms, by the number of cores). Its part of the processors
// stays the same, and no right is needed. Source: Stoica and Abdel-Wahab 1995, "Earliest Eligible
// Virtual Deadline First"; Linux, Documentation/scheduler/sched-eevdf.rst.
#ifndef HG_BASE_SLICE_H
#define HG_BASE_SLICE_H

#include <stdint.h>

enum { HG_SLICE_SHORT_NS = 100000 }; // the shortest there is

// Of this thread, and of threads and processes that it starts from then on; 0: the kernel's own.
// Nothing happens where the kernel knows no slices, refuses, or the thread is scheduled by other
// rules (real time, batch, idle).
void hg_slice_set(uint64_t slice_ns);

#endif
