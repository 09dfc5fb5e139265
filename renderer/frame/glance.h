// glance.h - automatic exposure of a view in motion: what it adapts to.
// Floor 4. Thread: the render thread.
//
// The meter of a view at rest (meter.h) takes longer than a picture in motion may. Here a few rays
// of the camera meet surfaces as the rays of probes do, and what is metered is the light that falls
// on them: direct light, and that of the field of probes. Views without such a field keep what they
// had until they rest.
#ifndef HG_RENDERER_FRAME_GLANCE_H
#define HG_RENDERER_FRAME_GLANCE_H

#include "renderer/frame/state.h"

#define HG_GLANCE_SIDE_PX 32
#define HG_GLANCE_NS      250000000u // between two of them

// After the field of this picture is there, and before it is drawn: meters if that is due, which is
// at once after a cut. Errors of tracing.
enum hg_status hg_glance_step(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;

#endif
