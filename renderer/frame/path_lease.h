// path_lease.h - paths of pictures at rest, shared out among the views of a scene.
// Floor 4. Thread: the render thread.
//
// A view that rests meters its exposure and gathers light with paths of its own. Their waves and
// films, and the triangles that their rays meet from there, take a hundred MiB and more, whatever
// the size of the picture. So HG_PATH_LEASES views of a scene have such at a time; another one that
// rests waits until one of them is through or moves on. Views that are not displayed before they
// are settled, and those that are path-traced or have planes, are not counted, and wait for none.
#ifndef HG_RENDERER_FRAME_PATH_LEASE_H
#define HG_RENDERER_FRAME_PATH_LEASE_H

#include <stdbool.h>

struct hg_view_state;

// The view may step its paths. False: others are at it; to be tried again.
bool hg_path_lease_take(struct hg_view_state *view);
// The view draws a picture in motion: what it had for the last one at rest goes after a second.
void hg_path_lease_note_motion(struct hg_view_state *view);
// The view ends.
void hg_path_lease_end(struct hg_view_state *view);

#endif
