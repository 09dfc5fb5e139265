// sharpen.h - sharpens a picture where neighbours differ little. Floor 2. Pure. Thread: any; the
// work is spread over `jobs`, of which the result does not depend.
#ifndef HG_RENDERER_TEMPORAL_SHARPEN_H
#define HG_RENDERER_TEMPORAL_SHARPEN_H

#include "base/jobs.h"

// A pixel moves away from the mean of its four neighbours by as much as it is off it, times twice
// the strength, less where they span much of the range; never beyond the least and greatest of the
// five, so that edges become steeper and have no halos.
//
//   from, to  [height][width][4] encoded; alpha is kept; not the same
//   strength  0 .. 1
void hg_temporal_sharpen(
    struct hg_jobs *jobs, const uint8_t *from, const uint32_t size[2], float strength, uint8_t *to);

#endif
