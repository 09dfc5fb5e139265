// spread.h - sums of reflections back into the texels of probe light.
// Floor 2, private to renderer/reflect. Thread: the render thread; on jobs.
#ifndef HG_RENDERER_REFLECT_SPREAD_H
#define HG_RENDERER_REFLECT_SPREAD_H

#include "renderer/reflect/work.h"

void hg_reflect_spread(struct hg_reflect_work *work); // work->out

#endif
