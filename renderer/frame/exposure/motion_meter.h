// motion_meter.h - automatic exposure of a view in motion: the value that it adapts to.
// Floor 4. Thread: the render thread.
//
// The meter of a view at rest (meter.h) takes longer than a picture in motion may. This one traces
// a few camera rays, shades their hits as those of probes are (gi.h), and meters the light that
// arrives there: direct light, and indirect light of the field of probes. Views without such a
// field keep their exposure until they rest.
#ifndef HG_RENDERER_FRAME_EXPOSURE_MOTION_METER_H
#define HG_RENDERER_FRAME_EXPOSURE_MOTION_METER_H

#include "renderer/frame/state.h"

#define HG_MOTION_METER_SIDE_PX 32
#define HG_MOTION_METER_NS      250000000u // between two meterings

// Meters if that is due: every HG_MOTION_METER_NS, and at once after a cut. Call when the field of
// this picture is up to date, before it is drawn. Errors of tracing.
enum hg_status hg_motion_meter_step(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;

#endif
